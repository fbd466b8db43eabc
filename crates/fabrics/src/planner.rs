//! Motion planning by integrating a fabric towards its goal.

use crate::fabric::{Fabric, Goal};
use robot::{JointState, JointVector, integrator};

/// Time step, max duration and stop criterion of a plan.
#[derive(Clone, Debug)]
pub struct PlannerConfig {
    /// Time step (s).
    pub dt: f64,
    /// Max duration (s).
    pub max_seconds: f64,
    /// Speed (rad/s, norm over all joints) below which the motion is at rest.
    pub rest_speed: f64,
}

impl PlannerConfig {
    /// Parameters for demonstrations: 30 Hz as the policy (paper §III-E), up to 8 s.
    pub fn demonstration() -> Self {
        Self { dt: 1.0 / 30.0, max_seconds: 8.0, rest_speed: 0.1 }
    }
}

/// A trajectory: n + 1 states and the n accelerations between them (Eq. 6, 7).
#[derive(Clone, Debug)]
pub struct Plan {
    /// States, one time step apart.
    pub states: Vec<JointState>,
    /// `accelerations[i]` leads from `states[i]` to `states[i + 1]`.
    pub accelerations: Vec<JointVector>,
}

impl Plan {
    /// A trajectory of the single state `state`.
    pub fn at_rest(state: JointState) -> Self {
        Self { states: vec![state], accelerations: Vec::new() }
    }

    /// The last state.
    pub fn last(&self) -> &JointState {
        // A plan contains at least its initial state.
        &self.states[self.states.len() - 1]
    }

    /// Appends one integration step with the acceleration `qdd` (rad/s²) and the time step `dt` (s).
    pub fn push(&mut self, qdd: JointVector, dt: f64) {
        self.states.push(integrator::step(self.last(), &qdd, dt));
        self.accelerations.push(qdd);
    }
}

