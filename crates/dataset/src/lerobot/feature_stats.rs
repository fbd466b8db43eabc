//! Statistics of all rows by feature, as policies need them for normalization: `meta/stats.json`.
//!
//! Two passes over the rows bound the memory: the first finds ranges and means, the second fills histograms.

use crate::parquet_io::{Column, Columns};
use serde_json::{Map, Value, json};

/// Bins of a histogram. Quantiles are accurate to the width of a bin: 1/4096 of the range of the values.
const NUM_BINS: usize = 4096;

/// Quantiles by their name in LeRobot.
const QUANTILES: [(&str, f64); 5] =
    [("q01", 0.01), ("q10", 0.1), ("q50", 0.5), ("q90", 0.9), ("q99", 0.99)];

/// First pass: number of rows, and range and sum of each component of each feature.
#[derive(Clone, Debug, Default)]
pub struct FeatureRanges {
    features: Vec<(&'static str, Vec<Range>)>,
    num_rows: usize,
}

/// Second pass: distribution of each component of each feature.
#[derive(Clone, Debug)]
pub struct FeatureStats {
    features: Vec<(&'static str, Vec<Distribution>)>,
    num_rows: usize,
}

#[derive(Clone, Copy, Debug)]
struct Range {
    count: usize,
    min: f64,
    max: f64,
    sum: f64,
}

#[derive(Clone, Debug)]
struct Distribution {
    range: Range,
    /// Sum of the squared distances from the mean.
    sum_of_squares: f64,
    bins: Vec<usize>,
}

impl FeatureRanges {
    /// Adds rows; all calls have the same columns.
    pub fn add(&mut self, columns: &Columns) {
        if self.features.is_empty() {
            let range = Range { count: 0, min: f64::INFINITY, max: f64::NEG_INFINITY, sum: 0.0 };
            let ranges =
                columns.iter().map(|(name, column)| (*name, vec![range; components(column)]));
            self.features = ranges.collect();
        }
        self.num_rows += columns.first().map_or(0, |(_, column)| num_rows(column));
        for ((_, ranges), (_, column)) in self.features.iter_mut().zip(columns) {
            for_each_value(column, |component, x| {
                let range = &mut ranges[component];
                range.count += 1;
                range.sum += x;
                (range.min, range.max) = (range.min.min(x), range.max.max(x));
            });
        }
    }

    /// Starts the second pass, which must add the same rows.
    pub fn into_stats(self) -> FeatureStats {
        // JSON cannot represent the infinite range of no rows.
        let finite = |range: Range| match range.count {
            0 => Range { min: 0.0, max: 0.0, ..range },
            _ => range,
        };
        let distribution = |range| Distribution {
            range: finite(range),
            sum_of_squares: 0.0,
            bins: vec![0; NUM_BINS],
        };
        let features = self.features.into_iter();
        let features = features
            .map(|(name, ranges)| (name, ranges.into_iter().map(distribution).collect()))
            .collect();
        FeatureStats { features, num_rows: self.num_rows }
    }
}

impl FeatureStats {
    /// Adds rows of the first pass.
    pub fn add(&mut self, columns: &Columns) {
        for ((_, distributions), (_, column)) in self.features.iter_mut().zip(columns) {
            for_each_value(column, |component, x| distributions[component].add(x));
        }
    }

    /// Contents of `meta/stats.json`.
    pub(super) fn json(&self) -> Value {
        let features = self.features.iter().map(|(name, distributions)| {
            let all = |of: &dyn Fn(&Distribution) -> f64| -> Value {
                distributions.iter().map(of).collect::<Vec<f64>>().into()
            };
            let mut stats = Map::from_iter([
                ("min".to_owned(), all(&|of| of.range.min)),
                ("max".to_owned(), all(&|of| of.range.max)),
                ("mean".to_owned(), all(&|of| of.range.mean())),
                ("std".to_owned(), all(&Distribution::std)),
                ("count".to_owned(), json!([self.num_rows])),
            ]);
            stats.extend(
                QUANTILES.map(|(name, level)| (name.to_owned(), all(&|of| of.quantile(level)))),
            );
            ((*name).to_owned(), stats.into())
        });
        Value::Object(features.collect())
    }
}

impl Range {
    fn mean(&self) -> f64 {
        // The sum of equal values is rounded; their mean is not.
        if self.min == self.max { self.min } else { self.sum / self.count as f64 }
    }
}

impl Distribution {
    fn add(&mut self, x: f64) {
        let distance = x - self.range.mean();
        self.sum_of_squares += distance * distance;
        let position = (x - self.range.min) / self.bin_width();
        // Equal values have bins without width.
        let bin = if position.is_finite() { position as usize } else { 0 };
        self.bins[bin.min(NUM_BINS - 1)] += 1;
    }

    fn bin_width(&self) -> f64 {
        (self.range.max - self.range.min) / NUM_BINS as f64
    }

    fn std(&self) -> f64 {
        libm::sqrt(self.sum_of_squares / self.range.count.max(1) as f64)
    }

