//! Batched Fourier features and their vector-Jacobian product; counterpart of `policy::networks::fourier`.

use crate::nn::ops::storage::{contiguous, with_values};
use candle_core::{CpuStorage, CustomOp1, Device, Layout, Result, Shape, Tensor};
use policy::networks::fourier::{NUM_FEATURES, NUM_FREQUENCIES, sin_cos};
use policy::simd::with_simd;

/// Cosines, then sines of the phases, shape (B, NUM_FEATURES). Constants for automatic differentiation.
#[derive(Clone)]
pub struct FeatureBatch(Tensor);

impl FeatureBatch {
    /// Features of phases (rad), shape (B, NUM_FREQUENCIES).
    pub fn from_phases(phases: &Tensor) -> Result<Self> {
        let mut features = vec![0.0; 2 * phases.elem_count()];
        with_values(phases, |phases| {
            let rows =
                features.chunks_exact_mut(NUM_FEATURES).zip(phases.chunks_exact(NUM_FREQUENCIES));
            with_simd(
                #[inline(always)]
                || {
                    for (row, phases) in rows {
                        let (cosines, sines) = row.split_at_mut(NUM_FREQUENCIES);
                        for ((cosine, sine), phase) in cosines.iter_mut().zip(sines).zip(phases) {
                            (*sine, *cosine) = sin_cos(*phase);
                        }
                    }
                },
            );
        })?;
        let shape = (features.len() / NUM_FEATURES, NUM_FEATURES);
        Ok(Self(Tensor::from_vec(features, shape, &Device::Cpu)?))
    }

    /// The features as a tensor, shape (B, NUM_FEATURES).
    pub fn tensor(&self) -> Tensor {
        self.0.clone()
    }

    /// Vector-Jacobian product: gradient with respect to the phases (B, NUM_FREQUENCIES) from the gradient
    /// with respect to the features (B, NUM_FEATURES).
    pub fn vjp(&self, of_features: &Tensor) -> Result<Tensor> {
        of_features.contiguous()?.apply_op1(FourierBackward(self.clone()))
    }
}

/// cos ⊙ ḡ_sin - sin ⊙ ḡ_cos, with ḡ the gradient with respect to the features.
struct FourierBackward(FeatureBatch);

impl CustomOp1 for FourierBackward {
    fn name(&self) -> &'static str {
        "fourier-backward"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let of_features = contiguous(storage, layout)?;
        let mut out = vec![0.0; of_features.len() / 2];
        with_values(&self.0.0, |features| {
            let rows =
                features.chunks_exact(NUM_FEATURES).zip(of_features.chunks_exact(NUM_FEATURES));
            let rows = rows.zip(out.chunks_exact_mut(NUM_FREQUENCIES));
            with_simd(
                #[inline(always)]
                || {
                    for ((features, gradient), out) in rows {
                        let (cosines, sines) = features.split_at(NUM_FREQUENCIES);
                        let (of_cosines, of_sines) = gradient.split_at(NUM_FREQUENCIES);
                        let terms = cosines.iter().zip(of_sines).zip(sines.iter().zip(of_cosines));
                        for (out, ((cosine, of_sine), (sine, of_cosine))) in
                            out.iter_mut().zip(terms)
                        {
                            *out = cosine * of_sine - sine * of_cosine;
                        }
                    }
                },
            );
        })?;
        let shape = Shape::from((out.len() / NUM_FREQUENCIES, NUM_FREQUENCIES));
        Ok((CpuStorage::F32(out), shape))
    }

    fn bwd(&self, arg: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let mut out = vec![0.0; 2 * gradient.elem_count()];
        with_values(&self.0.0, |features| {
            with_values(gradient, |gradient| {
                let rows =
                    features.chunks_exact(NUM_FEATURES).zip(out.chunks_exact_mut(NUM_FEATURES));
                let rows = rows.zip(gradient.chunks_exact(NUM_FREQUENCIES));
                with_simd(
                    #[inline(always)]
                    || {
                        for ((features, out), gradient) in rows {
                            let (cosines, sines) = features.split_at(NUM_FREQUENCIES);
                            let (of_cosines, of_sines) = out.split_at_mut(NUM_FREQUENCIES);
                            let out = of_cosines.iter_mut().zip(of_sines);
                            let features = cosines.iter().zip(sines);
                            for (((of_cosine, of_sine), (cosine, sine)), g) in
                                out.zip(features).zip(gradient)
                            {
                                (*of_cosine, *of_sine) = (-sine * g, cosine * g);
                            }
                        }
                    },
                );
            })
        })??;
        Ok(Some(Tensor::from_vec(out, arg.shape(), arg.device())?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Var;

    #[test]
    fn fourier_vjp_matches_candle() {
        let wave =
            |n: usize, by: f32| (0..n).map(|k| libm::sinf(by * k as f32)).collect::<Vec<_>>();
        let phases =
            Tensor::from_vec(wave(2 * NUM_FREQUENCIES, 0.7), (2, NUM_FREQUENCIES), &Device::Cpu);
        let phases = phases.unwrap();
        let features = FeatureBatch::from_phases(&phases).unwrap();
        let of_features =
            Var::from_vec(wave(2 * NUM_FEATURES, 1.3), (2, NUM_FEATURES), &Device::Cpu);
        let of_features = of_features.unwrap();
        let of_phases = features.vjp(&of_features).unwrap();
        // Reference with candle's own operations.
        let [cosines, sines] = [phases.cos().unwrap(), phases.sin().unwrap()];
        let both = Tensor::cat(&[&cosines, &sines], 1).unwrap();
        let max_error = |a: &Tensor, b: &Tensor| {
            let error = (a - b).unwrap().abs().unwrap().max_all().unwrap();
            error.to_scalar::<f32>().unwrap()
        };
        assert!(max_error(&features.tensor(), &both) < 1e-6);
        let part = |first| of_features.narrow(1, first, NUM_FREQUENCIES).unwrap();
        let expected =
            ((part(NUM_FREQUENCIES) * &cosines).unwrap() - (part(0) * &sines).unwrap()).unwrap();
        assert!(max_error(&of_phases, &expected) < 1e-6);
        let weights =
            Tensor::from_vec(wave(2 * NUM_FREQUENCIES, 0.2), (2, NUM_FREQUENCIES), &Device::Cpu);
        let weights = weights.unwrap();
        let gradient = |output: &Tensor| {
            let store = (output * &weights).unwrap().sum_all().unwrap().backward().unwrap();
            store.get(&of_features).unwrap().clone()
        };
        assert!(max_error(&gradient(&of_phases), &gradient(&expected)) < 1e-6);
    }
}
