//! Point clouds: downsampling to a fixed count, and the distance between two clouds.

use crate::Vec3;

/// Farthest-point sampling: `count` indices into `points`; each point is the farthest from all previous ones.
///
/// Starts at the first point; the lower index wins a tie. With fewer than `count` points, the sequence of
/// indices repeats. Empty input gives no indices.
///
/// ```rust
/// use geometry::{Vec3, point_cloud::farthest_point_sampling};
/// // Points on a line, 1 m apart: first the ends, then the middle.
/// let line: Vec<Vec3> = (0..9).map(|i| Vec3::X * i as f32).collect();
/// assert_eq!(farthest_point_sampling(&line, 3), [0, 8, 4]);
/// ```
pub fn farthest_point_sampling(points: &[Vec3], count: usize) -> Vec<usize> {
    if points.is_empty() {
        return Vec::new();
    }
    let distinct = count.min(points.len());
    let mut chosen = Vec::with_capacity(count);
    let mut distance = vec![f32::INFINITY; points.len()];
    let mut next = 0;
    while chosen.len() < distinct {
        chosen.push(next);
        let from = points[next];
        let mut farthest = -1.0;
        for (i, (point, nearest)) in points.iter().zip(&mut distance).enumerate() {
            *nearest = nearest.min(from.distance_squared(*point));
            if *nearest > farthest {
                (farthest, next) = (*nearest, i);
            }
        }
    }
    for i in distinct..count {
        chosen.push(chosen[i - distinct]);
    }
    chosen
}

/// Mean distance (m) from each point of both clouds to the nearest point of the other cloud.
///
/// Infinite if a cloud is empty.
///
/// ```rust
/// use geometry::{Vec3, point_cloud::mean_nearest_distance};
/// // The same line of points, 0.2 m higher.
/// let line: Vec<Vec3> = (0..9).map(|i| Vec3::X * i as f32).collect();
/// let above: Vec<Vec3> = line.iter().map(|point| *point + Vec3::Z * 0.2).collect();
/// assert!((mean_nearest_distance(&line, &above) - 0.2).abs() < 1e-6);
/// ```
pub fn mean_nearest_distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    let nearest = |point: &Vec3, others: &[Vec3]| {
        let squares = others.iter().map(|other| point.distance_squared(*other));
        squares.fold(f32::INFINITY, f32::min).sqrt()
    };
    let a_to_b: f32 = a.iter().map(|point| nearest(point, b)).sum();
    let b_to_a: f32 = b.iter().map(|point| nearest(point, a)).sum();
    if a.is_empty() || b.is_empty() {
        f32::INFINITY
    } else {
        (a_to_b + b_to_a) / (a.len() + b.len()) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(count: usize) -> Vec<Vec3> {
        (0..count).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect()
    }

    #[test]
    fn sampling_selects_the_farthest_point_next() {
        assert_eq!(farthest_point_sampling(&line(9), 5), [0, 8, 4, 2, 6]);
    }

    #[test]
    fn indices_repeat_when_points_are_too_few() {
        assert_eq!(farthest_point_sampling(&line(2), 5), [0, 1, 0, 1, 0]);
        assert!(farthest_point_sampling(&[], 5).is_empty());
    }

    #[test]
    fn cloud_distance_is_the_mean_nearest_distance() {
        let above: Vec<Vec3> = line(5).into_iter().map(|p| p + Vec3::new(0.0, 0.2, 0.0)).collect();
        assert!((mean_nearest_distance(&line(5), &above) - 0.2).abs() < 1e-6);
        // Of 0, 1, 2 and 0, 1, only point 2 has a nonzero distance.
        assert!((mean_nearest_distance(&line(3), &line(2)) - 0.2).abs() < 1e-6);
        assert_eq!(mean_nearest_distance(&line(3), &[]), f32::INFINITY);
    }
}
