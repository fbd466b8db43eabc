//! How sure a success rate is.

/// Of the normal distribution, for 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// The Wilson score interval (95 %) for k successes in n trials; all of it if there were none.
pub fn wilson95(k: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    wilson(k as f64 / n as f64, n as f64)
}

/// The interval (95 %) for objects like these, of each of which the successes and the trials are given.
///
/// Trials with one object are alike, and count for less than as many with different ones: n is divided by how much more
/// the objects' rates differ than those of coins would, and by what so few objects tell of that (Korn & Graubard, Survey
/// Methodology 24, 1998). A single object tells nothing of others: of one it is [`wilson95`], for attempts with that one.
pub fn wilson95_among(counts: &[(usize, usize)]) -> [f64; 2] {
    let [k, n] = [|c: &(usize, usize)| c.0, |c: &(usize, usize)| c.1]
        .map(|part| counts.iter().map(part).sum::<usize>());
    let counts: Vec<_> = counts.iter().filter(|(_, n)| *n > 0).collect();
    if counts.len() < 2 {
        return wilson95(k, n);
    }
    let (p, objects) = (k as f64 / n as f64, counts.len() as f64);
    let off = counts.iter().map(|(k, n)| *k as f64 - p * *n as f64);
    let variance = objects / (objects - 1.0) * off.map(|off| off * off).sum::<f64>();
    // Where all were lifted, or none, objects do not differ.
    let of_coins = n as f64 * p * (1.0 - p);
    let more = if of_coins > 0.0 { (variance / of_coins).max(1.0) } else { 1.0 };
    let (of_trials, of_objects) = (student(n - 1), student(counts.len() - 1));
    let fewer = (of_trials / of_objects) * (of_trials / of_objects);
    wilson(p, n as f64 / more * fewer)
}

fn wilson(p: f64, n: f64) -> [f64; 2] {
    let middle = p + Z * Z / (2.0 * n);
    let spread = Z * libm::sqrt(p * (1.0 - p) / n + Z * Z / (4.0 * n * n));
    let scale = 1.0 + Z * Z / n;
    [((middle - spread) / scale).max(0.0), ((middle + spread) / scale).min(1.0)]
}

/// Of Student's distribution with so many degrees of freedom, for 95 %: the first three from the table, then the series
/// in 1 / ν (Abramowitz & Stegun 26.7.5).
fn student(freedom: usize) -> f64 {
    match freedom {
        0 | 1 => 12.7062,
        2 => 4.3027,
        3 => 3.1824,
        more => {
            let (u, z2) = (1.0 / more as f64, Z * Z);
            let terms = [
                (z2 + 1.0) / 4.0,
                ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0,
                (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0,
            ];
            Z * terms.iter().rev().fold(0.0, |sum, term| (sum + term) * u) + Z
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

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

    #[test]
    fn student_gives_the_table() {
        for (freedom, wanted) in [(4, 2.7764), (5, 2.5706), (10, 2.2281), (30, 2.0423)] {
            let got = student(freedom);
            assert!((got - wanted).abs() < 1e-2, "{freedom}: wanted {wanted}, got {got}");
        }
    }

    #[test]
    fn of_objects_that_differ_the_interval_holds_their_mean() {
        // Rates between 0.4 and 1: their mean is 0.7.
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for objects in [4, 18] {
            let (mut held, mut held_as_if_one) = (0, 0);
            for _ in 0..2000 {
                let mut object = |_| {
                    let rate: f64 = rng.random_range(0.4..1.0);
                    ((0..28).filter(|_| rng.random::<f64>() < rate).count(), 28)
                };
                let counts: Vec<(usize, usize)> = (0..objects).map(&mut object).collect();
                let holds = |[low, high]: [f64; 2]| usize::from((low..=high).contains(&0.7));
                held += holds(wilson95_among(&counts));
                let k = counts.iter().map(|count| count.0).sum();
                held_as_if_one += holds(wilson95(k, 28 * objects));
            }
            println!("{objects} objects: {held} of 2000, {held_as_if_one} as if they were one");
            assert!(held > 1860, "{objects} objects: {held} of 2000");
            assert!(held_as_if_one < 1600, "{objects} objects: {held_as_if_one} of 2000");
        }
    }

    #[test]
    fn of_objects_alike_it_is_nearly_that_of_all_trials() {
        let [of_all, among] = [wilson95(720, 900), wilson95_among(&[(24, 30); 30])];
        let off = (0..2).map(|i| (of_all[i] - among[i]).abs()).fold(0.0, f64::max);
        assert!(off < 2e-3, "{of_all:?}, {among:?}");
        // Few objects tell little, also where all were lifted.
        let [all, nearly] = [[28, 28], [27, 28]].map(|k| wilson95_among(&k.map(|k| (k, 28))));
        assert!(all[0] < 0.5 && nearly[0] < 0.5 && all[1] > 0.999, "{all:?}, {nearly:?}");
        assert_eq!(wilson95_among(&[(5, 9), (0, 0)]), wilson95(5, 9));
        assert_eq!(wilson95_among(&[]), [0.0, 1.0]);
    }
}
