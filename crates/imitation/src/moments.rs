//! Where the whole surface of an object lies, in a few numbers: what z is asked to tell.
//!
//! *Departure: the paper's autoencoder gets the cloud back and no more. The Chamfer distance hardly sees an object's yaw:
//! turned by a tenth of a radian, the points of a bottle move less than they lie apart. Its moments see it, and they see
//! it as far as the shape tells it: what looks the same after half a turn has the same moments after half a turn.*

use geometry::Vec3;

/// Mean (3), second (6) and third (10) central moments.
pub const MOMENTS: usize = 19;

/// Pairs and triples of axes, each once.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];
const TRIPLES: [[usize; 3]; 10] = [
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

/// Moments of points on the surface of an object (its frame) that stands at x, y (m) with a yaw (rad): in m, m², m³,
/// heights over the table.
pub fn moments(surface: &[Vec3], [x, y, yaw]: [f32; 3]) -> [f32; MOMENTS] {
    let (sin, cos) = libm::sincosf(yaw);
    let count = surface.len().max(1) as f32;
    let turned = |p: &Vec3| Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
    let mean = surface.iter().map(turned).sum::<Vec3>() / count;
    let mut found = [0.0; MOMENTS];
    let place = mean + Vec3::new(x, y, 0.0);
    found[..3].copy_from_slice(&place.to_array());
    for point in surface {
        let d = (turned(point) - mean).to_array();
        for (k, [i, j]) in PAIRS.into_iter().enumerate() {
            found[3 + k] += d[i] * d[j];
        }
        for (k, [h, i, j]) in TRIPLES.into_iter().enumerate() {
            found[9 + k] += d[h] * d[i] * d[j];
        }
    }
    found[3..].iter_mut().for_each(|moment| *moment /= count);
    found
}

/// Mean and spread of each moment over many objects and poses; what does not vary counts as if it did a little.
pub struct Scale {
    mean: [f32; MOMENTS],
    spread: [f32; MOMENTS],
}

impl Scale {
    /// Of a set of moments.
    pub fn of(all: &[[f32; MOMENTS]]) -> Self {
        let count = all.len().max(1) as f64;
        let mean: [f64; MOMENTS] =
            std::array::from_fn(|i| all.iter().map(|m| f64::from(m[i])).sum::<f64>() / count);
        let spread = |i: usize| {
            let squares = all.iter().map(|m| (f64::from(m[i]) - mean[i]).powi(2)).sum::<f64>();
            libm::sqrt(squares / count)
        };
        // A hundredth of what is usual at that order: lengths of 5 cm.
        let least = |i: usize| {
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
            spread: std::array::from_fn(|i| spread(i).max(least(i)) as f32),
        }
    }

    /// Moments in these units.
    pub fn apply(&self, moments: &[f32; MOMENTS]) -> [f32; MOMENTS] {
        std::array::from_fn(|i| (moments[i] - self.mean[i]) / self.spread[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::object::Object;
    use geometry::surface;

    fn of(name: &str, yaw: f32) -> [f32; MOMENTS] {
        let surface = surface::points(&Object::built_in(name).unwrap().mesh, 4096);
        moments(&surface, [0.6, -0.1, yaw])
    }

    fn apart(a: &[f32; MOMENTS], b: &[f32; MOMENTS], which: std::ops::Range<usize>) -> f32 {
        which.map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn they_see_a_yaw_as_far_as_the_shape_tells_it() {
        let pi = std::f32::consts::PI;
        let [front, turned, behind] = [0.3, 0.4, 0.3 + pi].map(|yaw| of("sugar_box", yaw));
        // (b² - a²) sin 2θ / 2 of a box of 49 x 94 mm, a tenth of a radian further.
        assert!(apart(&front, &turned, 3..9) > 4e-5, "{}", apart(&front, &turned, 3..9));
        let behind = apart(&front, &behind, 3..9);
        assert!(behind < 4e-6, "{behind}");
        let can = [0.3, 1.0].map(|yaw| of("soup_can", yaw));
        assert!(apart(&can[0], &can[1], 3..9) < 1e-5);
        // A mug shows in the third moments on which side its handle is.
        let mug = [0.3, 0.3 + pi].map(|yaw| of("coffee_mug", yaw));
        assert!(apart(&mug[0], &mug[1], 9..19) > 2e-6);
    }

    #[test]
    fn the_mean_is_where_the_surface_is() {
        let found = of("sugar_box", 1.0);
        assert!((found[0] - 0.6).abs() < 2e-3 && (found[1] + 0.1).abs() < 2e-3);
        assert!((found[2] - 0.088).abs() < 2e-3, "{}", found[2]);
    }

    #[test]
    fn in_their_units_they_have_unit_variance() {
        let all: Vec<_> = (0..60).map(|k| of("bleach", 0.1 * k as f32)).collect();
        let scale = Scale::of(&all);
        let unit: Vec<_> = all.iter().map(|m| scale.apply(m)).collect();
        for i in [3, 4, 6] {
            let variance = unit.iter().map(|m| m[i] * m[i]).sum::<f32>() / 60.0;
            assert!((variance - 1.0).abs() < 1e-3, "{i}: {variance}");
        }
        assert!(unit.iter().all(|m| m[0].abs() < 5.0), "what does not vary stays small");
    }
}
