//! Rollout states for DAgger. A state is sampled near a demonstration or at a start configuration, rolled out
//! by the current policy, and resampled when its horizon ends.

use crate::data::demo_group::DemoGroup;
use anyhow::{Result, ensure};
use configs::DaggerConfig;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use robot::{ARM_DOF, DOF, JointLimits, JointState, JointVector};

/// Distance (rad, norm) from the nearest demonstration state beyond which a rollout is dropped.
const MAX_DRIFT: f64 = 0.6;

/// A robot state of a rollout, with the demonstration group and observation it belongs to.
#[derive(Clone, Copy)]
pub(crate) struct RolloutState {
    pub(crate) group: usize,
    pub(crate) encoding: usize,
    pub(crate) state: JointState,
    pub(crate) steps_left: usize,
}

/// Samples initial states of rollouts from the trainable demonstration groups.
pub(crate) struct StateSampler<'a> {
    groups: &'a [DemoGroup],
    trainable: Vec<usize>,
    limits: &'a JointLimits,
}

impl<'a> StateSampler<'a> {
    pub(crate) fn new(groups: &'a [DemoGroup], limits: &'a JointLimits) -> Self {
        let trainable = (0..groups.len()).filter(|&i| groups[i].is_trainable()).collect();
        Self { groups, trainable, limits }
    }

    /// Initial states of `num_buffers` batches. The remaining steps are random, so that the rollouts end at
    /// different times.
    pub(crate) fn staggered_batches(
        &self,
        config: &DaggerConfig,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<RolloutState>> {
        let mut draw = |_| {
            let rollout = self.sample(config, config.horizon_fraction(0), rng);
            RolloutState { steps_left: rng.random_range(1..=rollout.steps_left), ..rollout }
        };
        let mut batch = |_| (0..config.batch).map(&mut draw).collect();
        (0..config.num_buffers.max(1)).map(&mut batch).collect()
    }

    /// A start configuration of a neighbour, or a noisy state of a random demonstration. `fraction` is the
    /// current fraction of the full horizon.
    pub(crate) fn sample(
        &self,
        config: &DaggerConfig,
        fraction: f64,
        rng: &mut ChaCha8Rng,
    ) -> RolloutState {
        let group = self.trainable[rng.random_range(0..self.trainable.len())];
        let encoding = rng.random_range(0..self.groups[group].encodings.len());
        if rng.random::<f64>() < fraction * config.start_fraction {
            let start = self.groups[group].sample_start(rng);
            let q = self.groups[group].encodings[encoding].from_canonical(&start);
            let (state, steps_left) =
                (JointState::at_rest(q), sample_horizon(config.start_horizon(), fraction, rng));
            let rollout = RolloutState { group, encoding, state, steps_left };
            if is_on_track(&rollout, self.groups) {
                return rollout;
            }
        }
        let demonstrations = &self.groups[group].demonstrations;
        let (first, end) =
            demonstrations.row_range(rng.random_range(0..demonstrations.num_trajectories()));
        let mut state = demonstrations.state(rng.random_range(first..end));
        let [arm, hand, velocity] = config.noise;
        let position = |joint: usize| if joint < ARM_DOF { arm } else { hand };
        state.q += JointVector::from_fn(|i, _| rng.random_range(-position(i)..=position(i)));
        state.qd += JointVector::from_fn(|_, _| rng.random_range(-velocity..=velocity));
        let state = self.limits.clamp_state(&state);
        RolloutState {
            group,
            encoding,
            state,
            steps_left: sample_horizon(config.horizon, fraction, rng),
        }
    }
}

/// Number of steps of a rollout: `fraction` times `full_horizon`, ± 25 %. Rollouts that start together end at
/// different times, so each batch contains states of all ages.
fn sample_horizon(full_horizon: usize, fraction: f64, rng: &mut ChaCha8Rng) -> usize {
    let mean = 1 + (fraction * (full_horizon.max(1) - 1) as f64) as usize;
    rng.random_range(mean - mean / 4..=mean + mean / 4)
}

/// Length of a rollout state in a checkpoint: group, encoding, remaining steps, positions, velocities.
const ROW_LEN: usize = 3 + 2 * DOF;

/// Serialises rollout states for a checkpoint, [`ROW_LEN`] numbers each.
pub(crate) fn encode_states(batches: &[Vec<RolloutState>]) -> Vec<f32> {
    let row = |rollout: &RolloutState| {
        let indices =
            [rollout.group, rollout.encoding, rollout.steps_left].map(|index| index as f32);
        let state = [rollout.state.q, rollout.state.qd];
        let state = state
            .into_iter()
            .flat_map(|joints| joints.iter().map(|x| *x as f32).collect::<Vec<_>>());
        indices.into_iter().chain(state).collect::<Vec<_>>()
    };
    batches.iter().flatten().flat_map(row).collect()
}

/// Inverse of [`encode_states`]: restores batches of `batch` rollout states.
pub(crate) fn decode_states(
    numbers: &[f32],
    batch: usize,
    groups: &[DemoGroup],
) -> Result<Vec<Vec<RolloutState>>> {
    let rollout = |row: &[f32; ROW_LEN]| {
        let [group, encoding, steps_left] = std::array::from_fn(|i| row[i] as usize);
        let steps_left = steps_left.max(1);
        let joints = |from: usize| JointVector::from_fn(|i, _| f64::from(row[from + i]));
        let state = JointState { q: joints(3), qd: joints(3 + DOF) };
        let is_valid = groups.get(group).is_some_and(|group| encoding < group.encodings.len());
        ensure!(is_valid, "the checkpoint belongs to other training data; delete it to restart");
        Ok(RolloutState { group, encoding, state, steps_left })
    };
    let (rows, rest) = numbers.as_chunks::<ROW_LEN>();
    ensure!(
        rest.is_empty() && !rows.is_empty(),
        "the checkpoint is truncated; delete it to restart"
    );
    let rollouts = rows.iter().map(rollout).collect::<Result<Vec<_>>>()?;
    Ok(rollouts.chunks(batch.max(1)).map(<[RolloutState]>::to_vec).collect())
}

/// Whether the state is within [`MAX_DRIFT`] of its demonstrations, where the expert's action is meaningful.
pub(crate) fn is_on_track(rollout: &RolloutState, groups: &[DemoGroup]) -> bool {
    let demonstrations = &groups[rollout.group].demonstrations;
    let (nearest, _) = demonstrations.nearest_row(&rollout.state.q);
    let distance = (rollout.state.q - demonstrations.state(nearest).q).norm();
    distance.is_finite() && distance < MAX_DRIFT
}

#[cfg(test)]
pub(crate) mod fixtures {
    use super::*;
    use crate::train::expert::DemoTrajectories;
    use policy::{Observation, PolicyConfig};
    use robot::DOF;

