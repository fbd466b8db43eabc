//! The surrogate expert: a PD controller along the nearest demonstration (Eq. 1, paper §II-B).

use robot::{DOF, JointState, JointVector};

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
}

const ROW: usize = 2 * DOF;
/// Seconds that make a velocity comparable with a position (design: (0.1 s)²).
const VELOCITY_WEIGHT: f32 = 0.1 * 0.1;

impl Demonstrations {
    /// Takes rows of 46: q, q̇.
    pub fn new(rows: Vec<f32>, offsets: Vec<usize>) -> Self {
        Self { rows, offsets }
    }

    /// Number of trajectories.
    pub fn trajectories(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Rows of one trajectory: first, and one past the last.
    pub fn span(&self, trajectory: usize) -> (usize, usize) {
        (self.offsets[trajectory], self.offsets[trajectory + 1])
    }

    /// One row as a state.
    pub fn state(&self, row: usize) -> JointState {
        let row = &self.rows[row * ROW..(row + 1) * ROW];
        JointState {
            q: JointVector::from_fn(|i, _| row[i] as f64),
            qd: JointVector::from_fn(|i, _| row[DOF + i] as f64),
        }
    }

    /// The row nearest to a state over all trajectories, and one past the end of its trajectory.
    pub fn nearest(&self, state: &JointState) -> (usize, usize) {
        let key: Vec<f32> = state.q.iter().chain(state.qd.iter()).map(|x| *x as f32).collect();
        let mut best = (0, f32::INFINITY);
        for (i, row) in self.rows.chunks_exact(ROW).enumerate() {
            let square = |a: &[f32], b: &[f32]| -> f32 {
                a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
            };
            let distance = square(&row[..DOF], &key[..DOF])
                + VELOCITY_WEIGHT * square(&row[DOF..], &key[DOF..]);
            if distance < best.1 {
                best = (i, distance);
            }
        }
        let end = self.offsets.partition_point(|&first| first <= best.0);
        (best.0, self.offsets[end])
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
    fn nearest_counts_speed_less_than_position() {
        let mut rows = vec![0.0; 3 * ROW];
        rows[ROW] = 0.3;
        rows[2 * ROW + DOF] = 1.0;
        let demonstrations = Demonstrations::new(rows, vec![0, 2, 3]);
        let mut state = JointState::at_rest(JointVector::zeros());
        state.qd[0] = 0.9;
        assert_eq!(demonstrations.nearest(&state), (2, 3));
        state.q[0] = 0.3;
        assert_eq!(demonstrations.nearest(&state), (1, 2));
    }
}
