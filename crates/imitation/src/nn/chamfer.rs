//! The Chamfer distance of two batches of clouds, with its gradient.

use super::head::contiguous;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};

/// Mean squared distance to the nearest point, both ways: clouds (B, N, 3) and (B, M, 3) to (B).
///
/// Only the first cloud gets a gradient.
pub struct Chamfer;

impl CustomOp2 for Chamfer {
    fn name(&self) -> &'static str {
        "chamfer"
    }

    fn cpu_fwd(
        &self,
        s1: &CpuStorage,
        l1: &Layout,
        s2: &CpuStorage,
        l2: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (made, wanted) = (contiguous(s1, l1)?, contiguous(s2, l2)?);
        let batch = l1.dims()[0];
        let pairs =
            made.chunks_exact(made.len() / batch).zip(wanted.chunks_exact(wanted.len() / batch));
        let distances: Vec<f32> = pairs
            .map(|(a, b)| {
                let mean = |from: &[f32], to: &[f32]| {
                    let near = nearest(from, to);
                    near.iter().map(|n| n.1).sum::<f32>() / near.len() as f32
                };
                mean(a, b) + mean(b, a)
            })
            .collect();
        Ok((CpuStorage::F32(distances), Shape::from(batch)))
    }

    fn bwd(
        &self,
        made: &Tensor,
        wanted: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let batch = made.dims()[0];
        let a = made.flatten_all()?.to_vec1::<f32>()?;
        let b = wanted.flatten_all()?.to_vec1::<f32>()?;
        let scale = gradient.to_vec1::<f32>()?;
        let mut out = vec![0.0; a.len()];
        let (size_a, size_b) = (a.len() / batch, b.len() / batch);
        for (i, scale) in scale.iter().enumerate() {
            let (a, b) = (&a[i * size_a..(i + 1) * size_a], &b[i * size_b..(i + 1) * size_b]);
            let out = &mut out[i * size_a..(i + 1) * size_a];
            let mut push = |from: usize, to: usize, weight: f32| {
                for k in 0..3 {
                    out[3 * from + k] += weight * (a[3 * from + k] - b[3 * to + k]);
                }
            };
            let (per_a, per_b) = (6.0 * scale / size_a as f32, 6.0 * scale / size_b as f32);
            for (from, (to, _)) in nearest(a, b).into_iter().enumerate() {
                push(from, to, per_a);
            }
            for (to, (from, _)) in nearest(b, a).into_iter().enumerate() {
                push(from, to, per_b);
            }
        }
        Ok((Some(Tensor::from_vec(out, made.shape(), made.device())?), None))
    }
}

/// For each point its nearest one in the other cloud, and the squared distance.
fn nearest(from: &[f32], to: &[f32]) -> Vec<(usize, f32)> {
    let axis = |k: usize| -> Vec<f32> { to.iter().skip(k).step_by(3).copied().collect() };
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let mut distances = vec![0.0f32; x.len()];
    from.chunks_exact(3)
        .map(|p| {
            for (((d, x), y), z) in distances.iter_mut().zip(&x).zip(&y).zip(&z) {
                let (dx, dy, dz) = (p[0] - x, p[1] - y, p[2] - z);
                *d = dx * dx + dy * dy + dz * dz;
            }
            let least = distances.iter().copied().fold(f32::INFINITY, f32::min);
            (distances.iter().position(|d| *d == least).unwrap_or(0), least)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    fn cloud(count: usize, shift: f32) -> Vec<f32> {
        (0..3 * count).map(|k| libm::sinf((k * k) as f32) + shift).collect()
    }

    #[test]
    fn a_shifted_point_is_its_squared_distance_away_both_ways() {
        let a = Tensor::new(&[[[0.0f32, 0.0, 0.0]]], &Device::Cpu).unwrap();
        let b = Tensor::new(&[[[0.3f32, 0.4, 0.0]]], &Device::Cpu).unwrap();
        let distance = a.apply_op2(&b, Chamfer).unwrap().to_vec1::<f32>().unwrap()[0];
        assert!((distance - 0.5).abs() < 1e-6, "{distance}, wanted twice 0.25");
    }

    #[test]
    fn gradient_agrees_with_central_differences() {
        let made = cloud(7, 0.0);
        let wanted = Tensor::from_vec(cloud(9, 0.2), (1, 9, 3), &Device::Cpu).unwrap();
        let value = |made: Vec<f32>| {
            let made = Tensor::from_vec(made, (1, 7, 3), &Device::Cpu).unwrap();
            made.apply_op2(&wanted, Chamfer).unwrap().to_vec1::<f32>().unwrap()[0]
        };
        let var = Var::from_vec(made.clone(), (1, 7, 3), &Device::Cpu).unwrap();
        let loss = var.apply_op2(&wanted, Chamfer).unwrap().sum_all().unwrap();
        let store = loss.backward().unwrap();
        let gradient = store.get(&var).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        for k in 0..made.len() {
            let (mut up, mut down) = (made.clone(), made.clone());
            up[k] += 1e-3;
            down[k] -= 1e-3;
            let wanted = (value(up) - value(down)) / 2e-3;
            assert!((gradient[k] - wanted).abs() < 2e-3, "{} against {wanted}", gradient[k]);
        }
    }
}
