//! DAgger with the surrogate expert: the policy visits states, the expert says what to do there
//! (Eq. 2, paper §II-B).

use crate::expert::{self, Gains};
use crate::lesson::Lesson;
use crate::loss::joint_and_tip_error;
use crate::nn::Params;
use crate::nn::adam::{AdamW, schedule};
use crate::nn::network::{self, Network, Response};
use crate::nn::ngf::Active;
use crate::step::{self, Batch, Loss, Outcome};
use crate::visits::{self, Sampler, Visit, is_near};
use crate::watcher::{Progress, Reporter, Watcher};
use anyhow::{Result, bail};
use policy::PolicyConfig;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{JointState, JointVector, Tree, integrator};
use scene::config::CONTROL_PERIOD;
use std::ops::Range;
use std::path::Path;

/// How the policy is trained; the paper gives the scheme, the figures are ours.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct DaggerConfig {
    /// Optimiser steps.
    pub steps: u64,
    /// Of a fabric that is begun anew, share of the steps, the first ones, that train F_ψ alone, with a third of the products:
    /// where to go is most of what there is to learn. The other networks are as they begin meanwhile.
    pub potential_share: f64,
    /// States a step.
    pub batch: usize,
    /// Batches of states under way: each step takes the next one of them. With few, the states of a step would be
    /// those of some steps before, 33 ms later, and the weights would follow the few lessons that are under way.
    pub rounds: usize,
    /// Threads.
    pub threads: usize,
    /// Peak learning rate.
    pub rate: f32,
    /// Steps over which the rate rises to its peak, a tenth of all at most.
    pub warmup: u64,
    /// Decoupled weight decay, in units of the rate.
    pub decay: f32,
    /// Norm to which the gradient is cut. It is always longer (100 to 5,000): each step counts alike, however far off the
    /// states of its batch are.
    pub clip: f32,
    /// Steps that a state is rolled out by the policy before it is drawn anew (H), a quarter more or less. One: behaviour
    /// cloning of noisy states.
    pub horizon: usize,
    /// Shares of the steps at which roll-outs begin to grow, from one step, and have their full length:
    /// those of a policy that knows nothing lead where nothing can be learned.
    pub growth: [f64; 2],
    /// Uniform noise on a drawn state: position of arm and hand (rad), velocity (rad/s).
    pub noise: [f64; 3],
    /// Weight (rad/m) of what the fingertips do in the loss.
    pub tip_weight: f64,
    /// Weight of the mean square of what the networks of the metrics give: the entries of U.
    ///
    /// *Departure: Eq. 2 alone leaves the unit of mass open: metrics, potential and damping can grow
    /// together without changing an acceleration. They did, a millionfold in 6,000 steps, and what was
    /// learned drowned in it.*
    pub metric_weight: f64,
    /// Share of the drawn states, once roll-outs have their full length, that are what an attempt begins with: a start of
    /// one of the nearest other object poses, at rest (paper §III-F).
    pub start_share: f64,
    /// The expert.
    pub gains: Gains,
    /// Distance (rad, weighted) that the expert looks ahead at least: times k_p / k_d, its least speed.
    pub lead: f64,
    /// Steps from checkpoint to checkpoint. States under way go on from what is written there, so that a run that is resumed
    /// takes the same steps as one that was never stopped.
    pub span: u64,
    /// What is trained.
    pub policy: PolicyConfig,
    /// Seed of weights, states and noise.
    pub seed: u64,
}

impl DaggerConfig {
    /// Full size.
    pub fn standard(policy: PolicyConfig) -> Self {
        Self {
            steps: 72_000,
            potential_share: 0.95,
            batch: 128,
            rounds: 64,
            threads: 2,
            rate: 5e-4,
            warmup: 500,
            decay: 1e-4,
            clip: 10.0,
            horizon: 90,
            growth: [0.3, 0.6],
            noise: [0.12, 0.1, 0.3],
            tip_weight: 3.0,
            metric_weight: 10.0,
            start_share: 0.25,
            gains: Gains { position: 225.0, velocity: 30.0 },
            lead: 0.2,
            span: 5000,
            policy,
            seed: 0,
        }
    }

    /// As long as a dataset's preset is worth ([`dataset::config::PRESETS`]).
    pub fn preset(name: &str, policy: PolicyConfig) -> Option<Self> {
        let standard = Self::standard(policy);
        Some(match name {
            "smoke" => Self { steps: 200, batch: 32, ..standard },
            "small" => Self { steps: 12_000, ..standard },
            "variants" | "families" => Self { steps: 160_000, ..standard },
            "paper" => standard,
            _ => return None,
        })
    }

    /// Learning rate of a step.
    fn rate_at(&self, step: u64) -> f32 {
        schedule(step, self.warmup.min(self.steps / 10), self.steps, self.rate)
    }

