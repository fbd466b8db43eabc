//! Search for a grasp near the final configuration of a policy.
//!
//! A policy that imitates grasps ends some centimetres from them. Where the hand can also grasp the object from there,
//! such a grasp is easier to imitate: the policy already does what it demonstrates.

use crate::plan::lift;
use crate::search::candidates::{self, CandidateConfig};
use crate::search::closing::ClosingConfig;
use crate::search::trial::{self, TrialOutcome, TrialProtocol};
use crate::search::{GraspTester, SearchConfig};
use crate::set::grasp::Grasp;
use crate::set::k_medoids::palm_distance;
use crate::{GraspBranch, PlacedObject, Posture, RobotContext};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::hand_model::FINGER_FLEXION_DOF;
use robot::{ARM_DOF, FINGER_DOF, HAND_DOF, Isometry, JointVector, NUM_FINGERS, Vector, rotation};
use scene::SceneError;

/// Number of palm poses at which the hand is closed: that of the configuration, and others with larger and larger
/// perturbations.
const NUM_PALMS: usize = 24;

/// Maximum perturbation of the last one along each of its axes (m), and about each (rad).
const MAX_SHIFT: f64 = 0.03;
const MAX_TURN: f64 = 0.3;

/// Maximum number of trials with closed hands.
const MAX_TRIALS: usize = 14;

/// Fractions of the way from the configuration to the demonstrated grasp. Thin objects need them: without them, a grasp
/// near `models/any-object` was found at 34 % of the poses of generated rods (565) and 35 % of hammers (571).
const FRACTIONS: [f64; 3] = [0.25, 0.5, 0.75];

/// Trials of a lifting grasp with an error of the hand.
const NUM_REPEATS: usize = 3;
/// Number of these trials that lift with a robust grasp.
pub const MIN_REPEAT_SUCCESSES: usize = 2;

/// Error of the palm in these trials along each of its axes (m) and about each (rad), and range of the fraction of the
/// squeeze. The shift is about half of that in [`robustness`](crate::search::robustness).
const PALM_SHIFT: f64 = 0.008;
const PALM_TURN: f64 = 0.08;
const SQUEEZE_FRACTION: [f64; 2] = [0.7, 1.0];

/// Range of a joint's share in the flexion of a finger, as multiples of the hand's own.
const FLEXION_RANGE: [f64; 2] = [0.4, 1.6];

/// A grasp that lifts, near a configuration.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct NearbyGrasp {
    /// The grasp.
    pub grasp: Grasp,
    /// Index of the placement above which it is planned.
    pub lowering: usize,
    /// Index of the IK seed with which it is planned.
    pub ik_seed: usize,
    /// Distance (m) between the palm poses of grasp and configuration ([`palm_distance`]).
    pub distance: f64,
    /// Number of trials with an error that lift, up to [`MIN_REPEAT_SUCCESSES`].
    pub repeat_successes: usize,
}

/// A configuration in the neighbourhood of which grasps are searched.
#[derive(Clone, Copy, Debug)]
pub struct Neighborhood<'a> {
    /// Joint positions (rad).
    pub end: &'a JointVector,
    /// The grasp that is demonstrated there. Hands are closed from its pregrasp posture.
    pub demonstrated: &'a Grasp,
    /// Indices of the placements that are tried, that of the demonstrated grasp first.
    pub lowerings: &'a [usize],
    /// Seed of the perturbations.
    pub seed: u64,
}

/// Searches for a grasp near a configuration. `None` if none is found.
///
/// First, the hand is closed at palm poses around that of the configuration. Then, the demonstrated grasp is moved
/// towards it. The grasps are tried in physics, the nearest first. The first is selected that also lifts with an error of
/// the hand, or else the one that lifts most often.
///
/// `placed`: the object above the table, then above lowered tables ([`RobotContext::above_lowered_table`]); grasps are
/// planned above these and tried above the first.
pub fn find_nearby_grasp(
    robot: &RobotContext,
    placed: &[PlacedObject],
    near: Neighborhood,
) -> Result<Option<NearbyGrasp>, SceneError> {
    let search = NearbySearch { robot, placed, near };
    let closed = search.select(&search.close(), MAX_TRIALS)?;
    if closed.as_ref().is_some_and(NearbyGrasp::is_robust) {
        return Ok(closed);
    }
    let moved = search.select(&search.move_demonstrated(), usize::MAX)?;
    let is_better = moved.as_ref().is_some_and(|moved| {
        closed.as_ref().is_none_or(|closed| moved.repeat_successes > closed.repeat_successes)
    });
    Ok(if is_better { moved } else { closed })
}

