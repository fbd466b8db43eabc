//! Selection of grasps by success rate and covered object poses: greedy maximum coverage.

use crate::set::clusters::{HALF_TURN_TOLERANCE, ScoredGrasp, half_turn};
use crate::set::grasp::Grasp;
use crate::set::k_medoids;
use objects::object::Object;
use robot::HandModel;

/// Weight of the gain of a grasp without its half-turn counterpart. A point cloud hardly distinguishes a pose
/// from the pose half a turn away; with a one-sided grasp, similar clouds require two postures
/// ([`crate::set::clusters`]).
const ONE_SIDED_WEIGHT: f64 = 0.7;

/// Minimum gain of a cluster, as a fraction of all attempts. Each cluster is one more posture to learn, and
/// to confuse with another.
const MIN_COVERAGE_GAIN: f64 = 0.02;

/// A grasp and, if there is one, its half-turn counterpart.
#[derive(Clone, Debug)]
struct SymmetricPair {
    /// Indices of the one or two grasps.
    grasps: Vec<usize>,
    /// Mean success rate of the grasps.
    success_rate: f64,
    /// For each object pose, whether one of the grasps covers it.
    covers: Vec<bool>,
}

/// Selects up to `count` clusters, each a grasp and, if there is one, its half-turn counterpart.
///
/// Greedy: each step adds the pair with the largest gain in success rate, averaged over object poses. The
/// result is in order of success rate, because the first cluster is used wherever it is reachable.
///
/// `success_rates` and `covered` are given per grasp, by [`crate::search::robustness::mean_success_rate`] and
/// [`crate::search::robustness::covered_poses`].
pub fn select_grasps(
    hand: &HandModel,
    object: &Object,
    found: &[ScoredGrasp],
    success_rates: &[f64],
    covered: &[Vec<bool>],
    count: usize,
) -> Vec<Grasp> {
    let pair = |grasps: Vec<usize>| SymmetricPair {
        success_rate: grasps.iter().map(|&i| success_rates[i]).sum::<f64>() / grasps.len() as f64,
        covers: (0..covered[grasps[0]].len())
            .map(|pose| grasps.iter().any(|&i| covered[i][pose]))
            .collect(),
        grasps,
    };
    let pairs: Vec<SymmetricPair> =
        with_half_turns(hand, object, found, success_rates).into_iter().map(pair).collect();
    let mut chosen = greedy_cover(&pairs, count);
    chosen.sort_by(|a, b| b.success_rate.total_cmp(&a.success_rate));
    let numbered = chosen.iter().enumerate();
    numbered
        .flat_map(|(cluster, pair)| pair.grasps.iter().map(move |&grasp| (cluster, grasp)))
        .map(|(cluster, grasp)| Grasp { cluster, ..found[grasp].grasp.clone() })
        .collect()
}

/// Each grasp that ever lifts, alone and paired with each candidate for its counterpart. A counterpart with a
/// low success rate is still useful where no other grasp is reachable.
fn with_half_turns(
    hand: &HandModel,
    object: &Object,
    found: &[ScoredGrasp],
    success_rates: &[f64],
) -> Vec<Vec<usize>> {
    let lifting: Vec<usize> = (0..found.len()).filter(|&i| success_rates[i] > 0.0).collect();
    let pose = |i: usize| &found[i].grasp.object_from_palm;
    let of_one = |&one: &usize| {
        let turned = half_turn(hand, object, pose(one));
        let is_other = |&i: &usize| {
            i != one && k_medoids::palm_distance(&turned, pose(i)) < HALF_TURN_TOLERANCE
        };
        let others = lifting.iter().copied().filter(is_other).map(|other| vec![one, other]);
        std::iter::once(vec![one]).chain(others).collect::<Vec<_>>()
    };
    lifting.iter().flat_map(of_one).collect()
}

