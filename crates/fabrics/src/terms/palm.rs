//! Palm pose term: attracts seven points fixed to the palm to their goal positions.

use super::{TermSums, attractor::Attractor};
use nalgebra::{Matrix3, SVector};
use robot::{Isometry, JointVector, KinematicTree, Kinematics, Vector};

/// Distance (m) of the points from the palm origin: metres of position error per radian of orientation error.
pub const POINT_LEVER: f64 = 0.25;
const NUM_POINTS: usize = 7;

/// The palm origin and the points at ± [`POINT_LEVER`] on each axis, palm frame.
fn points() -> [Vector; NUM_POINTS] {
    let mut points = [Vector::zeros(); NUM_POINTS];
    for axis in 0..3 {
        points[1 + 2 * axis][axis] = POINT_LEVER;
        points[2 + 2 * axis][axis] = -POINT_LEVER;
    }
    points
}

/// Adds the attraction of the palm to the pose `target` (world from palm).
pub fn add(
    sums: &mut TermSums,
    tree: &KinematicTree,
    kinematics: &Kinematics,
    qd: &JointVector,
    target: &Isometry,
    attractor: &Attractor,
) {
    let (palm, body) = (kinematics.palm_pose(), tree.palm.body);
    let motion = kinematics.velocities(qd);
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
        sums.add_forcing(&jacobian, &bias, &metric, &wanted);
    }
}
