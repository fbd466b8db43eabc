//! What many measured values come to: the one in the middle, and what nine of ten stay below.

/// Median and 9 of 10.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Half of the values are smaller.
    pub median: f64,
    /// Nine of ten are smaller.
    pub p90: f64,
}

impl Spread {
    /// Of values in any order, if there are any. One that is not a number counts as the greatest.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let at = |tenths: usize| values.get(values.len() * tenths / 10).copied();
        Some(Self { median: at(5)?, p90: at(9)? })
    }
}

/// The median of values in any order, if there are any.
pub fn median(values: Vec<f64>) -> Option<f64> {
    Spread::of(values).map(|spread| spread.median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_are_smaller_than_the_median_and_nine_of_ten_than_the_other() {
        let values: Vec<f64> = (0..100).map(|k| f64::from(k * 37 % 100)).collect();
        let Spread { median, p90 } = Spread::of(values.clone()).unwrap();
        let below = |x: f64| values.iter().filter(|value| **value < x).count();
        assert_eq!([below(median), below(p90)], [50, 90]);
        let lost = Spread::of(vec![f64::NAN, 2.0, f64::INFINITY, 1.0]).unwrap();
        assert!(lost.median == f64::INFINITY && lost.p90.is_nan(), "{lost:?}");
        assert_eq!(Spread::of(vec![3.0]), Some(Spread { median: 3.0, p90: 3.0 }));
        assert_eq!(Spread::of(Vec::new()), None);
    }
}
