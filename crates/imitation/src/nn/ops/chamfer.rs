//! Chamfer distance of two batches of clouds, with its gradient: how far two clouds are apart, independent of
//! the order of their points.

use crate::nn::ops::storage::contiguous;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};
use pulp::{Simd, WithSimd};
use std::sync::Mutex;

/// Mean squared distance to the nearest point, summed over both directions: clouds (B, N, 3) and (B, M, 3) to
/// (B).
///
/// Only the first cloud has a gradient. It is computed in the forward pass and stored for the backward pass.
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
        let (cloud, target) = (contiguous(s1, l1)?, contiguous(s2, l2)?);
        let batch = l1.dims()[0];
        let (size_a, size_b) = (cloud.len() / batch, target.len() / batch);
        let mut gradient = vec![0.0; cloud.len()];
        let pairs = cloud.chunks_exact(size_a).zip(target.chunks_exact(size_b));
        let distances = pairs
            .zip(gradient.chunks_exact_mut(size_a))
            .map(|((a, b), gradient)| distance(a, b, gradient))
            .collect();
        if let Ok(mut stored) = self.gradient.lock() {
            *stored = gradient;
        }
        Ok((CpuStorage::F32(distances), Shape::from(batch)))
    }

    fn bwd(
        &self,
        cloud: &Tensor,
        _: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let stored = self.gradient.lock().map(|mut stored| std::mem::take(&mut *stored));
        let stored = stored.unwrap_or_default();
        if stored.len() != cloud.elem_count() {
            candle_core::bail!(
                "the backward pass of a Chamfer distance can run only once, after its forward pass"
            );
        }
        let of_cloud = Tensor::from_vec(stored, cloud.shape(), cloud.device())?;
        let scale = gradient.reshape((cloud.dims()[0], 1, 1))?;
        Ok((Some(of_cloud.broadcast_mul(&scale)?), None))
    }
}

/// Chamfer distance of two clouds; adds its gradient with respect to the first one to `gradient`.
fn distance(a: &[f32], b: &[f32], gradient: &mut [f32]) -> f32 {
    let (per_a, per_b) = (3.0 / a.len() as f32, 3.0 / b.len() as f32);
    let mut sum = 0.0;
    let mut add_pair = |from: usize, to: usize, weight: f32, squared: f32| {
        sum += weight * squared;
        for k in 0..3 {
            gradient[3 * from + k] += 2.0 * weight * (a[3 * from + k] - b[3 * to + k]);
        }
    };
    for (from, (to, squared)) in nearest(a, b).into_iter().enumerate() {
        add_pair(from, to, per_a, squared);
    }
    for (to, (from, squared)) in nearest(b, a).into_iter().enumerate() {
        add_pair(from, to, per_b, squared);
    }
    sum
}

/// Number of f32 values in the widest SIMD registers.
const LANES: usize = 16;

/// For each point, the index of the nearest point in the other cloud (the first on ties) and the squared
/// distance.
fn nearest(from: &[f32], to: &[f32]) -> Vec<(usize, f32)> {
    let count = from.len() / 3;
    let mut axes = [(); 3].map(|()| vec![0.0; count.next_multiple_of(LANES)]);
    for (i, point) in from.chunks_exact(3).enumerate() {
        (0..3).for_each(|k| axes[k][i] = point[k]);
    }
    let (mut min, mut index) = (vec![0.0; axes[0].len()], vec![0.0; axes[0].len()]);
    let from = axes.each_ref().map(Vec::as_slice);
    pulp::Arch::new().dispatch(NearestSearch {
        queries: from,
        points: to,
        min: &mut min,
        argmin: &mut index,
    });
    index.into_iter().map(|i| i as usize).zip(min).take(count).collect()
}

/// Nearest-point search, vectorised over the query points.
struct NearestSearch<'a> {
    /// x, y and z of the query points.
    queries: [&'a [f32]; 3],
    /// Points of the other cloud, x, y, z per point.
    points: &'a [f32],
    /// Output: min. squared distance of each query point.
    min: &'a mut [f32],
    /// Output: index of the nearest point; small integers, exact in single precision.
    argmin: &'a mut [f32],
}

impl WithSimd for NearestSearch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [x, y, z] = self.queries.map(|axis| S::as_simd_f32s(axis).0);
        let (min, argmin) = (S::as_mut_simd_f32s(self.min).0, S::as_mut_simd_f32s(self.argmin).0);
        for (((x, y), z), (min, argmin)) in x.iter().zip(y).zip(z).zip(min.iter_mut().zip(argmin)) {
            let (mut nearest, mut at) = (simd.splat_f32s(f32::INFINITY), simd.splat_f32s(0.0));
            let mut index = 0.0;
            for point in self.points.chunks_exact(3) {
                let square = |axis: S::f32s, coordinate: f32| {
                    let difference = simd.sub_f32s(axis, simd.splat_f32s(coordinate));
                    simd.mul_f32s(difference, difference)
                };
                let squared = simd.add_f32s(square(*x, point[0]), square(*y, point[1]));
                let squared = simd.add_f32s(squared, square(*z, point[2]));
                let is_nearer = simd.less_than_f32s(squared, nearest);
                nearest = simd.select_f32s(is_nearer, squared, nearest);
                at = simd.select_f32s(is_nearer, simd.splat_f32s(index), at);
                index += 1.0;
            }
            (*min, *argmin) = (nearest, at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    fn cloud(count: usize, shift: f32) -> Vec<f32> {
        (0..3 * count).map(|k| libm::sinf((k * k) as f32) + shift).collect()
    }

    #[test]
    fn distance_of_a_shifted_point_is_twice_its_squared_shift() {
        let a = Tensor::new(&[[[0.0f32, 0.0, 0.0]]], &Device::Cpu).unwrap();
        let b = Tensor::new(&[[[0.3f32, 0.4, 0.0]]], &Device::Cpu).unwrap();
        let distance = a.apply_op2(&b, Chamfer::default()).unwrap().to_vec1::<f32>().unwrap()[0];
        assert!((distance - 0.5).abs() < 1e-6, "got {distance}, expected twice 0.25");
    }

    #[test]
    fn nearest_returns_the_first_minimum_for_any_cloud_size() {
        for count in [1, 7, 16, 17, 50] {
            let (a, mut b) = (cloud(20, 0.0), cloud(count, 0.1));
            // Duplicates the last point; the first copy must be returned.
            b.extend_from_within(3 * (count - 1)..);
            for (point, (i, squared)) in a.chunks_exact(3).zip(nearest(&a, &b)) {
                let squared_to = |q: &[f32]| (0..3).map(|k| (point[k] - q[k]).powi(2)).sum::<f32>();
                let all: Vec<f32> = b.chunks_exact(3).map(squared_to).collect();
                let min = all.iter().copied().fold(f32::INFINITY, f32::min);
                let first = all.iter().position(|d| *d == min).unwrap();
                assert!(i == first && (squared - min).abs() < 1e-6, "got {i}, expected {first}");
            }
        }
    }
}
