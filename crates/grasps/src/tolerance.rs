//! Which grasps bear that the hand comes beside its place, and where they can be used.
//!
//! A policy that has seen one cloud is 10 mm and a few degrees off, and its fingers close all the same. Of the grasps of a
//! heavy bottle some then lift nearly always, others one time in three: those from above slip off its shoulder where the
//! hand comes a centimetre too high. Few perturbed repeats with the hand alone do not tell them apart, and an object that
//! stands on its table is not beside its place in height.
//!
//! Nor does the object itself tell what a grasp is worth on the next one like it. Two grasps of the bleach bottle from
//! straight above lifted 0.83 and 0.62 of their trials; a policy that had learned them lifted the mustard bottle, which it had
//! never seen, 3 times of 36 with them, and 110 of 112 times with the two others (counted once, seeds 1000 to 1149).

use crate::demonstration::TrajectoryConfig;
use crate::grasp::{Grasp, Posture};
use crate::kind::{Scored, half_turn};
use crate::place::{Planned, reach, reach_poses};
use crate::trial::{self, Endurance, Physics, TrialOutcome};
use crate::{Robot, Setting, cluster, demonstration, lift, proposal, transfer};
use geometry::mesh::MeshError;
use geometry::object::Object;
use geometry::proportions::Proportions;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::Isometry;
use scene::SceneError;

/// Trials of each grasp with arm and hand.
const TRIALS: usize = 24;

/// How far the palm is beside its place, at most: along each of its axes (m), about each (rad).
const SHIFT: f64 = 0.015;
const TURN: f64 = 0.1;

/// Of what the fingers press beyond touch, the share that they come to, at least and at most: a policy comes to rest before
/// it is there, with all of them.
const PRESSED: [f64; 2] = [0.7, 1.0];

/// How far each finger joint is beside that, at most (rad).
const OFF: f64 = 0.03;

/// How far beside that in height (m): an object never seen is taller or lower than those that were taught.
const HEIGHT: f64 = 0.015;

/// Of the first so many trials at least so many must lift, or no more are made.
const FIRST: [usize; 2] = [8, 4];

/// The least share of its trials that a grasp must lift.
pub(crate) const LEAST: f64 = 0.5;

/// Motions into a grasp that are planned at a pose before it counts as not served.
const APPROACHES: usize = 2;

/// A hold as long as an attempt's.
const HELD: Endurance = Endurance { is_shaken: false, ..Endurance::FULL };

/// The share of its trials that a good grasp lifts.
pub const GOOD: f64 = 0.66;

/// So many of the good ones are centers, so far apart (m, by [`cluster::distance`]).
const CENTERS: usize = 12;
const APART: f64 = 0.03;

/// Variants on which a grasp is tried too, by their numbers ([`Proportions::of_variant`]): those of the first seven with
/// the lowest shoulders, as far from the object as variants are.
const LIKE: [u32; 2] = [4, 7];

/// An object like another one.
pub struct Like {
    object: Object,
    proportions: Proportions,
}

impl Like {
    /// What is like an object.
    ///
    /// # Errors
    /// What comes of its mesh has no volume.
    pub fn all(object: &Object) -> Result<Vec<Self>, MeshError> {
        let like = |variant| {
            let proportions = Proportions::of_variant(variant);
            Ok(Self { object: object.reshaped("variant", &proportions)?, proportions })
        };
        LIKE.into_iter().map(like).collect()
    }
}

/// The mean of a grasp's shares of trials on the object and, carried over, on what is like it; 0 if it lifts too few on the
/// object itself.
pub fn share_among(
    robot: &Robot,
    object: &Object,
    like: &[Like],
    grasp: &Grasp,
) -> Result<f64, SceneError> {
    let own = share(robot, object, grasp)?;
    if own < LEAST {
        return Ok(0.0);
    }
    let mut sum = own;
    for Like { object: other, proportions } in like {
        if let Some(grasp) = transfer::closed_again(robot, object, grasp, other, proportions) {
            sum += share_of(robot, other, &grasp, FIRST[0])?;
        }
    }
    Ok(sum / (1 + like.len()) as f64)
}

/// The share of trials that a grasp lifts with arm and hand, the palm and the fingers beside their place in each; 0 if it
/// is given up early.
pub fn share(robot: &Robot, object: &Object, grasp: &Grasp) -> Result<f64, SceneError> {
    share_of(robot, object, grasp, TRIALS)
}

fn share_of(
    robot: &Robot,
    object: &Object,
    grasp: &Grasp,
    trials: usize,
) -> Result<f64, SceneError> {
    let Some(planned) = Planned::easiest(&Setting::anywhere(robot, object), grasp)? else {
        return Ok(0.0);
    };
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let mut lifted = 0;
    for tried in 0..trials {
        if tried == FIRST[0] && lifted < FIRST[1] {
            return Ok(0.0);
        }
        let palm = proposal::vary_palm(&grasp.object_from_palm, SHIFT, TURN, &mut rng);
        let raised = Isometry::translation(0.0, 0.0, rng.random_range(-HEIGHT..=HEIGHT));
        let palm = raised * palm;
        let pressed = rng.random_range(PRESSED[0]..=PRESSED[1]);
        let squeeze = std::array::from_fn(|i| {
            let press = pressed * (grasp.squeeze[i] - grasp.touch[i]);
            grasp.touch[i] + press + rng.random_range(-OFF..=OFF)
        });
        let beside = Grasp { object_from_palm: palm, squeeze, ..grasp.clone() };
        lifted += usize::from(lifts(&planned.setting, &beside)?);
    }
    Ok(lifted as f64 / trials as f64)
}

