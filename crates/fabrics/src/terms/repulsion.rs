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
    /// Scale of the priority (m²): 100 times this at 1 cm, falling with the squared distance.
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
            // Motion away from the obstacle is free, unless the sphere is inside.
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