impl NearbyGrasp {
    fn is_robust(&self) -> bool {
        self.repeat_successes == MIN_REPEAT_SUCCESSES
    }
}

struct NearbySearch<'a> {
    robot: &'a RobotContext,
    placed: &'a [PlacedObject<'a>],
    near: Neighborhood<'a>,
}

/// A grasp that has not been tried, with its lowering and its distance from the configuration.
struct Proposal {
    grasp: Grasp,
    lowering: usize,
    distance: f64,
}

impl NearbySearch<'_> {
    /// The first robust one of some grasps, or else the one that lifts most often. Stops after `max_trials`.
    fn select(
        &self,
        proposals: &[Proposal],
        max_trials: usize,
    ) -> Result<Option<NearbyGrasp>, SceneError> {
        let mut best: Option<NearbyGrasp> = None;
        let mut num_trials = 0;
        for Proposal { grasp, lowering, distance } in proposals {
            if num_trials >= max_trials {
                break;
            }
            let planned = &self.placed[*lowering];
            let Some((GraspBranch { ik_seed, .. }, posture)) =
                planned.plan_grasp(0, std::slice::from_ref(grasp))
            else {
                continue;
            };
            num_trials += 1;
            if !self.lifts(planned, &posture, TrialProtocol::SHORT)? {
                continue;
            }
            let (tried, repeat_successes) = self.repeat(planned, grasp)?;
            num_trials += tried;
            if best.as_ref().is_none_or(|best| repeat_successes > best.repeat_successes) {
                let (grasp, lowering, distance) = (grasp.clone(), *lowering, *distance);
                best = Some(NearbyGrasp { grasp, lowering, ik_seed, distance, repeat_successes });
            }
            if best.as_ref().is_some_and(NearbyGrasp::is_robust) {
                break;
            }
        }
        Ok(best)
    }

    /// Palm pose of the configuration, in the frame of the object with an index of the placements.
    fn object_from_palm(&self, lowering: usize) -> Isometry {
        let world_from_palm = self.robot.tree.forward_kinematics(self.near.end).palm_pose();
        let world_from_object = rotation::to_isometry(&self.placed[lowering].world_from_object);
        world_from_object.inverse() * world_from_palm
    }

    /// Closes the hand at palm poses around that of the configuration. Returns the closed grasps, the nearest first.
    fn close(&self) -> Vec<Proposal> {
        let Neighborhood { end, demonstrated, lowerings, seed } = self.near;
        let config = SearchConfig::paper(self.robot);
        let tester = GraspTester::new(self.robot, self.placed[0].object, &config, seed);
        let candidate =
            CandidateConfig { pregrasp: demonstrated.pregrasp, ..config.candidate.clone() };
        let closing = closing_towards(&candidate.closing, &demonstrated.pregrasp, end);
        let mut found = Vec::new();
        for index in 0..NUM_PALMS {
            let fraction = index as f64 / NUM_PALMS as f64;
            let (shift, turn) = (fraction * MAX_SHIFT, fraction * MAX_TURN);
            for &lowering in lowerings {
                let wanted = self.object_from_palm(lowering);
                let mut rng = tester.candidate_rng(index);
                let palm = candidates::perturb_palm(&wanted, shift, turn, &mut rng);
                if let Ok((grasp, _)) = tester.close_in_proportion(palm, &candidate, &closing) {
                    let distance = palm_distance(&wanted, &grasp.object_from_palm);
                    found.push(Proposal { grasp, lowering, distance });
                }
            }
        }
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        found
    }

    /// The demonstrated grasp with its palm on the way from the configuration to it, the nearest first.
    fn move_demonstrated(&self) -> Vec<Proposal> {
        let Neighborhood { demonstrated, lowerings, .. } = self.near;
        let Some(&lowering) = lowerings.first() else { return Vec::new() };
        let wanted = self.object_from_palm(lowering);
        let propose = |fraction| {
            let object_from_palm = interpolate(&wanted, &demonstrated.object_from_palm, fraction);
            let distance = palm_distance(&wanted, &object_from_palm);
            Proposal {
                grasp: Grasp { object_from_palm, ..demonstrated.clone() },
                lowering,
                distance,
            }
        };
        FRACTIONS.map(propose).into()
    }

    /// Tries a grasp with errors of palm and squeeze. Returns the number of trials and of those that lift. Stops as soon
    /// as the result is certain.
    fn repeat(&self, planned: &PlacedObject, grasp: &Grasp) -> Result<(usize, usize), SceneError> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.near.seed);
        let mut lifted = 0;
        for tried in 0..NUM_REPEATS {
            if lifted == MIN_REPEAT_SUCCESSES || lifted + NUM_REPEATS - tried < MIN_REPEAT_SUCCESSES
            {
                return Ok((tried, lifted));
            }
            let palm =
                candidates::perturb_palm(&grasp.object_from_palm, PALM_SHIFT, PALM_TURN, &mut rng);
            let fraction = rng.random_range(SQUEEZE_FRACTION[0]..=SQUEEZE_FRACTION[1]);
            let squeeze = std::array::from_fn(|i| {
                grasp.grasp[i] + fraction * (grasp.squeeze[i] - grasp.grasp[i])
            });
            let perturbed = Grasp { object_from_palm: palm, squeeze, ..grasp.clone() };
            if let Some(posture) = planned.solve_posture(&perturbed) {
                let lifts = self.lifts(planned, &posture, TrialProtocol::SCREENING)?;
                lifted += usize::from(lifts);
            }
        }
        Ok((NUM_REPEATS, lifted))
    }

    /// Whether a grasp lifts that is planned above one of the tables.
    fn lifts(
        &self,
        planned: &PlacedObject,
        posture: &Posture,
        protocol: TrialProtocol,
    ) -> Result<bool, SceneError> {
        let lift = lift::plan_from_grasp(planned, posture)?;
        let lift = lift.filter(|lift| lift::reaches_hold_height(self.robot, lift));
        let Some(lift) = lift else { return Ok(false) };
        let outcome = trial::try_grasp(&self.placed[0], posture, &lift, protocol)?;
        Ok(matches!(outcome, TrialOutcome::Lifted { .. }))
    }
}

