//! The surrogate expert: a PD controller along the nearest demonstration (Eq. 1, paper §II-B).

use crate::nearest::Configurations;
use robot::{ARM, DOF, JointState, JointVector};

/// Gains of the expert.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Gains {
    /// k_p (1/s²).
    pub position: f64,
    /// k_d (1/s). Stable at 30 Hz if ½ k_p dt < k_d < 2 / dt = 60.
    pub velocity: f64,
}

impl Gains {
    /// Rows by which a steady follower stays behind its target: k_d / k_p seconds, for want of a
    /// velocity feed-forward in Eq. 1.
    pub fn lag_rows(&self, dt: f64) -> usize {
        (self.velocity / self.position / dt).round() as usize
    }
}

/// π_e(q*_{t+1}, q, q̇) = k_p (q*_{t+1} - q) - k_d q̇ (Eq. 1), rad/s².
pub fn acceleration(gains: &Gains, target: &JointVector, state: &JointState) -> JointVector {
    (target - state.q) * gains.position - state.qd * gains.velocity
}

/// Demonstrations of one object pose, row by row.
#[derive(Clone, Debug)]
pub struct Demonstrations {
    rows: Vec<f32>,
    /// First row of each trajectory, and the number of rows at the end.
    offsets: Vec<usize>,
    /// The rows' configurations, weighted.
    weighted: Configurations,
}

const ROW: usize = 2 * DOF;

/// What a radian of an arm's joint counts for where configurations are compared, those of the hand counting for one:
/// it moves the hand several times as far. A corner, where the hand has come and the fingers set in to close, is cut
/// by the less.
const ARM_WEIGHT: f64 = 2.0;

/// What a joint counts for.
fn weight(joint: usize) -> f64 {
    if joint < ARM { ARM_WEIGHT } else { 1.0 }
}

