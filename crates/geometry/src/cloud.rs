//! Point clouds: what a depth camera sees, cropped and thinned to a fixed count.

use crate::Vec3;

/// Farthest-point sampling: `count` indices into `points`, each next one farthest from those before.
///
/// Starts at the first point; ties go to the lower index. With fewer points than asked for, the
/// order repeats from its beginning. Empty input gives no indices.
pub fn farthest_points(points: &[Vec3], count: usize) -> Vec<usize> {
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

/// How far apart (m) two clouds are: the mean distance from each point to the nearest one of the other cloud. Infinite if
/// one of them is empty.
pub fn apart(a: &[Vec3], b: &[Vec3]) -> f32 {
    let nearest = |point: &Vec3, others: &[Vec3]| {
        let squares = others.iter().map(|other| point.distance_squared(*other));
        squares.fold(f32::INFINITY, f32::min).sqrt()
    };
    let there: f32 = a.iter().map(|point| nearest(point, b)).sum();
    let back: f32 = b.iter().map(|point| nearest(point, a)).sum();
    if a.is_empty() || b.is_empty() {
        f32::INFINITY
    } else {
        (there + back) / (a.len() + b.len()) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(count: usize) -> Vec<Vec3> {
        (0..count).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect()
    }

    #[test]
    fn the_farthest_comes_next() {
        assert_eq!(farthest_points(&line(9), 5), [0, 8, 4, 2, 6]);
    }

    #[test]
    fn few_points_repeat_in_order() {
        assert_eq!(farthest_points(&line(2), 5), [0, 1, 0, 1, 0]);
        assert!(farthest_points(&[], 5).is_empty());
    }

    #[test]
    fn clouds_are_apart_by_the_mean_way_to_the_nearest_point() {
        let above: Vec<Vec3> = line(5).into_iter().map(|p| p + Vec3::new(0.0, 0.2, 0.0)).collect();
        assert!((apart(&line(5), &above) - 0.2).abs() < 1e-6);
        // Of 0, 1, 2 and 0, 1 only the last is away from the others.
        assert!((apart(&line(3), &line(2)) - 0.2).abs() < 1e-6);
        assert_eq!(apart(&line(3), &[]), f32::INFINITY);
    }
}
