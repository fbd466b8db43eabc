//! Batched autoencoder; counterpart of `policy::encoder`.

use crate::data::grasp_points::GRASP_DIM;
use crate::nn::ops::linear_max_pool::LinearMaxPool;
use crate::nn::{Params, linear, mlp};
use anyhow::Result;
use candle_core::{D, Device, Tensor};
use geometry::Vec3;
use objects::shape_moments::NUM_MOMENTS;
use policy::LATENT_DIM;
use policy::encoder::{
    CLOUD_POINTS, DECODER_WIDTHS, ENCODER_ACTIVATION, GLOBAL_WIDTHS, LOCAL_WIDTHS, NUM_CENTERS,
    NUM_NEIGHBORS, READOUT_WIDTHS, local_input, neighborhoods, normalized_position,
};
use rand_chacha::ChaCha8Rng;

/// Adds random initial parameters of encoder and decoder.
pub fn init(params: &mut Params, rng: &mut ChaCha8Rng) -> Result<()> {
    params.add_mlp("encoder.local", &LOCAL_WIDTHS, 1.0, rng)?;
    params.add_mlp("encoder.global", &GLOBAL_WIDTHS, 1.0, rng)?;
    params.add_mlp("encoder.readout", &READOUT_WIDTHS, 1.0, rng)?;
    params.add_mlp("decoder", &DECODER_WIDTHS, 1.0, rng)
}

/// Adds random initial parameters of the linear moment layer, which is used only in training.
pub fn init_moments(params: &mut Params, rng: &mut ChaCha8Rng) -> Result<()> {
    params.add_mlp("moments", &[LATENT_DIM, NUM_MOMENTS], 1.0, rng)
}

/// Adds random initial parameters of the linear grasp layer, which is used only in training.
pub fn init_grasp(params: &mut Params, rng: &mut ChaCha8Rng) -> Result<()> {
    params.add_mlp("grasp", &[LATENT_DIM, GRASP_DIM], 1.0, rng)
}

/// Converts a flat cloud (x, y, z per point) to points.
pub fn to_points(cloud: &[f32]) -> Vec<Vec3> {
    cloud.chunks_exact(3).map(|p| Vec3::new(p[0], p[1], p[2])).collect()
}

/// Indices of the points nearest to a centre.
pub type Neighborhood = [u16; NUM_NEIGHBORS];

/// Neighbourhoods of a cloud, one per centre.
pub fn neighborhoods_of(cloud: &[f32]) -> Vec<Neighborhood> {
    let nearest = neighborhoods(&to_points(cloud));
    nearest.into_iter().map(|nearest| nearest.map(|i| i as u16)).collect()
}

/// Raw z of each cloud (m, canonical frame) before whitening, shape (B, LATENT_DIM).
pub fn encode(params: &Params, clouds: &[&[f32]]) -> Result<Tensor> {
    let neighborhoods: Vec<Vec<Neighborhood>> =
        clouds.iter().map(|cloud| neighborhoods_of(cloud)).collect();
    let neighborhoods: Vec<&[Neighborhood]> = neighborhoods.iter().map(Vec::as_slice).collect();
    encode_with_neighborhoods(params, clouds, &neighborhoods)
}

/// [`encode`] with precomputed neighbourhoods.
pub fn encode_with_neighborhoods(
    params: &Params,
    clouds: &[&[f32]],
    neighborhoods: &[&[Neighborhood]],
) -> Result<Tensor> {
    let batch = clouds.len();
    let mut local = Vec::with_capacity(batch * NUM_CENTERS * NUM_NEIGHBORS * LOCAL_WIDTHS[0]);
    let mut positions = Vec::with_capacity(batch * NUM_CENTERS * 3);
    for (cloud, near) in clouds.iter().zip(neighborhoods) {
        let points = to_points(cloud);
        for (center, near) in points.iter().zip(*near) {
            for i in near {
                local.extend(local_input(*center, points[usize::from(*i)]));
            }
            positions.extend(normalized_position(*center));
        }
    }
    let rows = batch * NUM_CENTERS;
    let local = Tensor::from_vec(local, (rows * NUM_NEIGHBORS, LOCAL_WIDTHS[0]), &Device::Cpu)?;
    let local = point_net(&local, params, "encoder.local", NUM_NEIGHBORS)?;
    let positions = Tensor::from_vec(positions, (rows, 3), &Device::Cpu)?;
    let global = Tensor::cat(&[local, positions], D::Minus1)?;
    let global = point_net(&global, params, "encoder.global", NUM_CENTERS)?;
    Ok(mlp(&global, params, "encoder.readout", READOUT_WIDTHS.len() - 1, ENCODER_ACTIVATION)?)
}

