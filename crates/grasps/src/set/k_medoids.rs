//! k-medoids clustering of grasps by palm pose (paper §II-A).

use robot::{Isometry, rotation};

/// Lever arm (m) that converts a rotation (rad) into a distance.
const ROTATION_LEVER: f64 = 0.1;

/// Distance (m) between two palm poses: translation, and rotation at a lever arm of 10 cm.
pub fn palm_distance(a: &Isometry, b: &Isometry) -> f64 {
    let moved = (a.translation.vector - b.translation.vector).norm();
    let turned = rotation::angle_between(&a.rotation, &b.rotation);
    libm::sqrt(moved * moved + ROTATION_LEVER * ROTATION_LEVER * turned * turned)
}

/// Indices of up to `count` medoids of the items `0..total` under `distance`.
///
/// Greedy start: each next medoid reduces the cost most. Then swaps, until no swap reduces the cost.
/// Deterministic: ties select the lower index.
pub fn k_medoids(total: usize, count: usize, distance: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let table: Vec<Vec<f64>> =
        (0..total).map(|a| (0..total).map(|b| distance(a, b)).collect()).collect();
    let cost = |medoids: &[usize]| -> f64 {
        let nearest =
            |row: &Vec<f64>| medoids.iter().map(|&m| row[m]).fold(f64::INFINITY, f64::min);
        table.iter().map(nearest).sum()
    };
    let mut chosen: Vec<usize> = Vec::new();
    for _ in 0..count.min(total) {
        let candidates = (0..total).filter(|i| !chosen.contains(i));
        let priced = candidates.map(|i| (cost(&[chosen.as_slice(), &[i]].concat()), i));
        if let Some((_, best)) = priced.min_by(|a, b| a.0.total_cmp(&b.0)) {
            chosen.push(best);
        }
    }
    loop {
        let before = cost(&chosen);
        let mut best = (before, None);
        for slot in 0..chosen.len() {
            for i in (0..total).filter(|i| !chosen.contains(i)) {
                let mut swapped = chosen.clone();
                swapped[slot] = i;
                let price = cost(&swapped);
                if price < best.0 - 1e-12 {
                    best = (price, Some((slot, i)));
                }
            }
        }
        match best.1 {
            Some((slot, i)) => chosen[slot] = i,
            None => return chosen,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_separate_groups_get_one_medoid_each() {
        let at = |x: f64| Isometry::translation(x, 0.0, 0.0);
        let poses: Vec<_> = [0.0, 0.1, 0.2, 5.0, 5.1, 5.2].map(at).to_vec();
        let mut got = k_medoids(6, 2, |a, b| palm_distance(&poses[a], &poses[b]));
        got.sort();
        assert_eq!(got, [1, 4]);
    }

    #[test]
    fn all_items_become_medoids_when_fewer_than_clusters() {
        assert_eq!(k_medoids(1, 7, |_, _| 0.0), [0]);
        assert!(k_medoids(0, 7, |_, _| 0.0).is_empty());
    }

    #[test]
    fn rotation_distance_is_angle_times_lever() {
        let turned = Isometry::rotation(robot::Vector::z() * 0.5);
        assert!((palm_distance(&Isometry::identity(), &turned) - 0.05).abs() < 1e-9);
    }
}
