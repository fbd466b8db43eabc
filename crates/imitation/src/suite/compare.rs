//! Two policies from the same seeds: McNemar's test on the attempts in which they differ.

use crate::evaluation::Report;
use std::collections::BTreeMap;

/// What two policies did from the same seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paired {
    /// Seeds from which the first one alone lifted.
    pub first: usize,
    /// Seeds from which the second one alone lifted.
    pub second: usize,
    /// Seeds that both were tried from.
    pub seeds: usize,
    /// Probability (exact, two-sided) of so uneven a split if neither were better.
    pub p: f64,
}

/// Compares two reports seed by seed.
pub fn paired(first: &Report, second: &Report) -> Paired {
    let verdicts: BTreeMap<u64, bool> =
        second.rows.iter().map(|row| (row.seed, row.verdict.is_lifted())).collect();
    let pairs = || {
        let of = |row: &crate::evaluation::Row| {
            Some((row.verdict.is_lifted(), *verdicts.get(&row.seed)?))
        };
        first.rows.iter().filter_map(of)
    };
    let alone = |which: (bool, bool)| pairs().filter(|pair| *pair == which).count();
    let (a, b) = (alone((true, false)), alone((false, true)));
    Paired { first: a, second: b, seeds: pairs().count(), p: sign_test(a, b) }
}

/// Two-sided exact probability of a split of a + b throws of a coin as uneven as a to b.
fn sign_test(a: usize, b: usize) -> f64 {
    let (n, least) = (a + b, a.min(b));
    // Terms in logarithms: 2⁻ⁿ is too small a number for many throws.
    let mut term = -(n as f64) * std::f64::consts::LN_2;
    let mut sum = libm::exp(term);
    for k in 0..least {
        term += libm::log((n - k) as f64 / (k + 1) as f64);
        sum += libm::exp(term);
    }
    (2.0 * sum).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::samples::report;

    #[test]
    fn the_sign_test_has_the_textbook_values() {
        // Sums of binomial coefficients over 2ⁿ, times two.
        for (a, b, wanted) in [
            (0, 0, 1.0),
            (5, 5, 1.0),
            (0, 5, 0.0625),
            (1, 9, 22.0 / 1024.0),
            (15, 5, 2.0 * 21_700.0 / 1_048_576.0),
        ] {
            let got = sign_test(a, b);
            assert!((got - wanted).abs() < 1e-12, "{a} to {b}: {got}, wanted {wanted}");
            assert_eq!(got, sign_test(b, a));
        }
        assert!(sign_test(900, 1100) < 1e-4 && sign_test(900, 1100) > 1e-7);
    }

    #[test]
    fn only_seeds_that_both_were_tried_from_are_compared() {
        let first = report("a", "box", &[true, true, false, true]);
        let second = report("b", "box", &[true, false, true]);
        let wanted = Paired { first: 1, second: 1, seeds: 3, p: 1.0 };
        assert_eq!(paired(&first, &second), wanted);
    }
}
