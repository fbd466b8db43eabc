//! Backward pass of a policy's loss on several threads.
//!
//! The networks of a fabric are combined only in its head. Each network therefore processes the whole batch
//! on one thread, and every weight and its gradient are read and written once. Rows are split between threads
//! only if there are fewer networks than threads.

use crate::nn::Params;
use crate::nn::networks::ngf::{SubnetOutput, TrainableSet};
use crate::nn::networks::{Network, NetworkOutput};
use crate::train::data_parallel::{Gradient, Gradients, parallel_map};
use anyhow::{Context, Result};
use candle_core::{Device, Tensor, Var};
use robot::{JointState, JointVector};
use std::ops::Range;

/// A batch of states with their observations.
pub struct Batch<'a> {
    /// Joint states (canonical frame).
    pub states: &'a [JointState],
    /// Observation vector for each state.
    pub observations: &'a [&'a [f32]],
}

/// The loss of some rows of a batch.
pub struct Loss {
    /// Mean loss for reports: the imitation loss alone.
    pub reported: Tensor,
    /// Mean loss to differentiate, with regularisation.
    pub total: Tensor,
}

impl Loss {
    /// Adds `weight` times the metric penalty of a fabric to the loss; other networks have no penalty.
    pub fn with_metric_penalty(
        reported: Tensor,
        response: &NetworkOutput,
        weight: f64,
    ) -> Result<Self> {
        let total = match &response.metric_penalty {
            Some(metrics) => (&reported + metrics * weight)?,
            None => reported.clone(),
        };
        Ok(Self { reported, total })
    }
}

/// Loss, predictions and gradients of a batch.
pub struct StepResult {
    /// Mean reported loss.
    pub loss: f32,
    /// Predicted acceleration in each state (rad/s²).
    pub accelerations: Vec<JointVector>,
    /// Partial gradients whose sum is the gradient of the mean total loss.
    pub gradients: Gradients,
}

/// A network and the rows of the batch it processes.
struct SubnetTask {
    subnet: SubnetOutput,
    rows: Range<usize>,
}

/// Differentiates the mean loss of a batch. `loss` receives a row range and the network's output for it.
pub fn differentiate(
    network: &Network,
    params: &Params,
    batch: &Batch,
    active: TrainableSet,
    threads: usize,
    loss: &(dyn Fn(Range<usize>, &NetworkOutput) -> Result<Loss> + Sync),
) -> Result<StepResult> {
    let count = batch.states.len();
    let subnets = network.subnets(active);
    let ranges =
        if subnets.len() < threads { split_rows(count, threads) } else { split_rows(count, 1) };
    let tasks_of = |subnet: &SubnetOutput| {
        let of_rows =
            |rows: &Range<usize>| SubnetTask { subnet: subnet.clone(), rows: rows.clone() };
        ranges.iter().map(of_rows).collect::<Vec<_>>()
    };
    let tasks: Vec<SubnetTask> = subnets.iter().flat_map(tasks_of).collect();
    let cost = |task: &SubnetTask| task.subnet.passes * task.rows.len();
    let outputs = parallel_map(&tasks, threads, cost, |task| {
        let (params, rows) = (params.with_accumulators(), task.rows.clone());
        let (states, observations) = (&batch.states[rows.clone()], &batch.observations[rows]);
        let output = network.output(&params, &task.subnet, states, observations)?;
        Ok((params, output))
    })?;

    let inactive = network.inactive_output();
    let width = inactive.len();
    let mut packed = inactive.repeat(count);
    for (task, (_, output)) in tasks.iter().zip(&outputs) {
        for (row, values) in task.rows.clone().zip(output.to_vec2::<f32>()?) {
            let columns = task.subnet.columns.clone();
            packed[row * width..(row + 1) * width][columns].copy_from_slice(&values);
        }
    }

    let parts = split_rows(count, threads);
    let heads = parallel_map(&parts, threads, Range::len, |rows| {
        let (from, to) = (rows.start * width, rows.end * width);
        let leaf = Var::from_slice(&packed[from..to], (rows.len(), width), &Device::Cpu)?;
        let response = network.head(&leaf, &batch.states[rows.clone()])?;
        let loss = loss(rows.clone(), &response)?;
        let store = (loss.total * (rows.len() as f64 / count as f64))?.backward()?;
        let gradient = store.get(&leaf).context("the loss does not depend on the policy")?;
        let weight = rows.len() as f32 / count as f32;
        let predicted = response.accelerations.to_vec2::<f32>()?;
        let gradient = gradient.flatten_all()?.to_vec1::<f32>()?;
        Ok((loss.reported.to_scalar::<f32>()? * weight, predicted, gradient))
    })?;
    let gradient: Vec<f32> = heads.iter().flat_map(|(_, _, gradient)| gradient).copied().collect();

    let tasks: Vec<(SubnetTask, (Params, Tensor))> = tasks.into_iter().zip(outputs).collect();
    let shards = parallel_map(
        &tasks,
        threads,
        |(task, _)| cost(task),
        |(task, (params, output))| {
            let of_row =
                |row: usize| &gradient[row * width..(row + 1) * width][task.subnet.columns.clone()];
            let of_output: Vec<f32> = task.rows.clone().flat_map(of_row).copied().collect();
            let of_output = Tensor::from_vec(of_output, output.shape(), &Device::Cpu)?;
            Ok((1.0, Gradient::compute(&(output * of_output)?.sum_all()?, params)?))
        },
    )?;
    let predicted = heads.iter().flat_map(|(_, predicted, _)| predicted);
    Ok(StepResult {
        loss: heads.iter().map(|(loss, _, _)| loss).sum(),
        accelerations: predicted
            .map(|row| JointVector::from_fn(|i, _| f64::from(row[i])))
            .collect(),
        gradients: Gradients { partials: shards },
    })
}

