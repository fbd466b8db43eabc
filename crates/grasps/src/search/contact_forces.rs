//! Contact-force optimisation: forces that balance each other and the object's weight, and the joint targets
//! with which compliant motors apply them.

use crate::search::closing::ClosedHand;
use geometry::Pose;
use objects::object::Object;
use robot::{ARM_DOF, HAND_DOF, JointVector, KinematicTree, Vector, rotation};

/// Contact model and motor limits of the squeeze.
#[derive(Clone, Debug)]
pub struct SqueezeConfig {
    /// Minimum normal force (N) of each touching finger.
    pub min_force: f64,
    /// Friction coefficient (dimensionless) that is assumed, below the true one.
    pub friction: f64,
    /// Motor stiffness of the hand (N·m/rad).
    pub stiffness: f64,
    /// Maximum torque (N·m) of a finger joint.
    pub max_torque: f64,
    /// Factor on the commanded joint offset beyond the surface, relative to the offset that yields
    /// `max_torque`.
    ///
    /// A policy's fingers stop some hundredths of a radian short of the command, and a heavy object slips
    /// with the reduced torque. A saturated motor gives no more torque for a larger offset; the other motors
    /// press harder.
    pub squeeze_gain: f64,
    /// Maximum ratio of the commanded forces to the required ones. Fingers that press a thin object as hard as they
    /// can push it out between them.
    pub max_scale: f64,
}

/// A squeeze posture, and how well its forces balance.
#[derive(Clone, Debug)]
pub struct Squeeze {
    /// Commanded hand joints (rad).
    pub hand: [f64; HAND_DOF],
    /// Norm of the unbalanced force and torque (at a lever of 5 cm) per newton of normal force; 0 is
    /// balanced.
    pub wrench_residual: f64,
    /// Ratio of the forces that the motors can apply to the required forces.
    pub force_margin: f64,
}

const GRAVITY: f64 = 9.81;

/// Lever arm (m) that converts torques into forces.
const TORQUE_LEVER: f64 = 0.05;

/// Computes forces at the contacts of `closed`, with the arm joints of `q`, and the squeeze posture that
/// applies them.
pub fn compute_squeeze(
    tree: &KinematicTree,
    q: &JointVector,
    closed: &ClosedHand,
    object: &Object,
    world_from_object: &Pose,
    config: &SqueezeConfig,
) -> Option<Squeeze> {
    // Objects are upright, so the direction of gravity is known in their frame, also where the hand is fixed
    // and the object is moved to it.
    let touch = robot::joint_vector(&robot::arm_joints(q), &closed.hand);
    let kinematics = tree.forward_kinematics(&touch);
    let com = rotation::to_vector(*world_from_object * object.center_of_mass);
    let contacts: Vec<_> = closed
        .contacts
        .iter()
        .flatten()
        .map(|(body, contact)| {
            let point = rotation::to_vector(contact.point);
            (*body, point, -rotation::to_vector(contact.normal).normalize())
        })
        .collect();
    if contacts.len() < 2 {
        return None;
    }
    let down = world_from_object.rotation * geometry::Vec3::NEG_Z;
    let weight = rotation::to_vector(down) * (GRAVITY * object.mass as f64);
    let levers: Vec<Vector> = contacts.iter().map(|(_, point, _)| point - com).collect();
    let inward: Vec<Vector> = contacts.iter().map(|&(_, _, inward)| inward).collect();
    let forces = solve_contact_forces(&levers, &inward, &weight, config);

    let (force, torque) = net_wrench(&levers, &forces, &weight);
    let pressed: f64 = forces.iter().zip(&inward).map(|(f, n)| f.dot(n)).sum();
    let residual =
        libm::sqrt(force.norm_squared() + torque.norm_squared() / (TORQUE_LEVER * TORQUE_LEVER));

    let mut torques = JointVector::zeros();
    for ((body, point, _), force) in contacts.iter().zip(&forces) {
        torques += kinematics.point_jacobian(*body, point).transpose() * force;
    }
    let max_torque = (ARM_DOF..ARM_DOF + HAND_DOF).map(|i| torques[i].abs()).fold(1e-9, f64::max);
    let scale = config.max_torque / max_torque;
    let pressed_scale = scale.min(config.max_scale);
    let pressing = touch + torques * (config.squeeze_gain * pressed_scale / config.stiffness);
    let hand = robot::hand_joints(&tree.limits.clamp(&pressing, 0.0));
    Some(Squeeze { hand, wrench_residual: residual / pressed, force_margin: scale })
}

