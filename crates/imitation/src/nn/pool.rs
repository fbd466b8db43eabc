//! The maximum over a neighbourhood, with its gradient.

use super::head::contiguous;
use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor};

/// Shape (B, N, C) to (B, C): the largest of N; the gradient goes to the first that is as large.
pub struct Largest;

/// For each (b, c) the n of the largest value.
fn places(values: &[f32], count: usize, channels: usize) -> Vec<u32> {
    let mut places = Vec::with_capacity(values.len() / count);
    for group in values.chunks_exact(count * channels) {
        let (mut best, mut place) = (group[..channels].to_vec(), vec![0u32; channels]);
        for (n, row) in group.chunks_exact(channels).enumerate().skip(1) {
            for ((best, place), x) in best.iter_mut().zip(&mut place).zip(row) {
                *place = if x > best { n as u32 } else { *place };
                *best = best.max(*x);
            }
        }
        places.extend(place);
    }
    places
}

impl CustomOp1 for Largest {
    fn name(&self) -> &'static str {
        "largest"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (batch, count, channels) = layout.shape().dims3()?;
        let values = contiguous(storage, layout)?;
        let mut out = Vec::with_capacity(batch * channels);
        for group in values.chunks_exact(count * channels) {
            let mut best = group[..channels].to_vec();
            for row in group.chunks_exact(channels).skip(1) {
                best.iter_mut().zip(row).for_each(|(best, x)| *best = best.max(*x));
            }
            out.extend(best);
        }
        Ok((CpuStorage::F32(out), Shape::from((batch, channels))))
    }

    fn bwd(&self, values: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let (_, count, channels) = values.dims3()?;
        let all = values.flatten_all()?.to_vec1::<f32>()?;
        let gradients = gradient.flatten_all()?.to_vec1::<f32>()?;
        let places = places(&all, count, channels);
        let mut out = vec![0.0; all.len()];
        for (i, (g, place)) in gradients.iter().zip(places).enumerate() {
            let (group, channel) = (i / channels, i % channels);
            out[(group * count + place as usize) * channels + channel] = *g;
        }
        Ok(Some(Tensor::from_vec(out, values.shape(), values.device())?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn the_first_largest_gets_the_gradient() {
        let values = [[[1.0f32, 5.0], [3.0, 5.0], [2.0, -1.0]], [[0.0, 0.0]; 3]];
        let var = Var::new(&values, &Device::Cpu).unwrap();
        let largest = var.apply_op1(Largest).unwrap();
        assert_eq!(largest.to_vec2::<f32>().unwrap(), [[3.0, 5.0], [0.0, 0.0]]);
        let weights = Tensor::new(&[[10.0f32, 20.0], [30.0, 40.0]], &Device::Cpu).unwrap();
        let store = (largest * weights).unwrap().sum_all().unwrap().backward().unwrap();
        let got = store.get(&var).unwrap().to_vec3::<f32>().unwrap();
        assert_eq!(got[0], [[0.0, 20.0], [10.0, 0.0], [0.0, 0.0]]);
        assert_eq!(got[1], [[30.0, 40.0], [0.0, 0.0], [0.0, 0.0]]);
    }
}
