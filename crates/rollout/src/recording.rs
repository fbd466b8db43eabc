//! Recording of an attempt, and its exact replay without the model.

use crate::attempt::Attempt;
use crate::controller::Controller;
use crate::outcome::Outcome;
use crate::rollout_context::{RolloutContext, RolloutError};
use objects::object::Object;
use robot::{DOF, JointState, JointVector};
use scene::scene_hash;

/// Max joint speed (rad/s) of a valid recording. No policy commands higher speeds.
const MAX_JOINT_SPEED: f64 = 1e3;

/// A recorded attempt: scene, object and the joint targets of every tick (JSON).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AttemptRecording {
    /// Hash of the scene file and the robot description (hex).
    pub scene_hash: String,
    /// Hash of the object (hex).
    pub object_hash: String,
    /// Name of the object.
    pub object_name: String,
    /// Initial pose of the object: x, y (m), yaw (rad).
    pub object_pose: [f32; 3],
    /// Seed of the attempt.
    pub seed: u64,
    /// Commanded q (rad), then q̇ (rad/s), of all joints: the initial state and one row per tick.
    pub targets: Vec<Vec<f64>>,
    /// Tick at which the policy phase started; `None` if it was not reached or not recorded.
    #[serde(default)]
    pub policy_tick: Option<usize>,
    /// Tick at which the lift started, if any.
    pub lift_tick: Option<usize>,
    /// Tick at which the hold started, if any.
    pub hold_tick: Option<usize>,
    /// Outcome of the attempt, if it has ended.
    pub outcome: Option<Outcome>,
    /// Hash of the final simulation state (hex).
    pub final_state_hash: String,
}

/// The states, phase starts and outcome of a recorded attempt, for replay.
#[derive(Clone, Debug)]
pub struct RecordedTrajectory {
    /// Commanded states: the initial state and one per tick.
    pub(crate) states: Vec<JointState>,
    pub(crate) phase_starts: PhaseStarts,
    /// Recorded outcome, if any.
    pub(crate) outcome: Option<Outcome>,
}

/// Ticks at which the phases started, if they did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PhaseStarts {
    pub(crate) policy: Option<usize>,
    pub(crate) lift: Option<usize>,
    pub(crate) hold: Option<usize>,
}

/// Converts a state to a row of joint targets.
pub(crate) fn to_row(state: &JointState) -> Vec<f64> {
    state.q.iter().chain(state.qd.iter()).copied().collect()
}

pub(crate) fn parse_row((row, values): (usize, &Vec<f64>)) -> Result<JointState, RolloutError> {
    let (found, wanted) = (values.len(), 2 * DOF);
    if found != wanted {
        return Err(RolloutError::RowLength { row, found, wanted });
    }
    Ok(from_row(values))
}

/// Converts a row of 2 × DOF joint targets to a state.
pub(crate) fn from_row(row: &[f64]) -> JointState {
    JointState {
        q: JointVector::from_column_slice(&row[..DOF]),
        qd: JointVector::from_column_slice(&row[DOF..]),
    }
}

/// Returns an error if a recorded hash differs from the current one.
pub(crate) fn check_provenance(
    what: &'static str,
    wanted: String,
    found: &String,
) -> Result<(), RolloutError> {
    if wanted == *found {
        return Ok(());
    }
    Err(RolloutError::HashMismatch { what, wanted, found: found.clone() })
}

/// Returns an error if a state exceeds the joint limits by more than 0.1 rad or the speed `max_speed`
/// (rad/s).
pub(crate) fn check_states(
    context: &RolloutContext,
    states: &[JointState],
    max_speed: f64,
) -> Result<(), RolloutError> {
    let limits = &context.robot.tree.limits;
    let is_possible = |state: &JointState| {
        limits.contains(&state.q, -0.1)
            && state.qd.amax() < max_speed
            && state.qd.norm().is_finite()
    };
    match states.iter().position(|state| !is_possible(state)) {
        Some(row) => Err(RolloutError::BeyondLimits { row }),
        None => Ok(()),
    }
}

impl AttemptRecording {
    /// Starts the replay: physics steps through the recorded targets. If the attempt failed before the hold,
    /// its recorded outcome is used.
    pub fn start_replay(
        &self,
        context: &RolloutContext,
        object: &Object,
    ) -> Result<Attempt, RolloutError> {
        check_provenance("scene", scene_hash(), &self.scene_hash)?;
        check_provenance("object", object.hash(), &self.object_hash)?;
        let rows: Vec<JointState> =
            self.targets.iter().enumerate().map(parse_row).collect::<Result<_, _>>()?;
        check_states(context, &rows, MAX_JOINT_SPEED)?;
        let marks =
            PhaseStarts { policy: self.policy_tick, lift: self.lift_tick, hold: self.hold_tick };
        let controller = Controller::Replay(RecordedTrajectory {
            states: rows,
            phase_starts: marks,
            outcome: self.outcome,
        });
        Attempt::new(
            context,
            object,
            &self.object_name,
            Some(self.object_pose),
            self.seed,
            controller,
        )
    }

    /// Replays to the end. Returns the outcome and the hash of the final state (hex).
    pub fn replay(
        &self,
        context: &RolloutContext,
        object: &Object,
    ) -> Result<(Option<Outcome>, String), RolloutError> {
        let mut attempt = self.start_replay(context, object)?;
        while attempt.outcome().is_none() && attempt.ticks() + 1 < self.targets.len() {
            attempt.step(context);
        }
        Ok((attempt.outcome(), attempt.state_hash()))
    }
}
