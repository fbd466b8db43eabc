//! What a policy learns from: one way to grasp one object pose.

use crate::expert::Demonstrations;
use policy::Encoding;
use rand::{Rng, RngExt};
use rayon::prelude::*;
use robot::{DOF, JointVector};
use std::sync::Arc;

/// Demonstrations of one way to grasp one object pose, and its clouds, encoded.
pub struct Lesson {
    /// Name of the object.
    pub object: Arc<str>,
    /// Number of the object pose: turned about the robot it is the same one.
    pub pose: usize,
    /// Demonstrations.
    pub demonstrations: Demonstrations,
    /// Each noisy cloud of the pose.
    pub encodings: Vec<Encoding>,
    /// Whether an attempt may begin at a start of this lesson.
    pub has_starts: bool,
    /// Starts (rad, with the object in front) of the nearest other object poses that are grasped alike: where an attempt
    /// with this object may begin ([`introduce`]).
    pub near: Vec<JointVector>,
}

/// Object poses whose starts a lesson gets.
const NEIGHBORS: usize = 3;

/// Distance (rad, norm) of two starts of one way of grasping, at neighbouring object poses.
const ALIKE: f64 = 0.8;

impl Lesson {
    /// Whether there is something to learn from it.
    pub fn is_full(&self) -> bool {
        self.demonstrations.trajectories() > 0 && !self.encodings.is_empty()
    }

    /// Where its demonstrations begin (rad, with the object in front).
    pub fn starts(&self) -> impl Iterator<Item = JointVector> {
        (0..self.demonstrations.trajectories()).map(|trajectory| {
            let (first, _) = self.demonstrations.span(trajectory);
            self.encodings[0].in_front(&self.demonstrations.state(first).q)
        })
    }

    /// Adds everything that is learned from to a hash.
    pub(crate) fn digest(&self, hasher: &mut blake3::Hasher) {
        hasher.update(&(self.pose as u64).to_le_bytes());
        for Encoding { bearing, z } in &self.encodings {
            hasher.update(&bearing.to_le_bytes());
            hasher.update(&z.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        }
        for start in &self.near {
            hasher.update(&start.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        }
        self.demonstrations.digest(hasher);
    }

    /// A start (rad, in front) that an attempt with this object may have; its own if no pose nearby is grasped alike.
    pub(crate) fn draw_start(&self, rng: &mut impl Rng) -> JointVector {
        if self.near.is_empty() {
            let trajectory = rng.random_range(0..self.demonstrations.trajectories());
            return self.starts().nth(trajectory).unwrap_or_default();
        }
        self.near[rng.random_range(0..self.near.len())]
    }
}

/// Where the attempts with an object pose may begin.
pub struct PoseStarts {
    pose: usize,
    z: Vec<f32>,
    q: Vec<JointVector>,
}

/// The starts of those lessons that attempts may begin with.
pub fn starts(lessons: &[Lesson]) -> Vec<PoseStarts> {
    let of = |lesson: &Lesson| PoseStarts {
        pose: lesson.pose,
        z: lesson.encodings[0].z.clone(),
        q: lesson.starts().collect(),
    };
    lessons.iter().filter(|lesson| lesson.has_starts && lesson.is_full()).map(of).collect()
}

/// Gives each lesson the starts of the nearest other object poses, by z, that are grasped alike.
pub fn introduce(lessons: &mut [Lesson], among: &[PoseStarts]) {
    lessons.par_iter_mut().filter(|lesson| lesson.is_full()).for_each(|lesson| {
        let z = &lesson.encodings[0].z;
        let distance = |other: &PoseStarts| -> f32 {
            other.z.iter().zip(z).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let own: Vec<JointVector> = lesson.starts().collect();
        let is_one_of_them = |start: &&JointVector| own.iter().any(|q| (q - *start).norm() < ALIKE);
        let others = among.iter().filter(|other| other.pose != lesson.pose);
        let mut others: Vec<_> = others
            .filter_map(|other| {
                let alike: Vec<_> = other.q.iter().filter(is_one_of_them).copied().collect();
                (!alike.is_empty()).then(|| (distance(other), alike))
            })
            .collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        lesson.near = others.into_iter().take(NEIGHBORS).flat_map(|(_, alike)| alike).collect();
    });
}

/// The mean configuration (rad) of all demonstrations, with the object in front.
pub fn mean_configuration(lessons: &[Lesson]) -> [f64; DOF] {
    let mut sum = JointVector::zeros();
    let mut rows = 0;
    for Lesson { demonstrations, encodings, .. } in lessons {
        sum += (0..demonstrations.rows())
            .map(|row| encodings[0].in_front(&demonstrations.state(row).q))
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

    /// Object pose `pose` with z = `z` at a bearing; a demonstration begins at `q` in front.
    fn lesson(pose: usize, z: f32, q: f32, bearing: f64) -> Lesson {
        let rows = (0..2 * DOF).map(|i| match i {
            0 => q + bearing as f32,
            i if i < DOF => q,
            _ => 0.0,
        });
        Lesson {
            object: "box".into(),
            pose,
            demonstrations: Demonstrations::new(rows.collect(), vec![0, 1]),
            encodings: vec![Encoding { bearing, z: vec![z] }],
            has_starts: true,
            near: Vec::new(),
        }
    }

    #[test]
    fn a_lesson_knows_the_starts_of_the_nearest_poses_that_are_grasped_alike() {
        // Pose 0, once more at another bearing; near it pose 1, grasped in another way, and then poses 2 to 5.
        let mut lessons: Vec<Lesson> = [(1, 1.1, 0.9), (2, 1.4, 0.12), (3, 1.3, 0.13)]
            .into_iter()
            .chain([(4, 0.5, 0.14), (5, 3.0, 0.15)])
            .map(|(pose, z, q)| lesson(pose, z, q, 0.2 * pose as f64))
            .chain([lesson(0, 1.0, 0.1, 0.3), lesson(0, 1.0, 0.1, -0.5)])
            .collect();
        let among = starts(&lessons);
        introduce(&mut lessons, &among);
        for lesson in &lessons[5..] {
            let near: Vec<f64> = lesson.near.iter().map(|start| start[7]).collect();
            let wanted = [0.13, 0.12, 0.14];
            let off = near.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(near.len() == 3 && off < 1e-6, "{near:?}");
            // In front, whatever the bearing at which they were demonstrated.
            assert!((lesson.near[0][0] - 0.13).abs() < 1e-6);
        }
        // Nobody is grasped as pose 1 is: it keeps to its own start.
        assert!(lessons[0].near.is_empty());
        let own = lessons[0].draw_start(&mut ChaCha8Rng::seed_from_u64(0));
        assert!((own[0] - 0.9).abs() < 1e-6, "{own}");
    }
}