/// Two shared layers, then the maximum of their outputs over each group of `rows` rows.
fn point_net(x: &Tensor, params: &Params, name: &str, rows: usize) -> Result<Tensor> {
    let hidden = linear(x, params, &format!("{name}.0"), Some(ENCODER_ACTIVATION))?;
    let (weight, accumulator) = params.weight(&format!("{name}.1.weight"))?;
    let bias = params.tensor(&format!("{name}.1.bias"))?;
    Ok(hidden.apply_op3(&weight, bias, LinearMaxPool::new(rows, accumulator))?)
}

/// Clouds decoded from raw `z`, shape (B, CLOUD_POINTS, 3), in workspace units.
pub fn decode(params: &Params, z: &Tensor) -> Result<Tensor> {
    let batch = z.dims()[0];
    let flat = mlp(z, params, "decoder", DECODER_WIDTHS.len() - 1, ENCODER_ACTIVATION)?;
    Ok(flat.reshape((batch, CLOUD_POINTS, 3))?.contiguous()?)
}

/// Standardised shape moments predicted linearly from raw `z`, shape (B, NUM_MOMENTS).
pub fn moments(params: &Params, z: &Tensor) -> Result<Tensor> {
    Ok(mlp(z, params, "moments", 1, ENCODER_ACTIVATION)?)
}

/// Points of the hand in the preferred grasp predicted linearly from raw `z`, in workspace units, shape (B, GRASP_DIM).
pub fn grasp(params: &Params, z: &Tensor) -> Result<Tensor> {
    Ok(mlp(z, params, "grasp", 1, ENCODER_ACTIVATION)?)
}

/// Reconstruction targets of [`decode`]: the clouds in workspace units, shape (B, CLOUD_POINTS, 3).
pub fn targets(clouds: &[&[f32]]) -> Result<Tensor> {
    let flat: Vec<f32> = clouds
        .iter()
        .flat_map(|cloud| {
            to_points(cloud).into_iter().flat_map(normalized_position).collect::<Vec<_>>()
        })
        .collect();
    Ok(Tensor::from_vec(flat, (clouds.len(), CLOUD_POINTS, 3), &Device::Cpu)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn batched_encoder_matches_the_inference_encoder() {
        let mut params = Params::default();
        init(&mut params, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let rounded: Vec<f32> =
            params.values().unwrap().iter().map(|&x| half::f16::from_f32(x).to_f32()).collect();
        params.set_values(&rounded).unwrap();
        let bytes = params.export(&policy::Whitening::identity().tensors()).unwrap();
        let tensors = policy::weights::Tensors::parse(&bytes).unwrap();
        let encoder = policy::Encoder::load(&tensors).unwrap();
        let cloud: Vec<f32> =
            (0..3 * CLOUD_POINTS).map(|k| 0.5 + 0.1 * libm::sinf((k * k) as f32)).collect();
        let got = encode(&params, &[&cloud]).unwrap().to_vec2::<f32>().unwrap();
        let expected = encoder.encode_unwhitened(&to_points(&cloud)).unwrap();
        let size = expected.iter().map(|x| x.abs()).fold(0.0, f32::max);
        for (got, expected) in got[0].iter().zip(&expected) {
            assert!((got - expected).abs() < 1e-4 * size, "got {got}, expected {expected}");
        }
    }
}
