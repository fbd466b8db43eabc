//! Which grasps bear that the hand comes beside its place, and the kinds that lift the most.
//!
//! A policy that has seen one cloud is 10 mm and a few degrees off, and its fingers close all the same. Of the grasps of a
//! heavy bottle some then lift always, others two times in three; few perturbed repeats with the hand alone do not tell
//! them apart.

use crate::grasp::Grasp;
use crate::kind::{OTHER_SIDE, Scored, half_turn};
use crate::place::{Planned, reach, reach_poses};
use crate::trial::{Endurance, Physics, TrialOutcome};
use crate::{Robot, Setting, cluster};
use geometry::object::Object;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use scene::SceneError;

/// Trials of each grasp with arm and hand.
const TRIALS: usize = 24;

/// How far the object stands beside its place, at most: along x and y (m), about the vertical (rad).
const SHIFT: f32 = 0.010;
const TURN: f32 = 0.07;

/// Of the first so many trials at least so many must lift, or no more are made.
const FIRST: [usize; 2] = [8, 5];

/// The least share of its trials that a grasp must lift.
pub const LEAST: f64 = 0.75;

/// What a grasp adds that has no other side counts for less: a cloud hardly tells a pose from that half a turn away, and
/// where both are grasped from one side, it calls for two postures ([`crate::kind`]).
const ONE_SIDED: f64 = 0.5;

/// A hold as long as an attempt's.
const HELD: Endurance = Endurance { is_shaken: false, ..Endurance::FULL };

/// The share of trials beside its place that a grasp lifts with arm and hand; 0 if it is given up early.
pub fn share(robot: &Robot, object: &Object, grasp: &Grasp) -> Result<f64, SceneError> {
    let Some(planned) = Planned::easiest(&Setting::anywhere(robot, object), grasp)? else {
        return Ok(0.0);
    };
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let mut draw = |most: f32| rng.random_range(-most..=most);
    let mut lifted = 0;
    for tried in 0..TRIALS {
        if tried == FIRST[0] && lifted < FIRST[1] {
            return Ok(0.0);
        }
        let beside = [draw(SHIFT), draw(SHIFT), draw(TURN)];
        let outcome = planned.try_beside(Physics::Full, beside, HELD)?;
        lifted += usize::from(matches!(outcome, TrialOutcome::Lifted { .. }));
    }
    Ok(lifted as f64 / TRIALS as f64)
}

/// A grasp and its other side, if there is one, as indices.
type Sides = (usize, Option<usize>);

/// At most `count` kinds, each a grasp and, where there is one, its other side: one after another that which adds the
/// most to the share of attempts that lift, over object poses, where each is grasped by the best that is within reach.
pub fn choose(
    robot: &Robot,
    object: &Object,
    found: &[Scored],
    shares: &[f64],
    count: usize,
) -> Vec<Grasp> {
    let anywhere = Setting::anywhere(robot, object);
    let poses = reach_poses(robot);
    let within: Vec<Vec<bool>> =
        found.iter().map(|found| reach(&anywhere, &poses, &found.grasp)).collect();
    let worth = |grasp: usize, pose: usize| if within[grasp][pose] { shares[grasp] } else { 0.0 };
    greatest(&sides(object, found, shares), &worth, poses.len(), count)
        .into_iter()
        .enumerate()
        .flat_map(|(kind, (one, other))| [Some((kind, one)), other.map(|other| (kind, other))])
        .flatten()
        .map(|(kind, grasp)| Grasp { kind, ..found[grasp].grasp.clone() })
        .collect()
}

/// Every grasp that lifts often enough, alone and with each that may be its other side.
fn sides(object: &Object, found: &[Scored], shares: &[f64]) -> Vec<Sides> {
    let sound: Vec<usize> = (0..found.len()).filter(|&i| shares[i] >= LEAST).collect();
    let pose = |i: usize| &found[i].grasp.object_from_palm;
    let of_one = |&one: &usize| {
        let turned = half_turn(object, pose(one));
        let is_other = |&i: &usize| i != one && cluster::distance(&turned, pose(i)) < OTHER_SIDE;
        let others = sound.iter().copied().filter(is_other).map(Some);
        std::iter::once(None).chain(others).map(|other| (one, other)).collect::<Vec<_>>()
    };
    sound.iter().flat_map(of_one).collect()
}

/// One after another the sides that add the most, until `count` are chosen or nothing is added; none twice.
fn greatest(
    all: &[Sides],
    worth: &dyn Fn(usize, usize) -> f64,
    poses: usize,
    count: usize,
) -> Vec<Sides> {
    let mut left = all.to_vec();
    let mut best = vec![0.0f64; poses];
    let mut chosen = Vec::new();
    while chosen.len() < count {
        let at = |(one, other): &Sides, pose| {
            worth(*one, pose).max(other.map_or(0.0, |other| worth(other, pose)))
        };
        let gain = |sides: &Sides| {
            let weight = if sides.1.is_some() { 1.0 } else { ONE_SIDED };
            weight * (0..poses).map(|pose| (at(sides, pose) - best[pose]).max(0.0)).sum::<f64>()
        };
        let gains: Vec<f64> = left.iter().map(gain).collect();
        let most = (0..left.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]));
        let Some(most) = most.filter(|&most| gains[most] > 0.0) else { break };
        let (one, other) = left[most];
        for (pose, best) in best.iter_mut().enumerate() {
            *best = best.max(at(&(one, other), pose));
        }
        chosen.push((one, other));
        let is_used = |i: usize| i == one || Some(i) == other;
        left.retain(|(one, other)| !is_used(*one) && !other.is_some_and(is_used));
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lifts_the_most_comes_first_and_none_comes_twice() {
        // Shares of five grasps at six poses; 1 is the other side of 0.
        let shares = [
            [0.9, 0.9, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.8, 0.8, 0.0, 0.0],
            [1.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.9, 0.0],
        ];
        let worth = |grasp: usize, pose: usize| shares[grasp][pose];
        let all = [(0, None), (0, Some(1)), (1, None), (2, None), (3, None), (4, None)];
        let chosen = greatest(&all, &worth, 6, 7);
        assert_eq!(chosen, [(0, Some(1)), (3, None), (2, None)]);
        // Alone it would serve as many poses as the other two together.
        let wide = |grasp: usize, pose: usize| if grasp == 2 { 0.9 } else { worth(grasp, pose) };
        assert_eq!(greatest(&all, &wide, 4, 1), [(0, Some(1))]);
        assert_eq!(greatest(&all, &worth, 6, 1), [(0, Some(1))]);
        assert!(greatest(&[], &worth, 6, 7).is_empty());
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
        let all = sides(&object, &found, &[0.9, 0.8, 0.5]);
        assert_eq!(all, [(0, None), (0, Some(1)), (1, None), (1, Some(0))]);
    }
}
