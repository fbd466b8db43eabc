//! Recording an attempt and replaying it exactly, without the model.

use crate::attempt::{Attempt, Controller};
use crate::verdict::Verdict;
use crate::workcell::{RolloutError, Workcell};
use geometry::object::Object;
use robot::{DOF, JointState, JointVector};
use scene::config::scene_hash;

/// A recorded attempt: what was there, and the joint targets of every tick.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Episode {
    /// Hash of scene file and robot.
    pub scene: String,
    /// Hash of the object.
    pub object: String,
    /// Name of the object.
    pub name: String,
    /// Pose of the object at the beginning: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Seed of the attempt.
    pub seed: u64,
    /// Commanded q then q̇ of all joints at the beginning and after each tick.
    pub targets: Vec<Vec<f64>>,
    /// The tick at which the lift began, if it did.
    pub lift_tick: Option<usize>,
    /// The tick at which the hold began, if it did.
    pub hold_tick: Option<usize>,
    /// How it ended.
    pub verdict: Option<Verdict>,
    /// Hash of the final state, hex.
    pub state_hash: String,
}

/// A state as a row of targets.
pub(crate) fn row_of(state: &JointState) -> Vec<f64> {
    state.q.iter().chain(state.qd.iter()).copied().collect()
}

pub(crate) fn state_of((row, values): (usize, &Vec<f64>)) -> Result<JointState, RolloutError> {
    let (found, wanted) = (values.len(), 2 * DOF);
    if found != wanted {
        return Err(RolloutError::Row { row, found, wanted });
    }
    Ok(state_of_row(values))
}

/// A row of targets of the right length as a state.
pub(crate) fn state_of_row(row: &[f64]) -> JointState {
    JointState {
        q: JointVector::from_column_slice(&row[..DOF]),
        qd: JointVector::from_column_slice(&row[DOF..]),
    }
}

/// An error if what was recorded there was recorded with something else.
pub(crate) fn foreign(
    what: &'static str,
    wanted: String,
    found: &String,
) -> Result<(), RolloutError> {
    if wanted == *found {
        return Ok(());
    }
    Err(RolloutError::Foreign { what, wanted, found: found.clone() })
}

impl Episode {
    /// Steps physics through the recorded targets; gives the verdict and the final state hash. What
    /// failed before the lift has nothing to judge: its verdict is the recorded one.
    pub fn replay(
        &self,
        workcell: &Workcell,
        object: &Object,
    ) -> Result<(Option<Verdict>, String), RolloutError> {
        foreign("scene", scene_hash(), &self.scene)?;
        foreign("object", object.hash(), &self.object)?;
        let targets = self.targets.iter().enumerate().map(state_of).collect::<Result<_, _>>()?;
        let controller =
            Controller::Replay { targets, lift_tick: self.lift_tick, hold_tick: self.hold_tick };
        let mut attempt =
            Attempt::begin(workcell, object, &self.name, Some(self.pose), self.seed, controller)?;
        while attempt.verdict().is_none() && attempt.ticks() + 1 < self.targets.len() {
            attempt.tick(workcell);
        }
        let judged = if self.lift_tick.is_some() { attempt.verdict() } else { self.verdict };
        Ok((judged, attempt.state_hash()))
    }
}
