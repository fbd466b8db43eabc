//! Collision avoidance: repels the robot's spheres from the table, the object and the arm itself.

use super::TermSums;
use geometry::convex_shape::ConvexShape;
use nalgebra::Matrix3;
use robot::collision_spheres::Sphere;
use robot::{JointVector, Kinematics, Vector, rotation};

/// Parameters of the repulsion term.
#[derive(Clone, Copy, Debug)]
pub struct RepulsionConfig {
    /// Acceleration of the potential part (m/s²).
    pub potential_gain: f64,
    /// Acceleration of the geometric part per squared speed (1/m).
    pub geometric_gain: f64,
    /// Scale of the priority (m²). It is divided by the squared distance: a factor of 10⁴ at 1 cm.
    pub priority: f64,
    /// Max distance (m) at which an obstacle repels.
    pub max_distance: f64,
    /// Min distance (m): smaller distances count as this one.
    pub min_distance: f64,
}

/// An obstacle of the robot.
#[derive(Clone)]
pub struct Obstacle {
    /// Convex shapes, world frame.
    pub shapes: Vec<ConvexShape>,
    /// First body that is repelled. The arm's base is fixed near the table and needs no repulsion
    /// ([`robot::hand_model::Avoidance::first_body`]).
    pub first_active_body: usize,
}

/// Signed distance (m) to an obstacle and the unit vector from it to the sphere.
struct ClosestObstacle {
    distance: f64,
    direction: Vector,
}

/// Adds the repulsion of every sphere from every obstacle and from the arm's own spheres.
pub fn add(
    sums: &mut TermSums,
    kinematics: &Kinematics,
    qd: &JointVector,
    spheres: &[Sphere],
    obstacles: &[Obstacle],
    config: &RepulsionConfig,
) {
    let motion = kinematics.velocities(qd);
    let last_arm_body = kinematics.tree().hand.avoidance.last_self_body;
    let centers: Vec<Vector> = spheres
        .iter()
        .map(|s| kinematics.world_from_body[s.body].transform_point(&s.center.into()).coords)
        .collect();
    for (sphere, center) in spheres.iter().zip(&centers) {
        let active = obstacles.iter().filter(|o| sphere.body >= o.first_active_body);
        let mut near: Vec<ClosestObstacle> = active
            .filter_map(|obstacle| closest_obstacle(&obstacle.shapes, center, sphere.radius))
            .collect();
        near.extend(self_distances(sphere, center, spheres, &centers, last_arm_body));
        near.retain(|n| n.distance < config.max_distance);
        if near.is_empty() {
            continue;
        }
        let velocity = motion.velocity(sphere.body, center);
        let mut direction = Vector::zeros();
        let mut metric = Matrix3::zeros();
        let mut min_distance = f64::INFINITY;
        for ClosestObstacle { distance: gap, direction: away } in &near {
            let distance = gap.max(config.min_distance);
            direction += away / distance;
            // Motion away from the obstacle is free, unless the sphere is inside. The metric is normalized
            // below, so for a single obstacle the motion is free only above about 1 cm/s.
            let approach = -velocity.dot(away);
            let gate =
                if *gap <= 0.0 { 1.0 } else { 0.5 * libm::tanh(1000.0 * (approach + 0.002)) + 0.5 };
            metric += away * away.transpose() * (gate / distance);
            min_distance = min_distance.min(distance);
        }
        let direction = direction / (direction.norm() + 1e-9);
        let metric =
            metric * (config.priority / (min_distance * min_distance) / (metric.norm() + 1e-6));
        let jacobian = kinematics.point_jacobian(sphere.body, center);
        let bias = motion.bias_acceleration(sphere.body, center);
        // Both parts share one metric, which is added once.
        sums.add_forcing(&jacobian, &bias, &metric, &(direction * config.potential_gain));
        let acceleration = direction * (config.geometric_gain * velocity.norm_squared());
        sums.geometry.force -= jacobian.transpose() * (metric * acceleration);
    }
}

