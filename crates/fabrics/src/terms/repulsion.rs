//! Keeps the robot's covering spheres off the table, the object and the arm itself.

use super::Pull;
use geometry::solid::Solid;
use nalgebra::Matrix3;
use robot::spheres::Sphere;
use robot::{JointVector, Kinematics, Vector, rotation};

/// Parameters of the repulsion term.
#[derive(Clone, Copy, Debug)]
pub struct RepulsionConfig {
    /// Acceleration of the potential part (m/s²).
    pub push: f64,
    /// Acceleration of the geometric part per squared speed (1/m).
    pub bend: f64,
    /// Scale of the priority (m²), which is divided by the squared gap: 10⁴ times this at 1 cm.
    pub priority: f64,
    /// Gaps (m) beyond this are ignored.
    pub reach: f64,
    /// Least gap (m) that is told apart.
    pub least: f64,
}

/// What the robot has to keep off.
#[derive(Clone)]
pub struct Obstacle {
    /// Convex solids, world frame.
    pub solids: Vec<Solid>,
    /// First body that has to keep off; the base of the arm stands beside the table anyway.
    pub first_body: usize,
}

/// Least gap and unit direction from the obstacle to the sphere.
struct Nearness {
    gap: f64,
    away: Vector,
}

/// Adds the repulsion of every sphere from every obstacle and from the arm's own spheres.
pub fn add(
    pull: &mut Pull,
    kinematics: &Kinematics,
    qd: &JointVector,
    spheres: &[Sphere],
    obstacles: &[Obstacle],
    config: &RepulsionConfig,
) {
    let motion = kinematics.motion(qd);
    let centers: Vec<Vector> = spheres
        .iter()
        .map(|s| kinematics.world_from_body[s.body].transform_point(&s.center.into()).coords)
        .collect();
    for (sphere, center) in spheres.iter().zip(&centers) {
        let outside = obstacles.iter().filter(|o| sphere.body >= o.first_body);
        let mut near: Vec<Nearness> = outside
            .filter_map(|obstacle| nearest(&obstacle.solids, center, sphere.radius))
            .collect();
        near.extend(own_links(sphere, center, spheres, &centers));
        near.retain(|n| n.gap < config.reach);
        if near.is_empty() {
            continue;
        }
        let velocity = motion.velocity(sphere.body, center);
        let mut direction = Vector::zeros();
        let mut metric = Matrix3::zeros();
        let mut least = f64::INFINITY;
        for Nearness { gap, away } in &near {
            let room = gap.max(config.least);
            direction += away / room;
            // Motion away from the obstacle is free, unless the sphere is inside. Below, the metric is divided by its own
            // norm: from a single obstacle it is free only above some 1 cm/s.
            let approach = -velocity.dot(away);
            let gate =
                if *gap <= 0.0 { 1.0 } else { 0.5 * libm::tanh(1000.0 * (approach + 0.002)) + 0.5 };
            metric += away * away.transpose() * (gate / room);
            least = least.min(room);
        }
        let direction = direction / (direction.norm() + 1e-9);
        let metric = metric * (config.priority / (least * least) / (metric.norm() + 1e-6));
        let jacobian = kinematics.point_jacobian(sphere.body, center);
        let bias = motion.bias_acceleration(sphere.body, center);
        // One metric carries both parts; it is counted once.
        pull.add_forcing(&jacobian, &bias, &metric, &(direction * config.push));
        let bend = direction * (config.bend * velocity.norm_squared());
        pull.geometry.force -= jacobian.transpose() * (metric * bend);
    }
}