/// Weighted distance (rad) of configurations.
fn apart(a: &JointVector, b: &JointVector) -> f64 {
    let squares = (0..DOF).map(|i| (weight(i) * (a[i] - b[i])).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Greatest difference (rad) of a joint in postures that are one.
const ONE_POSTURE: f64 = 1e-3;

impl Demonstrations {
    /// Takes rows of 46: q, q̇.
    pub fn new(rows: Vec<f32>, offsets: Vec<usize>) -> Self {
        let weighted = |row: &[f32]| std::array::from_fn(|i| weight(i) as f32 * row[i]);
        let weighted = Configurations::new(rows.chunks_exact(ROW).map(weighted));
        Self { rows, offsets, weighted }
    }

    /// Adds every row to a hash.
    pub(crate) fn digest(&self, hasher: &mut blake3::Hasher) {
        let bytes: Vec<u8> = self.rows.iter().flat_map(|x| x.to_le_bytes()).collect();
        hasher.update(&bytes);
        for &offset in &self.offsets {
            hasher.update(&(offset as u64).to_le_bytes());
        }
    }

    /// The same, turned by an angle (rad) about the robot's vertical axis: the axis of its first joint.
    pub fn turned(&self, turn: f32) -> Self {
        let mut rows = self.rows.clone();
        rows.iter_mut().step_by(ROW).for_each(|q| *q += turn);
        Self::new(rows, self.offsets.clone())
    }

    /// Those that end in one posture, apart from the others: one way of grasping each.
    pub fn by_grasp(&self) -> Vec<Self> {
        // Rows, ends of trajectories, and the posture in which they end.
        let mut apart: Vec<(Vec<f32>, Vec<usize>, JointVector)> = Vec::new();
        for trajectory in 0..self.trajectories() {
            let (first, end) = self.span(trajectory);
            let rows = &self.rows[first * ROW..end * ROW];
            let last = self.state(end - 1).q;
            match apart.iter_mut().find(|(_, _, other)| (last - other).amax() < ONE_POSTURE) {
                Some((others, offsets, other)) => {
                    others.extend(rows);
                    offsets.push(others.len() / ROW);
                    *other = last;
                }
                None => apart.push((rows.to_vec(), vec![0, end - first], last)),
            }
        }
        apart.into_iter().map(|(rows, offsets, _)| Self::new(rows, offsets)).collect()
    }

    /// Number of trajectories.
    pub fn trajectories(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Rows of one trajectory: first, and one past the last.
    pub fn span(&self, trajectory: usize) -> (usize, usize) {
        (self.offsets[trajectory], self.offsets[trajectory + 1])
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows.len() / ROW
    }

    /// One row as a state.
    pub fn state(&self, row: usize) -> JointState {
        let row = &self.rows[row * ROW..(row + 1) * ROW];
        JointState {
            q: JointVector::from_fn(|i, _| row[i] as f64),
            qd: JointVector::from_fn(|i, _| row[DOF + i] as f64),
        }
    }

    /// The configuration that the expert heads for: at least `rows` after the nearest one and at least
    /// `lead` (rad, weighted) away from it, or the last one.
    ///
    /// *Departure: the paper looks the trajectory up where a roll-out begins and then marches along it,
    /// wherever the policy goes meanwhile; what the expert says then depends on when the roll-out
    /// began, which no policy can know. Looked up at every state, it depends on the state alone.*
    ///
    /// *Departure: Eq. 1 heads for the next row. A follower under Eq. 1 stays rows behind its target,
    /// and where the demonstration is slow the next row is nearer than a policy can tell: it stalls.*
    pub fn target(&self, state: &JointState, rows: usize, lead: f64) -> JointVector {
        let (nearest, end) = self.nearest(&state.q);
        let from = self.state(nearest).q;
        let mut row = (nearest + rows).min(end - 1);
        let mut target = self.state(row).q;
        while row + 1 < end && apart(&target, &from) < lead {
            row += 1;
            target = self.state(row).q;
        }
        target
    }

    /// The row with the nearest configuration (weighted) over all trajectories, and one past the end of
    /// its trajectory.
    ///
    /// *Departure: the paper compares velocities too. The policy's velocity is off long before its
    /// configuration is, and a potential, which sees none, cannot follow a target that jumps with it.*
    pub fn nearest(&self, q: &JointVector) -> (usize, usize) {
        let nearest = self.weighted.nearest(&std::array::from_fn(|i| (weight(i) * q[i]) as f32));
        let end = self.offsets.partition_point(|&first| first <= nearest);
        (nearest, self.offsets[end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::integrator;

    #[test]
    fn eq1_collapses_onto_its_target() {
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
            assert!(error < 1e-4, "gains {position}, {velocity}: still off by {error}");
        }
    }

    #[test]
    fn eq1_is_dead_beat_at_900_and_45() {
        let target = JointVector::from_element(1.0);
        let mut state = JointState::at_rest(JointVector::zeros());
        for _ in 0..2 {
            let gains = Gains { position: 900.0, velocity: 45.0 };
            state = integrator::step(&state, &acceleration(&gains, &target, &state), 1.0 / 30.0);
        }
        assert!((state.q - target).amax() < 1e-12 && state.qd.amax() < 1e-9);
    }

    #[test]
    fn the_expert_follows_a_demonstration_to_its_end_at_its_pace() {
        // One joint moves by 1 rad with a smooth start and stop, in 61 rows; then 15 rows of rest.
        let dt = 1.0 / 30.0;
        let angle = |row: usize| {
            let s = (row as f64 / 60.0).min(1.0);
            s * s * (3.0 - 2.0 * s)
        };
        let mut rows = Vec::new();
        for row in 0..76 {
            let mut one = vec![0.0; ROW];
            one[0] = angle(row) as f32;
            one[DOF] = ((angle(row + 1) - angle(row)) / dt) as f32;
            rows.extend(one);
        }
        let demonstrations = Demonstrations::new(rows, vec![0, 76]);
        let gains = Gains { position: 225.0, velocity: 30.0 };
        let mut state = demonstrations.state(3);
        // It sets out beside the path.
        state.q[4] = 0.05;
        let mut worst = 0.0f64;
        for row in 3..90 {
            let target = demonstrations.target(&state, gains.lag_rows(dt), 0.05);
            state = integrator::step(&state, &acceleration(&gains, &target, &state), dt);
            worst = worst.max((state.q[0] - angle(row + 1)).abs());
        }
        assert!(worst < 0.12, "it runs {worst} rad ahead or behind");
        assert!((state.q[0] - 1.0).abs() < 1e-3 && state.q[4].abs() < 1e-3, "ends at {}", state.q);
    }

    #[test]
    fn demonstrations_of_one_object_pose_are_told_apart_by_where_they_end() {
        let row = |q: f32| (0..ROW).map(move |i| if i < DOF { q } else { 0.0 });
        // They end at 0.5, 0.9 and 0.5.
        let rows = [0.1, 0.5, 0.3, 0.2, 0.9, 0.4, 0.5].into_iter().flat_map(row).collect();
        let apart = Demonstrations::new(rows, vec![0, 2, 5, 7]).by_grasp();
        let found: Vec<(Vec<usize>, f64)> =
            apart.iter().map(|one| (one.offsets.clone(), one.state(one.rows() - 1).q[3])).collect();
        assert_eq!(found.len(), 2);
        assert!(found[0].0 == [0, 2, 4] && (found[0].1 - 0.5).abs() < 1e-6, "{found:?}");
        assert!(found[1].0 == [0, 3] && (found[1].1 - 0.9).abs() < 1e-6, "{found:?}");
        assert!((apart[0].state(2).q[0] - 0.4).abs() < 1e-6);
        assert!(Demonstrations::new(vec![], vec![0]).by_grasp().is_empty());
    }

    #[test]
    fn the_nearest_row_comes_with_the_end_of_its_trajectory() {
        let mut rows = vec![0.0; 3 * ROW];
        rows[ROW] = 0.3;
        rows[2 * ROW] = 0.5;
        let demonstrations = Demonstrations::new(rows, vec![0, 2, 3]);
        let mut q = JointVector::zeros();
        for (at, wanted) in [(0.1, (0, 2)), (0.32, (1, 2)), (0.45, (2, 3))] {
            q[0] = at;
            assert_eq!(demonstrations.nearest(&q), wanted);
        }
    }
}
