//! How often attempts succeed, and how sure that is.

use serde::Serialize;

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
        let mut tally = Tally::default();
        for is_lifted in [true, false, true] {
            tally.count(is_lifted);
        }
        assert_eq!((tally.lifted, tally.attempts), (2, 3));
        assert_eq!(tally.interval, rollout::wilson95(2, 3));
    }
}
