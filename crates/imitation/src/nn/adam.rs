//! AdamW in one pass over parameters, moments and partial gradients, with a serialisable state.

use crate::nn::Params;
use crate::nn::ops::storage::contiguous;
use crate::train::data_parallel::{Gradient, Gradients, parallel_map};
use anyhow::Result;
use candle_core::{CpuStorage, InplaceOp1, Layout, Storage, Tensor, Var};
use policy::simd::with_simd;
use std::sync::Mutex;

/// Decay rates of the first and second moment, and the constant that bounds the quotient.
const BETA1: f32 = 0.9;
const BETA2: f32 = 0.99;
const EPSILON: f32 = 1e-8;
/// Values per block; a block stays in the L1 cache.
const BLOCK: usize = 4096;

/// State of the AdamW optimiser.
#[derive(Clone, Debug)]
pub struct AdamW {
    /// First moments of all parameters, concatenated in parameter order.
    pub first_moment: Vec<f32>,
    /// Second moments of all parameters, concatenated in parameter order.
    pub second_moment: Vec<f32>,
    /// Number of completed steps.
    pub steps: u64,
    /// Number of steps in which each parameter had a gradient, for the bias correction of its moments.
    pub param_steps: Vec<u64>,
    /// Decoupled weight decay, relative to the learning rate.
    pub weight_decay: f32,
}

/// One parameter with its moments and weighted partial gradients.
struct ParamSlice<'a> {
    var: Var,
    gradients: Vec<(f32, Tensor)>,
    moments: Mutex<(&'a mut [f32], &'a mut [f32])>,
    /// Number of steps of this parameter, including the current one.
    steps: u64,
}

/// In-place update of one parameter.
struct Update<'a, 'b> {
    slice: &'a ParamSlice<'b>,
    rate: f32,
    scale: f32,
    decay: f32,
    correct1: f32,
    correct2: f32,
}

impl AdamW {
    /// Initial state for `params`: zero moments.
    pub fn new(params: &Params, decay: f32) -> Self {
        let moments = vec![0.0; params.count()];
        let taken = vec![0; params.names().count()];
        Self {
            first_moment: moments.clone(),
            second_moment: moments,
            steps: 0,
            param_steps: taken,
            weight_decay: decay,
        }
    }

    /// Performs one step on `threads` threads, with the gradient clipped to norm `clip`. Returns the norm
    /// before clipping; if it is not finite, nothing changes.
    pub fn step(
        &mut self,
        params: &Params,
        gradients: &Gradients,
        rate: f32,
        clip: f32,
        threads: usize,
    ) -> Result<f32> {
        let (mut indices, mut slices) = (Vec::new(), Vec::new());
        let (mut first, mut second) =
            (self.first_moment.as_mut_slice(), self.second_moment.as_mut_slice());
        for (i, var) in params.vars().enumerate() {
            let (m, rest) = first.split_at_mut(var.elem_count());
            first = rest;
            let (v, rest) = second.split_at_mut(var.elem_count());
            second = rest;
            let of_partial = |(weight, partial): &(f32, Gradient)| {
                Some((*weight, partial.by_param.get(i)?.clone()?))
            };
            let partials: Vec<_> = gradients.partials.iter().filter_map(of_partial).collect();
            // Parameters without a gradient stay unchanged.
            if !partials.is_empty() {
                let moments = Mutex::new((m, v));
                let (var, taken) = (var.clone(), self.param_steps[i] + 1);
                indices.push(i);
                slices.push(ParamSlice { var, gradients: partials, moments, steps: taken });
            }
        }
        let size = |slice: &ParamSlice| slice.var.elem_count();
        let squares = parallel_map(&slices, threads, size, ParamSlice::squared_norm)?;
        let norm = squares.iter().sum::<f64>().sqrt() as f32;
        if !norm.is_finite() {
            return Ok(norm);
        }
        self.steps += 1;
        indices.into_iter().for_each(|i| self.param_steps[i] += 1);
        parallel_map(&slices, threads, size, |slice| {
            let count = slice.steps.min(10_000) as i32;
            let update = Update {
                slice,
                rate,
                scale: if norm > clip { clip / norm } else { 1.0 },
                decay: self.weight_decay,
                correct1: 1.0 - BETA1.powi(count),
                correct2: 1.0 - BETA2.powi(count),
            };
            Ok(slice.var.inplace_op1(&update)?)
        })?;
        Ok(norm)
    }
}

