//! AdamW in one pass over parameters, moments and the shards' gradients, with a state that can be saved.

use super::Params;
use super::memory::contiguous;
use crate::shards::{Gradient, Gradients, over_threads};
use anyhow::Result;
use candle_core::{CpuStorage, InplaceOp1, Layout, Storage, Tensor, Var};
use policy::lanes::widest;
use std::sync::Mutex;

/// Decay of the first and second moment, and what keeps the quotient finite.
const BETA1: f32 = 0.9;
const BETA2: f32 = 0.99;
const EPSILON: f32 = 1e-8;
/// Numbers that are worked on at a time: they stay in the nearest cache.
const BLOCK: usize = 4096;

/// The optimiser's state.
#[derive(Clone, Debug)]
pub struct AdamW {
    /// First moment.
    pub first: Vec<f32>,
    /// Second moment.
    pub second: Vec<f32>,
    /// Steps so far.
    pub steps: u64,
    /// Those that each parameter took part in: its moments are as old as that.
    pub taken: Vec<u64>,
    /// Decoupled weight decay.
    pub decay: f32,
}

/// One parameter with its moments and the shares of its gradient.
struct Part<'a> {
    var: Var,
    gradients: Vec<(f32, Tensor)>,
    moments: Mutex<(&'a mut [f32], &'a mut [f32])>,
    /// Steps that it has taken with this one.
    taken: u64,
}

/// The step of one parameter in place.
struct Update<'a, 'b> {
    part: &'a Part<'b>,
    rate: f32,
    scale: f32,
    decay: f32,
    correct1: f32,
    correct2: f32,
}

impl AdamW {
    /// A fresh optimiser of these parameters.
    pub fn new(params: &Params, decay: f32) -> Self {
        let moments = vec![0.0; params.count()];
        let taken = vec![0; params.names().count()];
        Self { first: moments.clone(), second: moments, steps: 0, taken, decay }
    }

    /// One step along `gradients`, clipped to norm `clip`, on `threads` threads. Gives the norm before clipping; if that is not finite,
    /// nothing is changed.
    pub fn step(
        &mut self,
        params: &Params,
        gradients: &Gradients,
        rate: f32,
        clip: f32,
        threads: usize,
    ) -> Result<f32> {
        let (mut indices, mut parts) = (Vec::new(), Vec::new());
        let (mut first, mut second) = (self.first.as_mut_slice(), self.second.as_mut_slice());
        for (i, var) in params.vars().enumerate() {
            let (m, rest) = first.split_at_mut(var.elem_count());
            first = rest;
            let (v, rest) = second.split_at_mut(var.elem_count());
            second = rest;
            let of_shard =
                |(share, shard): &(f32, Gradient)| Some((*share, shard.of_params.get(i)?.clone()?));
            let of_shards: Vec<_> = gradients.shards.iter().filter_map(of_shard).collect();
            // What took no part in the loss stays as it is.
            if !of_shards.is_empty() {
                let moments = Mutex::new((m, v));
                let (var, taken) = (var.clone(), self.taken[i] + 1);
                indices.push(i);
                parts.push(Part { var, gradients: of_shards, moments, taken });
            }
        }
        let size = |part: &Part| part.var.elem_count();
        let squares = over_threads(&parts, threads, size, Part::squared_norm)?;
        let norm = squares.iter().sum::<f64>().sqrt() as f32;
        if !norm.is_finite() {
            return Ok(norm);
        }
        self.steps += 1;
        indices.into_iter().for_each(|i| self.taken[i] += 1);
        over_threads(&parts, threads, size, |part| {
            let count = part.taken.min(10_000) as i32;
            let update = Update {
                part,
                rate,
                scale: if norm > clip { clip / norm } else { 1.0 },
                decay: self.decay,
                correct1: 1.0 - BETA1.powi(count),
                correct2: 1.0 - BETA2.powi(count),
            };
            Ok(part.var.inplace_op1(&update)?)
        })?;
        Ok(norm)
    }
}

