//! Trained encoder: computes observations from clouds.

use crate::nn::Params;
use crate::nn::networks::autoencoder as net;
use crate::train::autoencoder::{canonicalize, encode_all};
use anyhow::{Context, Result};
use geometry::Vec3;
use policy::encoder::points_from_output;
use policy::weights::Tensors;
use policy::{Observation, ObservationKind, Whitening};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// A trained autoencoder with the whitening of its latent z.
pub struct TrainedEncoder {
    /// Weights of encoder and decoder (single precision).
    pub params: Params,
    pub(crate) whitening: Whitening,
}

impl TrainedEncoder {
    /// Reads the output folder of [`crate::train::autoencoder::train`].
    pub fn load(dir: &Path) -> Result<Self> {
        let read = |file: &str| {
            std::fs::read(dir.join(file)).with_context(|| {
                format!("{} has no {file}; run `ngf train encoder` first", dir.display())
            })
        };
        let mut params = Params::default();
        net::init(&mut params, &mut ChaCha8Rng::seed_from_u64(0))?;
        params.restore(&read("encoder.safetensors")?)?;
        let bytes = read("latent.safetensors")?;
        let whitening = Whitening::load(&Tensors::parse(&bytes)?)?;
        Ok(Self { params, whitening })
    }

    /// Reads the encoder from a model's `weights.safetensors`.
    pub fn from_model(weights: &[u8]) -> Result<Self> {
        let mut params = Params::default();
        net::init(&mut params, &mut ChaCha8Rng::seed_from_u64(0))?;
        params.restore(weights)?;
        Ok(Self { params, whitening: Whitening::load(&Tensors::parse(weights)?)? })
    }

    /// Hash of the exported weights and whitening.
    pub fn hash(&self) -> Result<String> {
        let weights = self.params.export(&self.whitening.tensors())?;
        Ok(blake3::hash(&weights).to_hex().to_string())
    }

    /// Reconstructs a cloud (m, canonical frame): encode, then decode.
    pub fn reconstruct(&self, canonical: &[Vec3]) -> Result<Vec<Vec3>> {
        let flat: Vec<f32> = canonical.iter().flat_map(|p| p.to_array()).collect();
        let decoded = net::decode(&self.params, &net::encode(&self.params, &[&flat])?)?;
        Ok(points_from_output(&decoded.flatten_all()?.to_vec1::<f32>()?))
    }

    /// Observation of each cloud (base frame), for a policy with this observation kind.
    pub(crate) fn observe(
        &self,
        observation: ObservationKind,
        clouds: &[Vec<f32>],
    ) -> Result<Vec<Observation>> {
        let latents = match observation.has_latent() {
            true => self.encode(clouds)?.into_iter().map(|encoding| encoding.latent).collect(),
            false => vec![Vec::new(); clouds.len()],
        };
        let observe = |(cloud, z): (&Vec<f32>, Vec<f32>)| {
            let (azimuth, canonical) = policy::observation::canonicalize(&net::to_points(cloud));
            Observation { azimuth, latent: observation.values(z, &canonical) }
        };
        Ok(clouds.iter().zip(latents).map(observe).collect())
    }

    /// Encodes clouds (base frame) into azimuth and whitened z.
    pub fn encode(&self, clouds: &[Vec<f32>]) -> Result<Vec<Observation>> {
        let (azimuths, canonical): (Vec<f64>, Vec<Vec<f32>>) =
            clouds.iter().map(|cloud| canonicalize(cloud)).unzip();
        let latents = encode_all(&self.params, &canonical)?;
        let encoding = |(azimuth, z): (f64, &Vec<f32>)| Observation {
            azimuth,
            latent: self.whitening.apply(z),
        };
        Ok(azimuths.into_iter().zip(&latents).map(encoding).collect())
    }
}
