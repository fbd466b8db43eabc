//! Fourier features on a batch, and back through them; the twin of `policy::fourier`.

use super::memory::{contiguous, read};
use candle_core::{CpuStorage, CustomOp1, Device, Layout, Result, Shape, Tensor};
use policy::fourier::{FEATURES, FREQUENCIES, sin_cos};
use policy::lanes::widest;

/// Cosines, then sines of phases, shape (B, FEATURES): constants of the tape.
#[derive(Clone)]
pub struct Features(Tensor);

impl Features {
    /// Of phases, shape (B, FREQUENCIES).
    pub fn of(phases: &Tensor) -> Result<Self> {
        let mut features = vec![0.0; 2 * phases.elem_count()];
        read(phases, |phases| {
            let rows = features.chunks_exact_mut(FEATURES).zip(phases.chunks_exact(FREQUENCIES));
            widest(
                #[inline(always)]
                || {
                    for (row, phases) in rows {
                        let (cosines, sines) = row.split_at_mut(FREQUENCIES);
                        for ((cosine, sine), phase) in cosines.iter_mut().zip(sines).zip(phases) {
                            (*sine, *cosine) = sin_cos(*phase);
                        }
                    }
                },
            );
        })?;
        let shape = (features.len() / FEATURES, FEATURES);
        Ok(Self(Tensor::from_vec(features, shape, &Device::Cpu)?))
    }

    /// As a tensor, shape (B, FEATURES).
    pub fn tensor(&self) -> Tensor {
        self.0.clone()
    }

    /// From a gradient with respect to the features (B, FEATURES) to that with respect to the phases
    /// (B, FREQUENCIES).
    pub fn pull_back(&self, of_features: &Tensor) -> Result<Tensor> {
        of_features.contiguous()?.apply_op1(PullBack(self.clone()))
    }
}

/// cos ⊙ ḡ_sin - sin ⊙ ḡ_cos.
struct PullBack(Features);

impl CustomOp1 for PullBack {
    fn name(&self) -> &'static str {
        "fourier-pull-back"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let of_features = contiguous(storage, layout)?;
        let mut out = vec![0.0; of_features.len() / 2];
        read(&self.0.0, |features| {
            let rows = features.chunks_exact(FEATURES).zip(of_features.chunks_exact(FEATURES));
            let rows = rows.zip(out.chunks_exact_mut(FREQUENCIES));
            widest(
                #[inline(always)]
                || {
                    for ((features, gradient), out) in rows {
                        let (cosines, sines) = features.split_at(FREQUENCIES);
                        let (of_cosines, of_sines) = gradient.split_at(FREQUENCIES);
                        let along = cosines.iter().zip(of_sines).zip(sines.iter().zip(of_cosines));
                        for (out, ((cosine, of_sine), (sine, of_cosine))) in
                            out.iter_mut().zip(along)
                        {
                            *out = cosine * of_sine - sine * of_cosine;
                        }
                    }
                },
            );
        })?;
        let shape = Shape::from((out.len() / FREQUENCIES, FREQUENCIES));
        Ok((CpuStorage::F32(out), shape))
    }

    fn bwd(&self, arg: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let mut out = vec![0.0; 2 * gradient.elem_count()];
        read(&self.0.0, |features| {
            read(gradient, |gradient| {
                let rows = features.chunks_exact(FEATURES).zip(out.chunks_exact_mut(FEATURES));
                let rows = rows.zip(gradient.chunks_exact(FREQUENCIES));
                widest(
                    #[inline(always)]
                    || {
                        for ((features, out), gradient) in rows {
                            let (cosines, sines) = features.split_at(FREQUENCIES);
                            let (of_cosines, of_sines) = out.split_at_mut(FREQUENCIES);
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
    fn pulling_back_is_the_transpose_of_pushing_forward() {
        let wave =
            |n: usize, by: f32| (0..n).map(|k| libm::sinf(by * k as f32)).collect::<Vec<_>>();
        let phases = Tensor::from_vec(wave(2 * FREQUENCIES, 0.7), (2, FREQUENCIES), &Device::Cpu);
        let phases = phases.unwrap();
        let features = Features::of(&phases).unwrap();
        let of_features = Var::from_vec(wave(2 * FEATURES, 1.3), (2, FEATURES), &Device::Cpu);
        let of_features = of_features.unwrap();
        let pulled = features.pull_back(&of_features).unwrap();
        // By candle's own operations.
        let [cosines, sines] = [phases.cos().unwrap(), phases.sin().unwrap()];
        let both = Tensor::cat(&[&cosines, &sines], 1).unwrap();
        let apart = |a: &Tensor, b: &Tensor| {
            let off = (a - b).unwrap().abs().unwrap().max_all().unwrap();
            off.to_scalar::<f32>().unwrap()
        };
        assert!(apart(&features.tensor(), &both) < 1e-6);
        let part = |first| of_features.narrow(1, first, FREQUENCIES).unwrap();
        let wanted =
            ((part(FREQUENCIES) * &cosines).unwrap() - (part(0) * &sines).unwrap()).unwrap();
        assert!(apart(&pulled, &wanted) < 1e-6);
        let weights = Tensor::from_vec(wave(2 * FREQUENCIES, 0.2), (2, FREQUENCIES), &Device::Cpu);
        let weights = weights.unwrap();
        let gradient = |made: &Tensor| {
            let store = (made * &weights).unwrap().sum_all().unwrap().backward().unwrap();
            store.get(&of_features).unwrap().clone()
        };
        assert!(apart(&gradient(&pulled), &gradient(&wanted)) < 1e-6);
    }
}
