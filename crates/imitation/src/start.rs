//! The start network: z and the wanted palm -> where an attempt begins (paper §III-F leaves it for future work).
//!
//! It learns what the look-up of a model answers to what attempts ask, and a page then needs no table.

use crate::encoder::TrainedEncoder;
use crate::fit::{self, Fit};
use crate::loss::joint_and_tip_error;
use crate::nn::{Params, mlp};
use crate::shards::Gradient;
use crate::split::is_held_out;
use crate::spread::median;
use crate::watcher::Watcher;
use anyhow::{Result, bail};
use candle_core::{Device, Tensor};
use dataset::Dataset;
use dataset::poses::turned;
use geometry::object::Object;
use grasps::{Robot, demonstration};
use policy::start::{ACTIVATION, HIDDEN, NAME, Start, inputs, look_up, ranges, widths};
use policy::{Observation, Starts};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{DOF, Isometry, JointVector, Tree};
use std::path::Path;

/// How the start network is trained.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct StartConfig {
    /// Optimiser steps.
    pub steps: u64,
    /// Queries a step.
    pub batch: usize,
    /// Threads.
    pub threads: usize,
    /// Peak learning rate.
    pub rate: f32,
    /// Weight (rad/m) of the fingertips in the loss.
    pub tip_weight: f64,
    /// Steps from checkpoint to checkpoint.
    pub span: u64,
    /// Seed of weights and batches.
    pub seed: u64,
}

impl StartConfig {
    /// A few minutes on two cores.
    pub fn standard() -> Self {
        Self {
            steps: 20_000,
            batch: 128,
            threads: 2,
            rate: 1e-3,
            tip_weight: 3.0,
            span: 1000,
            seed: 0,
        }
    }
}

/// What an attempt asks, and what the look-up answers.
#[derive(Clone, Debug)]
pub struct Query {
    /// What is told of the object.
    pub z: Vec<f32>,
    /// The wanted palm, with the object in front.
    pub palm: Isometry,
    /// The start (rad, with the object in front).
    pub answer: JointVector,
}

/// Targets that are drawn of each object pose at each bearing.
const TARGETS: usize = 2;

/// Queries that are differentiated at once.
const PIECE: usize = 64;

/// What attempts with the objects of a dataset ask, and what `table` answers: of the poses that are taught, and of those
/// that are held out. `object_named` knows the objects; poses of those that it does not know are left out.
pub fn queries(
    dataset: &Dataset,
    encoder: &TrainedEncoder,
    observation: Observation,
    table: &[Start],
    robot: &Robot,
    object_named: impl Fn(&str) -> Option<Object>,
) -> Result<[Vec<Query>; 2]> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (mut taught, mut held_out) = (Vec::new(), Vec::new());
    for (number, name) in dataset.config.objects.iter().enumerate() {
        let Some(object) = object_named(name) else { continue };
        for (index, record) in dataset.poses(number)?.into_iter().enumerate() {
            let at_each = record.clouds.len() / record.turns.len().max(1);
            let seen: Vec<Vec<f32>> =
                record.clouds.iter().step_by(at_each.max(1)).cloned().collect();
            let encodings = encoder.observe(observation, &seen)?;
            for (turn, seen) in record.turns.iter().zip(encodings) {
                let [x, y, yaw] = turned(record.pose, *turn);
                let place = robot.config.upright(x, y, yaw);
                let palm = robot.tree.kinematics(&robot.nominal_towards(&place)).palm();
                for _ in 0..TARGETS {
                    let (region, bounds) = (&robot.config.target, &object.bounds);
                    let target =
                        demonstration::draw_target(region, bounds, &place, &palm, &mut rng);
                    let palm = seen.pose_in_front(&target);
                    let Some(start) = look_up(table, &seen.z, &palm) else { continue };
                    let query = Query { z: seen.z.clone(), palm, answer: start.q };
                    let queries = if is_held_out(index) { &mut held_out } else { &mut taught };
                    queries.push(query);
                }
            }
        }
    }
    Ok([taught, held_out])
}

