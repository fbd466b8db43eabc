//! Shape moments of the whole object surface: an auxiliary training target of z, and a measure of similar shapes.
//!
//! *Departure: the paper's autoencoder only reconstructs the cloud. The Chamfer distance is nearly
//! insensitive to yaw: a rotation by 0.1 rad moves the points of a bottle by less than their spacing. The
//! moments depend on yaw and have the symmetry of the shape: a shape with a half-turn symmetry has the same
//! moments after half a turn.*

use geometry::Vec3;

/// Number of moments: mean (3), second (6) and third (10) central moments.
pub const NUM_MOMENTS: usize = 19;

/// Distinct pairs and triples of axes.
const AXIS_PAIRS: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];
const AXIS_TRIPLES: [[usize; 3]; 10] = [
    [0, 0, 0],
    [0, 0, 1],
    [0, 0, 2],
    [0, 1, 1],
    [0, 1, 2],
    [0, 2, 2],
    [1, 1, 1],
    [1, 1, 2],
    [1, 2, 2],
    [2, 2, 2],
];

/// Moments (m, m², m³) of surface points (object frame) of an object at x, y (m) with a yaw (rad). Heights
/// are above the table.
pub fn moments(surface: &[Vec3], [x, y, yaw]: [f32; 3]) -> [f32; NUM_MOMENTS] {
    let (sin, cos) = libm::sincosf(yaw);
    let count = surface.len().max(1) as f32;
    let rotate = |p: &Vec3| Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
    let mean = surface.iter().map(rotate).sum::<Vec3>() / count;
    let mut moments = [0.0; NUM_MOMENTS];
    let position = mean + Vec3::new(x, y, 0.0);
    moments[..3].copy_from_slice(&position.to_array());
    for point in surface {
        let d = (rotate(point) - mean).to_array();
        for (k, [i, j]) in AXIS_PAIRS.into_iter().enumerate() {
            moments[3 + k] += d[i] * d[j];
        }
        for (k, [h, i, j]) in AXIS_TRIPLES.into_iter().enumerate() {
            moments[9 + k] += d[h] * d[i] * d[j];
        }
    }
    moments[3..].iter_mut().for_each(|moment| *moment /= count);
    moments
}

/// Mean and standard deviation of each moment over many objects and poses, with a lower bound on the
/// deviation.
pub struct Standardizer {
    mean: [f32; NUM_MOMENTS],
    std: [f32; NUM_MOMENTS],
}

impl Standardizer {
    /// Statistics of a set of moments.
    pub fn fit(all: &[[f32; NUM_MOMENTS]]) -> Self {
        let count = all.len().max(1) as f64;
        let mean: [f64; NUM_MOMENTS] =
            std::array::from_fn(|i| all.iter().map(|m| f64::from(m[i])).sum::<f64>() / count);
        let spread = |i: usize| {
            let squares = all.iter().map(|m| (f64::from(m[i]) - mean[i]).powi(2)).sum::<f64>();
            libm::sqrt(squares / count)
        };
        // Lower bound: 1 % of the typical value at that order, for lengths of 5 cm.
        let min = |i: usize| {
            if i < 3 {
                5e-4
            } else if i < 9 {
                2.5e-5
            } else {
                1.25e-6
            }
        };
        Self {
            mean: mean.map(|x| x as f32),
            std: std::array::from_fn(|i| spread(i).max(min(i)) as f32),
        }
    }

    /// Standardises moments: zero mean, unit variance.
    pub fn apply(&self, moments: &[f32; NUM_MOMENTS]) -> [f32; NUM_MOMENTS] {
        std::array::from_fn(|i| (moments[i] - self.mean[i]) / self.std[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Object;
    use geometry::surface_sampling;

    fn of(name: &str, yaw: f32) -> [f32; NUM_MOMENTS] {
        let surface =
            surface_sampling::sample_surface(&Object::from_catalog(name).unwrap().mesh, 4096);
        moments(&surface, [0.6, -0.1, yaw])
    }

    fn max_difference(
        a: &[f32; NUM_MOMENTS],
        b: &[f32; NUM_MOMENTS],
        indices: std::ops::Range<usize>,
    ) -> f32 {
        indices.map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn moments_resolve_yaw_up_to_the_symmetry_of_the_shape() {
        let pi = std::f32::consts::PI;
        let [original, rotated, opposite] = [0.3, 0.4, 0.3 + pi].map(|yaw| of("sugar_box", yaw));
        // (b² - a²) sin 2θ / 2 for a box of 49 x 94 mm, rotated by 0.1 rad.
        let difference = max_difference(&original, &rotated, 3..9);
        assert!(difference > 4e-5, "{difference}");
        let half_turn = max_difference(&original, &opposite, 3..9);
        assert!(half_turn < 4e-6, "{half_turn}");
        let can = [0.3, 1.0].map(|yaw| of("soup_can", yaw));
        assert!(max_difference(&can[0], &can[1], 3..9) < 1e-5);
        // The third moments of a mug depend on the side of its handle.
        let mug = [0.3, 0.3 + pi].map(|yaw| of("coffee_mug", yaw));
        assert!(max_difference(&mug[0], &mug[1], 9..19) > 2e-6);
    }

    #[test]
    fn first_moments_are_the_surface_centroid() {
        let found = of("sugar_box", 1.0);
        assert!((found[0] - 0.6).abs() < 2e-3 && (found[1] + 0.1).abs() < 2e-3);
        assert!((found[2] - 0.088).abs() < 2e-3, "{}", found[2]);
    }

    #[test]
    fn standardized_moments_have_unit_variance() {
        let all: Vec<_> = (0..60).map(|k| of("bleach", 0.1 * k as f32)).collect();
        let standardizer = Standardizer::fit(&all);
        let unit: Vec<_> = all.iter().map(|m| standardizer.apply(m)).collect();
        for i in [3, 4, 6] {
            let variance = unit.iter().map(|m| m[i] * m[i]).sum::<f32>() / 60.0;
            assert!((variance - 1.0).abs() < 1e-3, "{i}: {variance}");
        }
        assert!(unit.iter().all(|m| m[0].abs() < 5.0), "constant moments stay small");
    }
}
