//! From touch to squeeze: contact forces that balance each other and the weight, and the joint
//! targets that make compliant motors press with them.

use crate::closing::Closed;
use geometry::Pose;
use geometry::object::Object;
use robot::{ARM, HAND, JointVector, Tree, Vector, rotation};

/// How hard and how the hand presses.
#[derive(Clone, Debug)]
pub struct SqueezeConfig {
    /// Normal force (N) asked of each touching finger at least.
    pub least_force: f64,
    /// Friction coefficient assumed, below the true one.
    pub friction: f64,
    /// Motor stiffness of the hand (N·m/rad).
    pub stiffness: f64,
    /// Torque (N·m) that the most loaded joint can give.
    pub torque: f64,
    /// How many times as far beyond the surface is commanded as that torque needs. A policy's fingers stop some
    /// hundredths of a radian short, and with as much less torque a heavy object slips; a motor at its limit gives no
    /// more for a command beyond it, the others press harder.
    pub press: f64,
}

/// A squeeze and how well its forces balance.
#[derive(Clone, Debug)]
pub struct Squeeze {
    /// Commanded hand joints (rad).
    pub hand: [f64; HAND],
    /// What remains of force (N) and torque (N at 5 cm) per newton pressed: small is stable.
    pub residual: f64,
    /// How many times the needed forces the motors can give.
    pub reserve: f64,
}

const GRAVITY: f64 = 9.81;

/// Length (m) that makes torques comparable with forces.
const LEVER: f64 = 0.05;

/// Distributes forces over the contacts of `closed`, whose arm stands as in `q`.
pub fn squeeze(
    tree: &Tree,
    q: &JointVector,
    closed: &Closed,
    object: &Object,
    world_from_object: &Pose,
    config: &SqueezeConfig,
) -> Option<Squeeze> {
    // Objects stand upright, so gravity is known in their frame even where the hand is kept still
    // and the object is brought to it.
    let touch = robot::join(&robot::arm_of(q), &closed.hand);
    let kinematics = tree.kinematics(&touch);
    let com = rotation::to_vector(*world_from_object * object.center_of_mass);
    let contacts: Vec<_> = closed
        .contacts
        .iter()
        .flatten()
        .map(|(body, contact)| {
            let point = rotation::to_vector(contact.point);
            (*body, point, -rotation::to_vector(contact.outward).normalize())
        })
        .collect();
    if contacts.len() < 2 {
        return None;
    }
    let down = world_from_object.rotation * geometry::Vec3::NEG_Z;
    let weight = rotation::to_vector(down) * (GRAVITY * object.mass as f64);
    let arms: Vec<Vector> = contacts.iter().map(|(_, point, _)| point - com).collect();
    let inward: Vec<Vector> = contacts.iter().map(|&(_, _, inward)| inward).collect();
    let forces = balance(&arms, &inward, &weight, config);

    let (force, torque) = wrench(&arms, &forces, &weight);
    let pressed: f64 = forces.iter().zip(&inward).map(|(f, n)| f.dot(n)).sum();
    let residual = libm::sqrt(force.norm_squared() + torque.norm_squared() / (LEVER * LEVER));

    let mut torques = JointVector::zeros();
    for ((body, point, _), force) in contacts.iter().zip(&forces) {
        torques += kinematics.point_jacobian(*body, point).transpose() * force;
    }
    let strongest = (ARM..ARM + HAND).map(|i| torques[i].abs()).fold(1e-9, f64::max);
    let scale = config.torque / strongest;
    let pressing = touch + torques * (config.press * scale / config.stiffness);
    let hand = robot::hand_of(&tree.limits.clamp(&pressing, 0.0));
    Some(Squeeze { hand, residual: residual / pressed, reserve: scale })
}

/// Forces inside their friction cones, at least the least force each, with the smallest net wrench.
///
/// Projected gradient descent; the problem is convex and has at most four contacts.
fn balance(
    arms: &[Vector],
    inward: &[Vector],
    weight: &Vector,
    config: &SqueezeConfig,
) -> Vec<Vector> {
    let mut forces: Vec<Vector> = inward.iter().map(|n| n * config.least_force).collect();
    let rate = 0.5 / (arms.len() as f64 * (1.0 + 0.1 * 0.1 / (LEVER * LEVER)));
    for _ in 0..1000 {
        let (force, torque) = wrench(arms, &forces, weight);
        for ((f, arm), n) in forces.iter_mut().zip(arms).zip(inward) {
            let gradient = force + torque.cross(arm) / (LEVER * LEVER);
            *f = into_cone(&(*f - gradient * rate), n, config);
        }
    }
    forces
}

