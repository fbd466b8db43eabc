//! McNemar's test of two policies on the same seeds: compares the attempts with different outcomes.

use crate::EvaluationReport;
use std::collections::BTreeMap;

/// Discordant counts of two policies on the same seeds, with the p-value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedTest {
    /// Number of seeds at which only the first policy lifted.
    pub first_only: usize,
    /// Number of seeds at which only the second policy lifted.
    pub second_only: usize,
    /// Number of seeds that both reports contain.
    pub num_seeds: usize,
    /// Exact two-sided p-value of the sign test on the discordant seeds.
    pub p_value: f64,
}

/// Pairs the attempts of two reports by seed; a seed in only one report is ignored.
pub fn paired_test(first: &EvaluationReport, second: &EvaluationReport) -> PairedTest {
    let lifted_second: BTreeMap<u64, bool> =
        second.rows.iter().map(|row| (row.seed, row.outcome.is_lifted())).collect();
    let pairs = || {
        let of = |row: &crate::AttemptResult| {
            Some((row.outcome.is_lifted(), *lifted_second.get(&row.seed)?))
        };
        first.rows.iter().filter_map(of)
    };
    let count = |outcomes: (bool, bool)| pairs().filter(|pair| *pair == outcomes).count();
    let (a, b) = (count((true, false)), count((false, true)));
    PairedTest {
        first_only: a,
        second_only: b,
        num_seeds: pairs().count(),
        p_value: sign_test(a, b),
    }
}

/// Exact two-sided sign test: probability that a + b fair coin tosses split at least as unevenly as a : b.
fn sign_test(a: usize, b: usize) -> f64 {
    let (n, min) = (a + b, a.min(b));
    // Sums exponentials of logarithms, because 2⁻ⁿ underflows for large n.
    let mut term = -(n as f64) * std::f64::consts::LN_2;
    let mut sum = libm::exp(term);
    for k in 0..min {
        term += libm::log((n - k) as f64 / (k + 1) as f64);
        sum += libm::exp(term);
    }
    (2.0 * sum).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::fixtures::report;

    #[test]
    fn sign_test_matches_textbook_values() {
        // Expected: twice the sum of binomial coefficients, over 2ⁿ.
        for (a, b, expected) in [
            (0, 0, 1.0),
            (5, 5, 1.0),
            (0, 5, 0.0625),
            (1, 9, 22.0 / 1024.0),
            (15, 5, 2.0 * 21_700.0 / 1_048_576.0),
        ] {
            let got = sign_test(a, b);
            assert!((got - expected).abs() < 1e-12, "{a} : {b}: got {got}, expected {expected}");
            assert_eq!(got, sign_test(b, a));
        }
        assert!(sign_test(900, 1100) < 1e-4 && sign_test(900, 1100) > 1e-7);
    }

    #[test]
    fn paired_test_uses_only_seeds_of_both_reports() {
        let first = report("a", "box", &[true, true, false, true]);
        let second = report("b", "box", &[true, false, true]);
        let expected = PairedTest { first_only: 1, second_only: 1, num_seeds: 3, p_value: 1.0 };
        assert_eq!(paired_test(&first, &second), expected);
    }
}
