//! DAgger with the surrogate expert: rolls out the policy and labels the visited states with the expert's
//! action (Eq. 2, paper §II-B).

use crate::data::demo_group::DemoGroup;
use crate::data::rollout_buffer::{self, RolloutState, StateSampler, is_on_track};
use crate::nn::Params;
use crate::nn::adam::{AdamW, cosine_schedule};
use crate::nn::networks::ngf::TrainableSet;
use crate::nn::networks::{self, Network, NetworkOutput};
use crate::train::backward::{self, Batch, Loss, StepResult};
use crate::train::callback::{LossAverager, TrainingCallback, TrainingStatus};
use crate::train::expert;
use crate::train::loss::joint_and_fingertip_error;
use anyhow::{Result, bail};
use configs::DaggerConfig;
use policy::Observation;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::{JointState, JointVector, KinematicTree, integrator};
use scene::config::CONTROL_DT;
use std::ops::Range;
use std::path::Path;

/// Learning rate of a step.
fn learning_rate_at(config: &DaggerConfig, step: u64) -> f32 {
    cosine_schedule(step, config.warmup.min(config.steps / 10), config.steps, config.learning_rate)
}

/// Random generator for sampled states after the checkpoint at `step`.
fn rng_at(config: &DaggerConfig, step: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(config.seed ^ (step + 1) << 20)
}

/// Trains a policy from random weights or from `init_weights`; resumes from a checkpoint in `out`. Returns
/// `None` if the callback stops the training.
///
/// `groups` is the training set of [`crate::data::split::train_val_split`]. `init_weights`: the bytes of a
/// model's `weights.safetensors`.
pub fn train(
    groups: &[DemoGroup],
    tree: &KinematicTree,
    config: &DaggerConfig,
    init_weights: Option<&[u8]>,
    out: &Path,
    watcher: &mut dyn TrainingCallback,
) -> Result<Option<Params>> {
    if !groups.iter().any(DemoGroup::is_trainable) {
        bail!(
            "the dataset has no demonstrations for training; generate more poses or other objects"
        );
    }
    let sampler = StateSampler::new(groups, &tree.limits);
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut params = Params::default();
    networks::init(&mut params, &config.policy, &mut rng)?;
    if let Some(weights) = init_weights {
        params.restore(weights)?;
    }
    let learner =
        PolicyLearner { tree, network: Network::new(&config.policy, tree)?, groups, config };
    let mut adam = AdamW::new(&params, config.weight_decay);
    let checkpoint = out.join("policy.checkpoint.safetensors");
    let settings = checkpoint_settings(config, groups, init_weights)?;
    let load = crate::train::checkpoint::load;
    let mut buffers =
        load(&checkpoint, &params, &mut adam, &settings, &mut |text| watcher.on_warning(text))?;
    if buffers.is_empty() {
        buffers = rollout_buffer::encode_states(&sampler.staggered_batches(config, &mut rng));
    }
    let mut batches = rollout_buffer::decode_states(&buffers, config.batch, groups)?;
    let mut rng = rng_at(config, adam.steps);
    if adam.steps > 0 {
        watcher.on_resume(adam.steps, config.steps, &params)?;
    }
    let mut reporter = LossAverager::new(config.checkpoint_every);
    while adam.steps < config.steps {
        let index = (adam.steps % batches.len() as u64) as usize;
        let rollouts: &mut [RolloutState] = &mut batches[index];
        let is_early = (adam.steps as f64) < config.potential_only_fraction * config.steps as f64;
        let active = if is_early { TrainableSet::Potential } else { TrainableSet::All };
        let observations = learner.observations(rollouts, adam.steps);
        let result = learner.differentiate(&params, active, rollouts, &observations)?;
        let rate = learning_rate_at(config, adam.steps);
        let norm =
            adam.step(&params, &result.gradients, rate, config.grad_clip_norm, config.threads)?;
        if !norm.is_finite() {
            bail!("the loss is {} at step {}; reduce the learning rate", result.loss, adam.steps);
        }
        for (rollout, qdd) in rollouts.iter_mut().zip(&result.accelerations) {
            rollout.state =
                tree.limits.clamp_state(&integrator::step(&rollout.state, qdd, CONTROL_DT));
            rollout.steps_left -= 1;
            if rollout.steps_left == 0 || !is_on_track(rollout, groups) {
                *rollout = sampler.sample(config, config.horizon_fraction(adam.steps), &mut rng);
            }
        }
        let (step, steps, loss) = (adam.steps, config.steps, result.loss);
        if step.is_multiple_of(config.checkpoint_every) || step == steps {
            let buffers = rollout_buffer::encode_states(&batches);
            crate::train::checkpoint::save(&checkpoint, &params, &adam, &buffers, &settings)?;
            // Continue from the stored single-precision states, as a resumed run does.
            batches = rollout_buffer::decode_states(&buffers, config.batch, groups)?;
            rng = rng_at(config, step);
        }
        let now = TrainingStatus { step, steps, loss, gradient_norm: norm, params: &params };
        if !reporter.record(watcher, now)? {
            return Ok(None);
        }
    }
    Ok(Some(params))
}

