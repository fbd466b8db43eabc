//! Backward pass of ELU as a differentiable operation, with its own gradient.

use crate::nn::ops::storage::{contiguous, with_values};
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};
use policy::simd::with_simd;

/// g ⊙ f'(x) for f = ELU, computed from h = f(x): f'(x) = e^x = h + 1 for x < 0, else 1. g and h have equal
/// shapes.
pub struct EluBackward;

impl CustomOp2 for EluBackward {
    fn name(&self) -> &'static str {
        "elu-backward"
    }

    fn cpu_fwd(
        &self,
        g: &CpuStorage,
        g_layout: &Layout,
        h: &CpuStorage,
        h_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (g, h) = (contiguous(g, g_layout)?, contiguous(h, h_layout)?);
        let mut out = g.to_vec();
        with_simd(
            #[inline(always)]
            || {
                for (out, h) in out.iter_mut().zip(h) {
                    *out *= h.min(0.0) + 1.0;
                }
            },
        );
        Ok((CpuStorage::F32(out), g_layout.shape().clone()))
    }

    fn bwd(
        &self,
        g: &Tensor,
        h: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let flat = |tensor: &Tensor| tensor.flatten_all()?.to_vec1::<f32>();
        let (mut of_g, mut of_h) = (flat(gradient)?, flat(g)?);
        with_values(h, |h| {
            with_simd(
                #[inline(always)]
                || {
                    for ((of_g, of_h), h) in of_g.iter_mut().zip(&mut of_h).zip(h) {
                        *of_h = if *h < 0.0 { *of_h * *of_g } else { 0.0 };
                        *of_g *= h.min(0.0) + 1.0;
                    }
                },
            );
        })?;
        let tensor = |values| Tensor::from_vec(values, g.shape(), g.device());
        Ok((Some(tensor(of_g)?), Some(tensor(of_h)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn elu_backward_matches_candle_with_its_gradient() {
        let wave = |by: f32| -> Vec<f32> { (0..40).map(|k| libm::sinf(by * k as f32)).collect() };
        let var = |by| Var::from_vec(wave(by), (5, 8), &Device::Cpu).unwrap();
        let (g, x, upstream) = (var(0.7), var(1.9), var(0.3));
        let h = x.elu(1.0).unwrap();
        let ours = g.apply_op2(&h, EluBackward).unwrap();
        // e^min(x, 0), with candle's own operations.
        let reference = (g.as_tensor() * x.minimum(0f64).unwrap().exp().unwrap()).unwrap();
        let max_error = |a: &Tensor, b: &Tensor| {
            let error = (a - b).unwrap().abs().unwrap().max_all().unwrap();
            error.to_scalar::<f32>().unwrap()
        };
        assert!(max_error(&ours, &reference) < 1e-6);
        let store = |y: &Tensor| {
            let weighted = (y * upstream.as_tensor()).unwrap();
            weighted.sum_all().unwrap().backward().unwrap()
        };
        let (ours, reference) = (store(&ours), store(&reference));
        for var in [&g, &x] {
            assert!(max_error(ours.get(var).unwrap(), reference.get(var).unwrap()) < 1e-6);
        }
    }
}
