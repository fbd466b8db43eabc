//! How often attempts succeed, and how sure that is.

use serde::Serialize;
use std::collections::BTreeSet;

/// Attempts with one object, each counted once however often it is repeated.
#[derive(Debug, Default)]
pub(crate) struct Attempts {
    tally: Tally,
    /// Seed, and the bits of the pose.
    seen: BTreeSet<[u32; 4]>,
}

impl Attempts {
    /// Counts an attempt that is new.
    pub(crate) fn count(&mut self, seed: u32, pose: [f32; 3], is_lifted: bool) {
        let [x, y, yaw] = pose.map(f32::to_bits);
        if self.seen.insert([seed, x, y, yaw]) {
            self.tally.count(is_lifted);
        }
    }

    /// The count.
    pub(crate) fn tally(&self) -> Tally {
        self.tally
    }
}

/// Attempts so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Tally {
    lifted: u32,
    attempts: u32,
    interval: [f64; 2],
}

impl Tally {
    /// Counts one more attempt.
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
    fn a_tally_counts() {
        let mut attempts = Attempts::default();
        let [here, there] = [[0.5, 0.0, 1.0], [0.5, 0.1, 1.0]];
        for (seed, pose, is_lifted) in [(0, here, true), (1, here, false), (1, there, true)] {
            attempts.count(seed, pose, is_lifted);
            attempts.count(seed, pose, is_lifted);
        }
        let tally = attempts.tally();
        assert_eq!((tally.lifted, tally.attempts), (2, 3));
        let [least, most] = tally.interval;
        assert!((least - 0.2077).abs() < 1e-3 && (most - 0.9385).abs() < 1e-3, "{least} {most}");
    }
}