/// Splits `rows` into up to `parts` ranges of equal size; the last range can be shorter.
fn split_rows(rows: usize, parts: usize) -> Vec<Range<usize>> {
    let size = rows.div_ceil(parts.max(1)).max(1);
    (0..rows).step_by(size).map(|first| first..(first + size).min(rows)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::networks;
    use policy::networks::NetworkConfig;
    use policy::{
        LATENT_DIM, ObservationKind, PolicyConfig,
        networks::acceleration_mlp::AccelerationMlpConfig,
    };
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::{DOF, KinematicTree};

    /// Gradient of each parameter: the weighted sum over the parts.
    fn sum_parts(params: &Params, gradients: &Gradients) -> Vec<Option<Vec<f32>>> {
        let of_param = |i: usize| {
            let parts = gradients.partials.iter().filter_map(|(weight, gradient)| {
                let values = gradient.by_param[i].as_ref()?.flatten_all().ok()?;
                Some(values.to_vec1::<f32>().ok()?.into_iter().map(|g| weight * g).collect())
            });
            parts.reduce(|a: Vec<f32>, b| a.iter().zip(&b).map(|(a, b)| a + b).collect())
        };
        (0..params.names().count()).map(of_param).collect()
    }

    #[test]
    fn gradient_is_independent_of_the_number_of_threads() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let mlp = AccelerationMlpConfig { hidden: vec![24; 3], ..AccelerationMlpConfig::large() };
        let mlp = PolicyConfig { network: NetworkConfig::Mlp(mlp), ..PolicyConfig::tiny() };
        for config in [PolicyConfig::tiny(), mlp] {
            assert_eq!(config.observation, ObservationKind::Cloud);
            let mut params = Params::default();
            networks::init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
            let wave = |k: usize| 0.2 * libm::sinf((k * k % 1013) as f32);
            params.set_values(&(0..params.count()).map(wave).collect::<Vec<_>>()).unwrap();
            let network = Network::new(&config, &tree).unwrap();
            let state = |k: usize| JointState {
                q: JointVector::from_fn(|i, _| libm::sin((3 * k + i) as f64)),
                qd: JointVector::from_fn(|i, _| libm::cos((k + 2 * i) as f64)),
            };
            let states: Vec<JointState> = (0..7).map(state).collect();
            let z: Vec<f32> = (0..LATENT_DIM).map(|i| libm::cosf(i as f32)).collect();
            let objects = vec![z.as_slice(); states.len()];
            let batch = Batch { states: &states, observations: &objects };
            let loss = |_: Range<usize>, response: &NetworkOutput| {
                let mut total = response.accelerations.sqr()?.sum(1)?.mean_all()?;
                let reported = total.clone();
                if let Some(metrics) = &response.metric_penalty {
                    total = (total + metrics)?;
                }
                Ok(Loss { reported, total })
            };

            let response = network.forward(&params, &states, &objects).unwrap();
            let single = loss(0..7, &response).unwrap();
            let reference = Gradient::compute(&single.total, &params).unwrap();
            let reference = Gradients { partials: vec![(1.0, reference)] };
            let expected = sum_parts(&params, &reference);
            for threads in [1, 2, 3, 9] {
                let found =
                    differentiate(&network, &params, &batch, TrainableSet::All, threads, &loss)
                        .unwrap();
                let loss_error = found.loss - single.reported.to_scalar::<f32>().unwrap();
                assert!(loss_error.abs() < 1e-4 * found.loss);
                let accelerations = response.accelerations.to_vec2::<f32>().unwrap();
                for (expected, found) in accelerations.iter().zip(&found.accelerations) {
                    let error = (0..DOF).map(|i| (f64::from(expected[i]) - found[i]).abs());
                    assert!(error.fold(0.0, f64::max) < 1e-4 * found.norm());
                }
                let got = sum_parts(&params, &found.gradients);
                for (name, (expected, got)) in params.names().zip(expected.iter().zip(&got)) {
                    let (Some(expected), Some(got)) = (expected, got) else {
                        assert!(expected.is_none() && got.is_none(), "{name}");
                        continue;
                    };
                    let size = expected.iter().map(|g| g.abs()).fold(0.0, f32::max);
                    let error =
                        expected.iter().zip(got).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(
                        error <= 1e-4 * size,
                        "{threads} threads, {name}: error {error} of {size}"
                    );
                }
            }
        }
    }
}