/// Whether a grasp lifts with arm and hand, even if the open hand grazes the object.
fn lifts(setting: &Setting, grasp: &Grasp) -> Result<bool, SceneError> {
    let Some(posture) = setting.posture(grasp) else { return Ok(false) };
    let Some(lift) = lift::plan_after(setting, &posture)? else { return Ok(false) };
    let outcome = trial::try_grasp(Physics::Full, setting, &posture, &lift, HELD)?;
    Ok(matches!(outcome, TrialOutcome::Lifted { .. }))
}

/// Whether, at each of 200 object poses, a grasp is within reach, a motion into it is found, and the arm can lift from there.
pub fn served(robot: &Robot, object: &Object, grasp: &Grasp) -> Result<Vec<bool>, SceneError> {
    let anywhere = Setting::anywhere(robot, object);
    let serves = |pose| {
        let setting = anywhere.elsewhere(pose);
        let Some(posture) = setting.reach(grasp) else { return Ok(false) };
        let lift = lift::plan_after(&setting, &posture)?;
        let rises = lift.is_some_and(|lift| lift::rises_enough(robot, &lift));
        Ok(rises && is_approached(&setting, &posture))
    };
    reach_poses(robot).iter().map(serves).collect()
}

/// Whether a motion into a grasp is found where it is the easiest to reach.
pub(crate) fn is_approachable(
    robot: &Robot,
    object: &Object,
    grasp: &Grasp,
) -> Result<bool, SceneError> {
    let planned = Planned::easiest(&Setting::anywhere(robot, object), grasp)?;
    Ok(planned.is_some_and(|planned| is_approached(&planned.setting, &planned.posture)))
}

/// Whether a motion into a grasp is found from one of a few places above the object.
fn is_approached(setting: &Setting, posture: &Posture) -> bool {
    let Setting { robot, object, world_from_object, .. } = setting;
    let palm = robot.tree.kinematics(&posture.touch).palm();
    let (region, bounds) = (&robot.config.target, &object.bounds);
    let config = TrajectoryConfig::standard();
    let mut rng = ChaCha8Rng::seed_from_u64(78);
    (0..APPROACHES).any(|_| {
        let above = demonstration::draw_target(region, bounds, world_from_object, &palm, &mut rng);
        demonstration::demonstrate(setting, posture, &above, &config).is_ok()
    })
}

/// Palm poses around which to look for more grasps that bear it: those of the best of `found`, by the square of their
/// `shares` and the object poses at which they are within reach, and their half turns.
pub fn centers(robot: &Robot, object: &Object, found: &[Scored], shares: &[f64]) -> Vec<Isometry> {
    let anywhere = Setting::anywhere(robot, object);
    let poses = reach_poses(robot);
    let within = |grasp: &Grasp| reach(&anywhere, &poses, grasp).into_iter().filter(|x| *x).count();
    let good = found.iter().zip(shares).filter(|(_, share)| **share >= GOOD);
    let mut good: Vec<(f64, Isometry)> = good
        .map(|(Scored { grasp, .. }, share)| {
            (share * share * within(grasp) as f64, grasp.object_from_palm)
        })
        .collect();
    good.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut centers: Vec<Isometry> = Vec::new();
    for (_, palm) in good {
        let is_new = centers.iter().all(|other| cluster::distance(&palm, other) > APART);
        if is_new && centers.len() < CENTERS {
            centers.push(palm);
        }
    }
    let turned: Vec<Isometry> = centers.iter().map(|palm| half_turn(object, palm)).collect();
    centers.extend(turned);
    centers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::built_in;

    #[test]
    fn centers_are_the_best_of_those_that_lie_together_and_their_half_turns() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("bleach").unwrap();
        let grasps = built_in("bleach").unwrap().grasps;
        let near = |grasp: &Grasp| {
            let shift = Isometry::translation(0.01, 0.0, 0.0);
            Grasp { object_from_palm: shift * grasp.object_from_palm, ..grasp.clone() }
        };
        let scored = |grasp| Scored { grasp, again: 10, shaken: None };
        // The first one twice, a centimetre apart; the second one; a third that lifts half of the time.
        let [a, b, c] = [0, 2, 3].map(|i| grasps[i].clone());
        let found = [near(&a), a.clone(), b.clone(), c].map(scored);
        let centers = centers(&robot, &object, &found, &[0.7, 1.0, 0.8, 0.5]);
        let of = |grasp: &Grasp| grasp.object_from_palm;
        assert_eq!(centers.len(), 4, "{centers:?}");
        for palm in [of(&a), of(&b)] {
            assert!(centers[..2].contains(&palm), "{centers:?}");
            assert!(centers[2..].contains(&half_turn(&object, &palm)), "{centers:?}");
        }
    }
}
