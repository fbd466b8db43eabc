//! Integrates a fabric towards its goal.

use crate::fabric::{Fabric, Goal};
use robot::{JointState, JointVector, integrator};

/// How finely a motion is integrated, and when it ends.
#[derive(Clone, Debug)]
pub struct PlannerConfig {
    /// Seconds between rows.
    pub dt: f64,
    /// Seconds at most.
    pub seconds: f64,
    /// Greatest speed of a motion that rests (rad/s), norm over all joints.
    pub rest_speed: f64,
}

impl PlannerConfig {
    /// Rows at the policy's 30 Hz (paper §III-E), 8 s at most.
    pub fn demonstration() -> Self {
        Self { dt: 1.0 / 30.0, seconds: 8.0, rest_speed: 0.1 }
    }
}

/// A motion: n + 1 states and the n accelerations between them (Eq. 6, 7).
#[derive(Clone, Debug)]
pub struct Plan {
    /// States, `dt` apart.
    pub states: Vec<JointState>,
    /// `accelerations[i]` leads from `states[i]` to `states[i + 1]`.
    pub accelerations: Vec<JointVector>,
}

impl Plan {
    /// A motion that stands at `state`.
    pub fn standing(state: JointState) -> Self {
        Self { states: vec![state], accelerations: Vec::new() }
    }

    /// The last state.
    pub fn last(&self) -> &JointState {
        // A plan is never empty: it begins with one state and only grows.
        &self.states[self.states.len() - 1]
    }

    /// Appends one step.
    pub fn push(&mut self, qdd: JointVector, dt: f64) {
        self.states.push(integrator::step(self.last(), &qdd, dt));
        self.accelerations.push(qdd);
    }
}

/// Lets the fabric flow from `start` towards `goal` until it rests or `seconds` are over, wherever
/// that is; `None` if it leaves the finite numbers.
pub fn flow(
    fabric: &Fabric,
    start: &JointState,
    goal: &Goal,
    config: &PlannerConfig,
) -> Option<Plan> {
    let mut plan = Plan::standing(*start);
    for row in 0..(config.seconds / config.dt).round() as usize {
        let state = *plan.last();
        plan.push(fabric.acceleration(&state, goal)?, config.dt);
        if row as f64 * config.dt > 0.5 && plan.last().qd.norm() < config.rest_speed {
            break;
        }
    }
    Some(plan)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FabricConfig;
    use crate::terms::repulsion::Obstacle;
    use geometry::solid::Solid;
    use geometry::{Pose, Vec3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use robot::{Isometry, Tree, Vector, rotation};

    fn nominal() -> JointVector {
        let hand =
            [0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 1.3, 0.6, 0.34, 0.61];
        robot::join(&[0.0, 0.3, 0.0, -1.5, 0.0, 1.3, 0.79], &hand)
    }

    fn table() -> Obstacle {
        let solid = Solid::cuboid(Vec3::new(0.4, 0.55, 0.05));
        let place = Pose::from_translation(Vec3::new(0.6, 0.0, -0.05));
        Obstacle { solids: vec![solid.moved(&place)], first_body: 3 }
    }

    /// How far (m, rad) the palm is from its goal where a motion ends.
    fn miss(tree: &Tree, plan: &Plan, goal: &Goal) -> [f64; 2] {
        let palm = tree.kinematics(&plan.last().q).palm();
        let distance = (palm.translation.vector - goal.palm.translation.vector).norm();
        [distance, rotation::angle_between(&palm.rotation, &goal.palm.rotation)]
    }

    #[test]
    fn random_goals_are_reached() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let start = JointState::at_rest(nominal());
        let palm = tree.kinematics(&start.q).palm();
        let fabric = Fabric::new(&tree, nominal(), vec![table()], FabricConfig::calm()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut reached, mut seconds) = (0, Vec::new());
        let count = 40;
        for _ in 0..count {
            let mut draw = |reach: f64| Vector::from_fn(|_, _| rng.random_range(-reach..=reach));
            let (shift, tilt) = (draw(0.15), draw(0.3));
            let turn = rotation::about(&tilt.normalize(), tilt.norm());
            let goal = Goal {
                palm: Isometry::from_parts(
                    (palm.translation.vector + shift).into(),
                    turn * palm.rotation,
                ),
                hand: robot::hand_of(&nominal()),
            };
            let plan = flow(&fabric, &start, &goal, &PlannerConfig::demonstration()).unwrap();
            assert!(plan.states.iter().all(|state| tree.limits.contains(&state.q, -1e-3)));
            let [distance, angle] = miss(&tree, &plan, &goal);
            if distance < 0.01 && angle < 0.09 {
                reached += 1;
                seconds.push(plan.accelerations.len() as f64 / 30.0);
            }
        }
        seconds.sort_by(f64::total_cmp);
        println!("reached {reached} of {count}, median {:.2} s", seconds[seconds.len() / 2]);
        assert!(reached >= 34, "{reached} of {count} goals reached");
    }

    #[test]
    fn rows_satisfy_eq6_and_eq7() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let fabric = Fabric::new(&tree, nominal(), vec![table()], FabricConfig::calm()).unwrap();
        let start = JointState::at_rest(nominal());
        let mut palm = tree.kinematics(&start.q).palm();
        palm.translation.vector.z += 0.12;
        let goal = Goal { palm, hand: [0.4; robot::HAND] };
        let plan = flow(&fabric, &start, &goal, &PlannerConfig::demonstration()).unwrap();
        for (i, qdd) in plan.accelerations.iter().enumerate() {
            let next = integrator::step(&plan.states[i], qdd, 1.0 / 30.0);
            assert_eq!(next, plan.states[i + 1]);
            let within = (0..23).all(|k| qdd[k].abs() <= tree.limits.acceleration[k] * 1.000_001);
            assert!(within, "acceleration limit exceeded in row {i}");
        }
    }

    #[test]
    fn a_goal_under_the_table_is_not_reached_and_the_table_not_touched() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let fabric = Fabric::new(&tree, nominal(), vec![table()], FabricConfig::calm()).unwrap();
        let start = JointState::at_rest(nominal());
        let mut palm = tree.kinematics(&start.q).palm();
        palm.translation.vector.z = -0.1;
        let goal = Goal { palm, hand: robot::hand_of(&nominal()) };
        let plan = flow(&fabric, &start, &goal, &PlannerConfig::demonstration()).unwrap();
        assert!(miss(&tree, &plan, &goal)[0] > 0.05);

        let solids = robot::solids::RobotSolids::new(&tree);
        for state in &plan.states {
            let gap = solids.least_gap(&tree.kinematics(&state.q), &table().solids, 0.1);
            assert!(gap > -0.001, "{gap} m into the table");
        }
    }
}