/// Trains a start network; continues from a checkpoint in `out`. A watcher may stop it: then there is none.
pub fn train(
    queries: &[Query],
    tree: &Tree,
    config: &StartConfig,
    out: &Path,
    watcher: &mut dyn Watcher,
) -> Result<Option<Params>> {
    let Some(first) = queries.first() else { bail!("there are no starts to learn from") };
    let mut params = Params::default();
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    params.add_mlp(NAME, &widths(first.z.len()), 1.0, &mut rng)?;
    let fit = Fit {
        steps: config.steps,
        batch: config.batch,
        piece: PIECE,
        threads: config.threads,
        rate: config.rate,
        span: config.span,
        seed: config.seed,
        checkpoint: &out.join("start.checkpoint.safetensors"),
        settings: fit::settings(config, "queries", digest(queries))?,
    };
    let gradient = |part: &[&Query]| {
        let params = params.of_shard();
        Gradient::of(&loss(&params, tree, part, config.tip_weight)?, &params)
    };
    Ok(fit.run(&params, queries, gradient, watcher)?.then_some(params))
}

/// How far what the network says is from what the look-up answers, in the joints and at the fingertips (rad).
fn loss(params: &Params, tree: &Tree, queries: &[&Query], tip_weight: f64) -> Result<Tensor> {
    let x: Vec<f32> = queries.iter().flat_map(|query| inputs(&query.z, &query.palm)).collect();
    let x = Tensor::from_vec(x.clone(), (queries.len(), x.len() / queries.len()), &Device::Cpu)?;
    let made = mlp(&x, params, NAME, HIDDEN.len() + 1, ACTIVATION)?;
    let row = |q: JointVector| -> Result<Tensor> {
        let values: Vec<f32> = q.iter().map(|x| *x as f32).collect();
        Ok(Tensor::from_vec(values, (1, DOF), &Device::Cpu)?)
    };
    let [middle, half] = ranges(&tree.limits);
    let made = made.broadcast_mul(&row(half)?)?.broadcast_add(&row(middle)?)?;
    let wanted: Vec<JointVector> = queries.iter().map(|query| query.answer).collect();
    joint_and_tip_error(tree, &wanted, &made, &wanted, tip_weight)
}

/// Which queries these are.
fn digest(queries: &[Query]) -> String {
    let mut hasher = blake3::Hasher::new();
    for query in queries {
        for x in inputs(&query.z, &query.palm) {
            hasher.update(&x.to_le_bytes());
        }
        for q in &query.answer {
            hasher.update(&q.to_le_bytes());
        }
    }
    hasher.finalize().to_hex().to_string()
}

/// Median distance of a start network's answers from those of the look-up: joints (rad, norm), and place of the palm (m).
pub fn errors(starts: &Starts, tree: &Tree, queries: &[Query]) -> [f64; 2] {
    let off = |query: &Query| {
        let seen = policy::Encoding { bearing: 0.0, z: query.z.clone() };
        let found = starts.find(&seen, &query.palm).unwrap_or_default();
        let palm = |q| tree.kinematics(q).palm().translation.vector;
        [(found - query.answer).norm(), (palm(&found) - palm(&query.answer)).norm()]
    };
    let mut all: [Vec<f64>; 2] = Default::default();
    for query in queries {
        for (all, off) in all.iter_mut().zip(off(query)) {
            all.push(off);
        }
    }
    all.map(|all| median(all).unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watcher::Progress;

    /// Objects at places along a line, whose starts stand along another.
    fn query(k: usize) -> Query {
        let share = (k % 61) as f64 / 60.0;
        let palm = Isometry::translation(0.5 + 0.2 * share, 0.1, 0.3);
        let answer = JointVector::from_fn(|i, _| 0.3 + 0.14 * share * libm::cos(i as f64).abs());
        Query { z: vec![share as f32, 1.0], palm, answer }
    }

    #[test]
    fn it_learns_what_the_table_answers() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let queries: Vec<Query> = (0..61).map(query).collect();
        let folder = tempfile::tempdir().unwrap();
        let config = StartConfig { steps: 300, batch: 32, ..StartConfig::standard() };
        let trained = |steps| {
            let config = StartConfig { steps, ..config.clone() };
            let out = folder.path().join(steps.to_string());
            let params = train(&queries, &tree, &config, &out, &mut |_: &Progress| Ok(true));
            let bytes = params.unwrap().unwrap().export(&[]).unwrap();
            errors(&Starts::load(&bytes, 2, &tree).unwrap(), &tree, &queries)
        };
        let [joints, palm] = trained(300);
        assert!(joints < 0.05 && palm < 0.02, "{joints} rad, {palm} m");
        assert!(trained(0)[0] > 5.0 * joints, "it knew before");
        let none = train(&[], &tree, &config, folder.path(), &mut |_: &Progress| Ok(true));
        assert!(none.err().unwrap().to_string().contains("no starts"));
    }
}
