//! The autoencoder on a batch; the twin of `policy::encoder`.

use super::pool::Largest;
use super::{Params, dense, mlp};
use crate::moments::MOMENTS;
use anyhow::Result;
use candle_core::{D, Device, Tensor};
use geometry::Vec3;
use policy::encoder::{
    CENTERS, CLOUD, DECODER_WIDTHS, GLOBAL_WIDTHS, LATENT, LOCAL_WIDTHS, NEIGHBORS, READOUT_WIDTHS,
    RELU, global_position, local_input, neighborhoods,
};
use rand_chacha::ChaCha8Rng;

/// Adds fresh parameters of encoder and decoder.
pub fn init(params: &mut Params, rng: &mut ChaCha8Rng) -> Result<()> {
    params.add_mlp("encoder.local", &LOCAL_WIDTHS, 1.0, rng)?;
    params.add_mlp("encoder.global", &GLOBAL_WIDTHS, 1.0, rng)?;
    params.add_mlp("encoder.readout", &READOUT_WIDTHS, 1.0, rng)?;
    params.add_mlp("decoder", &DECODER_WIDTHS, 1.0, rng)
}

/// Adds fresh parameters of the read-out that only training needs.
pub fn init_moments(params: &mut Params, rng: &mut ChaCha8Rng) -> Result<()> {
    params.add_mlp("moments", &[LATENT, MOMENTS], 1.0, rng)
}

/// Numbers as points.
pub fn points(cloud: &[f32]) -> Vec<Vec3> {
    cloud.chunks_exact(3).map(|p| Vec3::new(p[0], p[1], p[2])).collect()
}

/// z of each cloud, shape (B, LATENT), not standardised.
pub fn encode(params: &Params, clouds: &[&[f32]]) -> Result<Tensor> {
    let batch = clouds.len();
    let mut local = Vec::with_capacity(batch * CENTERS * NEIGHBORS * 6);
    let mut places = Vec::with_capacity(batch * CENTERS * 3);
    for cloud in clouds {
        let points = points(cloud);
        for (center, neighbors) in points.iter().zip(neighborhoods(&points)) {
            for i in neighbors {
                local.extend(local_input(*center, points[i]));
            }
            places.extend(global_position(*center));
        }
    }
    let rows = batch * CENTERS;
    let local = Tensor::from_vec(local, (rows * NEIGHBORS, LOCAL_WIDTHS[0]), &Device::Cpu)?;
    let local = activated(&local, params, "encoder.local", LOCAL_WIDTHS.len() - 1)?;
    let local = local.reshape((rows, NEIGHBORS, LOCAL_WIDTHS[2]))?.apply_op1(Largest)?;
    let places = Tensor::from_vec(places, (rows, 3), &Device::Cpu)?;
    let global = Tensor::cat(&[local, places], D::Minus1)?;
    let global = activated(&global, params, "encoder.global", GLOBAL_WIDTHS.len() - 1)?;
    let global = global.reshape((batch, CENTERS, GLOBAL_WIDTHS[2]))?.apply_op1(Largest)?;
    Ok(mlp(&global, params, "encoder.readout", READOUT_WIDTHS.len() - 1, RELU)?)
}

/// Layers with the activation after the last one too.
fn activated(x: &Tensor, params: &Params, name: &str, count: usize) -> Result<Tensor> {
    let mut h = x.clone();
    for layer in 0..count {
        h = dense(&h, params, &format!("{name}.{layer}"), Some(RELU))?;
    }
    Ok(h)
}

/// The clouds that `z` stands for, shape (B, CLOUD, 3), in units of the workspace.
pub fn decode(params: &Params, z: &Tensor) -> Result<Tensor> {
    let batch = z.dims()[0];
    let flat = mlp(z, params, "decoder", DECODER_WIDTHS.len() - 1, RELU)?;
    Ok(flat.reshape((batch, CLOUD, 3))?.contiguous()?)
}

/// The moments of the whole surfaces that `z` tells, shape (B, MOMENTS): a linear read-out.
pub fn moments(params: &Params, z: &Tensor) -> Result<Tensor> {
    Ok(mlp(z, params, "moments", 1, RELU)?)
}

/// The clouds as targets of [`decode`].
pub fn targets(clouds: &[&[f32]]) -> Result<Tensor> {
    let flat: Vec<f32> = clouds
        .iter()
        .flat_map(|cloud| points(cloud).into_iter().flat_map(global_position).collect::<Vec<_>>())
        .collect();
    Ok(Tensor::from_vec(flat, (clouds.len(), CLOUD, 3), &Device::Cpu)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_twin_agrees_with_the_encoder_that_runs() {
        let mut params = Params::default();
        init(&mut params, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let rounded: Vec<f32> =
            params.values().unwrap().iter().map(|&x| half::f16::from_f32(x).to_f32()).collect();
        params.set_values(&rounded).unwrap();
        let bytes = params.export(&policy::Whitening::identity().tensors()).unwrap();
        let tensors = policy::weights::Tensors::parse(&bytes).unwrap();
        let runs = policy::Encoder::load(&tensors).unwrap();
        let cloud: Vec<f32> =
            (0..3 * CLOUD).map(|k| 0.5 + 0.1 * libm::sinf((k * k) as f32)).collect();
        let got = encode(&params, &[&cloud]).unwrap().to_vec2::<f32>().unwrap();
        let wanted = runs.raw(&points(&cloud)).unwrap();
        let size = wanted.iter().map(|x| x.abs()).fold(0.0, f32::max);
        for (got, wanted) in got[0].iter().zip(&wanted) {
            assert!((got - wanted).abs() < 1e-4 * size, "{got} against {wanted}");
        }
    }
}