/// Adds the pairs with the largest gains, until `count` are selected or the gain is too small; no grasp
/// twice. A selected pair that adds little to those selected after it is removed.
fn greedy_cover(pairs: &[SymmetricPair], count: usize) -> Vec<&SymmetricPair> {
    let rate_at =
        |pair: &SymmetricPair, pose: usize| if pair.covers[pose] { pair.success_rate } else { 0.0 };
    let min_gain = |pair: &SymmetricPair| MIN_COVERAGE_GAIN * pair.covers.len() as f64;
    // Gain of a pair over other pairs, summed over object poses.
    let gain = |pair: &SymmetricPair, others: &[&SymmetricPair]| {
        let weight = if pair.grasps.len() > 1 { 1.0 } else { ONE_SIDED_WEIGHT };
        let best = |pose| others.iter().map(|other| rate_at(other, pose)).fold(0.0, f64::max);
        let added = |pose| (rate_at(pair, pose) - best(pose)).max(0.0);
        weight * (0..pair.covers.len()).map(added).sum::<f64>()
    };
    let mut remaining: Vec<&SymmetricPair> = pairs.iter().collect();
    let mut chosen: Vec<&SymmetricPair> = Vec::new();
    while chosen.len() < count {
        let gains: Vec<f64> = remaining.iter().map(|pair| gain(pair, &chosen)).collect();
        let best_index = (0..remaining.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]));
        let Some(best_index) =
            best_index.filter(|&best_index| gains[best_index] > min_gain(remaining[best_index]))
        else {
            break;
        };
        let new = remaining[best_index];
        chosen.push(new);
        remaining.retain(|pair| !pair.grasps.iter().any(|i| new.grasps.contains(i)));
        let adds_little = |&k: &usize| {
            let others = [&chosen[..k], &chosen[k + 1..]].concat();
            gain(chosen[k], &others) <= min_gain(chosen[k])
        };
        if let Some(k) = (0..chosen.len()).find(adds_little) {
            chosen.remove(k);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greedy_cover_orders_by_gain_and_removes_redundant_pairs() {
        let pair = |grasps: &[usize], share: f64, serves: [u8; 6]| SymmetricPair {
            grasps: grasps.to_vec(),
            success_rate: share,
            covers: serves.map(|x| x > 0).to_vec(),
        };
        // Grasp 1 is the half-turn counterpart of grasp 0.
        let all = [
            pair(&[0], 0.9, [1, 1, 0, 0, 0, 0]),
            pair(&[0, 1], 0.85, [1, 1, 1, 1, 0, 0]),
            pair(&[1], 0.8, [0, 0, 1, 1, 0, 0]),
            pair(&[2], 1.0, [1, 0, 0, 0, 1, 0]),
            pair(&[3], 0.8, [0, 0, 0, 0, 1, 0]),
        ];
        let chosen = |all: &[SymmetricPair], count| -> Vec<Vec<usize>> {
            greedy_cover(all, count).into_iter().map(|pair| pair.grasps.clone()).collect()
        };
        assert_eq!(chosen(&all, 7), [vec![0, 1], vec![2]]);
        // A single grasp that covers as many poses loses, because it is one-sided.
        let wide = pair(&[2], 0.9, [1, 1, 1, 1, 0, 0]);
        assert_eq!(chosen(&[all[1].clone(), wide], 1), [vec![0, 1]]);
        // The first pair covers four poses, but the other two cover three each and make it redundant.
        let three = [
            pair(&[4, 5], 0.7, [0, 1, 1, 1, 1, 0]),
            pair(&[6, 7], 0.9, [1, 1, 1, 0, 0, 0]),
            pair(&[8, 9], 0.85, [0, 0, 0, 1, 1, 1]),
        ];
        assert_eq!(chosen(&three, 7), [vec![6, 7], vec![8, 9]]);
        assert!(chosen(&[], 7).is_empty());
    }

    #[test]
    fn half_turn_counterpart_is_paired_only_if_it_lifts() {
        let object = Object::from_catalog("bleach").unwrap();
        let scored = |object_from_palm| {
            let hand = [0.0; robot::HAND_DOF];
            let grasp =
                Grasp { cluster: 0, object_from_palm, pregrasp: hand, grasp: hand, squeeze: hand };
            ScoredGrasp { grasp, repeat_successes: 0, shake_slip: None }
        };
        let top = robot::Isometry::translation(0.05, 0.0, 0.3);
        let hand = HandModel::standard();
        let found = [scored(top), scored(half_turn(hand, &object, &top)), scored(top)];
        let all = with_half_turns(hand, &object, &found, &[0.9, 0.3, 0.0]);
        assert_eq!(all, [vec![0], vec![0, 1], vec![1], vec![1, 0]]);
    }
}