    /// Value that a fraction `level` of the values does not exceed, interpolated within its bin.
    fn quantile(&self, level: f64) -> f64 {
        let wanted = level * self.range.count as f64;
        let mut below = 0.0;
        for (i, count) in self.bins.iter().enumerate() {
            let count = *count as f64;
            if count > 0.0 && below + count >= wanted {
                let fraction = (wanted - below) / count;
                return self.range.min + (i as f64 + fraction) * self.bin_width();
            }
            below += count;
        }
        self.range.max
    }
}

/// Number of rows of a column of numbers.
fn num_rows(column: &Column) -> usize {
    match column {
        Column::Floats(values) => values.len(),
        Column::Integers(values) => values.len(),
        Column::Vectors(values, width) => values.len() / width,
        Column::Clouds(values, points) => values.len() / (3 * points),
        Column::Flags(_) | Column::Texts(_) | Column::TextList(_) => 0,
    }
}

/// Number of components with separate statistics. All points of a cloud share those of x, y and z, because
/// their order is arbitrary.
fn components(column: &Column) -> usize {
    match column {
        Column::Vectors(_, width) => *width,
        Column::Clouds(..) => 3,
        _ => 1,
    }
}

/// Calls `visit` with the component and the value of each number in a column.
fn for_each_value(column: &Column, mut visit: impl FnMut(usize, f64)) {
    match column {
        Column::Integers(values) => values.iter().for_each(|x| visit(0, *x as f64)),
        Column::Floats(values) | Column::Vectors(values, _) | Column::Clouds(values, _) => {
            for vector in values.chunks_exact(components(column)) {
                vector.iter().enumerate().for_each(|(i, x)| visit(i, f64::from(*x)));
            }
        }
        Column::Flags(_) | Column::Texts(_) | Column::TextList(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stats(batches: &[Columns]) -> Value {
        let mut ranges = FeatureRanges::default();
        batches.iter().for_each(|batch| ranges.add(batch));
        let mut stats = ranges.into_stats();
        batches.iter().for_each(|batch| stats.add(batch));
        stats.json()
    }

    #[test]
    fn moments_match_rows_of_several_batches() {
        let batch = |values: &[f32], index: &[i64]| -> Columns {
            vec![
                ("v", Column::Vectors(values.to_vec(), 2)),
                ("i", Column::Integers(index.to_vec())),
            ]
        };
        let json = stats(&[batch(&[1.0, 2.0, 3.0, 6.0], &[4, 5]), batch(&[5.0, 4.0], &[9])]);
        // Variances: (4 + 0 + 4) / 3, (4 + 4 + 0) / 3 and (4 + 1 + 9) / 3.
        assert_eq!(json["v"]["mean"], json!([3.0, 4.0]));
        assert_eq!(json["v"]["std"], json!([f64::sqrt(8.0 / 3.0), f64::sqrt(8.0 / 3.0)]));
        assert_eq!(
            (&json["v"]["min"], &json["v"]["max"]),
            (&json!([1.0, 2.0]), &json!([5.0, 6.0]))
        );
        assert_eq!(json["v"]["count"], json!([3]));
        assert_eq!((&json["i"]["mean"], &json["i"]["max"]), (&json!([6.0]), &json!([9.0])));
        assert_eq!(json["i"]["std"], json!([f64::sqrt(14.0 / 3.0)]));
    }

    #[test]
    fn quantiles_of_uniform_values_are_within_a_bin() {
        let values: Vec<f32> = (0..=10_000).map(|i| (i * 7919 % 10_001) as f32 / 100.0).collect();
        let json = stats(&[vec![("x", Column::Floats(values))]]);
        for (name, level) in QUANTILES {
            let found = json["x"][name][0].as_f64().unwrap();
            assert!((found - 100.0 * level).abs() < 100.0 / NUM_BINS as f64, "{name}: {found}");
        }
    }

    #[test]
    fn equal_values_have_no_spread() {
        let json = stats(&[vec![("x", Column::Floats(vec![0.1; 1000]))]]);
        let value = json!([f64::from(0.1_f32)]);
        for name in ["min", "max", "mean", "q01", "q50", "q99"] {
            assert_eq!(json["x"][name], value, "{name}");
        }
        assert_eq!(json["x"]["std"], json!([0.0]));
    }

    #[test]
    fn statistics_of_no_rows_are_zero() {
        let json = stats(&[vec![("x", Column::Vectors(vec![], 2))]]);
        for name in ["min", "max", "mean", "std", "q50"] {
            assert_eq!(json["x"][name], json!([0.0, 0.0]), "{name}");
        }
        assert_eq!(json["x"]["count"], json!([0]));
    }

    #[test]
    fn points_of_a_cloud_share_their_statistics() {
        let clouds = vec![0.0, 1.0, 2.0, 4.0, 5.0, 6.0];
        let json = stats(&[vec![("cloud", Column::Clouds(clouds, 2))]]);
        assert_eq!(json["cloud"]["mean"], json!([2.0, 3.0, 4.0]));
        assert_eq!(json["cloud"]["std"], json!([2.0, 2.0, 2.0]));
        assert_eq!(json["cloud"]["count"], json!([1]));
    }
}
