//! Surrogate expert: a proportional-derivative controller along the nearest demonstration (Eq. 1, paper §II-B).

use crate::data::nearest_neighbor::ConfigurationIndex;
use configs::Gains;
use robot::{DOF, HandModel, JointState, JointVector};

/// π_e(q*_{t+1}, q, q̇) = k_p (q*_{t+1} - q) - k_d q̇ (Eq. 1), rad/s². q*_{t+1} is `target` (rad); `gains`
/// holds k_p (1/s²) and k_d (1/s).
pub fn acceleration(gains: &Gains, target: &JointVector, state: &JointState) -> JointVector {
    (target - state.q) * gains.position - state.qd * gains.velocity
}

/// Demonstration trajectories of one object pose (robot base frame), concatenated row by row.
#[derive(Clone, Debug)]
pub struct DemoTrajectories {
    rows: Vec<f32>,
    /// First row of each trajectory, then the total number of rows.
    offsets: Vec<usize>,
    /// Weighted configurations of all rows, for the nearest-neighbour search.
    weighted: ConfigurationIndex,
}

const ROW_LEN: usize = 2 * DOF;

/// Weight of a joint in the configuration metric. That of the arm reduces corner cutting at the transition
/// from approach to finger closing.
fn joint_weight(joint: usize) -> f64 {
    HandModel::standard().joint_weight(joint)
}

