//! Training data: the demonstrations of one grasp at one object pose, with the encoded observations.

use crate::train::expert::DemoTrajectories;
use policy::Observation;
use rand::{Rng, RngExt};
use rayon::prelude::*;
use robot::{DOF, JointVector};
use std::sync::Arc;

/// Demonstrations of one grasp at one object pose, and the encodings of the pose's clouds.
pub struct DemoGroup {
    /// Catalogue name of the object.
    pub object: Arc<str>,
    /// Index of the object pose, counted over all objects. Rotation about the robot does not change it.
    pub pose: usize,
    /// Trajectories that end in the same grasp (robot base frame).
    pub demonstrations: DemoTrajectories,
    /// Encoded noisy clouds of the pose, one per depth image.
    pub encodings: Vec<Observation>,
    /// Whether the model exports the start configurations of this group. Only groups at the unrotated pose do;
    /// the others are copies that are rotated about the robot to add views of the object.
    pub has_starts: bool,
    /// Start configurations (rad, canonical frame) of the nearest other object poses with the same grasp,
    /// where an attempt with this object may start ([`link_neighbor_starts`]).
    pub neighbor_starts: Vec<JointVector>,
}

/// Number of neighbouring object poses whose start configurations a group receives.
const NUM_NEIGHBORS: usize = 3;

/// Max. distance (rad, norm) between start configurations of the same grasp at neighbouring object poses.
const SAME_GRASP_DISTANCE: f64 = 0.8;

impl DemoGroup {
    /// Whether the group has at least one trajectory and one encoding.
    pub fn is_trainable(&self) -> bool {
        self.demonstrations.num_trajectories() > 0 && !self.encodings.is_empty()
    }

    /// First configuration (rad, canonical frame) of each trajectory.
    pub fn starts(&self) -> impl Iterator<Item = JointVector> {
        (0..self.demonstrations.num_trajectories()).map(|trajectory| {
            let (first, _) = self.demonstrations.row_range(trajectory);
            self.encodings[0].to_canonical(&self.demonstrations.state(first).q)
        })
    }

    /// Adds all training data of the group to a hash.
    pub(crate) fn hash_into(&self, hasher: &mut blake3::Hasher) {
        hasher.update(&(self.pose as u64).to_le_bytes());
        for Observation { azimuth, latent: z } in &self.encodings {
            hasher.update(&azimuth.to_le_bytes());
            hasher.update(&z.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        }
        for start in &self.neighbor_starts {
            hasher.update(&start.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        }
        self.demonstrations.hash_into(hasher);
    }

    /// A random start configuration (rad, canonical frame) of a neighbour, or of this group if it has no
    /// neighbours.
    pub(crate) fn sample_start(&self, rng: &mut impl Rng) -> JointVector {
        if self.neighbor_starts.is_empty() {
            let trajectory = rng.random_range(0..self.demonstrations.num_trajectories());
            return self.starts().nth(trajectory).unwrap_or_default();
        }
        self.neighbor_starts[rng.random_range(0..self.neighbor_starts.len())]
    }
}

/// Start configurations of one object pose.
pub struct PoseStarts {
    pose: usize,
    z: Vec<f32>,
    q: Vec<JointVector>,
}

/// Start configurations of all groups with `has_starts`.
pub fn collect_starts(groups: &[DemoGroup]) -> Vec<PoseStarts> {
    let of = |group: &DemoGroup| PoseStarts {
        pose: group.pose,
        z: group.encodings[0].features().to_vec(),
        q: group.starts().collect(),
    };
    groups.iter().filter(|group| group.has_starts && group.is_trainable()).map(of).collect()
}

/// Sets the neighbour starts of each group: start configurations of the nearest poses, in latent space, with
/// the same grasp.
pub fn link_neighbor_starts(groups: &mut [DemoGroup], starts: &[PoseStarts]) {
    groups.par_iter_mut().filter(|group| group.is_trainable()).for_each(|group| {
        let z = group.encodings[0].features();
        let distance = |other: &PoseStarts| -> f32 {
            other.z.iter().zip(z).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let own: Vec<JointVector> = group.starts().collect();
        let is_same_grasp =
            |start: &&JointVector| own.iter().any(|q| (q - *start).norm() < SAME_GRASP_DISTANCE);
        let others = starts.iter().filter(|other| other.pose != group.pose);
        let mut others: Vec<_> = others
            .filter_map(|other| {
                let same: Vec<_> = other.q.iter().filter(is_same_grasp).copied().collect();
                (!same.is_empty()).then(|| (distance(other), same))
            })
            .collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        group.neighbor_starts =
            others.into_iter().take(NUM_NEIGHBORS).flat_map(|(_, same)| same).collect();
    });
}

/// Mean configuration (rad, canonical frame) over all demonstration states.
pub fn mean_configuration(groups: &[DemoGroup]) -> [f64; DOF] {
    let mut sum = JointVector::zeros();
    let mut rows = 0;
    for DemoGroup { demonstrations, encodings, .. } in groups {
        sum += (0..demonstrations.rows())
            .map(|row| encodings[0].to_canonical(&demonstrations.state(row).q))
            .sum::<JointVector>();
        rows += demonstrations.rows();
    }
    (sum / rows.max(1) as f64).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Object pose `pose` with z = `z` at an azimuth; the demonstration starts at `q` in the canonical frame.
    fn demo_group(pose: usize, z: f32, q: f32, azimuth: f64) -> DemoGroup {
        let rows = (0..2 * DOF).map(|i| match i {
            0 => q + azimuth as f32,
            i if i < DOF => q,
            _ => 0.0,
        });
        DemoGroup {
            object: "box".into(),
            pose,
            demonstrations: DemoTrajectories::new(rows.collect(), vec![0, 1]),
            encodings: vec![Observation { azimuth, latent: vec![z] }],
            has_starts: true,
            neighbor_starts: Vec::new(),
        }
    }

    #[test]
    fn group_receives_starts_of_nearest_poses_with_the_same_grasp() {
        // Pose 0 at two azimuths. Pose 1 is nearest but has another grasp; poses 2 to 5 have the same grasp.
        let mut groups: Vec<DemoGroup> = [(1, 1.1, 0.9), (2, 1.4, 0.12), (3, 1.3, 0.13)]
            .into_iter()
            .chain([(4, 0.5, 0.14), (5, 3.0, 0.15)])
            .map(|(pose, z, q)| demo_group(pose, z, q, 0.2 * pose as f64))
            .chain([demo_group(0, 1.0, 0.1, 0.3), demo_group(0, 1.0, 0.1, -0.5)])
            .collect();
        let starts = collect_starts(&groups);
        link_neighbor_starts(&mut groups, &starts);
        for group in &groups[5..] {
            let near: Vec<f64> = group.neighbor_starts.iter().map(|start| start[7]).collect();
            let expected = [0.13, 0.12, 0.14];
            let error = near.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(near.len() == 3 && error < 1e-6, "{near:?}");
            // Canonical frame, independent of the azimuth of the demonstration.
            assert!((group.neighbor_starts[0][0] - 0.13).abs() < 1e-6);
        }
        // No other pose has the grasp of pose 1, so it uses its own start configuration.
        assert!(groups[0].neighbor_starts.is_empty());
        let own = groups[0].sample_start(&mut ChaCha8Rng::seed_from_u64(0));
        assert!((own[0] - 0.9).abs() < 1e-6, "{own}");
    }
}