/// Integrates the fabric from `start` towards `goal` until it is at rest or the max duration is reached. The
/// goal is not guaranteed to be reached. `None` if the state becomes non-finite.
///
/// ```rust
/// use fabrics::{Fabric, FabricConfig, Goal, PlannerConfig, planner};
/// use robot::{JointState, KinematicTree, integrator};
/// let (tree, hand) = (KinematicTree::iiwa7_allegro()?, [0.3; robot::HAND_DOF]);
/// let q = robot::joint_vector(&[0.0, 0.3, 0.0, -1.5, 0.0, 1.3, 0.79], &hand);
/// // The goal is 10 cm above the start; there are no obstacles.
/// let mut palm = tree.forward_kinematics(&q).palm_pose();
/// palm.translation.vector.z += 0.1;
/// let fabric = Fabric::new(&tree, q, Vec::new(), FabricConfig::demonstration())?;
/// let (start, config) = (JointState::at_rest(q), PlannerConfig::demonstration());
/// let goal = Goal { palm, hand };
/// let plan = planner::plan(&fabric, &start, &goal, &config).expect("finite states");
/// let reached = tree.forward_kinematics(&plan.last().q).palm_pose().translation;
/// assert!((reached.vector - palm.translation.vector).norm() < 0.05); // m
/// // Each step satisfies Eq. 6 and 7.
/// let next = integrator::step(&plan.states[0], &plan.accelerations[0], config.dt);
/// assert_eq!(next, plan.states[1]);
/// # Ok::<(), robot::UrdfError>(())
/// ```
pub fn plan(
    fabric: &Fabric,
    start: &JointState,
    goal: &Goal,
    config: &PlannerConfig,
) -> Option<Plan> {
    let mut plan = Plan::at_rest(*start);
    for row in 0..(config.max_seconds / config.dt).round() as usize {
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
    use geometry::convex_shape::ConvexShape;
    use geometry::{Pose, Vec3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use robot::{Isometry, KinematicTree, Vector, rotation};

    fn nominal() -> JointVector {
        let hand =
            [0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 1.3, 0.6, 0.34, 0.61];
        robot::joint_vector(&[0.0, 0.3, 0.0, -1.5, 0.0, 1.3, 0.79], &hand)
    }

    fn table() -> Obstacle {
        let solid = ConvexShape::cuboid(Vec3::new(0.4, 0.55, 0.05));
        let pose = Pose::from_translation(Vec3::new(0.6, 0.0, -0.05));
        Obstacle { shapes: vec![solid.transformed(&pose)], first_active_body: 3 }
    }

    /// Palm error at the end of a plan: distance (m) and angle (rad) to the goal.
    fn goal_error(tree: &KinematicTree, plan: &Plan, goal: &Goal) -> [f64; 2] {
        let palm = tree.forward_kinematics(&plan.last().q).palm_pose();
        let distance = (palm.translation.vector - goal.palm.translation.vector).norm();
        [distance, rotation::angle_between(&palm.rotation, &goal.palm.rotation)]
    }

    #[test]
    fn random_goals_are_reached() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let start = JointState::at_rest(nominal());
        let palm = tree.forward_kinematics(&start.q).palm_pose();
        let fabric =
            Fabric::new(&tree, nominal(), vec![table()], FabricConfig::demonstration()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut reached, mut seconds) = (0, Vec::new());
        let count = 40;
        for _ in 0..count {
            let mut draw = |reach: f64| Vector::from_fn(|_, _| rng.random_range(-reach..=reach));
            let (shift, tilt) = (draw(0.15), draw(0.3));
            let rotation_offset = rotation::from_axis_angle(&tilt.normalize(), tilt.norm());
            let goal = Goal {
                palm: Isometry::from_parts(
                    (palm.translation.vector + shift).into(),
                    rotation_offset * palm.rotation,
                ),
                hand: robot::hand_joints(&nominal()),
            };
            let plan = plan(&fabric, &start, &goal, &PlannerConfig::demonstration()).unwrap();
            assert!(plan.states.iter().all(|state| tree.limits.contains(&state.q, -1e-3)));
            let [distance, angle] = goal_error(&tree, &plan, &goal);
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
    fn plan_steps_satisfy_eq6_and_eq7() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let fabric =
            Fabric::new(&tree, nominal(), vec![table()], FabricConfig::demonstration()).unwrap();
        let start = JointState::at_rest(nominal());
        let mut palm = tree.forward_kinematics(&start.q).palm_pose();
        palm.translation.vector.z += 0.12;
        let goal = Goal { palm, hand: [0.4; robot::HAND_DOF] };
        let plan = plan(&fabric, &start, &goal, &PlannerConfig::demonstration()).unwrap();
        for (i, qdd) in plan.accelerations.iter().enumerate() {
            let next = integrator::step(&plan.states[i], qdd, 1.0 / 30.0);
            assert_eq!(next, plan.states[i + 1]);
            let within = (0..23).all(|k| qdd[k].abs() <= tree.limits.acceleration[k] * 1.000_001);
            assert!(within, "acceleration limit exceeded in row {i}");
        }
    }

    #[test]
    fn goal_under_table_is_not_reached_without_collision() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let fabric =
            Fabric::new(&tree, nominal(), vec![table()], FabricConfig::demonstration()).unwrap();
        let start = JointState::at_rest(nominal());
        let mut palm = tree.forward_kinematics(&start.q).palm_pose();
        palm.translation.vector.z = -0.1;
        let goal = Goal { palm, hand: robot::hand_joints(&nominal()) };
        let plan = plan(&fabric, &start, &goal, &PlannerConfig::demonstration()).unwrap();
        assert!(goal_error(&tree, &plan, &goal)[0] > 0.05);

        let solids = robot::collision_shapes::CollisionModel::new(&tree);
        for state in &plan.states {
            let gap = solids.min_distance(&tree.forward_kinematics(&state.q), &table().shapes, 0.1);
            assert!(gap > -0.001, "{gap} m into the table");
        }
    }
}
