//! The gradient of a policy's loss over several threads.
//!
//! The networks of a fabric meet in its head alone. So each goes through the whole batch on one thread, and every weight
//! and its gradient are read and written once; only where there are fewer networks than threads, rows are shared out.

use crate::nn::Params;
use crate::nn::network::{Network, Response};
use crate::nn::ngf::{Active, Piece};
use crate::shards::{Gradient, Gradients, over_threads};
use anyhow::{Context, Result};
use candle_core::{Device, Tensor, Var};
use robot::{JointState, JointVector};
use std::ops::Range;

/// A batch: states, and what is told of the object of each.
pub struct Batch<'a> {
    /// States with the object in front.
    pub states: &'a [JointState],
    /// What is told of the objects.
    pub objects: &'a [&'a [f32]],
}

/// The loss of some rows of a batch.
pub struct Loss {
    /// Their mean, as it is reported.
    pub shown: Tensor,
    /// Their mean, as it is differentiated.
    pub whole: Tensor,
}

impl Loss {
    /// A loss, and `weight` times what the metrics add to it where a fabric acts.
    pub fn with_metrics(shown: Tensor, response: &Response, weight: f64) -> Result<Self> {
        let whole = match &response.metrics {
            Some(metrics) => (&shown + metrics * weight)?,
            None => shown.clone(),
        };
        Ok(Self { shown, whole })
    }
}

/// What a step begins with.
pub struct Outcome {
    /// Mean loss.
    pub loss: f32,
    /// What the policy did in each state (rad/s²).
    pub accelerations: Vec<JointVector>,
    /// Gradients, the sum of which is that of the mean loss.
    pub gradients: Gradients,
}

/// A network with rows of the batch.
struct Job {
    piece: Piece,
    rows: Range<usize>,
}

/// Differentiates the mean loss of a batch; `loss` is told rows and what the policy does there.
pub fn differentiate(
    network: &Network,
    params: &Params,
    batch: &Batch,
    active: Active,
    threads: usize,
    loss: &(dyn Fn(Range<usize>, &Response) -> Result<Loss> + Sync),
) -> Result<Outcome> {
    let count = batch.states.len();
    let pieces = network.pieces(active);
    let shares = if pieces.len() < threads { split(count, threads) } else { split(count, 1) };
    let job = |piece: &Piece| {
        let of_rows = |rows: &Range<usize>| Job { piece: piece.clone(), rows: rows.clone() };
        shares.iter().map(of_rows).collect::<Vec<_>>()
    };
    let jobs: Vec<Job> = pieces.iter().flat_map(job).collect();
    let cost = |job: &Job| job.piece.passes * job.rows.len();
    let said = over_threads(&jobs, threads, cost, |job| {
        let (params, rows) = (params.of_shard(), job.rows.clone());
        let (states, objects) = (&batch.states[rows.clone()], &batch.objects[rows]);
        let output = network.output(&params, &job.piece, states, objects)?;
        Ok((params, output))
    })?;

    let silence = network.silence();
    let width = silence.len();
    let mut outputs = silence.repeat(count);
    for (job, (_, output)) in jobs.iter().zip(&said) {
        for (row, says) in job.rows.clone().zip(output.to_vec2::<f32>()?) {
            let columns = job.piece.columns.clone();
            outputs[row * width..(row + 1) * width][columns].copy_from_slice(&says);
        }
    }

    let parts = split(count, threads);
    let heads = over_threads(&parts, threads, Range::len, |rows| {
        let (from, to) = (rows.start * width, rows.end * width);
        let leaf = Var::from_slice(&outputs[from..to], (rows.len(), width), &Device::Cpu)?;
        let response = network.head(&leaf, &batch.states[rows.clone()])?;
        let loss = loss(rows.clone(), &response)?;
        let store = (loss.whole * (rows.len() as f64 / count as f64))?.backward()?;
        let gradient = store.get(&leaf).context("the loss does not depend on the policy")?;
        let share = rows.len() as f32 / count as f32;
        let made = response.accelerations.to_vec2::<f32>()?;
        let gradient = gradient.flatten_all()?.to_vec1::<f32>()?;
        Ok((loss.shown.to_scalar::<f32>()? * share, made, gradient))
    })?;
    let gradient: Vec<f32> = heads.iter().flat_map(|(_, _, gradient)| gradient).copied().collect();

    let jobs: Vec<(Job, (Params, Tensor))> = jobs.into_iter().zip(said).collect();
    let shards = over_threads(
        &jobs,
        threads,
        |(job, _)| cost(job),
        |(job, (params, output))| {
            let of_row =
                |row: usize| &gradient[row * width..(row + 1) * width][job.piece.columns.clone()];
            let of_output: Vec<f32> = job.rows.clone().flat_map(of_row).copied().collect();
            let of_output = Tensor::from_vec(of_output, output.shape(), &Device::Cpu)?;
            Ok((1.0, Gradient::of(&(output * of_output)?.sum_all()?, params)?))
        },
    )?;
    let made = heads.iter().flat_map(|(_, made, _)| made);
    Ok(Outcome {
        loss: heads.iter().map(|(loss, _, _)| loss).sum(),
        accelerations: made.map(|row| JointVector::from_fn(|i, _| f64::from(row[i]))).collect(),
        gradients: Gradients { shards },
    })
}