/// Net force and torque on the object.
fn wrench(arms: &[Vector], forces: &[Vector], weight: &Vector) -> (Vector, Vector) {
    let force = forces.iter().fold(*weight, |sum, f| sum + f);
    let torque = arms.iter().zip(forces).fold(Vector::zeros(), |sum, (arm, f)| sum + arm.cross(f));
    (force, torque)
}

/// The nearest force in the friction cone about `n`, with at least the least normal force.
fn into_cone(force: &Vector, n: &Vector, config: &SqueezeConfig) -> Vector {
    let mu = config.friction;
    let mut normal = force.dot(n);
    let tangent = force - n * normal;
    let tangential = tangent.norm();
    let direction = tangent / tangential.max(1e-12);
    let mut sliding = tangential;
    if sliding > mu * normal {
        // The nearest point of the cone's surface lies on the line through its apex.
        normal = ((normal + mu * sliding) / (1.0 + mu * mu)).max(0.0);
        sliding = mu * normal;
    }
    if normal < config.least_force {
        normal = config.least_force;
        sliding = tangential.min(mu * normal);
    }
    n * normal + direction * sliding
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: SqueezeConfig =
        SqueezeConfig { least_force: 4.0, friction: 0.5, stiffness: 3.0, torque: 0.6, press: 1.0 };

    #[test]
    fn opposed_contacts_carry_the_weight() {
        let arms = [Vector::new(0.03, 0.0, 0.0), Vector::new(-0.03, 0.0, 0.0)];
        let inward = [-Vector::x(), Vector::x()];
        let weight = Vector::new(0.0, 0.0, -3.0);
        let forces = balance(&arms, &inward, &weight, &CONFIG);
        let (force, torque) = wrench(&arms, &forces, &weight);
        assert!(force.norm() < 1e-3 && torque.norm() < 1e-4, "{force} {torque}");
        assert!((forces[0].z - 1.5).abs() < 1e-3, "each side carries half, got {}", forces[0].z);
    }

    #[test]
    fn a_heavy_object_is_pressed_harder() {
        let arms = [Vector::new(0.03, 0.0, 0.0), Vector::new(-0.03, 0.0, 0.0)];
        let inward = [-Vector::x(), Vector::x()];
        let weight = Vector::new(0.0, 0.0, -12.0);
        let forces = balance(&arms, &inward, &weight, &CONFIG);
        let normal = forces[0].dot(&inward[0]);
        assert!(normal > 11.9, "friction 0.5 needs 12 N on each side, got {normal}");
    }

    #[test]
    fn the_nearest_force_of_the_cut_cone_is_found() {
        let n = Vector::z();
        for force in [[3.0, 0.0, -5.0], [3.0, 0.0, 5.0], [9.0, 0.0, 6.0], [1.0, 0.0, 2.0]] {
            let force = Vector::from(force);
            let got = (into_cone(&force, &n, &CONFIG) - force).norm();
            // All forces of the plane in small steps.
            let (mut least, steps) = (f64::INFINITY, 0..=400);
            for (i, j) in steps.clone().flat_map(|i| steps.clone().map(move |j| (i, j))) {
                let normal = CONFIG.least_force + 0.025 * i as f64;
                let sliding = CONFIG.friction * normal * j as f64 / 400.0;
                least = least.min((Vector::new(sliding, 0.0, normal) - force).norm());
            }
            assert!((got - least).abs() < 0.02, "{force}: {got} away, the nearest is {least}");
        }
    }

    #[test]
    fn contacts_on_one_side_cannot_balance() {
        let arms = [Vector::new(0.03, 0.02, 0.0), Vector::new(0.03, -0.02, 0.0)];
        let inward = [-Vector::x(), -Vector::x()];
        let weight = Vector::new(0.0, 0.0, -3.0);
        let forces = balance(&arms, &inward, &weight, &CONFIG);
        assert!(wrench(&arms, &forces, &weight).0.norm() > 7.0);
    }
}