fn nearest(solids: &[Solid], center: &Vector, radius: f64) -> Option<Nearness> {
    solids
        .iter()
        .map(|solid| solid.point_gap(rotation::to_vec3(center)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(gap, away)| Nearness { gap: gap as f64 - radius, away: rotation::to_vector(away) })
}

/// The hand keeps off the first three arm links and the base, which it can reach.
fn own_links<'a>(
    sphere: &'a Sphere,
    center: &'a Vector,
    spheres: &'a [Sphere],
    centers: &'a [Vector],
) -> impl Iterator<Item = Nearness> + 'a {
    let is_hand = sphere.body >= robot::ARM;
    let arm = spheres.iter().zip(centers).filter(move |(s, _)| is_hand && s.body <= 3);
    arm.map(move |(s, c)| {
        let offset = center - c;
        let distance = offset.norm();
        Nearness { gap: distance - sphere.radius - s.radius, away: offset / distance.max(1e-9) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Pose, Vec3};
    use robot::{JointState, Tree, integrator};

    const CONFIG: RepulsionConfig =
        RepulsionConfig { push: 1.0, bend: 5.0, priority: 0.01, reach: 0.5, least: 0.01 };

    /// A posture away from singularities, and the middle fingertip's body.
    fn standing() -> (Tree, JointVector, usize) {
        let tree = Tree::iiwa7_allegro().unwrap();
        let arm = [0.0, 0.5, 0.0, -1.6, 0.0, 0.9, 0.0];
        let q = robot::join(&arm, &[0.3; robot::HAND]);
        let tip = tree.tips[1].body;
        (tree, q, tip)
    }

    /// A box of 20 cm whose side lies `gap` (m) beside `center` along `side`.
    fn boxed(center: &Vector, radius: f64, side: &Vector, gap: f64) -> Obstacle {
        let middle = center - side * (radius + gap + 0.1);
        let pose = Pose::from_translation(rotation::to_vec3(&middle));
        Obstacle { solids: vec![Solid::cuboid(Vec3::splat(0.1)).moved(&pose)], first_body: 3 }
    }

    /// Acceleration (m/s²) of a point of `body` that the term alone asks for.
    fn asked(
        tree: &Tree,
        state: &JointState,
        sphere: &Sphere,
        obstacle: Obstacle,
    ) -> Option<Vector> {
        let kinematics = tree.kinematics(&state.q);
        let center =
            kinematics.world_from_body[sphere.body].transform_point(&sphere.center.into()).coords;
        let mut pull = Pull::zero();
        let spheres = std::slice::from_ref(sphere);
        add(&mut pull, &kinematics, &state.qd, spheres, &[obstacle], &CONFIG);
        // A weak pull of every joint to rest makes the sum solvable.
        let metric = pull.geometry.metric + robot::JointMatrix::identity() * 1e-6;
        let force = pull.geometry.force + pull.potential;
        let qdd = -metric.cholesky()?.solve(&force);
        Some(kinematics.point_jacobian(sphere.body, &center) * qdd)
    }

    #[test]
    fn it_pushes_away_from_a_box_outside_and_inside() {
        let (tree, q, tip) = standing();
        let sphere =
            Sphere { body: tip, center: Vector::zeros(), radius: 0.012, link: "tip".into() };
        let center = tree.kinematics(&q).world_from_body[tip].translation.vector;
        for side in
            [Vector::x(), -Vector::x(), Vector::y(), -Vector::y(), Vector::z(), -Vector::z()]
        {
            // Outside, touching, with the centre still outside, with the centre inside.
            for gap in [0.03, 0.001, -0.005, -0.02] {
                let obstacle = boxed(&center, sphere.radius, &side, gap);
                let state = JointState::at_rest(q);
                let away = asked(&tree, &state, &sphere, obstacle).unwrap().dot(&side);
                assert!(away > 0.5, "gap {gap} m beside {side:?}: {away} m/s² away from the box");
            }
        }
    }

    #[test]
    fn leaving_is_free_and_approach_is_not() {
        let (tree, q, tip) = standing();
        let sphere =
            Sphere { body: tip, center: Vector::zeros(), radius: 0.012, link: "tip".into() };
        let kinematics = tree.kinematics(&q);
        let center = kinematics.world_from_body[tip].translation.vector;
        let side = Vector::z();
        let priority = |direction: f64| {
            let jacobian = kinematics.point_jacobian(tip, &center);
            let step = jacobian.transpose() * side * direction;
            let qd = step / (jacobian * step).norm() * 0.2;
            let mut pull = Pull::zero();
            let obstacle = boxed(&center, sphere.radius, &side, 0.02);
            let spheres = std::slice::from_ref(&sphere);
            add(&mut pull, &kinematics, &qd, spheres, &[obstacle], &CONFIG);
            pull.geometry.metric.norm()
        };
        let (towards, away) = (priority(-1.0), priority(1.0));
        assert!(towards > 100.0 * away, "priority {towards} approaching, {away} leaving");
    }

    #[test]
    fn a_sweep_across_a_box_does_not_enter_it() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let q = robot::join(&[-0.5, 0.9, 0.0, -1.4, 0.0, 0.9, 0.0], &[0.3; robot::HAND]);
        let spheres = tree.spheres().unwrap();
        let solids = robot::solids::RobotSolids::new(&tree);
        let palm = tree.kinematics(&q).palm().translation.vector;
        // The first joint swings the hand along an arc; a post stands in the middle of it.
        let middle = rotation::about(&Vector::z(), 0.5) * palm;
        let pose = Pose::from_translation(rotation::to_vec3(&middle));
        let post = Solid::cuboid(Vec3::new(0.03, 0.03, 0.4)).moved(&pose);
        let obstacle = || vec![Obstacle { solids: vec![post.clone()], first_body: 3 }];
        let mut goal = q;
        goal[0] += 1.0;
        let run = |is_repelled: bool| {
            let mut state = JointState::at_rest(q);
            let mut least = f32::INFINITY;
            for _ in 0..150 {
                let kinematics = tree.kinematics(&state.q);
                let mut pull = Pull::zero();
                // The goal lies behind the post; every joint is damped.
                let metric = robot::JointMatrix::identity();
                let wanted = (goal - state.q) * 9.0 - state.qd * 6.0;
                pull.geometry.metric += metric;
                pull.potential -= metric * wanted;
                if is_repelled {
                    add(&mut pull, &kinematics, &state.qd, &spheres, &obstacle(), &CONFIG);
                }
                let force = pull.geometry.force + pull.potential;
                let qdd = -pull.geometry.metric.cholesky().unwrap().solve(&force);
                let qdd = tree.limits.scale_acceleration(&qdd);
                state = integrator::step(&state, &qdd, 1.0 / 30.0);
                let kinematics = tree.kinematics(&state.q);
                least = least.min(solids.least_gap(&kinematics, std::slice::from_ref(&post), 0.2));
            }
            (least, state.q[0] - q[0])
        };
        let (without, swung) = run(false);
        assert!(
            without < -0.02 && swung > 0.9,
            "the way leads through it: {without} m, {swung} rad"
        );
        let (least, _) = run(true);
        println!("least gap {least} m, without repulsion {without} m");
        assert!(least > -0.001, "{least} m into the post");
    }
}
