//! Which grasps become kinds, where it is known how often each lifts and where it serves.

use crate::cluster;
use crate::grasp::Grasp;
use crate::kind::{OTHER_SIDE, Scored, half_turn};
use geometry::object::Object;

/// What a grasp adds that has no other side counts for less: a cloud hardly tells a pose from that half a turn away, and
/// where both are grasped from one side, it calls for two postures ([`crate::kind`]).
const ONE_SIDED: f64 = 0.7;

/// The least that a kind adds to the share of attempts that lift: each is one more thing to learn, and to mistake for
/// another.
const LEAST_GAIN: f64 = 0.02;

/// A grasp and its other side, if there is one.
#[derive(Clone, Debug)]
struct Sides {
    /// Indices of the grasps.
    grasps: Vec<usize>,
    /// The share of their trials that they lift.
    share: f64,
    /// Whether one of them serves, at each object pose.
    serves: Vec<bool>,
}

/// At most `count` kinds, each a grasp and, where there is one, its other side: one after another that which adds the
/// most to the share of attempts that lift, over object poses. The one that lifts the most comes first: it is taken
/// wherever it serves.
///
/// Of each grasp: the share of its trials that it lifts ([`crate::tolerance::share_among`]), and where it serves
/// ([`crate::tolerance::served`]).
pub fn choose(
    object: &Object,
    found: &[Scored],
    shares: &[f64],
    served: &[Vec<bool>],
    count: usize,
) -> Vec<Grasp> {
    let sides = |grasps: Vec<usize>| Sides {
        share: grasps.iter().map(|&i| shares[i]).sum::<f64>() / grasps.len() as f64,
        serves: (0..served[grasps[0]].len())
            .map(|pose| grasps.iter().any(|&i| served[i][pose]))
            .collect(),
        grasps,
    };
    let all: Vec<Sides> = with_other_sides(object, found, shares).into_iter().map(sides).collect();
    let mut chosen = greatest(&all, count);
    chosen.sort_by(|a, b| b.share.total_cmp(&a.share));
    let numbered = chosen.iter().enumerate();
    numbered
        .flat_map(|(kind, sides)| sides.grasps.iter().map(move |&grasp| (kind, grasp)))
        .map(|(kind, grasp)| Grasp { kind, ..found[grasp].grasp.clone() })
        .collect()
}

/// Every grasp that lifts, alone and with each that may be its other side: one that seldom does is better than none
/// where no other reaches.
fn with_other_sides(object: &Object, found: &[Scored], shares: &[f64]) -> Vec<Vec<usize>> {
    let lifting: Vec<usize> = (0..found.len()).filter(|&i| shares[i] > 0.0).collect();
    let pose = |i: usize| &found[i].grasp.object_from_palm;
    let of_one = |&one: &usize| {
        let turned = half_turn(object, pose(one));
        let is_other = |&i: &usize| i != one && cluster::distance(&turned, pose(i)) < OTHER_SIDE;
        let others = lifting.iter().copied().filter(is_other).map(|other| vec![one, other]);
        std::iter::once(vec![one]).chain(others).collect::<Vec<_>>()
    };
    lifting.iter().flat_map(of_one).collect()
}

/// One after another the sides that add the most, until `count` are chosen or little is added; no grasp twice. What adds
/// little beside those chosen after it makes room.
fn greatest(all: &[Sides], count: usize) -> Vec<&Sides> {
    let at = |sides: &Sides, pose: usize| if sides.serves[pose] { sides.share } else { 0.0 };
    let least = |sides: &Sides| LEAST_GAIN * sides.serves.len() as f64;
    // What sides add to others, over the poses.
    let gain = |sides: &Sides, others: &[&Sides]| {
        let weight = if sides.grasps.len() > 1 { 1.0 } else { ONE_SIDED };
        let best = |pose| others.iter().map(|other| at(other, pose)).fold(0.0, f64::max);
        let added = |pose| (at(sides, pose) - best(pose)).max(0.0);
        weight * (0..sides.serves.len()).map(added).sum::<f64>()
    };
    let mut left: Vec<&Sides> = all.iter().collect();
    let mut chosen: Vec<&Sides> = Vec::new();
    while chosen.len() < count {
        let gains: Vec<f64> = left.iter().map(|sides| gain(sides, &chosen)).collect();
        let most = (0..left.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]));
        let Some(most) = most.filter(|&most| gains[most] > least(left[most])) else { break };
        let new = left[most];
        chosen.push(new);
        left.retain(|sides| !sides.grasps.iter().any(|i| new.grasps.contains(i)));
        let adds_little = |&k: &usize| {
            let others = [&chosen[..k], &chosen[k + 1..]].concat();
            gain(chosen[k], &others) <= least(chosen[k])
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
    fn what_lifts_the_most_comes_first_and_what_later_ones_make_up_for_makes_room() {
        let sides = |grasps: &[usize], share: f64, serves: [u8; 6]| Sides {
            grasps: grasps.to_vec(),
            share,
            serves: serves.map(|x| x > 0).to_vec(),
        };
        // 1 is the other side of 0.
        let all = [
            sides(&[0], 0.9, [1, 1, 0, 0, 0, 0]),
            sides(&[0, 1], 0.85, [1, 1, 1, 1, 0, 0]),
            sides(&[1], 0.8, [0, 0, 1, 1, 0, 0]),
            sides(&[2], 1.0, [1, 0, 0, 0, 1, 0]),
            sides(&[3], 0.8, [0, 0, 0, 0, 1, 0]),
        ];
        let chosen = |all: &[Sides], count| -> Vec<Vec<usize>> {
            greatest(all, count).into_iter().map(|sides| sides.grasps.clone()).collect()
        };
        assert_eq!(chosen(&all, 7), [vec![0, 1], vec![2]]);
        // Alone it serves as many poses, but from one side.
        let wide = sides(&[2], 0.9, [1, 1, 1, 1, 0, 0]);
        assert_eq!(chosen(&[all[1].clone(), wide], 1), [vec![0, 1]]);
        // The first one, which serves four poses, is not needed beside two that serve three each.
        let three = [
            sides(&[4, 5], 0.7, [0, 1, 1, 1, 1, 0]),
            sides(&[6, 7], 0.9, [1, 1, 1, 0, 0, 0]),
            sides(&[8, 9], 0.85, [0, 0, 0, 1, 1, 1]),
        ];
        assert_eq!(chosen(&three, 7), [vec![6, 7], vec![8, 9]]);
        assert!(chosen(&[], 7).is_empty());
    }

    #[test]
    fn the_other_side_of_a_grasp_is_one_that_lifts_too() {
        let object = Object::built_in("bleach").unwrap();
        let scored = |object_from_palm| {
            let hand = [0.0; robot::HAND];
            let grasp = Grasp { kind: 0, object_from_palm, open: hand, touch: hand, squeeze: hand };
            Scored { grasp, again: 0, shaken: None }
        };
        let top = robot::Isometry::translation(0.05, 0.0, 0.3);
        let found = [scored(top), scored(half_turn(&object, &top)), scored(top)];
        let all = with_other_sides(&object, &found, &[0.9, 0.3, 0.0]);
        assert_eq!(all, [vec![0], vec![0, 1], vec![1], vec![1, 0]]);
    }
}
