//! How often attempts succeed, and how sure that is.

use serde::Serialize;

/// Attempts so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Tally {
    lifted: u32,
    attempts: u32,
    interval: [f64; 2],
}

/// Of the normal distribution, for 95 %.
const Z: f64 = 1.959_964;

impl Tally {
    /// Counts one more attempt.
    pub(crate) fn count(&mut self, is_lifted: bool) {
        self.attempts += 1;
        self.lifted += u32::from(is_lifted);
        self.interval = wilson(self.lifted, self.attempts);
    }
}

/// The Wilson score interval (95 %) for `successes` out of `attempts`, which is not zero.
fn wilson(successes: u32, attempts: u32) -> [f64; 2] {
    let n = f64::from(attempts);
    let p = f64::from(successes) / n;
    let z2 = Z * Z;
    let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let reach = Z * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt() / (1.0 + z2 / n);
    [(middle - reach).max(0.0), (middle + reach).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    #[test]
    fn wilson_gives_the_textbook_intervals() {
        // Newcombe (1998), table I: 81/263, 15/148, 0/20, 1/29.
        for (k, n, wanted) in [
            (81, 263, [0.2553, 0.3662]),
            (15, 148, [0.0624, 0.1605]),
            (0, 20, [0.0, 0.1611]),
            (1, 29, [0.0061, 0.1718]),
        ] {
            let got = wilson(k, n);
            let error = (0..2).map(|i| (got[i] - wanted[i]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-4, "{k} of {n}: wanted {wanted:?}, got {got:?}");
        }
    }

    #[test]
    fn a_tally_counts() {
        let mut tally = Tally::default();
        for is_lifted in [true, false, true] {
            tally.count(is_lifted);
        }
        assert_eq!((tally.lifted, tally.attempts), (2, 3));
        assert_eq!(tally.interval, wilson(2, 3));
    }
}
