//! Proportions: what makes a variant of an object.

use crate::Vec3;
use crate::sequence::spread;

/// Least and greatest factor of a variant's extents along x, y and z.
const SCALE: [[f32; 2]; 3] = [[0.8, 1.1], [0.8, 1.1], [0.7, 1.1]];

/// Least and greatest sink of a variant: shoulders lie at 0.88 to 0.62 of the height.
const SINK: [f32; 2] = [-0.02, 0.24];

/// Where the shoulder of the bleach bottle begins, in heights.
const SHOULDER: f32 = 0.86;

/// The fraction by which the sequence of sinks steps: the golden ratio's, which is no multiple of [`spread`]'s.
const STEP: f64 = 0.618_033_988_749_894_9;

/// How a shape is changed into a like one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proportions {
    /// Factors of the extents along x, y and z.
    pub scale: Vec3,
    /// How far (in heights) what is at a bottle's shoulder goes down, bottom and top staying where they are: what is below
    /// is shortened, what is above is stretched, evenly. Less than 0.86, where a shoulder begins, and more than -0.14.
    ///
    /// Bottles differ in where their shoulders are more than in how high they are. A policy that had learned one bottle
    /// in eight sizes held its lowest one in 284 of 300 attempts; the mustard bottle, as low, with a lower shoulder, in
    /// 228 (counted once, seeds 0 to 299). Grasps that hold a high shoulder from straight above hold no low one.
    pub sink: f32,
}

impl Proportions {
    /// Those of a variant, from 1; they fill what is allowed evenly.
    pub fn of_variant(variant: u32) -> Self {
        let index = (variant as usize).saturating_sub(1);
        let within = |[least, most]: [f32; 2], share: f32| least + (most - least) * share;
        let shares = spread(index);
        let at = 0.5 + STEP * (index + 1) as f64;
        Self {
            scale: Vec3::from_array(std::array::from_fn(|axis| within(SCALE[axis], shares[axis]))),
            sink: within(SINK, (at - libm::floor(at)) as f32),
        }
    }

    /// Those of one bounding box (m, its extents) to another: shoulders stay where they are of the height.
    pub fn of_sizes(from: Vec3, to: Vec3) -> Self {
        Self { scale: to / from, sink: 0.0 }
    }

    /// Where a point of an upright object of this height (m) goes.
    pub fn place(&self, point: Vec3, height: f32) -> Vec3 {
        let t = point.z / height;
        let shoulder = SHOULDER - self.sink;
        let sunk = match t < SHOULDER {
            true => t * (shoulder / SHOULDER),
            false => 1.0 - (1.0 - t) * ((1.0 - shoulder) / (1.0 - SHOULDER)),
        };
        point.with_z(height * sunk) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bottom_and_top_stay_and_nothing_changes_its_order() {
        for variant in 1..40 {
            let proportions = Proportions { scale: Vec3::ONE, ..Proportions::of_variant(variant) };
            let height = |z: f32| proportions.place(Vec3::new(0.1, -0.2, z), 0.2).z;
            assert!(height(0.0) == 0.0 && (height(0.2) - 0.2).abs() < 1e-7);
            let steps: Vec<f32> = (0..=20).map(|i| height(0.01 * i as f32)).collect();
            assert!(steps.windows(2).all(|pair| pair[1] - pair[0] > 0.007), "{steps:?}");
        }
    }

    #[test]
    fn variants_differ_in_each_proportion() {
        let of: Vec<[f32; 4]> = (1..=7)
            .map(|k| {
                let Proportions { scale, sink } = Proportions::of_variant(k);
                [scale.x, scale.y, scale.z, sink]
            })
            .collect();
        for (axis, [least, most]) in SCALE.into_iter().chain([SINK]).enumerate() {
            let mut values: Vec<f32> = of.iter().map(|of| of[axis]).collect();
            values.sort_by(f32::total_cmp);
            // Seven points in a range, no gap wider than two fifths of it.
            let ends = std::iter::once(least).chain(values).chain([most]).collect::<Vec<f32>>();
            let widest = ends.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
            assert!(ends.is_sorted() && widest < 0.4 * (most - least), "{ends:?}");
        }
    }
}
