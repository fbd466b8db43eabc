//! The Chamfer distance of two batches of clouds, with its gradient.

use super::memory::contiguous;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor};
use pulp::{Simd, WithSimd};
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

/// Most numbers that a register holds.
const LANES: usize = 16;

/// For each point the first of the nearest ones in the other cloud, and the squared distance.
fn nearest(from: &[f32], to: &[f32]) -> Vec<(usize, f32)> {
    let count = from.len() / 3;
    let mut axes = [(); 3].map(|()| vec![0.0; count.next_multiple_of(LANES)]);
    for (i, point) in from.chunks_exact(3).enumerate() {
        (0..3).for_each(|k| axes[k][i] = point[k]);
    }
    let (mut least, mut place) = (vec![0.0; axes[0].len()], vec![0.0; axes[0].len()]);
    let from = axes.each_ref().map(Vec::as_slice);
    pulp::Arch::new().dispatch(Search { from, to, least: &mut least, place: &mut place });
    place.into_iter().map(|i| i as usize).zip(least).take(count).collect()
}

/// Points that each search for the nearest ones, as many at once as a register holds.
struct Search<'a> {
    /// x, y and z of those that search.
    from: [&'a [f32]; 3],
    /// Those that are found, point by point.
    to: &'a [f32],
    /// The squared distance that is found for each.
    least: &'a mut [f32],
    /// Which one it is of: small whole numbers, exact in single precision.
    place: &'a mut [f32],
}

impl WithSimd for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [x, y, z] = self.from.map(|axis| S::as_simd_f32s(axis).0);
        let (least, place) = (S::as_mut_simd_f32s(self.least).0, S::as_mut_simd_f32s(self.place).0);
        for (((x, y), z), (least, place)) in x.iter().zip(y).zip(z).zip(least.iter_mut().zip(place))
        {
            let (mut nearest, mut at) = (simd.splat_f32s(f32::INFINITY), simd.splat_f32s(0.0));
            let mut index = 0.0;
            for point in self.to.chunks_exact(3) {
                let square = |axis: S::f32s, coordinate: f32| {
                    let off = simd.sub_f32s(axis, simd.splat_f32s(coordinate));
                    simd.mul_f32s(off, off)
                };
                let squared = simd.add_f32s(square(*x, point[0]), square(*y, point[1]));
                let squared = simd.add_f32s(squared, square(*z, point[2]));
                let is_nearer = simd.less_than_f32s(squared, nearest);
                nearest = simd.select_f32s(is_nearer, squared, nearest);
                at = simd.select_f32s(is_nearer, simd.splat_f32s(index), at);
                index += 1.0;
            }
            (*least, *place) = (nearest, at);
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
    fn a_shifted_point_is_its_squared_distance_away_both_ways() {
        let a = Tensor::new(&[[[0.0f32, 0.0, 0.0]]], &Device::Cpu).unwrap();
        let b = Tensor::new(&[[[0.3f32, 0.4, 0.0]]], &Device::Cpu).unwrap();
        let distance = a.apply_op2(&b, Chamfer::default()).unwrap().to_vec1::<f32>().unwrap()[0];
        assert!((distance - 0.5).abs() < 1e-6, "{distance}, wanted twice 0.25");
    }

    #[test]
    fn the_first_of_the_nearest_points_is_found_however_many_there_are() {
        for count in [1, 7, 16, 17, 50] {
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
}
