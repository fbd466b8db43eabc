//! Recording of an attempt, and its exact replay without the model.

mod demonstration_file;
mod joint_targets;
mod replay_file;

pub use demonstration_file::DemonstrationFile;
pub use replay_file::ReplayFile;

use crate::attempt::{Attempt, Outcome, PhaseStarts, RecordedTrajectory};
use crate::rollout_context::{RolloutContext, RolloutError};
use joint_targets::{check_states, parse_states, to_row};
use objects::object::Object;
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
    /// Initial pose of the object: x, y (m), yaw (rad), world frame.
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
        let states = parse_states(&self.targets)?;
        check_states(context, &states, MAX_JOINT_SPEED)?;
        let phase_starts =
            PhaseStarts { policy: self.policy_tick, lift: self.lift_tick, hold: self.hold_tick };
        let recording = RecordedTrajectory { states, phase_starts, outcome: self.outcome };
        let (name, pose) = (&self.object_name, self.object_pose);
        Attempt::replay(context, object, name, pose, self.seed, recording)
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

impl Attempt {
    /// Recording of the attempt so far.
    pub fn recording(&self) -> AttemptRecording {
        let (setup, phase_starts) = (self.setup(), self.phase_starts());
        AttemptRecording {
            scene_hash: scene_hash(),
            object_hash: setup.object.hash(),
            object_name: setup.object_name.clone(),
            object_pose: setup.pose,
            seed: setup.seed,
            targets: self.history().iter().map(to_row).collect(),
            policy_tick: phase_starts.policy,
            lift_tick: phase_starts.lift,
            hold_tick: phase_starts.hold,
            outcome: self.outcome(),
            final_state_hash: self.state_hash(),
        }
    }
}

/// Returns an error if a recorded hash differs from the current one.
fn check_provenance(
    what: &'static str,
    wanted: String,
    found: &String,
) -> Result<(), RolloutError> {
    if wanted == *found {
        return Ok(());
    }
    Err(RolloutError::HashMismatch { what, wanted, found: found.clone() })
}
