//! Nearest-neighbour search over configurations, 16 at a time with SIMD.

use policy::simd::with_simd;
use robot::DOF;

/// Number of f32 values in the widest SIMD registers.
const LANES: usize = 16;

/// One joint of 16 configurations.
type LaneColumn = [f32; LANES];

/// Configurations in structure-of-arrays layout. A training step compares each state with thousands of them.
#[derive(Clone, Debug)]
pub(crate) struct ConfigurationIndex {
    blocks: Vec<[LaneColumn; DOF]>,
}

impl ConfigurationIndex {
    /// Builds the index; configurations keep their order.
    pub(crate) fn new(configurations: impl Iterator<Item = [f32; DOF]>) -> Self {
        let mut blocks = Vec::new();
        for (i, configuration) in configurations.enumerate() {
            if i % LANES == 0 {
                // Unused lanes are infinitely far.
                blocks.push([[f32::INFINITY; LANES]; DOF]);
            }
            if let Some(block) = blocks.last_mut() {
                block.iter_mut().zip(configuration).for_each(|(column, q)| column[i % LANES] = q);
            }
        }
        Self { blocks }
    }

    /// Index of the nearest configuration (Euclidean); the first one on ties, 0 if the index is empty.
    pub(crate) fn nearest(&self, q: &[f32; DOF]) -> usize {
        let (min, block) = with_simd(
            #[inline(always)]
            || self.nearest_by_lane(q),
        );
        let first = |lane: usize| block[lane] as usize * LANES + lane;
        let closer =
            |a: &usize, b: &usize| min[*a].total_cmp(&min[*b]).then(first(*a).cmp(&first(*b)));
        (0..LANES).min_by(closer).map_or(0, first)
    }

    /// Min. squared distance in each lane, and the first block that attains it.
    #[inline(always)]
    fn nearest_by_lane(&self, q: &[f32; DOF]) -> (LaneColumn, [u32; LANES]) {
        let (mut min, mut at) = ([f32::INFINITY; LANES], [0; LANES]);
        for (i, block) in self.blocks.iter().enumerate() {
            let mut squares = [0.0; LANES];
            for (column, q) in block.iter().zip(q) {
                for (square, x) in squares.iter_mut().zip(column) {
                    *square += (x - q) * (x - q);
                }
            }
            for ((min, at), square) in min.iter_mut().zip(&mut at).zip(squares) {
                let is_closer = square < *min;
                *at = if is_closer { i as u32 } else { *at };
                *min = if is_closer { square } else { *min };
            }
        }
        (min, at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_returns_the_first_minimum_in_any_lane() {
        for count in [1, 15, 16, 17, 100] {
            let configuration =
                |k: usize| std::array::from_fn(|i| libm::sinf((k % 40 * 7 + i * i) as f32));
            let all: Vec<[f32; DOF]> = (0..count).map(configuration).collect();
            let configurations = ConfigurationIndex::new(all.iter().copied());
            for k in 0..60 {
                let q = std::array::from_fn(|i| libm::sinf((k * 7 + i * i) as f32 + 0.01));
                let distance = |k: usize| {
                    let squares =
                        all[k].iter().zip(&q).map(|(a, b): (&f32, &f32)| (a - b) * (a - b));
                    squares.sum::<f32>()
                };
                // `min_by` returns the first of equal elements; configurations 40 indices apart are equal.
                let expected = (0..count).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
                assert_eq!(Some(configurations.nearest(&q)), expected, "{count} configurations");
            }
        }
    }

    #[test]
    fn nearest_returns_zero_when_empty_or_nan() {
        assert_eq!(ConfigurationIndex::new(std::iter::empty()).nearest(&[0.0; DOF]), 0);
        let two = ConfigurationIndex::new([[0.0; DOF], [1.0; DOF]].into_iter());
        assert_eq!(two.nearest(&[f32::NAN; DOF]), 0);
    }
}