    /// Draws states after `step` steps, of which a checkpoint is kept.
    fn generator(&self, step: u64) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(self.seed ^ (step + 1) << 20)
    }

    /// Steps of a roll-out that begins where an attempt does: a third more.
    pub(crate) fn start_horizon(&self) -> usize {
        self.horizon + self.horizon / 3
    }

    /// The share of their full length that roll-outs have after `step` steps.
    pub(crate) fn grown(&self, step: u64) -> f64 {
        let [begin, end] = self.growth.map(|share| share * self.steps as f64);
        if step as f64 >= end {
            1.0
        } else {
            ((step as f64 - begin) / (end - begin)).clamp(0.0, 1.0)
        }
    }
}

/// Trains a policy, a fresh one or that of the weights `begin`; continues from a checkpoint in `out`. A watcher may stop it:
/// then there is none.
pub fn train(
    lessons: &[Lesson],
    tree: &Tree,
    config: &DaggerConfig,
    begin: Option<&[u8]>,
    out: &Path,
    watcher: &mut dyn Watcher,
) -> Result<Option<Params>> {
    if !lessons.iter().any(Lesson::is_full) {
        bail!("there are no demonstrations to learn from");
    }
    let sampler = Sampler::new(lessons, &tree.limits);
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut params = Params::default();
    network::init(&mut params, &config.policy, &mut rng)?;
    if let Some(weights) = begin {
        params.restore(weights)?;
    }
    let student =
        Student { tree, network: Network::new(&config.policy, &tree.limits)?, lessons, config };
    let mut adam = AdamW::new(&params, config.decay);
    let checkpoint = out.join("policy.checkpoint.safetensors");
    let settings = settings(config, lessons, begin)?;
    let load = crate::checkpoint::load;
    let mut under_way =
        load(&checkpoint, &params, &mut adam, &settings, &mut |text| watcher.warn(text))?;
    if under_way.is_empty() {
        under_way = visits::write(&sampler.rounds(config, &mut rng));
    }
    let mut rounds = visits::read(&under_way, config.batch, lessons)?;
    let mut rng = config.generator(adam.steps);
    if adam.steps > 0 {
        watcher.resumed(adam.steps, config.steps, &params)?;
    }
    let mut reporter = Reporter::new(config.span);
    while adam.steps < config.steps {
        let turn = (adam.steps % rounds.len() as u64) as usize;
        let visits: &mut [Visit] = &mut rounds[turn];
        let is_early = (adam.steps as f64) < config.potential_share * config.steps as f64;
        let active = if is_early { Active::Potential } else { Active::All };
        let outcome = student.differentiate(&params, active, visits)?;
        let rate = config.rate_at(adam.steps);
        let norm = adam.step(&params, &outcome.gradients, rate, config.clip, config.threads)?;
        if !norm.is_finite() {
            bail!("the loss is {} at step {}: lower the rate", outcome.loss, adam.steps);
        }
        for (visit, qdd) in visits.iter_mut().zip(&outcome.accelerations) {
            visit.state = tree.limits.stop(&integrator::step(&visit.state, qdd, CONTROL_PERIOD));
            visit.left -= 1;
            if visit.left == 0 || !is_near(visit, lessons) {
                *visit = sampler.draw(config, config.grown(adam.steps), &mut rng);
            }
        }
        let (step, steps, loss) = (adam.steps, config.steps, outcome.loss);
        if step.is_multiple_of(config.span) || step == steps {
            let under_way = visits::write(&rounds);
            crate::checkpoint::save(&checkpoint, &params, &adam, &under_way, &settings)?;
            // Whoever is resumed goes on from what is written there, and so does this run.
            rounds = visits::read(&under_way, config.batch, lessons)?;
            rng = config.generator(step);
        }
        let now = Progress { step, steps, loss, gradient: norm, params: &params };
        if !reporter.note(watcher, now)? {
            return Ok(None);
        }
    }
    Ok(Some(params))
}

/// What a checkpoint must have been made with: the configuration, the lessons, and with what was begun.
fn settings(
    config: &DaggerConfig,
    lessons: &[Lesson],
    begin: Option<&[u8]>,
) -> Result<serde_json::Value> {
    let mut settings = serde_json::to_value(config)?;
    let mut hasher = blake3::Hasher::new();
    lessons.iter().for_each(|lesson| lesson.digest(&mut hasher));
    settings["lessons"] = hasher.finalize().to_hex().as_str().into();
    settings["begin"] = begin.map(|weights| blake3::hash(weights).to_hex().to_string()).into();
    Ok(settings)
}

/// Who learns, from what and how.
struct Student<'a> {
    tree: &'a Tree,
    network: Network,
    lessons: &'a [Lesson],
    config: &'a DaggerConfig,
}

