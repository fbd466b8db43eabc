//! Trainable parameters: named tensors shared between threads, with separate gradient accumulators per
//! thread.

use crate::nn::ops::grad_accumulator::GradAccumulator;
use anyhow::Result;
use candle_core::backprop::GradStore;
use candle_core::{Device, Tensor, Var};
use half::f16;
use rand_chacha::ChaCha8Rng;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use std::collections::{BTreeMap, HashMap};

/// Named parameters, sorted by name.
#[derive(Default)]
pub struct Params {
    vars: BTreeMap<String, Var>,
    /// Gradient accumulators by parameter name; empty outside of [`Params::with_accumulators`].
    accumulators: BTreeMap<String, GradAccumulator>,
}

impl Params {
    /// Adds layers `name.0`, `name.1`, ... of the given widths. Weights are normal with variance 1 / inputs,
    /// biases zero; the weights of the last layer are scaled by `last`.
    pub fn add_mlp(
        &mut self,
        name: &str,
        widths: &[usize],
        last: f32,
        rng: &mut ChaCha8Rng,
    ) -> Result<()> {
        for (layer, pair) in widths.windows(2).enumerate() {
            let (inputs, outputs) = (pair[0], pair[1]);
            let is_last = layer + 2 == widths.len();
            let std = if is_last { last } else { 1.0 } / (inputs as f32).sqrt();
            let draw = |_| scene::depth_noise::normal_pair(rng).0 * std;
            let weight: Vec<f32> = (0..inputs * outputs).map(draw).collect();
            self.add(&format!("{name}.{layer}.weight"), &[inputs, outputs], weight)?;
            self.add(&format!("{name}.{layer}.bias"), &[outputs], vec![0.0; outputs])?;
        }
        Ok(())
    }

    /// Adds a parameter with the given shape and values.
    pub fn add(&mut self, name: &str, shape: &[usize], values: Vec<f32>) -> Result<()> {
        let tensor = Tensor::from_vec(values, shape, &Device::Cpu)?;
        self.vars.insert(name.to_owned(), Var::from_tensor(&tensor)?);
        Ok(())
    }

    /// The parameter `name` as a tensor; fails if there is none.
    pub fn tensor(&self, name: &str) -> candle_core::Result<&Tensor> {
        match self.vars.get(name) {
            Some(var) => Ok(var.as_tensor()),
            None => candle_core::bail!("no parameter named {name}"),
        }
    }

    /// The same parameters with new gradient accumulators, for a backward pass on one thread.
    pub fn with_accumulators(&self) -> Self {
        let accumulators =
            self.vars.keys().map(|name| (name.clone(), GradAccumulator::default())).collect();
        Self { vars: self.vars.clone(), accumulators }
    }

    /// A weight and its gradient accumulator, if any. With an accumulator, the weight is detached from
    /// automatic differentiation.
    pub(crate) fn weight(
        &self,
        name: &str,
    ) -> candle_core::Result<(Tensor, Option<GradAccumulator>)> {
        let weight = self.tensor(name)?;
        Ok(match self.accumulators.get(name) {
            Some(accumulator) => (weight.detach(), Some(accumulator.clone())),
            None => (weight.clone(), None),
        })
    }