/// Rows in as many even shares at most.
fn split(rows: usize, shares: usize) -> Vec<Range<usize>> {
    let size = rows.div_ceil(shares.max(1)).max(1);
    (0..rows).step_by(size).map(|first| first..(first + size).min(rows)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::network;
    use policy::network::NetworkConfig;
    use policy::{LATENT, Observation, PolicyConfig, baseline::BaselineConfig};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::{DOF, Tree};

    /// Gradients by parameter: the sum over the shards.
    fn summed(params: &Params, gradients: &Gradients) -> Vec<Option<Vec<f32>>> {
        let of_param = |i: usize| {
            let shares = gradients.shards.iter().filter_map(|(share, gradient)| {
                let values = gradient.of_params[i].as_ref()?.flatten_all().ok()?;
                Some(values.to_vec1::<f32>().ok()?.into_iter().map(|g| share * g).collect())
            });
            shares.reduce(|a: Vec<f32>, b| a.iter().zip(&b).map(|(a, b)| a + b).collect())
        };
        (0..params.names().count()).map(of_param).collect()
    }

    #[test]
    fn however_many_threads_the_gradient_is_that_of_one_tape() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let mlp = BaselineConfig { hidden: vec![24; 3], ..BaselineConfig::large() };
        let mlp = PolicyConfig { network: NetworkConfig::Mlp(mlp), ..PolicyConfig::tiny() };
        for config in [PolicyConfig::tiny(), mlp] {
            assert_eq!(config.observation, Observation::Cloud);
            let mut params = Params::default();
            network::init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
            let wave = |k: usize| 0.2 * libm::sinf((k * k % 1013) as f32);
            params.set_values(&(0..params.count()).map(wave).collect::<Vec<_>>()).unwrap();
            let network = Network::new(&config, &limits).unwrap();
            let state = |k: usize| JointState {
                q: JointVector::from_fn(|i, _| libm::sin((3 * k + i) as f64)),
                qd: JointVector::from_fn(|i, _| libm::cos((k + 2 * i) as f64)),
            };
            let states: Vec<JointState> = (0..7).map(state).collect();
            let z: Vec<f32> = (0..LATENT).map(|i| libm::cosf(i as f32)).collect();
            let objects = vec![z.as_slice(); states.len()];
            let batch = Batch { states: &states, objects: &objects };
            let loss = |_: Range<usize>, response: &Response| {
                let mut whole = response.accelerations.sqr()?.sum(1)?.mean_all()?;
                let shown = whole.clone();
                if let Some(metrics) = &response.metrics {
                    whole = (whole + metrics)?;
                }
                Ok(Loss { shown, whole })
            };

            let response = network.respond(&params, &states, &objects).unwrap();
            let tape = loss(0..7, &response).unwrap();
            let of_tape = Gradient::of(&tape.whole, &params).unwrap();
            let of_tape = Gradients { shards: vec![(1.0, of_tape)] };
            let wanted = summed(&params, &of_tape);
            for threads in [1, 2, 3, 9] {
                let found =
                    differentiate(&network, &params, &batch, Active::All, threads, &loss).unwrap();
                assert!(
                    (found.loss - tape.shown.to_scalar::<f32>().unwrap()).abs() < 1e-4 * found.loss
                );
                let made = response.accelerations.to_vec2::<f32>().unwrap();
                for (made, found) in made.iter().zip(&found.accelerations) {
                    let off = (0..DOF).map(|i| (f64::from(made[i]) - found[i]).abs());
                    assert!(off.fold(0.0, f64::max) < 1e-4 * found.norm());
                }
                let got = summed(&params, &found.gradients);
                for (name, (wanted, got)) in params.names().zip(wanted.iter().zip(&got)) {
                    let (Some(wanted), Some(got)) = (wanted, got) else {
                        assert!(wanted.is_none() && got.is_none(), "{name}");
                        continue;
                    };
                    let size = wanted.iter().map(|g| g.abs()).fold(0.0, f32::max);
                    let off =
                        wanted.iter().zip(got).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(off <= 1e-4 * size, "{threads} threads, {name}: {off} of {size}");
                }
            }
        }
    }
}
