//! Recording an attempt and replaying it exactly, without the model.

use crate::attempt::Attempt;
use crate::controller::Controller;
use crate::verdict::Verdict;
use crate::workcell::{RolloutError, Workcell};
use geometry::object::Object;
use robot::{DOF, JointState, JointVector};
use scene::config::scene_hash;

/// Joint speeds (rad/s) from here on are no policy's, not even a bad one's.
const FASTEST: f64 = 1e3;

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
    /// The tick at which the controller began to act, if it did; episodes of before do not say.
    #[serde(default)]
    pub policy_tick: Option<usize>,
    /// The tick at which the lift began, if it did.
    pub lift_tick: Option<usize>,
    /// The tick at which the hold began, if it did.
    pub hold_tick: Option<usize>,
    /// How it ended.
    pub verdict: Option<Verdict>,
    /// Hash of the final state, hex.
    pub state_hash: String,
}

/// A recorded attempt as it is followed.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Commanded states at the beginning and after each tick.
    pub(crate) rows: Vec<JointState>,
    pub(crate) marks: Marks,
    /// How it ended, if it did.
    pub(crate) verdict: Option<Verdict>,
}

/// The ticks at which phases began, if they did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Marks {
    pub(crate) policy: Option<usize>,
    pub(crate) lift: Option<usize>,
    pub(crate) hold: Option<usize>,
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

/// An error if a state is beyond the robot's limits, or faster (rad/s) than that.
pub(crate) fn check_states(
    workcell: &Workcell,
    states: &[JointState],
    fastest: f64,
) -> Result<(), RolloutError> {
    let limits = &workcell.robot.tree.limits;
    let is_possible = |state: &JointState| {
        limits.contains(&state.q, -0.1) && state.qd.amax() < fastest && state.qd.norm().is_finite()
    };
    match states.iter().position(|state| !is_possible(state)) {
        Some(row) => Err(RolloutError::Impossible { row }),
        None => Ok(()),
    }
}

impl Episode {
    /// Begins to play it: physics steps through the recorded targets. What failed before the hold has nothing to judge:
    /// its verdict is the recorded one.
    pub fn begin(&self, workcell: &Workcell, object: &Object) -> Result<Attempt, RolloutError> {
        foreign("scene", scene_hash(), &self.scene)?;
        foreign("object", object.hash(), &self.object)?;
        let rows: Vec<JointState> =
            self.targets.iter().enumerate().map(state_of).collect::<Result<_, _>>()?;
        check_states(workcell, &rows, FASTEST)?;
        let marks = Marks { policy: self.policy_tick, lift: self.lift_tick, hold: self.hold_tick };
        let controller = Controller::Replay(Recording { rows, marks, verdict: self.verdict });
        Attempt::begin(workcell, object, &self.name, Some(self.pose), self.seed, controller)
    }

    /// Plays it through; gives the verdict and the final state hash.
    pub fn replay(
        &self,
        workcell: &Workcell,
        object: &Object,
    ) -> Result<(Option<Verdict>, String), RolloutError> {
        let mut attempt = self.begin(workcell, object)?;
        while attempt.verdict().is_none() && attempt.ticks() + 1 < self.targets.len() {
            attempt.tick(workcell);
        }
        Ok((attempt.verdict(), attempt.state_hash()))
    }
}
