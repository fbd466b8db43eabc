//! Tests grasps of one object: closes the hand at palm poses, and tries the grasps in physics.

use crate::plan::object_poses::PlannedGrasp;
use crate::search::SearchConfig;
use crate::search::candidates::{
    CandidateConfig, Rejected, SearchTarget, close_in_proportion, evaluate_candidate,
};
use crate::search::closing::ClosingConfig;
use crate::search::contact_forces::Squeeze;
use crate::search::parallel;
use crate::search::trial::{TrialOutcome, TrialProtocol};
use crate::set::clusters::ScoredGrasp;
use crate::set::grasp::Grasp;
use crate::{PlacedObject, RobotContext};
use objects::object::Object;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::Isometry;
use scene::SceneError;

/// Tests grasps of one object under the same perturbations.
pub struct GraspTester<'a> {
    pub(crate) robot: &'a RobotContext,
    pub(crate) object: &'a Object,
    pub(crate) config: &'a SearchConfig,
    pub(crate) at_origin: PlacedObject<'a>,
    pub(crate) target: SearchTarget<'a>,
    /// Displacements of the object in the repeats, the same for every grasp: x, y (m), yaw (rad).
    perturbations: Vec<[f32; 3]>,
    seed: u64,
}

/// Object displacement and load of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Trial {
    /// The object is at the planned pose and lifted a little ([`TrialProtocol::SCREENING`]).
    Screening,
    /// The object is displaced by the perturbation with this index and lifted a little.
    ShortRepeat(usize),
    /// The object is at the planned pose, lifted and held ([`TrialProtocol::SHORT`]).
    Lift,
    /// The object is displaced by the perturbation with this index, lifted and held.
    Repeat(usize),
    /// The object is at the planned pose, lifted and shaken.
    Shaken,
}

/// Result of the trials of a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Robustness {
    /// It does not lift.
    Fails,
    /// It lifts, but not in enough repeats.
    Lifts,
    /// It also lifts in enough repeats.
    Robust,
}

impl<'a> GraspTester<'a> {
    /// A tester for `object`. `seed` determines the perturbations and the random numbers of every candidate.
    pub fn new(
        robot: &'a RobotContext,
        object: &'a Object,
        config: &'a SearchConfig,
        seed: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |reach: f32| rng.random_range(-reach..=reach);
        let [shift, turn] = [config.object_shift, config.object_turn];
        let perturbations =
            (0..config.num_repeats).map(|_| [draw(shift), draw(shift), draw(turn)]).collect();
        Self {
            robot,
            object,
            config,
            at_origin: PlacedObject::at_origin(robot, object),
            target: SearchTarget::new(object, &robot.config),
            perturbations,
            seed,
        }
    }

    /// Random generator of a candidate. Candidates are independent, so no result depends on the number of
    /// threads.
    pub(crate) fn candidate_rng(&self, index: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // Stream 0 has sampled the perturbations of the repeats.
        rng.set_stream(1 + index as u64);
        rng
    }

    /// Closes the hand at a palm pose.
    pub(crate) fn close_at(
        &self,
        palm: Isometry,
        config: &CandidateConfig,
        rng: &mut ChaCha8Rng,
    ) -> Result<(Grasp, Squeeze), Rejected> {
        evaluate_candidate(self.robot, &self.target, config, palm, rng)
    }

    /// Closes the hand at a palm pose, with the finger joints in given proportions.
    pub(crate) fn close_in_proportion(
        &self,
        palm: Isometry,
        config: &CandidateConfig,
        closing: &ClosingConfig,
    ) -> Result<(Grasp, Squeeze), Rejected> {
        close_in_proportion(self.robot, &self.target, config, palm, closing)
    }

    /// Tries each grasp at the object yaw that is easiest to reach; unreachable grasps are omitted. Returns
    /// the scores in order, `None` for a grasp that does not lift.
    pub(crate) fn score_grasps(
        &self,
        grasps: &[Grasp],
    ) -> Result<Vec<Option<ScoredGrasp>>, SceneError> {
        let results = parallel::map(grasps, |grasp| {
            let planned = PlannedGrasp::plan_at_easiest_yaw(&self.at_origin, grasp)?;
            planned.map(|planned| self.score_grasp(grasp, &planned)).transpose()
        });
        results.into_iter().filter_map(Result::transpose).collect()
    }

    /// Whether a grasp lifts, and in enough short repeats; `None` if it is unreachable. Stops as soon as the result
    /// is certain.
    pub(crate) fn is_robust(&self, grasp: &Grasp) -> Result<Option<Robustness>, SceneError> {
        let Some(planned) = PlannedGrasp::plan_at_easiest_yaw(&self.at_origin, grasp)? else {
            return Ok(None);
        };
        let lifts = |trial| Ok::<_, SceneError>(self.try_planned(&planned, trial)?.is_some());
        if !lifts(Trial::Screening)? || !lifts(Trial::Lift)? {
            return Ok(Some(Robustness::Fails));
        }
        let SearchConfig { num_repeats, min_repeat_successes, .. } = *self.config;
        let mut num_lifted = 0;
        for index in 0..num_repeats {
            num_lifted += usize::from(lifts(Trial::ShortRepeat(index))?);
            if num_lifted == min_repeat_successes {
                return Ok(Some(Robustness::Robust));
            }
            if num_lifted + num_repeats - (index + 1) < min_repeat_successes {
                break;
            }
        }
        Ok(Some(Robustness::Lifts))
    }

    /// Tries a grasp, then in perturbed repeats and under shaking. `None` if the first trial fails; the repeats
    /// stop when too many have failed.
    fn score_grasp(
        &self,
        grasp: &Grasp,
        planned: &PlannedGrasp,
    ) -> Result<Option<ScoredGrasp>, SceneError> {
        let mut found = ScoredGrasp { grasp: grasp.clone(), repeat_successes: 0, shake_slip: None };
        let lifts = |trial| Ok::<_, SceneError>(self.try_planned(planned, trial)?.is_some());
        if !lifts(Trial::Lift)? {
            return Ok(None);
        }
        let config = self.config;
        let mut num_failed = 0;
        for index in 0..config.num_repeats {
            num_failed += usize::from(!lifts(Trial::Repeat(index))?);
            if num_failed + config.min_repeat_successes > config.num_repeats {
                return Ok(Some(found));
            }
        }
        found.repeat_successes = config.num_repeats - num_failed;
        found.shake_slip = self.try_planned(planned, Trial::Shaken)?;
        Ok(Some(found))
    }

    /// Executes a planned grasp. Returns the slip (m) of the object in the palm; `None` if the trial fails.
    pub(crate) fn try_planned(
        &self,
        planned: &PlannedGrasp,
        trial: Trial,
    ) -> Result<Option<f32>, SceneError> {
        let perturbation = match trial {
            Trial::ShortRepeat(index) | Trial::Repeat(index) => self.perturbations[index],
            Trial::Screening | Trial::Lift | Trial::Shaken => [0.0; 3],
        };
        let protocol = match trial {
            Trial::Screening | Trial::ShortRepeat(_) => TrialProtocol::SCREENING,
            Trial::Lift | Trial::Repeat(_) => TrialProtocol::SHORT,
            Trial::Shaken => TrialProtocol { is_shaken: true, ..TrialProtocol::SHORT },
        };
        // Slip under shaking is a score, not a criterion.
        let max_slip = if trial == Trial::Shaken { f32::INFINITY } else { self.config.max_slip };
        Ok(match planned.try_perturbed(perturbation, protocol)? {
            TrialOutcome::Lifted { slip } if slip <= max_slip => Some(slip),
            _ => None,
        })
    }
}
