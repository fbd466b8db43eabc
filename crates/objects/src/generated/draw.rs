//! Random numbers of a generated object.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random numbers that depend on the name of an object only.
pub(super) struct Draw {
    rng: ChaCha8Rng,
}

impl Draw {
    /// The random numbers of an object.
    pub(super) fn new(family: &str, number: u32) -> Self {
        let mut rng = ChaCha8Rng::from_seed(*blake3::hash(family.as_bytes()).as_bytes());
        rng.set_stream(u64::from(number));
        Self { rng }
    }

    /// Uniform number between `low` and `high`.
    pub(super) fn uniform(&mut self, low: f32, high: f32) -> f32 {
        self.rng.random_range(low..=high)
    }

    /// Number between `low` and `high`, both positive, with a uniform logarithm: each octave is equally likely.
    pub(super) fn scale(&mut self, low: f32, high: f32) -> f32 {
        low * libm::powf(high / low, self.uniform(0.0, 1.0))
    }

    /// True with this probability.
    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    /// Index below `count`.
    pub(super) fn index(&mut self, count: usize) -> usize {
        self.rng.random_range(0..count)
    }
}