impl Part<'_> {
    /// Calls `f` with each block of the summed gradient and the index of its first number.
    fn blocks(&self, mut f: impl FnMut(usize, &[f32])) -> candle_core::Result<()> {
        let guards: Vec<_> =
            self.gradients.iter().map(|(share, g)| (*share, g.storage_and_layout())).collect();
        let mut slices = Vec::new();
        for (share, (storage, layout)) in &guards {
            let Storage::Cpu(storage) = &**storage else {
                candle_core::bail!("the optimiser runs on the processor")
            };
            slices.push((*share, contiguous(storage, layout)?));
        }
        if let [(1.0, gradient)] = slices[..] {
            // What is whole need not be summed.
            gradient.chunks(BLOCK).enumerate().for_each(|(k, part)| f(k * BLOCK, part));
            return Ok(());
        }
        let count = self.var.elem_count();
        let mut sum = [0.0; BLOCK];
        for begin in (0..count).step_by(BLOCK) {
            let sum = &mut sum[..BLOCK.min(count - begin)];
            sum.fill(0.0);
            widest(
                #[inline(always)]
                || {
                    for (share, gradient) in &slices {
                        for (sum, g) in sum.iter_mut().zip(&gradient[begin..]) {
                            *sum += share * g;
                        }
                    }
                },
            );
            f(begin, sum);
        }
        Ok(())
    }

    fn squared_norm(&self) -> Result<f64> {
        let mut total = 0.0;
        self.blocks(|_, sum| {
            let lanes = widest(
                #[inline(always)]
                || {
                    let mut lanes = [0.0f32; 64];
                    let (parts, rest) = sum.as_chunks::<64>();
                    for part in parts {
                        lanes.iter_mut().zip(part).for_each(|(lane, g)| *lane += g * g);
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
            candle_core::bail!("parameters are contiguous and of single precision")
        };
        let values = &mut values[start..end];
        let Ok(mut moments) = self.part.moments.lock() else {
            candle_core::bail!("another thread panicked")
        };
        let (first, second) = &mut *moments;
        // Quotients take ten times as long as products: one is left for each number.
        let (rate, correct2) = (self.rate / self.correct1, 1.0 / self.correct2);
        let kept = 1.0 - self.rate * self.decay;
        self.part.blocks(|begin, gradient| {
            let end = begin + gradient.len();
            let moments = first[begin..end].iter_mut().zip(&mut second[begin..end]);
            let all = values[begin..end].iter_mut().zip(gradient).zip(moments);
            widest(
                #[inline(always)]
                || {
                    for ((value, g), (m, v)) in all {
                        let g = g * self.scale;
                        *m = BETA1 * *m + (1.0 - BETA1) * g;
                        *v = BETA2 * *v + (1.0 - BETA2) * g * g;
                        *value = kept * *value - rate * *m / ((*v * correct2).sqrt() + EPSILON);
                    }
                },
            );
        })
    }
}

/// Learning rate that rises over `warmup` steps and falls on a cosine to a hundredth at `total`.
pub fn schedule(step: u64, warmup: u64, total: u64, peak: f32) -> f32 {
    if step < warmup {
        return peak * (step + 1) as f32 / warmup as f32;
    }
    let share = ((step - warmup) as f32 / (total - warmup).max(1) as f32).min(1.0);
    peak * (0.01 + 0.99 * 0.5 * (1.0 + (std::f32::consts::PI * share).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    /// Parameters `x` of one tensor, with gradients of one shard each.
    fn step(adam: &mut AdamW, params: &Params, gradients: &[&[f32]], rate: f32, clip: f32) -> f32 {
        let share = 1.0 / gradients.len() as f32;
        let shard = |g: &&[f32]| {
            let tensor = Tensor::from_slice(g, g.len(), &Device::Cpu).unwrap();
            (share, Gradient { loss: 0.0, of_params: vec![Some(tensor)] })
        };
        let gradients = Gradients { shards: gradients.iter().map(shard).collect() };
        adam.step(params, &gradients, rate, clip, 2).unwrap()
    }

    fn params(x: &[f32]) -> Params {
        let mut params = Params::default();
        params.add("x", &[x.len()], x.to_vec()).unwrap();
        params
    }

    #[test]
    fn it_finds_the_bottom_of_a_bowl() {
        let params = params(&[3.0, -2.0]);
        let mut adam = AdamW::new(&params, 0.0);
        for k in 0..2000 {
            let x = params.values().unwrap();
            let gradient = [2.0 * (x[0] - 1.0), 20.0 * (x[1] - 0.5)];
            step(&mut adam, &params, &[&gradient], schedule(k, 10, 2000, 0.05), 1e9);
        }
        let x = params.values().unwrap();
        assert!((x[0] - 1.0).abs() < 1e-3 && (x[1] - 0.5).abs() < 1e-3, "{x:?}");
    }

    #[test]
    fn the_first_step_has_the_size_of_the_rate() {
        let params = params(&[0.0]);
        step(&mut AdamW::new(&params, 0.0), &params, &[&[123.0]], 0.01, 1.0);
        let x = params.values().unwrap();
        assert!((x[0] + 0.01).abs() < 1e-6, "{}", x[0]);
    }

    #[test]
    fn shards_are_summed_over_all_blocks() {
        let count = 2 * BLOCK + 17;
        let gradients: Vec<Vec<f32>> =
            (0..2).map(|s| (0..count).map(|k| libm::sinf((k * k + s) as f32)).collect()).collect();
        let mean: Vec<f32> =
            gradients[0].iter().zip(&gradients[1]).map(|(a, b)| 0.5 * (a + b)).collect();
        let (apart, together) = (params(&vec![1.0; count]), params(&vec![1.0; count]));
        let (mut a, mut b) = (AdamW::new(&apart, 0.1), AdamW::new(&together, 0.1));
        for _ in 0..3 {
            let norm = step(&mut a, &apart, &[&gradients[0], &gradients[1]], 0.01, 1.0);
            let wanted = step(&mut b, &together, &[&mean], 0.01, 1.0);
            let exact = mean.iter().map(|g| (*g as f64).powi(2)).sum::<f64>().sqrt() as f32;
            assert!((norm - wanted).abs() < 1e-4 * exact && (norm - exact).abs() < 1e-4 * exact);
        }
        let pairs = apart.values().unwrap().into_iter().zip(together.values().unwrap());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        let params = params(&[0.5, 0.25]);
        let mut adam = AdamW::new(&params, 0.0);
        assert!(step(&mut adam, &params, &[&[f32::NAN, 1.0]], 0.01, 1.0).is_nan());
        assert_eq!(params.values().unwrap(), [0.5, 0.25]);
        assert_eq!((adam.steps, adam.taken, adam.first), (0, vec![0], vec![0.0; 2]));
    }

    #[test]
    fn who_joins_late_takes_a_first_step_of_the_size_of_the_rate() {
        let mut params = params(&[3.0]);
        params.add("y", &[1], vec![2.0]).unwrap();
        let mut adam = AdamW::new(&params, 0.0);
        for takes_part in [false, false, false, true] {
            let gradient = || Some(Tensor::from_slice(&[5.0f32], 1, &Device::Cpu).unwrap());
            let of_params = vec![gradient(), takes_part.then(gradient).flatten()];
            let shards = vec![(1.0, Gradient { loss: 0.0, of_params })];
            adam.step(&params, &Gradients { shards }, 0.01, 1e9, 2).unwrap();
        }
        let x = params.values().unwrap();
        assert!((x[0] - 2.96).abs() < 1e-5 && (x[1] - 1.99).abs() < 1e-5, "{x:?}");
        assert_eq!((adam.steps, adam.taken), (4, vec![4, 1]));
    }
}