/// Pose on the way from `a` to `b`: the translation along a line, the rotation about a fixed axis.
fn interpolate(a: &Isometry, b: &Isometry, fraction: f64) -> Isometry {
    let turn = rotation::log(&(a.rotation.inverse() * b.rotation));
    let angle = turn.norm();
    let axis = if angle > 0.0 { turn / angle } else { Vector::z() };
    let rotation = a.rotation * rotation::from_axis_angle(&axis, fraction * angle);
    let translation = a.translation.vector.lerp(&b.translation.vector, fraction);
    Isometry::from_parts(translation.into(), rotation)
}

/// Closing in the proportions in which a configuration has flexed the fingers. Sampled proportions would differ from
/// pose to pose, and a policy would imitate their mean.
fn closing_towards(
    config: &ClosingConfig,
    pregrasp: &[f64; HAND_DOF],
    end: &JointVector,
) -> ClosingConfig {
    let in_proportion = |fingers: std::ops::Range<usize>, rates: [f64; FINGER_FLEXION_DOF]| {
        // Joint 0 of a finger does not flex it.
        let flexed = |finger: usize, joint: usize| {
            let i = FINGER_DOF * finger + 1 + joint;
            (end[ARM_DOF + i] - pregrasp[i]).max(0.0)
        };
        let flexed: [f64; FINGER_FLEXION_DOF] =
            std::array::from_fn(|joint| fingers.clone().map(|finger| flexed(finger, joint)).sum());
        let (sum, total): (f64, f64) = (flexed.iter().sum(), rates.iter().sum());
        std::array::from_fn(|joint| {
            let [min, max] = FLEXION_RANGE.map(|factor| factor * rates[joint]);
            let rate = if sum > 0.0 { flexed[joint] / sum * total } else { rates[joint] };
            rate.clamp(min, max)
        })
    };
    let thumb = NUM_FINGERS - 1;
    ClosingConfig {
        finger_rates: in_proportion(0..thumb, config.finger_rates),
        thumb_rates: in_proportion(thumb..NUM_FINGERS, config.thumb_rates),
        ..*config
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::catalog::catalog_grasps;
    use objects::object::Object;

    /// Final configuration of a grasp of the sugar box at the centre of the workspace, with its hand moved by `shift`
    /// (m) along y; what is found there.
    fn find(shift: f64) -> (Grasp, Option<NearbyGrasp>) {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("sugar_box").unwrap();
        let placed = PlacedObject::new(&robot, &object, &robot.config.object_pose(0.6, 0.0, 0.4));
        let grasps = catalog_grasps("sugar_box").unwrap().grasps;
        let (branch, _) = placed.reachable(&grasps).next().unwrap();
        let mut moved = grasps[branch.grasp].clone();
        moved.object_from_palm.translation.y += shift;
        let end = placed.solve_posture(&moved).unwrap().squeeze;
        let demonstrated = &grasps[branch.grasp];
        let near = Neighborhood { end: &end, demonstrated, lowerings: &[0], seed: 7 };
        let found = find_nearby_grasp(&robot, std::slice::from_ref(&placed), near).unwrap();
        (grasps[branch.grasp].clone(), found)
    }

    #[test]
    fn grasp_that_works_is_found_where_it_is() {
        let (grasp, found) = find(0.0);
        let found = found.unwrap();
        assert!(found.distance < 1e-3, "{} m", found.distance);
        assert!(palm_distance(&grasp.object_from_palm, &found.grasp.object_from_palm) < 1e-3);
        assert_eq!(found.repeat_successes, MIN_REPEAT_SUCCESSES);
    }

    #[test]
    fn grasp_is_moved_towards_a_configuration_that_misses_the_object() {
        // At 0.12 m the hand closes next to the box, also where it is perturbed.
        let (_, found) = find(0.12);
        let found = found.unwrap();
        let fraction = found.distance / 0.12;
        assert!(FRACTIONS.iter().any(|wanted| (fraction - wanted).abs() < 1e-3), "{fraction}");
        assert!(fraction > 0.4, "too far from the object: {fraction}");
    }

    #[test]
    fn interpolation_is_exact_at_both_ends() {
        let pose = |x: f64, angles| {
            Isometry::from_parts(Vector::new(x, 0.1, -0.3).into(), rotation::from_rpy(angles))
        };
        let (a, b) = (pose(0.2, [0.3, -0.5, 1.0]), pose(0.5, [-0.4, 0.9, 0.2]));
        assert!(palm_distance(&interpolate(&a, &b, 0.0), &a) < 1e-9);
        assert!(palm_distance(&interpolate(&a, &b, 1.0), &b) < 1e-9);
        let half = interpolate(&a, &b, 0.5);
        let [first, second] =
            [&a, &b].map(|end| rotation::angle_between(&end.rotation, &half.rotation));
        assert!((first - second).abs() < 1e-9 && first > 0.3, "{first} {second}");
        assert_eq!(interpolate(&a, &a, 0.5).translation, a.translation);
    }

    #[test]
    fn fingers_close_in_the_proportions_of_the_configuration() {
        let config = CandidateConfig::standard(
            &scene::SceneConfig::standard().unwrap(),
            robot::HandModel::standard(),
        )
        .closing;
        let pregrasp = [0.1; HAND_DOF];
        let mut end = JointVector::repeat(0.1);
        assert_eq!(closing_towards(&config, &pregrasp, &end).finger_rates, config.finger_rates);
        // Proportional to the rates of the hand, each finger by another amount.
        for finger in 0..NUM_FINGERS {
            let rates =
                if finger == NUM_FINGERS - 1 { config.thumb_rates } else { config.finger_rates };
            for joint in 0..FINGER_FLEXION_DOF {
                end[ARM_DOF + FINGER_DOF * finger + 1 + joint] +=
                    0.1 * (finger + 1) as f64 * rates[joint];
            }
        }
        let found = closing_towards(&config, &pregrasp, &end);
        let pairs = found.finger_rates.iter().zip(&config.finger_rates);
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        // A joint that has not moved still flexes a little.
        (0..NUM_FINGERS - 1).for_each(|finger| end[ARM_DOF + FINGER_DOF * finger + 1] = 0.1);
        let found = closing_towards(&config, &pregrasp, &end);
        let wanted = FLEXION_RANGE[0] * config.finger_rates[0];
        assert!((found.finger_rates[0] - wanted).abs() < 1e-12, "{found:?}");
        assert!(found.finger_rates[1] > config.finger_rates[1]);
    }
}