impl ParamSlice<'_> {
    /// Calls `f` with the first index and the values of each block of the summed gradient.
    fn blocks(&self, mut f: impl FnMut(usize, &[f32])) -> candle_core::Result<()> {
        let guards: Vec<_> =
            self.gradients.iter().map(|(weight, g)| (*weight, g.storage_and_layout())).collect();
        let mut slices = Vec::new();
        for (weight, (storage, layout)) in &guards {
            let Storage::Cpu(storage) = &**storage else {
                candle_core::bail!("the optimiser requires CPU tensors")
            };
            slices.push((*weight, contiguous(storage, layout)?));
        }
        if let [(1.0, gradient)] = slices[..] {
            // A single gradient needs no sum.
            gradient.chunks(BLOCK).enumerate().for_each(|(k, block)| f(k * BLOCK, block));
            return Ok(());
        }
        let count = self.var.elem_count();
        let mut sum = [0.0; BLOCK];
        for first in (0..count).step_by(BLOCK) {
            let sum = &mut sum[..BLOCK.min(count - first)];
            sum.fill(0.0);
            with_simd(
                #[inline(always)]
                || {
                    for (weight, gradient) in &slices {
                        for (sum, g) in sum.iter_mut().zip(&gradient[first..]) {
                            *sum += weight * g;
                        }
                    }
                },
            );
            f(first, sum);
        }
        Ok(())
    }

    fn squared_norm(&self) -> Result<f64> {
        let mut total = 0.0;
        self.blocks(|_, sum| {
            let lanes = with_simd(
                #[inline(always)]
                || {
                    let mut lanes = [0.0f32; 64];
                    let (chunks, rest) = sum.as_chunks::<64>();
                    for chunk in chunks {
                        lanes.iter_mut().zip(chunk).for_each(|(lane, g)| *lane += g * g);
                    }
                    lanes.iter_mut().zip(rest).for_each(|(lane, g)| *lane += g * g);
                    lanes
                },
            );
            total += lanes.iter().map(|x| *x as f64).sum::<f64>();
        })?;
        Ok(total)
    }
}

impl InplaceOp1 for Update<'_, '_> {
    fn name(&self) -> &'static str {
        "adamw"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, layout: &Layout) -> candle_core::Result<()> {
        let (CpuStorage::F32(values), Some((start, end))) = (storage, layout.contiguous_offsets())
        else {
            candle_core::bail!("parameters must be contiguous f32 tensors")
        };
        let values = &mut values[start..end];
        let Ok(mut moments) = self.slice.moments.lock() else {
            candle_core::bail!("another thread panicked")
        };
        let (first, second) = &mut *moments;
        // Divisions take ten times as long as multiplications: only one per value remains.
        let (rate, correct2) = (self.rate / self.correct1, 1.0 / self.correct2);
        let retained = 1.0 - self.rate * self.decay;
        self.slice.blocks(|start, gradient| {
            let end = start + gradient.len();
            let moments = first[start..end].iter_mut().zip(&mut second[start..end]);
            let all = values[start..end].iter_mut().zip(gradient).zip(moments);
            with_simd(
                #[inline(always)]
                || {
                    for ((value, g), (m, v)) in all {
                        let g = g * self.scale;
                        *m = BETA1 * *m + (1.0 - BETA1) * g;
                        *v = BETA2 * *v + (1.0 - BETA2) * g * g;
                        *value = retained * *value - rate * *m / ((*v * correct2).sqrt() + EPSILON);
                    }
                },
            );
        })
    }
}

