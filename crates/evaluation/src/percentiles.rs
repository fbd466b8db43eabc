//! Median and 90th percentile of measured values.

/// Median and 90th percentile of a sample.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MedianP90 {
    /// 50th percentile, in the unit of the values.
    pub median: f64,
    /// 90th percentile, in the unit of the values.
    pub p90: f64,
}

impl MedianP90 {
    /// Percentiles of values in any order; `None` if empty. NaN sorts as the maximum.
    ///
    /// ```rust
    /// use evaluation::percentiles::MedianP90;
    /// // In ascending order, these are the values at n/2 and at 9n/10, counted from 0.
    /// let values: Vec<f64> = (1..=10).map(f64::from).collect();
    /// assert_eq!(MedianP90::of(values), Some(MedianP90 { median: 6.0, p90: 10.0 }));
    /// assert_eq!(MedianP90::of(Vec::new()), None);
    /// ```
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let percentile = |tenths: usize| values.get(values.len() * tenths / 10).copied();
        Some(Self { median: percentile(5)?, p90: percentile(9)? })
    }
}

/// Median of values in any order; `None` if empty.
pub fn median(values: Vec<f64>) -> Option<f64> {
    MedianP90::of(values).map(|spread| spread.median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_values_are_below_the_median_and_nine_tenths_below_p90() {
        let values: Vec<f64> = (0..100).map(|k| f64::from(k * 37 % 100)).collect();
        let MedianP90 { median, p90 } = MedianP90::of(values.clone()).unwrap();
        let below = |x: f64| values.iter().filter(|value| **value < x).count();
        assert_eq!([below(median), below(p90)], [50, 90]);
        let with_nan = MedianP90::of(vec![f64::NAN, 2.0, f64::INFINITY, 1.0]).unwrap();
        assert!(with_nan.median == f64::INFINITY && with_nan.p90.is_nan(), "{with_nan:?}");
        assert_eq!(MedianP90::of(vec![3.0]), Some(MedianP90 { median: 3.0, p90: 3.0 }));
        assert_eq!(MedianP90::of(Vec::new()), None);
    }
}