/// Forces in their friction cones, with at least the minimum normal force, that minimise the net wrench.
///
/// Projected gradient descent; the problem is convex and has up to four contacts.
fn solve_contact_forces(
    levers: &[Vector],
    inward: &[Vector],
    weight: &Vector,
    config: &SqueezeConfig,
) -> Vec<Vector> {
    let mut forces: Vec<Vector> = inward.iter().map(|n| n * config.min_force).collect();
    let rate = 0.5 / (levers.len() as f64 * (1.0 + 0.1 * 0.1 / (TORQUE_LEVER * TORQUE_LEVER)));
    for _ in 0..1000 {
        let (force, torque) = net_wrench(levers, &forces, weight);
        for ((f, lever), n) in forces.iter_mut().zip(levers).zip(inward) {
            let gradient = force + torque.cross(lever) / (TORQUE_LEVER * TORQUE_LEVER);
            *f = project_to_friction_cone(&(*f - gradient * rate), n, config);
        }
    }
    forces
}

/// Net force (N) and torque (N·m) on the object.
fn net_wrench(levers: &[Vector], forces: &[Vector], weight: &Vector) -> (Vector, Vector) {
    let force = forces.iter().fold(*weight, |sum, f| sum + f);
    let torque =
        levers.iter().zip(forces).fold(Vector::zeros(), |sum, (lever, f)| sum + lever.cross(f));
    (force, torque)
}

/// Projects a force onto the friction cone about `n`, truncated at the minimum normal force.
fn project_to_friction_cone(force: &Vector, n: &Vector, config: &SqueezeConfig) -> Vector {
    let mu = config.friction;
    let mut normal = force.dot(n);
    let tangent = force - n * normal;
    let tangential = tangent.norm();
    let direction = tangent / tangential.max(1e-12);
    let mut sliding = tangential;
    if sliding > mu * normal {
        // The closest point of the cone's surface is on the line through its apex.
        normal = ((normal + mu * sliding) / (1.0 + mu * mu)).max(0.0);
        sliding = mu * normal;
    }
    if normal < config.min_force {
        normal = config.min_force;
        sliding = tangential.min(mu * normal);
    }
    n * normal + direction * sliding
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: SqueezeConfig = SqueezeConfig {
        min_force: 4.0,
        friction: 0.5,
        stiffness: 3.0,
        max_torque: 0.6,
        squeeze_gain: 1.0,
        max_scale: f64::INFINITY,
    };

    #[test]
    fn opposed_contacts_balance_the_weight() {
        let levers = [Vector::new(0.03, 0.0, 0.0), Vector::new(-0.03, 0.0, 0.0)];
        let inward = [-Vector::x(), Vector::x()];
        let weight = Vector::new(0.0, 0.0, -3.0);
        let forces = solve_contact_forces(&levers, &inward, &weight, &CONFIG);
        let (force, torque) = net_wrench(&levers, &forces, &weight);
        assert!(force.norm() < 1e-3 && torque.norm() < 1e-4, "{force} {torque}");
        assert!(
            (forces[0].z - 1.5).abs() < 1e-3,
            "expected half the weight on each side, got {}",
            forces[0].z
        );
    }

    #[test]
    fn heavy_object_requires_larger_normal_force() {
        let levers = [Vector::new(0.03, 0.0, 0.0), Vector::new(-0.03, 0.0, 0.0)];
        let inward = [-Vector::x(), Vector::x()];
        let weight = Vector::new(0.0, 0.0, -12.0);
        let forces = solve_contact_forces(&levers, &inward, &weight, &CONFIG);
        let normal = forces[0].dot(&inward[0]);
        assert!(normal > 11.9, "friction 0.5 needs 12 N on each side, got {normal}");
    }

    #[test]
    fn projection_is_the_closest_force_in_the_truncated_cone() {
        let n = Vector::z();
        for force in [[3.0, 0.0, -5.0], [3.0, 0.0, 5.0], [9.0, 0.0, 6.0], [1.0, 0.0, 2.0]] {
            let force = Vector::from(force);
            let got = (project_to_friction_cone(&force, &n, &CONFIG) - force).norm();
            // Exhaustive search over a grid of forces in the plane.
            let (mut min, steps) = (f64::INFINITY, 0..=400);
            for (i, j) in steps.clone().flat_map(|i| steps.clone().map(move |j| (i, j))) {
                let normal = CONFIG.min_force + 0.025 * i as f64;
                let sliding = CONFIG.friction * normal * j as f64 / 400.0;
                min = min.min((Vector::new(sliding, 0.0, normal) - force).norm());
            }
            assert!((got - min).abs() < 0.02, "{force}: distance {got}, expected {min}");
        }
    }

    #[test]
    fn contacts_on_one_side_cannot_balance() {
        let levers = [Vector::new(0.03, 0.02, 0.0), Vector::new(0.03, -0.02, 0.0)];
        let inward = [-Vector::x(), -Vector::x()];
        let weight = Vector::new(0.0, 0.0, -3.0);
        let forces = solve_contact_forces(&levers, &inward, &weight, &CONFIG);
        assert!(net_wrench(&levers, &forces, &weight).0.norm() > 7.0);
    }
}