/// Learning rate schedule: linear warm-up over `warmup` steps, then cosine decay to 1 % of `peak` at `total`.
pub fn cosine_schedule(step: u64, warmup: u64, total: u64, peak: f32) -> f32 {
    if step < warmup {
        return peak * (step + 1) as f32 / warmup as f32;
    }
    let fraction = ((step - warmup) as f32 / (total - warmup).max(1) as f32).min(1.0);
    peak * (0.01 + 0.99 * 0.5 * (1.0 + (std::f32::consts::PI * fraction).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    /// One step of a single parameter tensor, with equally weighted partial gradients.
    fn step(adam: &mut AdamW, params: &Params, gradients: &[&[f32]], rate: f32, clip: f32) -> f32 {
        let weight = 1.0 / gradients.len() as f32;
        let partial = |g: &&[f32]| {
            let tensor = Tensor::from_slice(g, g.len(), &Device::Cpu).unwrap();
            (weight, Gradient { loss: 0.0, by_param: vec![Some(tensor)] })
        };
        let gradients = Gradients { partials: gradients.iter().map(partial).collect() };
        adam.step(params, &gradients, rate, clip, 2).unwrap()
    }

    fn params(x: &[f32]) -> Params {
        let mut params = Params::default();
        params.add("x", &[x.len()], x.to_vec()).unwrap();
        params
    }

    #[test]
    fn adamw_converges_on_a_quadratic() {
        let params = params(&[3.0, -2.0]);
        let mut adam = AdamW::new(&params, 0.0);
        for k in 0..2000 {
            let x = params.values().unwrap();
            let gradient = [2.0 * (x[0] - 1.0), 20.0 * (x[1] - 0.5)];
            step(&mut adam, &params, &[&gradient], cosine_schedule(k, 10, 2000, 0.05), 1e9);
        }
        let x = params.values().unwrap();
        assert!((x[0] - 1.0).abs() < 1e-3 && (x[1] - 0.5).abs() < 1e-3, "{x:?}");
    }

    #[test]
    fn first_step_equals_the_learning_rate() {
        let params = params(&[0.0]);
        step(&mut AdamW::new(&params, 0.0), &params, &[&[123.0]], 0.01, 1.0);
        let x = params.values().unwrap();
        assert!((x[0] + 0.01).abs() < 1e-6, "{}", x[0]);
    }

    #[test]
    fn partial_gradients_are_summed_over_all_blocks() {
        let count = 2 * BLOCK + 17;
        let gradients: Vec<Vec<f32>> =
            (0..2).map(|s| (0..count).map(|k| libm::sinf((k * k + s) as f32)).collect()).collect();
        let mean: Vec<f32> =
            gradients[0].iter().zip(&gradients[1]).map(|(a, b)| 0.5 * (a + b)).collect();
        let (partial, summed) = (params(&vec![1.0; count]), params(&vec![1.0; count]));
        let (mut a, mut b) = (AdamW::new(&partial, 0.1), AdamW::new(&summed, 0.1));
        for _ in 0..3 {
            let norm = step(&mut a, &partial, &[&gradients[0], &gradients[1]], 0.01, 1.0);
            let expected = step(&mut b, &summed, &[&mean], 0.01, 1.0);
            let exact = mean.iter().map(|g| (*g as f64).powi(2)).sum::<f64>().sqrt() as f32;
            assert!((norm - expected).abs() < 1e-4 * exact && (norm - exact).abs() < 1e-4 * exact);
        }
        let pairs = partial.values().unwrap().into_iter().zip(summed.values().unwrap());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn non_finite_gradient_changes_nothing() {
        let params = params(&[0.5, 0.25]);
        let mut adam = AdamW::new(&params, 0.0);
        assert!(step(&mut adam, &params, &[&[f32::NAN, 1.0]], 0.01, 1.0).is_nan());
        assert_eq!(params.values().unwrap(), [0.5, 0.25]);
        assert_eq!((adam.steps, adam.param_steps, adam.first_moment), (0, vec![0], vec![0.0; 2]));
    }

    #[test]
    fn late_first_step_of_a_parameter_equals_the_learning_rate() {
        let mut params = params(&[3.0]);
        params.add("y", &[1], vec![2.0]).unwrap();
        let mut adam = AdamW::new(&params, 0.0);
        for is_active in [false, false, false, true] {
            let gradient = || Some(Tensor::from_slice(&[5.0f32], 1, &Device::Cpu).unwrap());
            let by_param = vec![gradient(), is_active.then(gradient).flatten()];
            let shards = vec![(1.0, Gradient { loss: 0.0, by_param })];
            adam.step(&params, &Gradients { partials: shards }, 0.01, 1e9, 2).unwrap();
        }
        let x = params.values().unwrap();
        assert!((x[0] - 2.96).abs() < 1e-5 && (x[1] - 1.99).abs() < 1e-5, "{x:?}");
        assert_eq!((adam.steps, adam.param_steps), (4, vec![4, 1]));
    }
}
