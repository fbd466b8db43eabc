//! How sure a success rate is.

/// Of the normal distribution, for 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// The Wilson score interval (95 %) for k successes in n trials; all of it if there were none.
pub fn wilson95(k: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (n as f64, k as f64 / n as f64);
    let middle = p + Z * Z / (2.0 * n);
    let spread = Z * libm::sqrt(p * (1.0 - p) / n + Z * Z / (4.0 * n * n));
    let scale = 1.0 + Z * Z / n;
    [((middle - spread) / scale).max(0.0), ((middle + spread) / scale).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_gives_the_textbook_intervals() {
        // Newcombe (1998), table I.
        for (k, n, wanted) in [
            (81, 263, [0.2553, 0.3662]),
            (15, 148, [0.0624, 0.1605]),
            (0, 20, [0.0, 0.1611]),
            (1, 29, [0.0061, 0.1718]),
        ] {
            let got = wilson95(k, n);
            let error = (0..2).map(|i| (got[i] - wanted[i]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-4, "{k} of {n}: wanted {wanted:?}, got {got:?}");
        }
        assert_eq!(wilson95(0, 0), [0.0, 1.0]);
    }
}