/// Settings that a checkpoint must match: the configuration, the training data and the initial weights.
fn checkpoint_settings(
    config: &DaggerConfig,
    groups: &[DemoGroup],
    init_weights: Option<&[u8]>,
) -> Result<serde_json::Value> {
    let mut settings = serde_json::to_value(config)?;
    let mut hasher = blake3::Hasher::new();
    groups.iter().for_each(|group| group.hash_into(&mut hasher));
    settings["demo_groups"] = hasher.finalize().to_hex().as_str().into();
    settings["init_weights"] =
        init_weights.map(|weights| blake3::hash(weights).to_hex().to_string()).into();
    Ok(settings)
}

/// A policy network with its training data and hyperparameters.
struct PolicyLearner<'a> {
    tree: &'a KinematicTree,
    network: Network,
    groups: &'a [DemoGroup],
    config: &'a DaggerConfig,
}

impl PolicyLearner<'_> {
    /// Observation of the object for each state of a batch, with the noise of step `step`.
    fn observations(&self, rollouts: &[RolloutState], step: u64) -> Vec<Vec<f32>> {
        let bound = self.config.observation_noise as f32;
        let mut rng = ChaCha8Rng::seed_from_u64(self.config.seed);
        rng.set_stream(step + 1);
        let mut noisy = |x: f32| if bound > 0.0 { x + rng.random_range(-bound..=bound) } else { x };
        let observation = |rollout: &RolloutState| {
            self.encoding(rollout).latent.iter().map(|x| noisy(*x)).collect()
        };
        rollouts.iter().map(observation).collect()
    }

    /// Encoding of the object that a state belongs to.
    fn encoding(&self, rollout: &RolloutState) -> &Observation {
        &self.groups[rollout.group].encodings[rollout.encoding]
    }

    /// Eq. 2: imitation loss between policy and expert on a batch of states, with its gradient.
    fn differentiate(
        &self,
        params: &Params,
        active: TrainableSet,
        rollouts: &[RolloutState],
        observations: &[Vec<f32>],
    ) -> Result<StepResult> {
        let Self { tree, network, groups, config } = self;
        let states: Vec<JointState> = rollouts
            .iter()
            .map(|rollout| self.encoding(rollout).state_to_canonical(&rollout.state))
            .collect();
        let observations: Vec<&[f32]> = observations.iter().map(Vec::as_slice).collect();
        let batch = Batch { states: &states, observations: &observations };
        let lag = config.gains.lag_rows(CONTROL_DT).max(1);
        let loss = |rows: Range<usize>, response: &NetworkOutput| {
            let rollouts = &rollouts[rows];
            let expert_action = |rollout: &RolloutState| {
                let target = groups[rollout.group].demonstrations.target(
                    &rollout.state,
                    lag,
                    config.lookahead,
                );
                expert::acceleration(&config.gains, &target, &rollout.state)
            };
            let target: Vec<JointVector> = rollouts.iter().map(expert_action).collect();
            let q: Vec<JointVector> = rollouts.iter().map(|rollout| rollout.state.q).collect();
            let (predicted, weight) = (&response.accelerations, config.fingertip_weight);
            let reported = joint_and_fingertip_error(tree, &q, predicted, &target, weight)?;
            Loss::with_metric_penalty(reported, response, config.metric_weight)
        };
        backward::differentiate(network, params, &batch, active, config.threads, &loss)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::rollout_buffer::fixtures::{demo_group, tiny};
    use std::collections::BTreeSet;

    #[test]
    fn checkpoint_settings_depend_on_training_data_and_initial_weights() {
        type Change = dyn Fn(&mut Vec<DemoGroup>);
        let settings_with = |change: &Change, init_weights: Option<&[u8]>| {
            let mut groups = vec![demo_group(0, 0.0), demo_group(1, 0.7)];
            change(&mut groups);
            checkpoint_settings(&tiny(), &groups, init_weights).unwrap()
        };
        let own = settings_with(&|_| (), None);
        assert_eq!(own, settings_with(&|_| (), None));
        let others: [&Change; 4] = [
            // Another encoder, another dataset, fewer poses, other neighbour starts.
            &|groups| groups[1].encodings[1].latent[3] += 0.1,
            &|groups| groups[0].demonstrations = demo_group(2, 0.0).demonstrations,
            &|groups| groups.truncate(1),
            &|groups| groups[0].neighbor_starts.push(JointVector::zeros()),
        ];
        for change in others {
            let other = settings_with(change, None);
            assert_ne!(own["demo_groups"], other["demo_groups"]);
        }
        let resumed = settings_with(&|_| (), Some(b"weights"));
        assert_ne!(own["init_weights"], resumed["init_weights"]);
    }

    #[test]
    fn resume_reports_start_step() {
        #[derive(Default)]
        struct Events(Vec<String>);
        impl TrainingCallback for Events {
            fn on_progress(&mut self, now: &TrainingStatus) -> Result<bool> {
                self.0.push(format!("{} of {}", now.step, now.steps));
                Ok(now.step != 4)
            }
            fn on_resume(&mut self, step: u64, steps: u64, _: &Params) -> Result<()> {
                self.0.push(format!("from {step} of {steps}"));
                Ok(())
            }
        }
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let config = DaggerConfig { steps: 6, batch: 4, checkpoint_every: 2, ..tiny() };
        let mut events = Events::default();
        for is_over in [false, true, true] {
            let groups = [demo_group(0, 0.0), demo_group(1, 0.7)];
            let trained = train(&groups, &tree, &config, None, folder.path(), &mut events);
            assert_eq!(trained.unwrap().is_some(), is_over);
        }
        assert_eq!(events.0, ["2 of 6", "4 of 6", "from 4 of 6", "6 of 6", "from 6 of 6"]);
    }

    #[test]
    fn inactive_networks_are_not_trained() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let trained = |potential_only_fraction| {
            let folder = tempfile::tempdir().unwrap();
            let groups = [demo_group(0, 0.0), demo_group(1, 0.7)];
            let config = DaggerConfig { steps: 6, batch: 4, potential_only_fraction, ..tiny() };
            let mut callback = |_: &TrainingStatus| Ok(true);
            let trained = train(&groups, &tree, &config, None, folder.path(), &mut callback);
            trained.unwrap().unwrap()
        };
        let mut fresh = Params::default();
        networks::init(&mut fresh, &tiny().policy, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
        let changed = |params: &Params| -> BTreeSet<String> {
            let values = |params: &Params, name: &str| {
                params.tensor(name).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap()
            };
            let is_changed = |name: &&str| values(params, name) != values(&fresh, name);
            let names = params.names().filter(is_changed);
            names.map(|name| name.split('.').next().unwrap_or_default().to_owned()).collect()
        };
        assert_eq!(changed(&trained(1.0)), BTreeSet::from(["potential".to_owned()]));
        assert_eq!(changed(&trained(0.5)).len(), 5);
        assert_eq!(changed(&trained(0.0)).len(), 5);
    }

    #[test]
    fn observation_noise_depends_on_seed_and_step_only() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let groups = [demo_group(0, 0.0), demo_group(1, 0.7)];
        let state = groups[0].demonstrations.state(0);
        let rollouts =
            [0, 1].map(|group| RolloutState { group, encoding: 0, state, steps_left: 1 });
        let observations = |observation_noise, seed, step| {
            let config = DaggerConfig { observation_noise, seed, ..tiny() };
            let network = Network::new(&config.policy, &tree).unwrap();
            let learner = PolicyLearner { tree: &tree, network, groups: &groups, config: &config };
            learner.observations(&rollouts, step).concat()
        };
        let clean = observations(0.0, 0, 0);
        assert_eq!(
            clean,
            groups.each_ref().map(|group| group.encodings[0].latent.clone()).concat()
        );
        let noisy = observations(0.2, 0, 5);
        assert_eq!(noisy, observations(0.2, 0, 5));
        assert!(noisy != observations(0.2, 0, 6) && noisy != observations(0.2, 1, 5));
        let largest = clean.iter().zip(&noisy).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest > 0.15 && largest <= 0.2 + 1e-6, "{largest}");
    }

    #[test]
    fn loss_is_invariant_to_rotation_about_the_robot() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let config = tiny();
        let mut params = Params::default();
        networks::init(&mut params, &config.policy, &mut ChaCha8Rng::seed_from_u64(5)).unwrap();
        let loss_at = |turn: f32| {
            let groups = [demo_group(2, turn)];
            let mut state = groups[0].demonstrations.state(1);
            state.q[3] += 0.05;
            let rollout = RolloutState { group: 0, encoding: 1, state, steps_left: 1 };
            let network = Network::new(&config.policy, &tree).unwrap();
            let learner = PolicyLearner { tree: &tree, network, groups: &groups, config: &config };
            let observations = learner.observations(&[rollout], 0);
            let result =
                learner.differentiate(&params, TrainableSet::All, &[rollout], &observations);
            result.unwrap().loss
        };
        let (front, rotated) = (loss_at(0.0), loss_at(0.7));
        assert!(front > 1.0 && (front - rotated).abs() < 1e-3 * front, "{front}, {rotated}");
    }
}
