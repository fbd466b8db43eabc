//! Points of the hand relative to the observed object: an input of F_ψ in task space.
//!
//! *Departure: the paper's networks observe q, and have to learn where it puts the hand. Positions relative to
//! the object are the same wherever the object is.*

use crate::LATENT_DIM;
use crate::observation::box_center;
use nalgebra::SMatrix;
use robot::kinematics::Kinematics;
use robot::{DOF, JointVector, KinematicTree, NUM_FINGERS, Vector};

/// Palm origin, two points that give the orientation of the palm, fingertips.
pub const NUM_POINTS: usize = 3 + NUM_FINGERS;
/// Number of input values.
pub const HAND_DIM: usize = 3 * NUM_POINTS;
/// Distance (m) per unit of input.
const SCALE: f64 = 0.1;
/// Distance (m) of the two points from the palm origin: along the palm normal, along the fingers.
const LEVER: f64 = 0.1;

/// Derivative of the input values by q (1/rad).
pub type HandJacobian = SMatrix<f32, HAND_DIM, DOF>;

/// Input values at a configuration (rad, canonical frame): positions of the points relative to the centre of the
/// box in `observation` ([`crate::ObservationKind::CloudAndBox`]).
pub fn hand_inputs(tree: &KinematicTree, q: &JointVector, observation: &[f32]) -> [f32; HAND_DIM] {
    let center = box_center(&observation[LATENT_DIM..]);
    let points = points(&tree.forward_kinematics(q));
    std::array::from_fn(|i| ((points[i / 3].1[i % 3] - center[i % 3]) / SCALE) as f32)
}

/// Derivative of [`hand_inputs`] by q.
pub fn hand_jacobian(tree: &KinematicTree, q: &JointVector) -> HandJacobian {
    let kinematics = tree.forward_kinematics(q);
    let mut jacobian = HandJacobian::zeros();
    for (k, (body, point)) in points(&kinematics).into_iter().enumerate() {
        let of_point = kinematics.point_jacobian(body, &point) / SCALE;
        jacobian.fixed_view_mut::<3, DOF>(3 * k, 0).copy_from(&of_point.map(|x| x as f32));
    }
    jacobian
}

/// Body and position (m) of each point.
fn points(kinematics: &Kinematics) -> [(usize, Vector); NUM_POINTS] {
    let tree = kinematics.tree();
    let palm = kinematics.palm_pose();
    let on_palm =
        |offset: Vector| (tree.palm.body, palm.translation.vector + palm.rotation * offset);
    let tips = kinematics.fingertips();
    std::array::from_fn(|k| match k {
        0 => on_palm(Vector::zeros()),
        1 => on_palm(Vector::x() * LEVER),
        2 => on_palm(Vector::z() * LEVER),
        _ => (tree.fingertips[k - 3].body, tips[k - 3]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::BOX_DIM;

    #[test]
    fn jacobian_agrees_with_central_differences() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let observation = [0.3; LATENT_DIM + BOX_DIM];
        let q = JointVector::from_fn(|i, _| 0.4 * libm::sin(i as f64));
        let jacobian = hand_jacobian(&tree, &q);
        let step = 1e-3;
        for joint in 0..DOF {
            let at = |shift: f64| {
                let mut q = q;
                q[joint] += shift;
                hand_inputs(&tree, &q, &observation)
            };
            let (up, down) = (at(step), at(-step));
            for i in 0..HAND_DIM {
                let wanted = (up[i] - down[i]) / (2.0 * step as f32);
                assert!((jacobian[(i, joint)] - wanted).abs() < 2e-3, "input {i}, joint {joint}");
            }
        }
    }

    #[test]
    fn inputs_are_relative_to_the_centre_of_the_box() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = JointVector::zeros();
        let at = |side: f32| {
            let observation = [[0.0; LATENT_DIM].as_slice(), &[side, 0.0, 0.0, side, 0.0, 0.0]];
            hand_inputs(&tree, &q, &observation.concat())
        };
        // One unit of the box is 5 cm, one unit of the inputs 10 cm.
        for (i, (moved, before)) in at(1.0).into_iter().zip(at(0.0)).enumerate() {
            let wanted = if i % 3 == 0 { -0.5 } else { 0.0 };
            assert!((moved - before - wanted).abs() < 1e-5, "input {i}");
        }
    }
}
