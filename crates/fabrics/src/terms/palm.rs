//! Drives the palm to a pose by pulling seven points that are fixed to it.

use super::{Pull, attractor::Attractor};
use nalgebra::{Matrix3, SVector};
use robot::{Isometry, JointVector, Kinematics, Tree, Vector};

/// Distance of the points from the palm (m): how much a radian of error weighs against a metre.
pub const REACH: f64 = 0.25;
const POINTS: usize = 7;

/// The palm's origin, and a point on each side of it on each axis, palm frame.
fn points() -> [Vector; POINTS] {
    let mut points = [Vector::zeros(); POINTS];
    for axis in 0..3 {
        points[1 + 2 * axis][axis] = REACH;
        points[2 + 2 * axis][axis] = -REACH;
    }
    points
}

/// Adds the pull of the palm to `target` (world from palm).
pub fn add(
    pull: &mut Pull,
    tree: &Tree,
    kinematics: &Kinematics,
    qd: &JointVector,
    target: &Isometry,
    attractor: &Attractor,
) {
    let (palm, body) = (kinematics.palm(), tree.palm.body);
    let motion = kinematics.motion(qd);
    let world = points().map(|point| palm.transform_point(&point.into()).coords);
    let mut error = SVector::<f64, 21>::zeros();
    let mut velocity = SVector::<f64, 21>::zeros();
    for (i, (point, at)) in points().iter().zip(&world).enumerate() {
        let wanted = target.transform_point(&(*point).into()).coords;
        error.fixed_rows_mut::<3>(3 * i).copy_from(&(at - wanted));
        velocity.fixed_rows_mut::<3>(3 * i).copy_from(&motion.velocity(body, at));
    }
    let acceleration = attractor.acceleration(&error, &velocity);
    let metric = Matrix3::identity() * attractor.mass;
    for (i, at) in world.iter().enumerate() {
        let jacobian = kinematics.point_jacobian(body, at);
        let bias = motion.bias_acceleration(body, at);
        let wanted: Vector = acceleration.fixed_rows::<3>(3 * i).into();
        pull.add_forcing(&jacobian, &bias, &metric, &wanted);
    }
}
