//! The autoencoder on a batch; the twin of `policy::encoder`.

use super::pool::Strongest;
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

/// The indices of the points that are nearest to a centre.
pub type Neighborhood = [u16; NEIGHBORS];

/// The neighbourhoods of a cloud, one for each of its centres.
pub fn neighborhoods_of(cloud: &[f32]) -> Vec<Neighborhood> {
    let nearest = neighborhoods(&points(cloud));
    nearest.into_iter().map(|nearest| nearest.map(|i| i as u16)).collect()
}

/// z of each cloud, shape (B, LATENT), not standardised.
pub fn encode(params: &Params, clouds: &[&[f32]]) -> Result<Tensor> {
    let near: Vec<Vec<Neighborhood>> = clouds.iter().map(|cloud| neighborhoods_of(cloud)).collect();
    let near: Vec<&[Neighborhood]> = near.iter().map(Vec::as_slice).collect();
    encode_among(params, clouds, &near)
}

/// The same where the neighbourhoods are known.
pub fn encode_among(
    params: &Params,
    clouds: &[&[f32]],
    neighborhoods: &[&[Neighborhood]],
) -> Result<Tensor> {
    let batch = clouds.len();
    let mut local = Vec::with_capacity(batch * CENTERS * NEIGHBORS * LOCAL_WIDTHS[0]);
    let mut places = Vec::with_capacity(batch * CENTERS * 3);
    for (cloud, near) in clouds.iter().zip(neighborhoods) {
        let points = points(cloud);
        for (center, near) in points.iter().zip(*near) {
            for i in near {
                local.extend(local_input(*center, points[usize::from(*i)]));
            }
            places.extend(global_position(*center));
        }
    }
    let rows = batch * CENTERS;
    let local = Tensor::from_vec(local, (rows * NEIGHBORS, LOCAL_WIDTHS[0]), &Device::Cpu)?;
    let local = point_net(&local, params, "encoder.local", NEIGHBORS)?;
    let places = Tensor::from_vec(places, (rows, 3), &Device::Cpu)?;
    let global = Tensor::cat(&[local, places], D::Minus1)?;
    let global = point_net(&global, params, "encoder.global", CENTERS)?;
    Ok(mlp(&global, params, "encoder.readout", READOUT_WIDTHS.len() - 1, RELU)?)
}

/// Two shared layers, and the largest of what they say over each `rows` rows.
fn point_net(x: &Tensor, params: &Params, name: &str, rows: usize) -> Result<Tensor> {
    let hidden = dense(x, params, &format!("{name}.0"), Some(RELU))?;
    let (weight, slot) = params.weight(&format!("{name}.1.weight"))?;
    let bias = params.tensor(&format!("{name}.1.bias"))?;
    Ok(hidden.apply_op3(&weight, bias, Strongest::new(rows, slot))?)
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