/// Weighted Euclidean distance (rad) of two configurations.
fn weighted_distance(a: &JointVector, b: &JointVector) -> f64 {
    let squares = (0..DOF).map(|i| (joint_weight(i) * (a[i] - b[i])).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Max. difference (rad) of any joint between final postures of the same grasp.
const SAME_POSTURE: f64 = 1e-3;

impl DemoTrajectories {
    /// `rows`: 46 numbers per row (q in rad, q̇ in rad/s). `offsets`: first row of each trajectory, then the
    /// row count.
    pub fn new(rows: Vec<f32>, offsets: Vec<usize>) -> Self {
        let weighted = |row: &[f32]| std::array::from_fn(|i| joint_weight(i) as f32 * row[i]);
        let weighted = ConfigurationIndex::new(rows.chunks_exact(ROW_LEN).map(weighted));
        Self { rows, offsets, weighted }
    }

    /// Adds all rows and offsets to a hash.
    pub(crate) fn hash_into(&self, hasher: &mut blake3::Hasher) {
        let bytes: Vec<u8> = self.rows.iter().flat_map(|x| x.to_le_bytes()).collect();
        hasher.update(&bytes);
        for &offset in &self.offsets {
            hasher.update(&(offset as u64).to_le_bytes());
        }
    }

    /// The trajectories rotated by an angle (rad) about the robot's vertical axis, which is the axis of the
    /// first joint.
    pub fn rotated(&self, turn: f32) -> Self {
        let mut rows = self.rows.clone();
        rows.iter_mut().step_by(ROW_LEN).for_each(|q| *q += turn);
        Self::new(rows, self.offsets.clone())
    }

    /// Groups the trajectories by their final posture: one group per grasp.
    pub fn group_by_final_posture(&self) -> Vec<Self> {
        // Rows, offsets, and final posture of each group.
        let mut groups: Vec<(Vec<f32>, Vec<usize>, JointVector)> = Vec::new();
        for trajectory in 0..self.num_trajectories() {
            let (first, end) = self.row_range(trajectory);
            let rows = &self.rows[first * ROW_LEN..end * ROW_LEN];
            let last = self.state(end - 1).q;
            match groups.iter_mut().find(|(_, _, other)| (last - other).amax() < SAME_POSTURE) {
                Some((others, offsets, other)) => {
                    others.extend(rows);
                    offsets.push(others.len() / ROW_LEN);
                    *other = last;
                }
                None => groups.push((rows.to_vec(), vec![0, end - first], last)),
            }
        }
        groups.into_iter().map(|(rows, offsets, _)| Self::new(rows, offsets)).collect()
    }

    /// Number of trajectories.
    pub fn num_trajectories(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Row range of one trajectory: first row, and one past the last.
    pub fn row_range(&self, trajectory: usize) -> (usize, usize) {
        (self.offsets[trajectory], self.offsets[trajectory + 1])
    }

    /// Total number of rows.
    pub fn rows(&self) -> usize {
        self.rows.len() / ROW_LEN
    }

    /// The joint state of one row (rad, rad/s).
    pub fn state(&self, row: usize) -> JointState {
        let row = &self.rows[row * ROW_LEN..(row + 1) * ROW_LEN];
        JointState {
            q: JointVector::from_fn(|i, _| row[i] as f64),
            qd: JointVector::from_fn(|i, _| row[DOF + i] as f64),
        }
    }

    /// Target configuration of the expert: at least `min_rows` rows after the nearest row and at least
    /// `lookahead` (rad, weighted) away from it, or the last row.
    ///
    /// *Departure: the paper selects the trajectory at the start of a rollout and then advances along it,
    /// independent of the policy's motion. The expert's action then depends on the elapsed time, which the
    /// policy does not observe. Here the nearest row is searched at every state, so the action depends only
    /// on the state.*
    ///
    /// *Departure: the target of Eq. 1 is the next row. A follower under Eq. 1 lags several rows behind its
    /// target. On slow segments the next row is closer than the policy can resolve, and the policy stalls.*
    pub fn target(&self, state: &JointState, min_rows: usize, lookahead: f64) -> JointVector {
        let (nearest, end) = self.nearest_row(&state.q);
        let from = self.state(nearest).q;
        let mut row = (nearest + min_rows).min(end - 1);
        let mut target = self.state(row).q;
        while row + 1 < end && weighted_distance(&target, &from) < lookahead {
            row += 1;
            target = self.state(row).q;
        }
        target
    }

    /// The row with the nearest configuration (weighted metric) over all trajectories, and the end of its
    /// trajectory (exclusive).
    ///
    /// *Departure: the paper also compares velocities. The policy's velocity deviates long before its
    /// configuration. The potential does not observe velocity, so it cannot follow a target that jumps with
    /// the velocity.*
    pub fn nearest_row(&self, q: &JointVector) -> (usize, usize) {
        let nearest =
            self.weighted.nearest(&std::array::from_fn(|i| (joint_weight(i) * q[i]) as f32));
        let end = self.offsets.partition_point(|&first| first <= nearest);
        (nearest, self.offsets[end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::integrator;

    #[test]
    fn eq1_converges_to_its_target() {
        for (position, velocity) in [(900.0, 45.0), (225.0, 30.0)] {
            let target = JointVector::from_element(0.4);
            let mut state = JointState {
                q: JointVector::from_element(0.5),
                qd: JointVector::from_element(-0.3),
            };
            for _ in 0..60 {
                let qdd = acceleration(&Gains { position, velocity }, &target, &state);
                state = integrator::step(&state, &qdd, 1.0 / 30.0);
            }
            let error = (state.q - target).amax() + state.qd.amax();
            assert!(error < 1e-4, "gains {position}, {velocity}: remaining error {error}");
        }
    }

    #[test]
    fn eq1_is_deadbeat_with_gains_900_and_45() {
        let target = JointVector::from_element(1.0);
        let mut state = JointState::at_rest(JointVector::zeros());
        for _ in 0..2 {
            let gains = Gains { position: 900.0, velocity: 45.0 };
            state = integrator::step(&state, &acceleration(&gains, &target, &state), 1.0 / 30.0);
        }
        assert!((state.q - target).amax() < 1e-12 && state.qd.amax() < 1e-9);
    }

    #[test]
    fn expert_tracks_a_demonstration_in_time_to_its_end() {
        // One joint moves 1 rad with a smooth start and stop in 61 rows, then rests for 15 rows.
        let dt = 1.0 / 30.0;
        let angle = |row: usize| {
            let s = (row as f64 / 60.0).min(1.0);
            s * s * (3.0 - 2.0 * s)
        };
        let mut rows = Vec::new();
        for row in 0..76 {
            let mut one = vec![0.0; ROW_LEN];
            one[0] = angle(row) as f32;
            one[DOF] = ((angle(row + 1) - angle(row)) / dt) as f32;
            rows.extend(one);
        }
        let demonstrations = DemoTrajectories::new(rows, vec![0, 76]);
        let gains = Gains { position: 225.0, velocity: 30.0 };
        let mut state = demonstrations.state(3);
        // Initial offset from the path.
        state.q[4] = 0.05;
        let mut worst = 0.0f64;
        for row in 3..90 {
            let target = demonstrations.target(&state, gains.lag_rows(dt), 0.05);
            state = integrator::step(&state, &acceleration(&gains, &target, &state), dt);
            worst = worst.max((state.q[0] - angle(row + 1)).abs());
        }
        assert!(worst < 0.12, "max. tracking error {worst} rad");
        assert!(
            (state.q[0] - 1.0).abs() < 1e-3 && state.q[4].abs() < 1e-3,
            "final configuration {}",
            state.q
        );
    }

    #[test]
    fn trajectories_are_grouped_by_final_posture() {
        let row = |q: f32| (0..ROW_LEN).map(move |i| if i < DOF { q } else { 0.0 });
        // Final postures 0.5, 0.9 and 0.5.
        let rows = [0.1, 0.5, 0.3, 0.2, 0.9, 0.4, 0.5].into_iter().flat_map(row).collect();
        let groups = DemoTrajectories::new(rows, vec![0, 2, 5, 7]).group_by_final_posture();
        let found: Vec<(Vec<usize>, f64)> = groups
            .iter()
            .map(|group| (group.offsets.clone(), group.state(group.rows() - 1).q[3]))
            .collect();
        assert_eq!(found.len(), 2);
        assert!(found[0].0 == [0, 2, 4] && (found[0].1 - 0.5).abs() < 1e-6, "{found:?}");
        assert!(found[1].0 == [0, 3] && (found[1].1 - 0.9).abs() < 1e-6, "{found:?}");
        assert!((groups[0].state(2).q[0] - 0.4).abs() < 1e-6);
        assert!(DemoTrajectories::new(vec![], vec![0]).group_by_final_posture().is_empty());
    }

    #[test]
    fn nearest_row_is_returned_with_the_end_of_its_trajectory() {
        let mut rows = vec![0.0; 3 * ROW_LEN];
        rows[ROW_LEN] = 0.3;
        rows[2 * ROW_LEN] = 0.5;
        let demonstrations = DemoTrajectories::new(rows, vec![0, 2, 3]);
        let mut q = JointVector::zeros();
        for (at, expected) in [(0.1, (0, 2)), (0.32, (1, 2)), (0.45, (2, 3))] {
            q[0] = at;
            assert_eq!(demonstrations.nearest_row(&q), expected);
        }
    }
}