    /// Names of the parameters, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.vars.keys().map(String::as_str)
    }

    /// Total number of values in all parameters.
    pub fn count(&self) -> usize {
        self.vars.values().map(|var| var.elem_count()).sum()
    }

    /// Values of all parameters, concatenated in parameter order.
    pub fn values(&self) -> Result<Vec<f32>> {
        let mut values = Vec::with_capacity(self.count());
        for var in self.vars.values() {
            values.extend(var.flatten_all()?.to_vec1::<f32>()?);
        }
        Ok(values)
    }

    /// Sets the values of all parameters, concatenated in parameter order.
    pub fn set_values(&self, values: &[f32]) -> Result<()> {
        let mut rest = values;
        for var in self.vars.values() {
            let (head, tail) = rest.split_at(var.elem_count());
            var.set(&Tensor::from_slice(head, var.shape(), &Device::Cpu)?)?;
            rest = tail;
        }
        Ok(())
    }

    /// Gradient of each parameter after a backward pass; `None` if the loss does not depend on it.
    pub fn gradients(&self, store: &GradStore) -> candle_core::Result<Vec<Option<Tensor>>> {
        let gradient = |(name, var): (&String, &Var)| {
            let accumulated =
                self.accumulators.get(name).map_or(Ok(None), GradAccumulator::take)?;
            Ok(accumulated.or_else(|| store.get(var).cloned()))
        };
        self.vars.iter().map(gradient).collect()
    }

    /// Iterates over the parameters, sorted by name.
    pub(crate) fn vars(&self) -> impl Iterator<Item = &Var> {
        self.vars.values()
    }

    /// Parameters rounded to `bits` mantissa bits, up to 22.
    pub fn round_mantissa(&self, bits: u32) -> Result<Self> {
        let mut rounded = Self::default();
        for (name, var) in &self.vars {
            let values = var.flatten_all()?.to_vec1::<f32>()?;
            let values = values.into_iter().map(|x| round_mantissa(x, bits)).collect();
            rounded.add(name, var.dims(), values)?;
        }
        Ok(rounded)
    }

    /// Safetensors file with the parameters in half precision and the tensors `more` in single precision.
    pub fn export(&self, more: &[(&str, Vec<usize>, &[f32])]) -> Result<Vec<u8>> {
        let halves = |values: &[f32]| -> Vec<u8> {
            values.iter().flat_map(|&x| f16::from_f32(x).to_le_bytes()).collect()
        };
        let mut data = BTreeMap::new();
        for (name, var) in &self.vars {
            let bytes = halves(&var.flatten_all()?.to_vec1::<f32>()?);
            data.insert(name.clone(), (Dtype::F16, var.dims().to_vec(), bytes));
        }
        for (name, shape, values) in more {
            let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
            data.insert((*name).to_owned(), (Dtype::F32, shape.clone(), bytes));
        }
        let views = data
            .iter()
            .map(|(name, (dtype, shape, bytes))| {
                Ok((name.as_str(), TensorView::new(*dtype, shape.clone(), bytes)?))
            })
            .collect::<Result<BTreeMap<_, _>>>()?;
        Ok(safetensors::serialize(views, None::<HashMap<String, String>>)?)
    }

    /// Sets all parameters from a safetensors file with tensors of the same names, in half or single
    /// precision.
    pub fn restore(&self, bytes: &[u8]) -> Result<()> {
        let tensors = policy::weights::Tensors::parse(bytes)?;
        for (name, var) in &self.vars {
            let values = tensors.get(name, var.dims())?;
            var.set(&Tensor::from_vec(values, var.shape(), &Device::Cpu)?)?;
        }
        Ok(())
    }

    /// Safetensors file with the parameters in single precision, for [`Params::restore`].
    pub fn save(&self) -> Result<Vec<u8>> {
        let mut rows = Vec::new();
        for (name, var) in &self.vars {
            rows.push((name.as_str(), var.dims().to_vec(), var.flatten_all()?.to_vec1::<f32>()?));
        }
        let rows: Vec<_> = rows.iter().map(|(n, s, x)| (*n, s.clone(), x.as_slice())).collect();
        files::tensors::encode(&rows, None)
    }
}

/// Rounds to the nearest number with `bits` mantissa bits, ties to even.
fn round_mantissa(x: f32, bits: u32) -> f32 {
    let dropped = f32::MANTISSA_DIGITS - 1 - bits;
    let (unit, raw) = (1 << dropped, x.to_bits());
    let to_even = unit / 2 - 1 + (raw / unit) % 2;
    f32::from_bits((raw + to_even) / unit * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mantissa_is_rounded_to_nearest() {
        assert_eq!(round_mantissa(1.0 + 1.0 / 128.0, 6), 1.0);
        assert_eq!(round_mantissa(1.0 + 3.0 / 128.0, 6), 1.0 + 2.0 / 64.0);
        assert_eq!(round_mantissa(-1.999, 6), -2.0);
        assert_eq!(round_mantissa(0.0, 6), 0.0);
        let mut params = Params::default();
        let wave: Vec<f32> = (1..2000).map(|k| 0.3 * libm::sinf((k * k) as f32)).collect();
        params.add("w", &[wave.len()], wave.clone()).unwrap();
        let rounded = params.round_mantissa(6).unwrap().values().unwrap();
        for (x, y) in wave.iter().zip(&rounded) {
            assert!((x - y).abs() <= x.abs() / 128.0, "{x} rounded to {y}");
            assert_eq!(y.to_bits() % (1 << 17), 0);
        }
    }
}
