//! Vectors from points of the hand to the nearest seen surface: an input of F_ψ in task space.
//!
//! *Departure: the paper's networks observe q and z, and have to learn where q puts the hand relative to the object
//! that z describes. These vectors are the same wherever the object is, at every yaw and for every object with the
//! same local surface. RobustDexGrasp and GraspXL observe such vectors too.*
//!
//! ψ remains a potential: for given nearest points, a vector is a function of q. ψ jumps where the nearest point of a
//! hand point changes.

use nalgebra::{Matrix3, SMatrix};
use robot::kinematics::{Kinematics, PointJacobian};
use robot::{DOF, JointVector, KinematicTree, NUM_FINGERS, Vector};

/// Number of points on each finger: origins of the last two links, fingertip.
const POINTS_PER_FINGER: usize = 3;
/// Points of the hand: palm, point that the hand grasps, points of the fingers.
pub const NUM_POINTS: usize = 2 + POINTS_PER_FINGER * NUM_FINGERS;
/// Number of input values.
pub const SURFACE_DIM: usize = 3 * NUM_POINTS;
/// Distance (m) at which a vector has half of its maximum length, 1. Near the surface its resolution is highest.
const HALF_DISTANCE: f64 = 0.05;

/// Derivative of the input values by q (1/rad).
pub type SurfaceJacobian = SMatrix<f32, SURFACE_DIM, DOF>;

/// Input values at a configuration (rad, canonical frame), for surface points (m, canonical frame; x, y, z in turn):
/// v / (|v| + 5 cm) for the vector v from each point of the hand to the nearest surface point, palm frame. Zeros
/// without surface points.
pub fn surface_vectors(
    tree: &KinematicTree,
    q: &JointVector,
    surface: &[f32],
) -> [f32; SURFACE_DIM] {
    let kinematics = tree.forward_kinematics(q);
    let palm_from_world = kinematics.palm_pose().rotation.inverse();
    let mut values = [0.0; SURFACE_DIM];
    for (value, (_, point)) in values.chunks_exact_mut(3).zip(points(&kinematics)) {
        if let Some(nearest) = nearest_point(surface, &point) {
            let v = palm_from_world * (nearest - point);
            let saturated = v / (v.norm() + HALF_DISTANCE);
            value.copy_from_slice(&saturated.map(|x| x as f32).data.0[0]);
        }
    }
    values
}

/// Derivative of [`surface_vectors`] by q, at constant nearest points.
pub fn surface_jacobian(tree: &KinematicTree, q: &JointVector, surface: &[f32]) -> SurfaceJacobian {
    let kinematics = tree.forward_kinematics(q);
    let palm = kinematics.palm_pose();
    let palm_from_world = palm.rotation.inverse().to_rotation_matrix().into_inner();
    let of_palm = |point: &Vector| kinematics.point_jacobian(tree.palm.body, point);
    let mut jacobian = SurfaceJacobian::zeros();
    for (k, (body, point)) in points(&kinematics).into_iter().enumerate() {
        let Some(nearest) = nearest_point(surface, &point) else { continue };
        // The surface point is at rest. Seen from the palm, it moves against the palm's material at that place.
        let relative: PointJacobian =
            of_palm(&point) - of_palm(&nearest) - kinematics.point_jacobian(body, &point);
        let v = palm_from_world * (nearest - point);
        let (length, sum) = (v.norm(), v.norm() + HALF_DISTANCE);
        let direction = v / length.max(1e-9);
        let saturation =
            (Matrix3::identity() - direction * direction.transpose() * (length / sum)) / sum;
        let of_value = saturation * palm_from_world * relative;
        jacobian.fixed_view_mut::<3, DOF>(3 * k, 0).copy_from(&of_value.map(|x| x as f32));
    }
    jacobian
}