    pub(crate) fn tiny() -> DaggerConfig {
        DaggerConfig { num_buffers: 4, ..DaggerConfig::standard(PolicyConfig::tiny()) }
    }

    /// Pose `pose` at azimuth `turn`: one demonstration, from q = 0.1 pose, and two clouds.
    pub(crate) fn demo_group(pose: usize, turn: f32) -> DemoGroup {
        let rows: Vec<f32> = (0..3)
            .flat_map(|row| {
                let q = 0.1 * pose as f32 + 0.02 * row as f32;
                (0..2 * DOF).map(move |i| if i < DOF { q } else { 0.0 })
            })
            .collect();
        let cloud = |offset: f64| Observation {
            azimuth: f64::from(turn) + offset,
            latent: vec![pose as f32 + offset as f32; policy::LATENT_DIM],
        };
        DemoGroup {
            object: "box".into(),
            pose,
            demonstrations: DemoTrajectories::new(rows, vec![0, 3]).rotated(turn),
            encodings: vec![cloud(0.01), cloud(-0.02)],
            has_starts: turn == 0.0,
            neighbor_starts: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fixtures::{demo_group, tiny};
    use super::*;
    use crate::data::demo_group::{collect_starts, link_neighbor_starts};
    use rand::SeedableRng;
    use robot::KinematicTree;

    #[test]
    fn sampled_start_comes_from_another_pose_at_the_observed_azimuth() {
        let mut groups: Vec<DemoGroup> =
            (0..6).map(|k| demo_group(k / 2, [0.0, 0.7][k % 2])).collect();
        let starts = collect_starts(&groups);
        link_neighbor_starts(&mut groups, &starts);
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let sampler = StateSampler::new(&groups, &limits);
        let config = DaggerConfig { start_fraction: 1.0, ..tiny() };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..40 {
            let rollout = sampler.sample(&config, 1.0, &mut rng);
            let own = &groups[rollout.group];
            let q = rollout.state.q;
            let is_start_of = |pose: usize| (q[1] - 0.1 * pose as f64).abs() < 1e-6;
            let pose = (0..3).find(|pose| is_start_of(*pose)).unwrap();
            assert_ne!(pose, own.pose);
            // The first cloud of the other group was captured at azimuth 0.01.
            let expected = q[1] - 0.01 + own.encodings[rollout.encoding].azimuth;
            assert!((q[0] - expected).abs() < 1e-6, "got {}, expected {expected}", q[0]);
            assert_eq!(rollout.state.qd.norm(), 0.0);
        }
    }

    #[test]
    fn rollout_states_round_trip_in_single_precision() {
        let groups = [demo_group(3, 0.0), demo_group(1, 0.7)];
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let config = DaggerConfig { batch: 5, num_buffers: 3, ..tiny() };
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let batches = StateSampler::new(&groups, &limits).staggered_batches(&config, &mut rng);
        let written = encode_states(&batches);
        let found = decode_states(&written, 5, &groups).unwrap();
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [5; 3]);
        for (before, after) in batches.iter().flatten().zip(found.iter().flatten()) {
            let of = |rollout: &RolloutState| (rollout.group, rollout.encoding, rollout.steps_left);
            assert_eq!(of(before), of(after));
            let error =
                (before.state.q - after.state.q).amax() + (before.state.qd - after.state.qd).amax();
            assert!(error < 1e-6, "{error}");
        }
        // Serialisation is idempotent: a resumed run continues from the same states as the original run.
        assert_eq!(encode_states(&found), written);
        assert!(decode_states(&written[1..], 5, &groups).is_err(), "truncated");
        assert!(decode_states(&written, 5, &groups[..1]).is_err(), "other training data");
    }

    #[test]
    fn rollouts_that_start_together_end_at_different_steps() {
        let groups = [demo_group(3, 0.0)];
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let sampler = StateSampler::new(&groups, &limits);
        let config = DaggerConfig { horizon: 40, start_fraction: 0.0, ..tiny() };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let lengths: Vec<usize> =
            (0..400).map(|_| sampler.sample(&config, 1.0, &mut rng).steps_left).collect();
        assert!(lengths.iter().all(|length| (30..=50).contains(length)));
        let mean = lengths.iter().sum::<usize>() as f64 / 400.0;
        assert!((mean - 40.0).abs() < 1.0, "{mean}");
    }

    #[test]
    fn initial_rollouts_have_uniform_remaining_steps() {
        let groups = [demo_group(3, 0.0)];
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let config = DaggerConfig {
            num_buffers: 64,
            horizon: 40,
            horizon_ramp: [0.0; 2],
            start_fraction: 0.0,
            ..tiny()
        };
        let batches = StateSampler::new(&groups, &limits)
            .staggered_batches(&config, &mut ChaCha8Rng::seed_from_u64(5));
        assert_eq!(batches.len(), 64);
        let count = |batch: &Vec<RolloutState>, steps: std::ops::Range<usize>| {
            batch.iter().filter(|rollout| steps.contains(&rollout.steps_left)).count()
        };
        for batch in &batches {
            assert_eq!(batch.len(), count(batch, 1..51));
            let early = count(batch, 1..21);
            assert!(2 * early > batch.len() * 7 / 10 && early < batch.len() * 7 / 10, "{early}");
        }
    }

    #[test]
    fn sampled_states_stay_within_the_noise_bounds() {
        let groups = [demo_group(3, 0.0)];
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let sampler = StateSampler::new(&groups, &limits);
        let config = tiny();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..40 {
            let rollout = sampler.sample(&config, 0.0, &mut rng);
            let (nearest, _) = groups[0].demonstrations.nearest_row(&rollout.state.q);
            let offset = rollout.state.q - groups[0].demonstrations.state(nearest).q;
            assert!(offset.amax() <= 0.12 + 0.04 && rollout.state.qd.amax() <= 0.3);
            assert_eq!(rollout.steps_left, 1, "the initial horizon is one step");
            // States are clamped to the joint limits, as in attempts; the thumb's first joint starts at its
            // limit.
            assert!(limits.contains(&rollout.state.q, 0.0), "{}", rollout.state.q);
        }
    }
}
