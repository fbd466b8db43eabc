//! Start network: predicts the start configuration of an attempt from z and the palm pose (future work in
//! paper §III-F).
//!
//! It is trained on the results of the start lookup, so that the browser does not need the lookup table.

use crate::data::split::is_held_out;
use crate::models::encoder::TrainedEncoder;
use crate::nn::{Params, mlp};
use crate::train::callback::TrainingCallback;
use crate::train::data_parallel::Gradient;
use crate::train::loss::joint_and_fingertip_error;
use crate::train::supervised::{self, SupervisedTrainer};
use anyhow::{Result, bail};
use candle_core::{Device, Tensor};
use configs::StartConfig;
use dataset::Dataset;
use dataset::planar_pose::rotate_pose;
use evaluation::percentiles::median;
use grasps::RobotContext;
use grasps::plan::demonstration;
use objects::object::Object;
use policy::start_model::{
    ACTIVATION, HIDDEN_WIDTHS, StartConfiguration, TENSOR_PREFIX, inputs, joint_ranges,
    layer_widths, nearest_start,
};
use policy::{ObservationKind, StartModel};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{DOF, Isometry, JointVector, KinematicTree};
use std::path::Path;

/// A training example: the inputs of an attempt, and the start configuration that the lookup returns.
#[derive(Clone, Debug)]
pub struct StartExample {
    /// Observation of the object, without surface points.
    pub z: Vec<f32>,
    /// Target pose of the palm (canonical frame).
    pub palm: Isometry,
    /// Start configuration from the lookup (rad, canonical frame).
    pub label: JointVector,
}

/// Palm targets sampled per object pose and azimuth.
const TARGETS_PER_POSE: usize = 2;

/// Examples per backward pass.
const MICRO_BATCH: usize = 64;

/// Examples for attempts with the objects of a dataset, labelled by the lookup in `table`: training set and
/// held-out set. `object_named` returns an object by name; objects for which it returns `None` are skipped.
pub fn examples(
    dataset: &Dataset,
    encoder: &TrainedEncoder,
    observation: ObservationKind,
    table: &[StartConfiguration],
    robot: &RobotContext,
    object_named: impl Fn(&str) -> Option<Object>,
) -> Result<[Vec<StartExample>; 2]> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (mut train, mut held_out) = (Vec::new(), Vec::new());
    for (number, name) in dataset.config.objects.iter().enumerate() {
        let Some(object) = object_named(name) else { continue };
        for (index, record) in dataset.read_poses(number)?.into_iter().enumerate() {
            let at_each = record.clouds.len() / record.azimuths.len().max(1);
            let clouds: Vec<Vec<f32>> =
                record.clouds.iter().step_by(at_each.max(1)).cloned().collect();
            let encodings = encoder.observe(observation, &clouds)?;
            for (turn, encoding) in record.azimuths.iter().zip(encodings) {
                let [x, y, yaw] = rotate_pose(record.pose, *turn);
                let pose = robot.config.object_pose(x, y, yaw);
                let palm = robot.tree.forward_kinematics(&robot.nominal_facing(&pose)).palm_pose();
                for _ in 0..TARGETS_PER_POSE {
                    let bounds = &object.bounds;
                    let target =
                        demonstration::sample_pregrasp_pose(robot, bounds, &pose, &palm, &mut rng);
                    let palm = encoding.pose_to_canonical(&target);
                    let Some(start) = nearest_start(table, &encoding.latent, &palm) else {
                        continue;
                    };
                    let z = encoding.features().to_vec();
                    let example = StartExample { z, palm, label: start.q };
                    let examples = if is_held_out(index) { &mut held_out } else { &mut train };
                    examples.push(example);
                }
            }
        }
    }
    Ok([train, held_out])
}

/// Trains a start network; resumes from a checkpoint in `out`. Returns `None` if the callback stops the
/// training.
pub fn train(
    examples: &[StartExample],
    tree: &KinematicTree,
    config: &StartConfig,
    out: &Path,
    watcher: &mut dyn TrainingCallback,
) -> Result<Option<Params>> {
    let Some(first) = examples.first() else {
        bail!(
            "no training examples: the dataset and the model have no start configuration in common"
        )
    };
    let mut params = Params::default();
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    params.add_mlp(TENSOR_PREFIX, &layer_widths(first.z.len()), 1.0, &mut rng)?;
    let trainer = SupervisedTrainer {
        steps: config.steps,
        batch: config.batch,
        micro_batch: MICRO_BATCH,
        threads: config.threads,
        learning_rate: config.learning_rate,
        checkpoint_every: config.checkpoint_every,
        seed: config.seed,
        checkpoint: &out.join("start.checkpoint.safetensors"),
        settings: supervised::checkpoint_settings(config, "examples", hash_examples(examples))?,
    };
    let gradient = |batch: &[&StartExample]| {
        let params = params.with_accumulators();
        Gradient::compute(&loss(&params, tree, batch, config.fingertip_weight)?, &params)
    };
    Ok(trainer.run(&params, examples, gradient, watcher)?.then_some(params))
}

