//! A closed candidate of a search, with its trials.

use crate::search::pinch::PinchPlan;
use crate::search::task::ClosedCandidate;
use crate::search::tester::Trial;
use crate::set::clusters::{MAX_SHAKE_SLIP, ScoredGrasp};
use crate::set::grasp::Grasp;

/// Force margin above which stronger squeezes rank equal.
const SUFFICIENT_FORCE_MARGIN: f64 = 2.0;

/// A closed candidate and the outcomes of its trials.
#[derive(Clone, Debug)]
pub(crate) struct TestedCandidate {
    pub(crate) grasp: Grasp,
    /// Parameters of the pinch; `None` if the hand was closed at the palm pose.
    pub(crate) pinch: Option<PinchPlan>,
    force_margin: f64,
    /// Reach at a few coverage poses.
    pub(crate) sparse_reach: Vec<bool>,
    /// Reach at all coverage poses, once known.
    pub(crate) reach: Option<Vec<bool>>,
    /// Index of the object yaw of the trials, once known.
    pub(crate) yaw: Option<usize>,
    /// Whether the object was held in the first trial; `None` before it.
    has_lifted: Option<bool>,
    /// Whether the object was held in each repeat.
    repeats: Vec<bool>,
    /// Whether motions into the grasp are found; `None` before they are planned.
    pub(crate) is_approachable: Option<bool>,
    /// Whether the full lift is known to succeed.
    is_confirmed: bool,
    /// Slip under shaking (m), `Some(None)` if the object was lost; `None` before the trial.
    shaken: Option<Option<f32>>,
    /// Index of the candidate near whose half turn this one was sampled.
    pub(crate) counterpart_of: Option<usize>,
}

impl TestedCandidate {
    pub(crate) fn new(closed: ClosedCandidate, counterpart_of: Option<usize>) -> Self {
        let ClosedCandidate { grasp, pinch, force_margin, sparse_reach } = closed;
        Self {
            grasp,
            pinch,
            force_margin,
            sparse_reach,
            counterpart_of,
            reach: None,
            yaw: None,
            has_lifted: None,
            repeats: Vec::new(),
            is_approachable: None,
            is_confirmed: false,
            shaken: None,
        }
    }

    /// Records the outcome of a trial: the slip (m), `None` if the object was not held.
    pub(crate) fn record(&mut self, trial: Trial, slip: Option<f32>) {
        match trial {
            Trial::Screening => self.has_lifted = Some(slip.is_some()),
            Trial::ShortRepeat(_) | Trial::Repeat(_) => self.repeats.push(slip.is_some()),
            Trial::Lift => {
                self.is_confirmed = slip.is_some();
                self.has_lifted = Some(slip.is_some());
            }
            Trial::Shaken => self.shaken = Some(slip),
        }
    }

    /// Whether nothing has been tested yet. The first test is that of motions into the grasp.
    pub(crate) fn is_new(&self) -> bool {
        self.is_approachable.is_none()
    }

    /// Whether the grasp has not been tried in physics.
    pub(crate) fn is_untried(&self) -> bool {
        self.has_lifted.is_none()
    }

    pub(crate) fn has_lifted(&self) -> bool {
        self.has_lifted == Some(true)
    }

    /// Number of trials in which the object was held.
    pub(crate) fn num_lifted(&self) -> usize {
        usize::from(self.has_lifted()) + self.repeats.iter().filter(|lifts| **lifts).count()
    }

    pub(crate) fn num_repeats(&self) -> usize {
        self.repeats.len()
    }

    pub(crate) fn num_failed_repeats(&self) -> usize {
        self.repeats.iter().filter(|lifts| !**lifts).count()
    }

    /// Trials that a selected grasp lacks until this number of repeats has succeeded.
    pub(crate) fn missing_trials(&self, min_successes: usize) -> Vec<Trial> {
        let lift = (!self.is_confirmed).then_some(Trial::Lift);
        let shaken = self.shaken.is_none().then_some(Trial::Shaken);
        let done = self.repeats.len();
        let num_missing = min_successes.saturating_sub(done - self.num_failed_repeats());
        let repeats = (done..done + num_missing).map(Trial::ShortRepeat);
        lift.into_iter().chain(shaken).chain(repeats).collect()
    }

    /// Value of a first trial: force margin times the number of poses that it may add to `covered`.
    pub(crate) fn value(&self, covered: &[bool]) -> f64 {
        let is_new = |(reaches, covered): &(&bool, &bool)| **reaches && !**covered;
        let num_new = self.sparse_reach.iter().zip(covered).filter(is_new).count();
        num_new as f64 * self.force_margin.min(SUFFICIENT_FORCE_MARGIN)
    }

    /// The grasp with its scores. Trials that are still missing are assumed to succeed as often as those of
    /// the same grasp so far, and to slip by half the allowed amount.
    pub(crate) fn scored(&self, num_repeats: usize) -> ScoredGrasp {
        let lifted = self.repeats.len() - self.num_failed_repeats();
        let repeat_successes = num_repeats * lifted / self.repeats.len().max(1);
        let shake_slip = self.shaken.unwrap_or(Some(0.5 * MAX_SHAKE_SLIP));
        ScoredGrasp { grasp: self.grasp.clone(), repeat_successes, shake_slip }
    }
}
