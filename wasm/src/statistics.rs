//! Success rates of attempts with confidence intervals.

use serde::Serialize;
use std::collections::BTreeSet;

/// Attempts with one object and policy. Repetitions of the same seed and pose count once.
#[derive(Debug, Default)]
pub(crate) struct AttemptStatistics {
    tally: Tally,
    /// Seed and bits of the pose of each counted attempt.
    counted: BTreeSet<[u32; 4]>,
}

impl AttemptStatistics {
    /// Counts an attempt unless it is a repetition.
    pub(crate) fn count(&mut self, seed: u32, pose: [f32; 3], is_lifted: bool) {
        let [x, y, yaw] = pose.map(f32::to_bits);
        if self.counted.insert([seed, x, y, yaw]) {
            self.tally.count(is_lifted);
        }
    }

    /// Counts so far.
    pub(crate) fn tally(&self) -> Tally {
        self.tally
    }
}

/// Number of attempts and successes, with the 95 % Wilson interval of the success rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Tally {
    lifted: u32,
    attempts: u32,
    interval: [f64; 2],
}

impl Tally {
    /// Counts one attempt.
    pub(crate) fn count(&mut self, is_lifted: bool) {
        self.attempts += 1;
        self.lifted += u32::from(is_lifted);
        self.interval = rollout::wilson95(self.lifted as usize, self.attempts as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    #[test]
    fn repeated_attempts_count_once() {
        let mut attempts = AttemptStatistics::default();
        let [first, second] = [[0.5, 0.0, 1.0], [0.5, 0.1, 1.0]];
        for (seed, pose, is_lifted) in [(0, first, true), (1, first, false), (1, second, true)] {
            attempts.count(seed, pose, is_lifted);
            attempts.count(seed, pose, is_lifted);
        }
        let tally = attempts.tally();
        assert_eq!((tally.lifted, tally.attempts), (2, 3));
        let [min, max] = tally.interval;
        assert!((min - 0.2077).abs() < 1e-3 && (max - 0.9385).abs() < 1e-3, "{min} {max}");
    }
}
