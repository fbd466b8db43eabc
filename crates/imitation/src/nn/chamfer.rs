//! The Chamfer distance of two batches of clouds, with its gradient.

use super::head::contiguous;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};
use std::sync::Mutex;

/// Mean squared distance to the nearest point, both ways: clouds (B, N, 3) and (B, M, 3) to (B).
///
/// Only the first cloud gets a gradient; it is found together with the distance and kept until it is asked for.
#[derive(Default)]
pub struct Chamfer {
    gradient: Mutex<Vec<f32>>,
}

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
        let (size_a, size_b) = (made.len() / batch, wanted.len() / batch);
        let mut gradient = vec![0.0; made.len()];
        let pairs = made.chunks_exact(size_a).zip(wanted.chunks_exact(size_b));
        let distances = pairs
            .zip(gradient.chunks_exact_mut(size_a))
            .map(|((a, b), gradient)| distance(a, b, gradient))
            .collect();
        if let Ok(mut kept) = self.gradient.lock() {
            *kept = gradient;
        }
        Ok((CpuStorage::F32(distances), Shape::from(batch)))
    }

    fn bwd(
        &self,
        made: &Tensor,
        _: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let kept = self.gradient.lock().map(|mut kept| std::mem::take(&mut *kept));
        let kept = kept.unwrap_or_default();
        if kept.len() != made.elem_count() {
            candle_core::bail!("a Chamfer distance is differentiated once, where it was found");
        }
        let of_made = Tensor::from_vec(kept, made.shape(), made.device())?;
        let scale = gradient.reshape((made.dims()[0], 1, 1))?;
        Ok((Some(of_made.broadcast_mul(&scale)?), None))
    }
}

/// The distance of two clouds, and its gradient to the first one.
fn distance(a: &[f32], b: &[f32], gradient: &mut [f32]) -> f32 {
    let (per_a, per_b) = (3.0 / a.len() as f32, 3.0 / b.len() as f32);
    let mut sum = 0.0;
    let mut pull = |from: usize, to: usize, share: f32, squared: f32| {
        sum += share * squared;
        for k in 0..3 {
            gradient[3 * from + k] += 2.0 * share * (a[3 * from + k] - b[3 * to + k]);
        }
    };
    for (from, (to, squared)) in nearest(a, b).into_iter().enumerate() {
        pull(from, to, per_a, squared);
    }
    for (to, (from, squared)) in nearest(b, a).into_iter().enumerate() {
        pull(from, to, per_b, squared);
    }
    sum
}

/// Points that are looked at at once.
const LANES: usize = 8;

/// For each point the first of the nearest ones in the other cloud, and the squared distance.
fn nearest(from: &[f32], to: &[f32]) -> Vec<(usize, f32)> {
    let count = (to.len() / 3).next_multiple_of(LANES);
    let mut axes = [(); 3].map(|()| vec![f32::INFINITY; count]);
    for (i, point) in to.chunks_exact(3).enumerate() {
        (0..3).for_each(|k| axes[k][i] = point[k]);
    }
    let [x, y, z] = axes.each_ref().map(|axis| axis.as_chunks::<LANES>().0);
    from.chunks_exact(3)
        .map(|p| {
            let (mut least, mut place) = ([f32::INFINITY; LANES], [0u32; LANES]);
            for (block, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
                for lane in 0..LANES {
                    let (dx, dy, dz) = (p[0] - x[lane], p[1] - y[lane], p[2] - z[lane]);
                    let squared = dx * dx + dy * dy + dz * dz;
                    let is_nearer = squared < least[lane];
                    least[lane] = if is_nearer { squared } else { least[lane] };
                    place[lane] = if is_nearer { block as u32 } else { place[lane] };
                }
            }
            let found = (0..LANES).map(|lane| (least[lane], place[lane] as usize * LANES + lane));
            let first = found.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            first.map_or((0, f32::INFINITY), |(squared, i)| (i, squared))
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
        let distance = a.apply_op2(&b, Chamfer::default()).unwrap().to_vec1::<f32>().unwrap()[0];
        assert!((distance - 0.5).abs() < 1e-6, "{distance}, wanted twice 0.25");
    }

    #[test]
    fn the_first_of_the_nearest_points_is_found_however_many_there_are() {
        for count in [1, 7, 8, 9, 31] {
            let (a, mut b) = (cloud(20, 0.0), cloud(count, 0.1));
            // The last point once more: the first of both counts.
            b.extend_from_within(3 * (count - 1)..);
            for (point, (i, squared)) in a.chunks_exact(3).zip(nearest(&a, &b)) {
                let apart = |q: &[f32]| (0..3).map(|k| (point[k] - q[k]).powi(2)).sum::<f32>();
                let all: Vec<f32> = b.chunks_exact(3).map(apart).collect();
                let least = all.iter().copied().fold(f32::INFINITY, f32::min);
                let first = all.iter().position(|d| *d == least).unwrap();
                assert!(i == first && (squared - least).abs() < 1e-6, "{i}, wanted {first}");
            }
        }
    }

    #[test]
    fn gradient_agrees_with_central_differences() {
        let made = cloud(7, 0.0);
        let wanted = Tensor::from_vec(cloud(9, 0.2), (1, 9, 3), &Device::Cpu).unwrap();
        let value = |made: Vec<f32>| {
            let made = Tensor::from_vec(made, (1, 7, 3), &Device::Cpu).unwrap();
            made.apply_op2(&wanted, Chamfer::default()).unwrap().to_vec1::<f32>().unwrap()[0]
        };
        let var = Var::from_vec(made.clone(), (1, 7, 3), &Device::Cpu).unwrap();
        let loss = var.apply_op2(&wanted, Chamfer::default()).unwrap().sum_all().unwrap();
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
