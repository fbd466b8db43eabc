//! Layer y = f(xW + b) as one operation with its gradient, without separate memory passes for bias and
//! activation.

use crate::nn::ops::grad_accumulator::{GradAccumulator, accumulate_product};
use crate::nn::ops::matmul_nt::matmul_nt;
use crate::nn::ops::storage::{contiguous, with_values};
use candle_core::backend::BackendStorage;
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor};
use policy::networks::mlp::Activation;
use policy::simd::with_simd;

/// Layer with activation: x (N, inputs), W (inputs, outputs), b (outputs) to y (N, outputs).
pub struct LinearAct {
    /// Activation f; `None` means y = xW + b.
    pub activation: Option<Activation>,
    /// Accumulator for the gradient of W; without one the gradient is returned to candle's backward pass.
    pub accumulator: Option<GradAccumulator>,
}

impl LinearAct {
    /// f' as a function of the activated value y.
    #[inline(always)]
    fn derivative(&self, y: f32) -> f32 {
        match self.activation {
            None => 1.0,
            Some(Activation::Elu) => y.min(0.0) + 1.0,
            Some(Activation::Relu) => f32::from(y > 0.0),
        }
    }
}

/// Replaces y by f(y + b) in each row.
#[inline(always)]
fn apply(f: impl Fn(f32) -> f32, y: &mut [f32], bias: &[f32]) {
    for row in y.chunks_exact_mut(bias.len()) {
        for (y, b) in row.iter_mut().zip(bias) {
            *y = f(*y + b);
        }
    }
}

#[inline(always)]
fn elu(y: f32) -> f32 {
    y.max(0.0) + (exp(y.min(0.0)) - 1.0)
}

#[inline(always)]
fn relu(y: f32) -> f32 {
    y.max(0.0)
}

/// e^x for x <= 0, accurate to a few units in the last place. Branch-free, so that loops over it are
/// vectorised.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Adding 1.5 x 2^23 rounds to an integer, stored in the low bits of the sum.
    const ROUND: f32 = 12_582_912.0;
    let x = x.max(-87.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    // ln 2, split into two parts for precision.
    let r = (x - n * 0.693_359_4) + n * 2.121_944_4e-4;
    let series = 1.0
        + r * (1.0
            + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r / 720.0)))));
    series * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()))
}

impl CustomOp3 for LinearAct {
    fn name(&self) -> &'static str {
        "linear-act"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let ((rows, inputs), outputs) = (x_layout.shape().dims2()?, bias_layout.dims()[0]);
        let sizes = (1, rows, outputs, inputs);
        let product = x.matmul(weight, sizes, x_layout, weight_layout)?;
        let CpuStorage::F32(mut y) = product else {
            candle_core::bail!("layers require f32 tensors")
        };
        let bias = contiguous(bias, bias_layout)?;
        with_simd(
            #[inline(always)]
            || match self.activation {
                None => apply(|y| y, &mut y, bias),
                Some(Activation::Elu) => apply(elu, &mut y, bias),
                Some(Activation::Relu) => apply(relu, &mut y, bias),
            },
        );
        Ok((CpuStorage::F32(y), Shape::from((rows, outputs))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        weight: &Tensor,
        bias: &Tensor,
        y: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let mut of_product = gradient.flatten_all()?.to_vec1::<f32>()?;
        let mut of_bias = vec![0.0; bias.elem_count()];
        with_values(y, |y| {
            let rows = of_product.chunks_exact_mut(of_bias.len());
            let rows = rows.zip(y.chunks_exact(of_bias.len()));
            with_simd(
                #[inline(always)]
                || {
                    for (row, y) in rows {
                        for ((g, y), b) in row.iter_mut().zip(y).zip(&mut of_bias) {
                            *g *= self.derivative(*y);
                            *b += *g;
                        }
                    }
                },
            );
        })?;
        let of_product = Tensor::from_vec(of_product, gradient.shape(), x.device())?;
        // The inputs of the network need no gradient.
        let of_x = if x.track_op() { Some(matmul_nt(&of_product, weight)?) } else { None };
        let of_weight = accumulate_product(self.accumulator.as_ref(), x, &of_product)?;
        let of_bias = Tensor::from_vec(of_bias, bias.shape(), x.device())?;
        Ok((of_x, of_weight, Some(of_bias)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    fn wave(count: usize, shift: f32) -> Vec<f32> {
        (0..count).map(|k| libm::sinf((k * k) as f32 + shift)).collect()
    }

    #[test]
    fn exp_is_accurate_to_single_precision() {
        for k in 0..=8_800 {
            let x = -0.01 * k as f32;
            let (got, expected) = (exp(x), libm::expf(x.max(-87.0)));
            assert!(
                (got - expected).abs() <= 3e-7 * expected,
                "e^{x}: got {got}, expected {expected}"
            );
        }
        assert_eq!(exp(0.0), 1.0);
    }

    #[test]
    fn linear_act_matches_the_inference_layer() {
        let half: Vec<half::f16> = wave(35, 0.0).into_iter().map(half::f16::from_f32).collect();
        let weight: Vec<f32> = half.iter().map(|w| w.to_f32()).collect();
        let layer = policy::networks::mlp::Dense { weight: half, bias: wave(5, 1.0) };
        let x = wave(7, 2.0);
        let tensor = |v: &[f32], shape: &[usize]| Tensor::from_slice(v, shape, &Device::Cpu);
        let (tx, w, b) = (
            tensor(&x, &[1, 7]).unwrap(),
            tensor(&weight, &[7, 5]).unwrap(),
            tensor(&layer.bias, &[5]).unwrap(),
        );
        for activation in [None, Some(Activation::Elu), Some(Activation::Relu)] {
            let f = |y: f32| activation.map_or(y, |activation| activation.apply(y));
            let got = tx.apply_op3(&w, &b, LinearAct { activation, accumulator: None }).unwrap();
            let got = got.to_vec2::<f32>().unwrap();
            for (got, y) in got[0].iter().zip(layer.apply(&x)) {
                assert!((got - f(y)).abs() < 1e-6, "got {got}, expected {}", f(y));
            }
        }
    }
}
