//! The encoder as it was trained: what a policy is told of clouds.

use crate::autoencoder::{encode_all, to_front};
use crate::nn::{Params, autoencoder as twin};
use anyhow::{Context, Result};
use geometry::Vec3;
use policy::encoder::cloud_of;
use policy::weights::Tensors;
use policy::{Encoding, Observation, Whitening, network};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// A trained encoder with the whitening of its z.
pub struct TrainedEncoder {
    /// Weights of encoder and decoder.
    pub params: Params,
    pub(crate) whitening: Whitening,
}

impl TrainedEncoder {
    /// Reads what [`crate::autoencoder::train`] wrote.
    pub fn load(dir: &Path) -> Result<Self> {
        let read = |file: &str| {
            std::fs::read(dir.join(file)).with_context(|| {
                format!("{} has no {file}; train the encoder first", dir.display())
            })
        };
        let mut params = Params::default();
        twin::init(&mut params, &mut ChaCha8Rng::seed_from_u64(0))?;
        params.restore(&read("encoder.safetensors")?)?;
        let bytes = read("latent.safetensors")?;
        let whitening = Whitening::load(&Tensors::parse(&bytes)?)?;
        Ok(Self { params, whitening })
    }

    /// The encoder of a model, from its weights.
    pub fn of_model(weights: &[u8]) -> Result<Self> {
        let mut params = Params::default();
        twin::init(&mut params, &mut ChaCha8Rng::seed_from_u64(0))?;
        params.restore(weights)?;
        Ok(Self { params, whitening: Whitening::load(&Tensors::parse(weights)?)? })
    }

    /// Names its weights.
    pub fn hash(&self) -> Result<String> {
        let weights = self.params.export(&self.whitening.tensors())?;
        Ok(blake3::hash(&weights).to_hex().to_string())
    }

    /// What the decoder makes of a cloud that has been turned to the front.
    pub fn reconstruct(&self, front: &[Vec3]) -> Result<Vec<Vec3>> {
        let flat: Vec<f32> = front.iter().flat_map(|p| p.to_array()).collect();
        let made = twin::decode(&self.params, &twin::encode(&self.params, &[&flat])?)?;
        Ok(cloud_of(&made.flatten_all()?.to_vec1::<f32>()?))
    }

    /// What a policy is told of clouds (base frame).
    pub(crate) fn observe(
        &self,
        observation: Observation,
        clouds: &[Vec<f32>],
    ) -> Result<Vec<Encoding>> {
        match observation {
            Observation::Cloud => self.encode(clouds),
            Observation::Position => Ok(clouds
                .iter()
                .map(|cloud| {
                    let (bearing, front) = policy::encoding::to_front(&twin::points(cloud));
                    Encoding { bearing, z: network::position(&front) }
                })
                .collect()),
        }
    }

    /// Encodes clouds (base frame).
    pub fn encode(&self, clouds: &[Vec<f32>]) -> Result<Vec<Encoding>> {
        let (bearings, front): (Vec<f64>, Vec<Vec<f32>>) =
            clouds.iter().map(|cloud| to_front(cloud)).unzip();
        let latents = encode_all(&self.params, &front)?;
        let encoding =
            |(bearing, z): (f64, &Vec<f32>)| Encoding { bearing, z: self.whitening.apply(z) };
        Ok(bearings.into_iter().zip(&latents).map(encoding).collect())
    }
}
