//! Whitening of z: principal axes, each scaled to unit variance, so that all axes have equal weight.

use crate::LATENT_DIM;
use crate::weights::{Tensors, WeightsError};

/// An affine map of z, and its inverse.
#[derive(Clone, Debug)]
pub struct Whitening {
    /// Mean of z.
    pub mean: Vec<f32>,
    /// Principal axes as rows, shape (LATENT_DIM, LATENT_DIM).
    pub axes: Vec<f32>,
    /// Standard deviation along each axis.
    pub scale: Vec<f32>,
}

impl Whitening {
    /// The identity map.
    pub fn identity() -> Self {
        let axes =
            (0..LATENT_DIM * LATENT_DIM).map(|k| f32::from(k % (LATENT_DIM + 1) == 0)).collect();
        Self { mean: vec![0.0; LATENT_DIM], axes, scale: vec![1.0; LATENT_DIM] }
    }

    /// Loads `latent.mean`, `latent.axes` and `latent.scale`.
    pub fn load(tensors: &Tensors) -> Result<Self, WeightsError> {
        let scale: Vec<f32> = tensors.get("latent.scale", &[LATENT_DIM])?;
        // The scale is a divisor.
        if let Some(scale) = scale.iter().find(|scale| **scale <= 0.0) {
            let (name, value) = ("latent.scale".to_owned(), scale.to_string());
            return Err(WeightsError::InvalidValue { name, value });
        }
        Ok(Self {
            mean: tensors.get("latent.mean", &[LATENT_DIM])?,
            axes: tensors.get("latent.axes", &[LATENT_DIM, LATENT_DIM])?,
            scale,
        })
    }

    /// Names, shapes and values of the tensors that [`Whitening::load`] reads.
    pub fn tensors(&self) -> [(&'static str, Vec<usize>, &[f32]); 3] {
        [
            ("latent.mean", vec![LATENT_DIM], &self.mean),
            ("latent.axes", vec![LATENT_DIM, LATENT_DIM], &self.axes),
            ("latent.scale", vec![LATENT_DIM], &self.scale),
        ]
    }

    /// Maps z of the encoder to whitened z.
    pub fn apply(&self, z: &[f32]) -> Vec<f32> {
        let centered: Vec<f32> = z.iter().zip(&self.mean).map(|(z, mean)| z - mean).collect();
        let along = |axis: &[f32]| axis.iter().zip(&centered).map(|(a, z)| a * z).sum::<f32>();
        let axes = self.axes.chunks_exact(LATENT_DIM);
        axes.zip(&self.scale).map(|(axis, scale)| along(axis) / scale).collect()
    }

    /// Maps whitened z back to z of the encoder.
    pub fn inverse(&self, white: &[f32]) -> Vec<f32> {
        let mut z = self.mean.clone();
        let axes = self.axes.chunks_exact(LATENT_DIM);
        for ((axis, scale), white) in axes.zip(&self.scale).zip(white) {
            z.iter_mut().zip(axis).for_each(|(z, a)| *z += white * scale * a);
        }
        z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_restores_z() {
        let mut whitening = Whitening::identity();
        // A rotation in the plane of the first two axes.
        let (sin, cos) = libm::sincosf(0.7);
        whitening.axes[..2].copy_from_slice(&[cos, sin]);
        whitening.axes[LATENT_DIM..LATENT_DIM + 2].copy_from_slice(&[-sin, cos]);
        whitening.mean = (0..LATENT_DIM).map(|i| libm::sinf(i as f32)).collect();
        whitening.scale = (0..LATENT_DIM).map(|i| 0.1 + i as f32).collect();
        let z: Vec<f32> = (0..LATENT_DIM).map(|i| libm::cosf(3.0 * i as f32)).collect();
        let white = whitening.apply(&z);
        let wanted = cos * (z[0] - whitening.mean[0]) + sin * (z[1] - whitening.mean[1]);
        assert!((white[0] * 0.1 - wanted).abs() < 1e-6, "the first axis is rotated");
        for (back, z) in whitening.inverse(&white).iter().zip(&z) {
            assert!((back - z).abs() < 1e-5, "{back} against {z}");
        }
    }

    #[test]
    fn axis_without_variance_is_rejected() {
        let mut whitening = Whitening::identity();
        let loaded = |whitening: &Whitening| {
            let tensors = whitening.tensors();
            let bytes = tensors.each_ref().map(|(_, _, values)| -> Vec<u8> {
                values.iter().flat_map(|x| x.to_le_bytes()).collect()
            });
            let views = tensors.iter().zip(&bytes).map(|((name, shape, _), bytes)| {
                let view = safetensors::tensor::TensorView::new(
                    safetensors::Dtype::F32,
                    shape.clone(),
                    bytes,
                );
                (*name, view.unwrap())
            });
            let file = safetensors::serialize(views, None).unwrap();
            Whitening::load(&Tensors::parse(&file).unwrap())
        };
        assert!(loaded(&whitening).is_ok());
        whitening.scale[3] = 0.0;
        let error = loaded(&whitening).unwrap_err().to_string();
        assert!(error.contains("latent.scale = 0"), "{error}");
    }
}
