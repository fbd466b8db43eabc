//! The nearest of many configurations, sixteen at a time.

use policy::lanes::widest;
use robot::DOF;

/// As many numbers as the widest registers hold.
const LANES: usize = 16;

/// One number of each of sixteen configurations.
type Column = [f32; LANES];

/// Configurations, joint by joint: a step of training compares each of its states with thousands.
#[derive(Clone, Debug)]
pub(crate) struct Configurations {
    blocks: Vec<[Column; DOF]>,
}

impl Configurations {
    /// Takes them one by one.
    pub(crate) fn new(configurations: impl Iterator<Item = [f32; DOF]>) -> Self {
        let mut blocks = Vec::new();
        for (i, configuration) in configurations.enumerate() {
            if i % LANES == 0 {
                // Where there is none, it is infinitely far.
                blocks.push([[f32::INFINITY; LANES]; DOF]);
            }
            if let Some(block) = blocks.last_mut() {
                block.iter_mut().zip(configuration).for_each(|(column, q)| column[i % LANES] = q);
            }
        }
        Self { blocks }
    }

    /// The first one at the least distance (Euclidean), of none the number zero.
    pub(crate) fn nearest(&self, q: &[f32; DOF]) -> usize {
        let (least, at) = widest(
            #[inline(always)]
            || self.nearest_by_lane(q),
        );
        let first = |lane: usize| at[lane] as usize * LANES + lane;
        let closer =
            |a: &usize, b: &usize| least[*a].total_cmp(&least[*b]).then(first(*a).cmp(&first(*b)));
        (0..LANES).min_by(closer).map_or(0, first)
    }

    /// Least square of a distance in each lane, and the first block that has it.
    #[inline(always)]
    fn nearest_by_lane(&self, q: &[f32; DOF]) -> (Column, [u32; LANES]) {
        let (mut least, mut at) = ([f32::INFINITY; LANES], [0; LANES]);
        for (i, block) in self.blocks.iter().enumerate() {
            let mut squares = [0.0; LANES];
            for (column, q) in block.iter().zip(q) {
                for (square, x) in squares.iter_mut().zip(column) {
                    *square += (x - q) * (x - q);
                }
            }
            for ((least, at), square) in least.iter_mut().zip(&mut at).zip(squares) {
                let is_closer = square < *least;
                *at = if is_closer { i as u32 } else { *at };
                *least = if is_closer { square } else { *least };
            }
        }
        (least, at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_first_of_the_nearest_in_whatever_lane() {
        for count in [1, 15, 16, 17, 100] {
            let configuration =
                |k: usize| std::array::from_fn(|i| libm::sinf((k % 40 * 7 + i * i) as f32));
            let all: Vec<[f32; DOF]> = (0..count).map(configuration).collect();
            let configurations = Configurations::new(all.iter().copied());
            for k in 0..60 {
                let q = std::array::from_fn(|i| libm::sinf((k * 7 + i * i) as f32 + 0.01));
                let distance = |k: usize| {
                    let squares =
                        all[k].iter().zip(&q).map(|(a, b): (&f32, &f32)| (a - b) * (a - b));
                    squares.sum::<f32>()
                };
                // `min_by` gives the first of equals; those 40 apart are equal.
                let wanted = (0..count).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
                assert_eq!(Some(configurations.nearest(&q)), wanted, "of {count}");
            }
        }
    }

    #[test]
    fn of_none_and_of_what_is_no_number_it_is_the_first() {
        assert_eq!(Configurations::new(std::iter::empty()).nearest(&[0.0; DOF]), 0);
        let two = Configurations::new([[0.0; DOF], [1.0; DOF]].into_iter());
        assert_eq!(two.nearest(&[f32::NAN; DOF]), 0);
    }
}
