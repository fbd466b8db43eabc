//! Confidence intervals of success rates.

/// 97.5 % quantile of the standard normal distribution, for two-sided 95 % intervals.
const Z_95: f64 = 1.959_963_984_540_054;

/// Wilson score interval (95 %) for k successes in n trials; [0, 1] for n = 0.
///
/// ```rust
/// use rollout::wilson95;
/// // The interval of 5 in 10 is symmetric about 0.5.
/// let [low, high] = wilson95(5, 10);
/// assert!(low < 0.5 && (low + high - 1.0).abs() < 1e-12);
/// // Ten times as many trials narrow it.
/// let [many_low, many_high] = wilson95(50, 100);
/// assert!(many_high - many_low < high - low);
/// ```
pub fn wilson95(k: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    wilson(k as f64 / n as f64, n as f64)
}

/// Wilson interval (95 %) of the success rate over a population of objects.
///
/// `counts` holds (successes, trials) per object. Trials with the same object are correlated. Therefore n is
/// divided by the design effect, which compares the variance between objects with the binomial variance, and
/// corrected for the small number of objects (Korn & Graubard, Survey Methodology 24, 1998). A single object
/// gives no information about other objects: the result is [`wilson95`] for that object.
pub fn clustered_wilson95(counts: &[(usize, usize)]) -> [f64; 2] {
    let [k, n] = [|c: &(usize, usize)| c.0, |c: &(usize, usize)| c.1]
        .map(|part| counts.iter().map(part).sum::<usize>());
    let counts: Vec<_> = counts.iter().filter(|(_, n)| *n > 0).collect();
    if counts.len() < 2 {
        return wilson95(k, n);
    }
    let (p, objects) = (k as f64 / n as f64, counts.len() as f64);
    let deviations = counts.iter().map(|(k, n)| *k as f64 - p * *n as f64);
    let variance =
        objects / (objects - 1.0) * deviations.map(|deviation| deviation * deviation).sum::<f64>();
    // If all trials succeeded or all failed, the objects do not differ.
    let binomial = n as f64 * p * (1.0 - p);
    let design_effect = if binomial > 0.0 { (variance / binomial).max(1.0) } else { 1.0 };
    let (t_trials, t_objects) = (student_t_quantile(n - 1), student_t_quantile(counts.len() - 1));
    let correction = (t_trials / t_objects) * (t_trials / t_objects);
    wilson(p, n as f64 / design_effect * correction)
}

fn wilson(p: f64, n: f64) -> [f64; 2] {
    let center = p + Z_95 * Z_95 / (2.0 * n);
    let half_width = Z_95 * libm::sqrt(p * (1.0 - p) / n + Z_95 * Z_95 / (4.0 * n * n));
    let scale = 1.0 + Z_95 * Z_95 / n;
    [((center - half_width) / scale).max(0.0), ((center + half_width) / scale).min(1.0)]
}

/// 97.5 % quantile of Student's t distribution: tabulated up to three degrees of freedom, then the series in
/// 1 / ν (Abramowitz & Stegun 26.7.5).
fn student_t_quantile(degrees: usize) -> f64 {
    match degrees {
        0 | 1 => 12.7062,
        2 => 4.3027,
        3 => 3.1824,
        _ => {
            let (u, z2) = (1.0 / degrees as f64, Z_95 * Z_95);
            let terms = [
                (z2 + 1.0) / 4.0,
                ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0,
                (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0,
            ];
            Z_95 * terms.iter().rev().fold(0.0, |sum, term| (sum + term) * u) + Z_95
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn wilson95_reproduces_published_intervals() {
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

    #[test]
    fn student_t_quantile_reproduces_table() {
        for (degrees, wanted) in [(4, 2.7764), (5, 2.5706), (10, 2.2281), (30, 2.0423)] {
            let got = student_t_quantile(degrees);
            assert!((got - wanted).abs() < 1e-2, "{degrees}: wanted {wanted}, got {got}");
        }
    }

    #[test]
    fn clustered_interval_covers_mean_of_differing_objects() {
        // Success rates are uniform between 0.4 and 1, with the mean 0.7.
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for objects in [4, 18] {
            let (mut covered, mut covered_unclustered) = (0, 0);
            for _ in 0..2000 {
                let mut object = |_| {
                    let rate: f64 = rng.random_range(0.4..1.0);
                    ((0..28).filter(|_| rng.random::<f64>() < rate).count(), 28)
                };
                let counts: Vec<(usize, usize)> = (0..objects).map(&mut object).collect();
                let covers = |[low, high]: [f64; 2]| usize::from((low..=high).contains(&0.7));
                covered += covers(clustered_wilson95(&counts));
                let k = counts.iter().map(|count| count.0).sum();
                covered_unclustered += covers(wilson95(k, 28 * objects));
            }
            println!("{objects} objects: {covered} of 2000, unclustered {covered_unclustered}");
            assert!(covered > 1860, "{objects} objects: {covered} of 2000");
            assert!(covered_unclustered < 1600, "{objects} objects: {covered_unclustered} of 2000");
        }
    }

    #[test]
    fn clustered_interval_equals_pooled_for_similar_objects() {
        let [pooled, clustered] = [wilson95(720, 900), clustered_wilson95(&[(24, 30); 30])];
        let off = (0..2).map(|i| (pooled[i] - clustered[i]).abs()).fold(0.0, f64::max);
        assert!(off < 2e-3, "{pooled:?}, {clustered:?}");
        // Few objects give a wide interval, even if all trials succeeded.
        let [all, nearly] = [[28, 28], [27, 28]].map(|k| clustered_wilson95(&k.map(|k| (k, 28))));
        assert!(all[0] < 0.5 && nearly[0] < 0.5 && all[1] > 0.999, "{all:?}, {nearly:?}");
        assert_eq!(clustered_wilson95(&[(5, 9), (0, 0)]), wilson95(5, 9));
        assert_eq!(clustered_wilson95(&[]), [0.0, 1.0]);
    }
}