/// Joint and fingertip error (rad) of the predicted start configurations.
fn loss(
    params: &Params,
    tree: &KinematicTree,
    examples: &[&StartExample],
    fingertip_weight: f64,
) -> Result<Tensor> {
    let x: Vec<f32> =
        examples.iter().flat_map(|example| inputs(&example.z, &example.palm)).collect();
    let x = Tensor::from_vec(x.clone(), (examples.len(), x.len() / examples.len()), &Device::Cpu)?;
    let predicted = mlp(&x, params, TENSOR_PREFIX, HIDDEN_WIDTHS.len() + 1, ACTIVATION)?;
    let row = |q: JointVector| -> Result<Tensor> {
        let values: Vec<f32> = q.iter().map(|x| *x as f32).collect();
        Ok(Tensor::from_vec(values, (1, DOF), &Device::Cpu)?)
    };
    let [center, half] = joint_ranges(&tree.limits);
    let predicted = predicted.broadcast_mul(&row(half)?)?.broadcast_add(&row(center)?)?;
    let target: Vec<JointVector> = examples.iter().map(|example| example.label).collect();
    joint_and_fingertip_error(tree, &target, &predicted, &target, fingertip_weight)
}

/// Hash of all examples.
fn hash_examples(examples: &[StartExample]) -> String {
    let mut hasher = blake3::Hasher::new();
    for example in examples {
        for x in inputs(&example.z, &example.palm) {
            hasher.update(&x.to_le_bytes());
        }
        for q in &example.label {
            hasher.update(&q.to_le_bytes());
        }
    }
    hasher.finalize().to_hex().to_string()
}

/// Median error of a start network against the lookup: joints (rad, norm) and palm position (m).
pub fn median_errors(
    starts: &StartModel,
    tree: &KinematicTree,
    examples: &[StartExample],
) -> [f64; 2] {
    let error = |example: &StartExample| {
        let observation = policy::Observation { azimuth: 0.0, latent: example.z.clone() };
        let predicted = starts.find(&observation, &example.palm).unwrap_or_default();
        let palm = |q| tree.forward_kinematics(q).palm_pose().translation.vector;
        [(predicted - example.label).norm(), (palm(&predicted) - palm(&example.label)).norm()]
    };
    let mut all: [Vec<f64>; 2] = Default::default();
    for example in examples {
        for (all, error) in all.iter_mut().zip(error(example)) {
            all.push(error);
        }
    }
    all.map(|all| median(all).unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::callback::TrainingStatus;

    /// Object positions on a line; the start configurations vary linearly with the position.
    fn example(k: usize) -> StartExample {
        let fraction = (k % 61) as f64 / 60.0;
        let palm = Isometry::translation(0.5 + 0.2 * fraction, 0.1, 0.3);
        let answer = JointVector::from_fn(|i, _| 0.3 + 0.14 * fraction * libm::cos(i as f64).abs());
        StartExample { z: vec![fraction as f32, 1.0], palm, label: answer }
    }

    #[test]
    fn start_network_reproduces_the_lookup() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let examples: Vec<StartExample> = (0..61).map(example).collect();
        let folder = tempfile::tempdir().unwrap();
        let config = StartConfig { steps: 300, batch: 32, ..StartConfig::standard() };
        let trained = |steps| {
            let config = StartConfig { steps, ..config.clone() };
            let out = folder.path().join(steps.to_string());
            let params = train(&examples, &tree, &config, &out, &mut |_: &TrainingStatus| Ok(true));
            let bytes = params.unwrap().unwrap().export(&[]).unwrap();
            median_errors(&StartModel::load(&bytes, 2, &tree).unwrap(), &tree, &examples)
        };
        let [joints, palm] = trained(300);
        assert!(joints < 0.05 && palm < 0.02, "{joints} rad, {palm} m");
        assert!(trained(0)[0] > 5.0 * joints, "error before training");
        let none = train(&[], &tree, &config, folder.path(), &mut |_: &TrainingStatus| Ok(true));
        assert!(none.err().unwrap().to_string().contains("no training examples"));
    }
}