fn closest_obstacle(
    solids: &[ConvexShape],
    center: &Vector,
    radius: f64,
) -> Option<ClosestObstacle> {
    solids
        .iter()
        .map(|solid| solid.point_signed_distance(rotation::to_vec3(center)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(gap, away)| ClosestObstacle {
            distance: gap as f64 - radius,
            direction: rotation::to_vector(away),
        })
}

/// Distances of a hand sphere to the bodies of the arm up to `last_arm_body`, the only ones in its reach.
fn self_distances<'a>(
    sphere: &'a Sphere,
    center: &'a Vector,
    spheres: &'a [Sphere],
    centers: &'a [Vector],
    last_arm_body: usize,
) -> impl Iterator<Item = ClosestObstacle> + 'a {
    let is_hand = sphere.body >= robot::ARM_DOF;
    let arm = spheres.iter().zip(centers).filter(move |(s, _)| is_hand && s.body <= last_arm_body);
    arm.map(move |(s, c)| {
        let offset = center - c;
        let distance = offset.norm();
        ClosestObstacle {
            distance: distance - sphere.radius - s.radius,
            direction: offset / distance.max(1e-9),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Pose, Vec3};
    use robot::{JointState, KinematicTree, integrator};

    const CONFIG: RepulsionConfig = RepulsionConfig {
        potential_gain: 1.0,
        geometric_gain: 5.0,
        priority: 0.01,
        max_distance: 0.5,
        min_distance: 0.01,
    };

    /// A posture away from singularities, and the body of the middle fingertip.
    fn regular_posture() -> (KinematicTree, JointVector, usize) {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let arm = [0.0, 0.5, 0.0, -1.6, 0.0, 0.9, 0.0];
        let q = robot::joint_vector(&arm, &[0.3; robot::HAND_DOF]);
        let tip = tree.fingertips[1].body;
        (tree, q, tip)
    }

    /// A 20 cm box at the distance `gap` (m) from the sphere at `center`, opposite to `side`.
    fn box_near(center: &Vector, radius: f64, side: &Vector, gap: f64) -> Obstacle {
        let center = center - side * (radius + gap + 0.1);
        let pose = Pose::from_translation(rotation::to_vec3(&center));
        Obstacle {
            shapes: vec![ConvexShape::cuboid(Vec3::splat(0.1)).transformed(&pose)],
            first_active_body: 3,
        }
    }

    /// Acceleration (m/s²) of a sphere centre under the repulsion term alone.
    fn repulsion(
        tree: &KinematicTree,
        state: &JointState,
        sphere: &Sphere,
        obstacle: Obstacle,
    ) -> Option<Vector> {
        let kinematics = tree.forward_kinematics(&state.q);
        let center =
            kinematics.world_from_body[sphere.body].transform_point(&sphere.center.into()).coords;
        let mut sums = TermSums::zero();
        let spheres = std::slice::from_ref(sphere);
        add(&mut sums, &kinematics, &state.qd, spheres, &[obstacle], &CONFIG);
        // A small metric on every joint makes the sum invertible.
        let metric = sums.geometry.metric + robot::JointMatrix::identity() * 1e-6;
        let force = sums.geometry.force + sums.potential;
        let qdd = -metric.cholesky()?.solve(&force);
        Some(kinematics.point_jacobian(sphere.body, &center) * qdd)
    }

    #[test]
    fn sphere_is_pushed_away_from_box_outside_and_inside() {
        let (tree, q, tip) = regular_posture();
        let sphere =
            Sphere { body: tip, center: Vector::zeros(), radius: 0.012, link: "tip".into() };
        let center = tree.forward_kinematics(&q).world_from_body[tip].translation.vector;
        for side in
            [Vector::x(), -Vector::x(), Vector::y(), -Vector::y(), Vector::z(), -Vector::z()]
        {
            // Outside; touching; overlapping with the centre outside; with the centre inside.
            for gap in [0.03, 0.001, -0.005, -0.02] {
                let obstacle = box_near(&center, sphere.radius, &side, gap);
                let state = JointState::at_rest(q);
                let away = repulsion(&tree, &state, &sphere, obstacle).unwrap().dot(&side);
                assert!(
                    away > 0.5,
                    "distance {gap} m along {side:?}: {away} m/s² away from the box"
                );
            }
        }
    }

    #[test]
    fn leaving_motion_has_low_priority_and_approach_has_high() {
        let (tree, q, tip) = regular_posture();
        let sphere =
            Sphere { body: tip, center: Vector::zeros(), radius: 0.012, link: "tip".into() };
        let kinematics = tree.forward_kinematics(&q);
        let center = kinematics.world_from_body[tip].translation.vector;
        let side = Vector::z();
        let priority = |direction: f64| {
            let jacobian = kinematics.point_jacobian(tip, &center);
            let step = jacobian.transpose() * side * direction;
            let qd = step / (jacobian * step).norm() * 0.2;
            let mut sums = TermSums::zero();
            let obstacle = box_near(&center, sphere.radius, &side, 0.02);
            let spheres = std::slice::from_ref(&sphere);
            add(&mut sums, &kinematics, &qd, spheres, &[obstacle], &CONFIG);
            sums.geometry.metric.norm()
        };
        let (towards, away) = (priority(-1.0), priority(1.0));
        assert!(towards > 100.0 * away, "priority {towards} approaching, {away} leaving");
    }

    #[test]
    fn sweep_across_post_does_not_enter_it() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q =
            robot::joint_vector(&[-0.5, 0.9, 0.0, -1.4, 0.0, 0.9, 0.0], &[0.3; robot::HAND_DOF]);
        let spheres = tree.collision_spheres().unwrap();
        let solids = robot::collision_shapes::CollisionModel::new(&tree);
        let palm = tree.forward_kinematics(&q).palm_pose().translation.vector;
        // The first joint swings the hand along an arc through a post.
        let center = rotation::from_axis_angle(&Vector::z(), 0.5) * palm;
        let pose = Pose::from_translation(rotation::to_vec3(&center));
        let post = ConvexShape::cuboid(Vec3::new(0.03, 0.03, 0.4)).transformed(&pose);
        let obstacle = || vec![Obstacle { shapes: vec![post.clone()], first_active_body: 3 }];
        let mut goal = q;
        goal[0] += 1.0;
        let run = |is_repelled: bool| {
            let mut state = JointState::at_rest(q);
            let mut min_distance = f32::INFINITY;
            for _ in 0..150 {
                let kinematics = tree.forward_kinematics(&state.q);
                let mut sums = TermSums::zero();
                // The goal is behind the post; every joint is damped.
                let metric = robot::JointMatrix::identity();
                let wanted = (goal - state.q) * 9.0 - state.qd * 6.0;
                sums.geometry.metric += metric;
                sums.potential -= metric * wanted;
                if is_repelled {
                    add(&mut sums, &kinematics, &state.qd, &spheres, &obstacle(), &CONFIG);
                }
                let force = sums.geometry.force + sums.potential;
                let qdd = -sums.geometry.metric.cholesky().unwrap().solve(&force);
                let qdd = tree.limits.scale_acceleration(&qdd);
                state = integrator::step(&state, &qdd, 1.0 / 30.0);
                let kinematics = tree.forward_kinematics(&state.q);
                min_distance = min_distance.min(solids.min_distance(
                    &kinematics,
                    std::slice::from_ref(&post),
                    0.2,
                ));
            }
            (min_distance, state.q[0] - q[0])
        };
        let (without, rotated) = run(false);
        assert!(
            without < -0.02 && rotated > 0.9,
            "without repulsion the path enters the post: {without} m, {rotated} rad"
        );
        let (min_distance, _) = run(true);
        println!("min distance {min_distance} m, without repulsion {without} m");
        assert!(min_distance > -0.001, "{min_distance} m into the post");
    }
}