/// The surface point (m) nearest to a point; `None` without surface points.
fn nearest_point(surface: &[f32], point: &Vector) -> Option<Vector> {
    let [x, y, z] = [point.x as f32, point.y as f32, point.z as f32];
    let squared = |p: &[f32]| {
        let [dx, dy, dz] = [p[0] - x, p[1] - y, p[2] - z];
        dx * dx + dy * dy + dz * dz
    };
    let mut best: Option<(f32, &[f32])> = None;
    for other in surface.chunks_exact(3) {
        let distance = squared(other);
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, other));
        }
    }
    best.map(|(_, p)| Vector::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])))
}

/// Body and position (m) of each point of the hand.
fn points(kinematics: &Kinematics) -> [(usize, Vector); NUM_POINTS] {
    let tree = kinematics.tree();
    let palm = kinematics.palm_pose();
    let center = palm.transform_point(&tree.hand.grasp.center.into()).coords;
    let tips = kinematics.fingertips();
    std::array::from_fn(|k| match k {
        0 => (tree.palm.body, palm.translation.vector),
        1 => (tree.palm.body, center),
        _ => {
            let (finger, along) = ((k - 2) / POINTS_PER_FINGER, (k - 2) % POINTS_PER_FINGER);
            let last = tree.fingertips[finger].body;
            match along {
                0 => (last, tips[finger]),
                _ => {
                    let body = last + 1 - along;
                    (body, kinematics.world_from_body[body].translation.vector)
                }
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::{Isometry, rotation};

    /// Surface points within 12 cm of the palm at `q`, along each axis.
    fn surface(tree: &KinematicTree, q: &JointVector) -> Vec<f32> {
        let palm = tree.forward_kinematics(q).palm_pose().translation.vector;
        let point = |k: usize| {
            let wave = |seed: f64| 0.12 * libm::sin(seed * k as f64);
            palm + Vector::new(wave(1.3), wave(2.1), wave(0.7))
        };
        (1..40).flat_map(|k| point(k).map(|x| x as f32).data.0[0]).collect()
    }

    #[test]
    fn jacobian_agrees_with_central_differences() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = JointVector::from_fn(|i, _| 0.4 * libm::sin(i as f64));
        let surface = surface(&tree, &q);
        let jacobian = surface_jacobian(&tree, &q, &surface);
        let step = 1e-4;
        for joint in 0..DOF {
            let at = |shift: f64| {
                let mut q = q;
                q[joint] += shift;
                surface_vectors(&tree, &q, &surface)
            };
            let (up, down) = (at(step), at(-step));
            for i in 0..SURFACE_DIM {
                let wanted = (up[i] - down[i]) / (2.0 * step as f32);
                let error = (jacobian[(i, joint)] - wanted).abs();
                assert!(error < 1e-2, "input {i}, joint {joint}: error {error}");
            }
        }
    }

    #[test]
    fn vectors_do_not_change_if_robot_and_surface_turn_together() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = JointVector::from_fn(|i, _| 0.4 * libm::cos(i as f64));
        let surface = surface(&tree, &q);
        let turn: Isometry = rotation::rotation_z(0.7);
        let turned: Vec<f32> = surface
            .chunks_exact(3)
            .flat_map(|p| {
                let point = Vector::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
                (turn * nalgebra::Point3::from(point)).coords.map(|x| x as f32).data.0[0]
            })
            .collect();
        let mut turned_q = q;
        turned_q[0] += 0.7;
        let [before, after] = [(&q, &surface), (&turned_q, &turned)]
            .map(|(q, surface)| surface_vectors(&tree, q, surface));
        for (before, after) in before.iter().zip(after) {
            assert!((before - after).abs() < 1e-4, "{before} against {after}");
        }
        assert!(before.chunks_exact(3).all(|v| v.iter().map(|x| x * x).sum::<f32>() < 1.0));
        assert_eq!(surface_vectors(&tree, &q, &[]), [0.0; SURFACE_DIM]);
    }
}
