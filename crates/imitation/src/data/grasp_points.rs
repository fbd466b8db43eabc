//! Points of the hand in the grasp that an object pose is demonstrated with, an auxiliary training target of z.
//!
//! *Departure: the paper's autoencoder only reconstructs the cloud. Two shapes with similar clouds may have different
//! grasps, and a policy that is nearly linear in z needs what the grasp depends on.*

use crate::train::autoencoder::canonicalize;
use crate::train::expert::DemoTrajectories;
use anyhow::Result;
use dataset::Dataset;
use policy::encoder::normalized_position;
use robot::{JointVector, KinematicTree, NUM_FINGERS, rotation};

/// Number of points: palm, point that the hand grasps, fingertips.
const NUM_POINTS: usize = 2 + NUM_FINGERS;
/// Number of coordinates.
pub const GRASP_DIM: usize = 3 * NUM_POINTS;

/// Points of the hand at `q` (rad), in workspace units.
pub fn grasp_points(tree: &KinematicTree, q: &JointVector) -> [f32; GRASP_DIM] {
    let kinematics = tree.forward_kinematics(q);
    let palm = kinematics.palm_pose();
    let center = palm.transform_point(&tree.hand.grasp.center.into()).coords;
    let points = [palm.translation.vector, center].into_iter().chain(kinematics.fingertips());
    let mut coordinates = [0.0; GRASP_DIM];
    for (coordinates, point) in coordinates.chunks_exact_mut(3).zip(points) {
        coordinates.copy_from_slice(&normalized_position(rotation::to_vec3(&point)));
    }
    coordinates
}

/// A cloud and the hand in the preferred grasp, both in the canonical frame of the cloud.
pub struct GraspView {
    /// Index of the object in the dataset's objects.
    pub object: usize,
    /// Object pose x, y (m), yaw (rad) in the canonical frame.
    pub pose: [f32; 3],
    /// Points (m), 512 x 3.
    pub cloud: Vec<f32>,
    /// [`grasp_points`] of the last state of the first demonstration.
    pub grasp: [f32; GRASP_DIM],
}

/// One noisy cloud at each azimuth of each demonstrated object pose, except the held-out poses.
pub fn grasp_views(dataset: &Dataset, tree: &KinematicTree) -> Result<Vec<GraspView>> {
    let mut views = Vec::new();
    for object in 0..dataset.config.objects.len() {
        for (index, record) in dataset.read_poses(object)?.into_iter().enumerate() {
            if record.offsets.len() < 2 || super::split::is_held_out(index) {
                continue;
            }
            let demonstrations = DemoTrajectories::new(record.states, record.offsets);
            let last = demonstrations.state(demonstrations.row_range(0).1 - 1).q;
            let per_turn = (record.clouds.len() / record.azimuths.len().max(1)).max(1);
            let turns = record.azimuths.iter().zip(record.clouds.chunks_exact(per_turn));
            for (look, (turn, clouds)) in turns.enumerate() {
                let (azimuth, cloud) = canonicalize(&clouds[look % per_turn]);
                let rotation = f64::from(*turn) - azimuth;
                let mut q = last;
                q[0] += rotation;
                let pose = dataset::planar_pose::rotate_pose(record.pose, rotation as f32);
                let grasp = grasp_points(tree, &q);
                views.push(GraspView { object, pose, cloud, grasp });
            }
        }
    }
    Ok(views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grasp_points_rotate_with_the_first_joint() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = robot::joint_vector(&tree.hand.arm.nominal, &[0.3; robot::HAND_DOF]);
        let mut turned = q;
        turned[0] += std::f64::consts::FRAC_PI_2;
        let [a, b] = [q, turned].map(|q| grasp_points(&tree, &q));
        let origin = normalized_position(geometry::Vec3::ZERO);
        for (a, b) in a.chunks_exact(3).zip(b.chunks_exact(3)) {
            let [a, b] = [a, b].map(|p| [p[0] - origin[0], p[1] - origin[1], p[2]]);
            let error = (b[0] + a[1]).abs().max((b[1] - a[0]).abs()).max((b[2] - a[2]).abs());
            assert!(error < 1e-5, "{a:?} {b:?}");
        }
        // The fingertips of an open hand are 5 to 20 cm from the palm.
        let scale = policy::encoder::WORKSPACE_SCALE;
        for tip in a[6..].chunks_exact(3) {
            let distance = tip.iter().zip(&a[..3]).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
            assert!((0.05..0.2).contains(&(scale * distance.sqrt())), "{tip:?}");
        }
    }
}