impl Student<'_> {
    /// Eq. 2: how far the policy is from the expert in the states of a batch, with the gradient.
    fn differentiate(&self, params: &Params, active: Active, visits: &[Visit]) -> Result<Outcome> {
        let Self { tree, network, lessons, config } = self;
        let told = |visit: &Visit| &lessons[visit.lesson].encodings[visit.encoding];
        let states: Vec<JointState> =
            visits.iter().map(|visit| told(visit).state_in_front(&visit.state)).collect();
        let objects: Vec<&[f32]> = visits.iter().map(|visit| told(visit).z.as_slice()).collect();
        let batch = Batch { states: &states, objects: &objects };
        let lag = config.gains.lag_rows(CONTROL_PERIOD).max(1);
        let loss = |rows: Range<usize>, response: &Response| {
            let visits = &visits[rows];
            let advice = |visit: &Visit| {
                let target =
                    lessons[visit.lesson].demonstrations.target(&visit.state, lag, config.lead);
                expert::acceleration(&config.gains, &target, &visit.state)
            };
            let wanted: Vec<JointVector> = visits.iter().map(advice).collect();
            let at: Vec<JointVector> = visits.iter().map(|visit| visit.state.q).collect();
            let (made, weight) = (&response.accelerations, config.tip_weight);
            let shown = joint_and_tip_error(tree, &at, made, &wanted, weight)?;
            Loss::with_metrics(shown, response, config.metric_weight)
        };
        step::differentiate(network, params, &batch, active, config.threads, &loss)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visits::samples::{lesson, tiny};
    use std::collections::BTreeSet;

    #[test]
    fn a_checkpoint_belongs_to_its_lessons_and_to_what_was_begun_with() {
        type Change = dyn Fn(&mut Vec<Lesson>);
        let of = |change: &Change, begin: Option<&[u8]>| {
            let mut lessons = vec![lesson(0, 0.0), lesson(1, 0.7)];
            change(&mut lessons);
            settings(&tiny(), &lessons, begin).unwrap()
        };
        let own = of(&|_| (), None);
        assert_eq!(own, of(&|_| (), None));
        let others: [&Change; 4] = [
            // Another encoder, another dataset, fewer poses, other neighbours.
            &|lessons| lessons[1].encodings[1].z[3] += 0.1,
            &|lessons| lessons[0].demonstrations = lesson(2, 0.0).demonstrations,
            &|lessons| lessons.truncate(1),
            &|lessons| lessons[0].near.push(JointVector::zeros()),
        ];
        for change in others {
            let other = of(change, None);
            assert_ne!(own["lessons"], other["lessons"]);
        }
        assert_ne!(own["begin"], of(&|_| (), Some(b"weights"))["begin"]);
    }

    #[test]
    fn whoever_goes_on_is_told_from_where() {
        #[derive(Default)]
        struct Notes(Vec<String>);
        impl Watcher for Notes {
            fn progress(&mut self, now: &Progress) -> Result<bool> {
                self.0.push(format!("{} of {}", now.step, now.steps));
                Ok(now.step != 4)
            }
            fn resumed(&mut self, step: u64, steps: u64, _: &Params) -> Result<()> {
                self.0.push(format!("from {step} of {steps}"));
                Ok(())
            }
        }
        let tree = Tree::iiwa7_allegro().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let config = DaggerConfig { steps: 6, batch: 4, span: 2, ..tiny() };
        let mut notes = Notes::default();
        for is_over in [false, true, true] {
            let lessons = [lesson(0, 0.0), lesson(1, 0.7)];
            let trained = train(&lessons, &tree, &config, None, folder.path(), &mut notes);
            assert_eq!(trained.unwrap().is_some(), is_over);
        }
        assert_eq!(notes.0, ["2 of 6", "4 of 6", "from 4 of 6", "6 of 6", "from 6 of 6"]);
    }

    #[test]
    fn what_is_not_active_is_not_trained() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let trained = |potential_share| {
            let folder = tempfile::tempdir().unwrap();
            let lessons = [lesson(0, 0.0), lesson(1, 0.7)];
            let config = DaggerConfig { steps: 6, batch: 4, potential_share, ..tiny() };
            let mut look_on = |_: &Progress| Ok(true);
            let trained = train(&lessons, &tree, &config, None, folder.path(), &mut look_on);
            trained.unwrap().unwrap()
        };
        let mut fresh = Params::default();
        network::init(&mut fresh, &tiny().policy, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
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
    fn a_lesson_that_is_turned_teaches_the_same() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let config = tiny();
        let mut params = Params::default();
        network::init(&mut params, &config.policy, &mut ChaCha8Rng::seed_from_u64(5)).unwrap();
        let loss_at = |turn: f32| {
            let lessons = [lesson(2, turn)];
            let mut state = lessons[0].demonstrations.state(1);
            state.q[3] += 0.05;
            let visit = Visit { lesson: 0, encoding: 1, state, left: 1 };
            let network = Network::new(&config.policy, &tree.limits).unwrap();
            let student = Student { tree: &tree, network, lessons: &lessons, config: &config };
            student.differentiate(&params, Active::All, &[visit]).unwrap().loss
        };
        let (front, turned) = (loss_at(0.0), loss_at(0.7));
        assert!(front > 1.0 && (front - turned).abs() < 1e-3 * front, "{front}, {turned}");
    }
}
