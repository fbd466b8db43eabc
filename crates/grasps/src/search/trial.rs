//! Trial of a grasp in physics: close, squeeze, lift, hold, shake.

use crate::PlacedObject;
use crate::set::grasp::Posture;
use robot::{JointState, JointVector};
use scene::config::CONTROL_DT;
use scene::{HoldFailure, HoldMonitor, Scene, SceneError};

/// Outcome of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrialOutcome {
    /// The object was held to the end.
    Lifted {
        /// Maximum slip of the object in the palm (m).
        slip: f32,
    },
    /// The object was not held.
    Failed(HoldFailure),
    /// The simulation diverged: a state is not finite.
    NotFinite,
}

/// Control periods in a segment of `seconds`.
fn ticks(seconds: f64) -> usize {
    (seconds / CONTROL_DT).round() as usize
}

/// Accelerations (rad/s²) from rest at `from` to rest at `to` in `count` rows: constant acceleration, then
/// constant deceleration. An odd `count` is rounded down. Eq. 6, 7 hold in every row.
pub fn rest_to_rest(from: &JointVector, to: &JointVector, count: usize) -> Vec<JointVector> {
    let half = (count / 2).max(1);
    let squared_duration = (half * half) as f64 * CONTROL_DT * CONTROL_DT;
    let qdd = (to - from) / squared_duration;
    let mut rows = vec![qdd; half];
    rows.extend(std::iter::repeat_n(-qdd, half));
    rows
}

/// Load on a grasp after the lift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrialProtocol {
    /// Duration of the hold at rest (s).
    pub hold_seconds: f64,
    /// Whether the arm then shakes the object, laterally and vertically.
    pub is_shaken: bool,
    /// Whether the trial ends after a lift of 5 cm, without a hold.
    pub is_short: bool,
}

impl TrialProtocol {
    /// For candidates, in 40 % of the control periods of [`SHORT`](Self::SHORT). Of 943 trials with 14 scans, it
    /// rejected 20 of 714 that lift, and accepted 35 of 229 that do not.
    pub const SCREENING: Self = Self { hold_seconds: 0.0, is_shaken: false, is_short: true };
    /// For many trials: an object that slips does so within the first 0.5 s.
    pub const SHORT: Self = Self { hold_seconds: 0.5, is_shaken: false, is_short: false };
    /// The protocol's hold duration, then shaking.
    pub const FULL: Self = Self { hold_seconds: 2.0, is_shaken: true, is_short: false };
}

/// Heights (m) by which the palm has risen, between which the object must not slip in a short trial.
const SCREENING_HEIGHTS: [f64; 2] = [0.03, 0.05];

/// Maximum slip (m) between these heights. An object that still slips is lost later; one that has settled in the
/// hand is not.
const SCREENING_SLIP: f32 = 0.001;

/// Tries a grasp: the fingers close in 16 rows, squeeze in 10, hold for 0.3 s, then the arm executes `lift`.
pub fn try_grasp(
    placed: &PlacedObject,
    posture: &Posture,
    lift: &[JointState],
    protocol: TrialProtocol,
) -> Result<TrialOutcome, SceneError> {
    let mut state = JointState::at_rest(posture.pregrasp);
    let mut states = vec![state];
    let closing = rest_to_rest(&posture.pregrasp, &posture.grasp, 16);
    for qdd in closing.iter().chain(&rest_to_rest(&posture.grasp, &posture.squeeze, 10)) {
        state = robot::integrator::step(&state, qdd, CONTROL_DT);
        states.push(state);
    }
    let pressing = JointState::at_rest(posture.squeeze);
    states.extend(std::iter::repeat_n(pressing, 1 + ticks(0.3)));
    GraspMotion { states: &states, lift }.simulate(placed, protocol)
}

/// A motion into a grasp and a lift, to be simulated.
pub struct GraspMotion<'a> {
    /// States of the motion into the grasp, one per control period.
    pub states: &'a [JointState],
    /// States of the lift; see [`crate::plan::lift`].
    pub lift: &'a [JointState],
}

impl GraspMotion<'_> {
    /// Simulates the motion and returns the outcome.
    pub fn simulate(
        &self,
        placed: &PlacedObject,
        protocol: TrialProtocol,
    ) -> Result<TrialOutcome, SceneError> {
        let (config, tree) = (&placed.robot.config, &placed.robot.tree);
        let (pose, start) = (&placed.world_from_object, &self.states[0].q);
        let mut scene = Scene::new(config, tree, placed.object, pose, start)?;
        for pair in self.states.windows(2) {
            scene.track(&pair[0], &pair[1]);
        }
        let palm_height =
            |state: &JointState| tree.forward_kinematics(&state.q).palm_pose().translation.z;
        let start_height = palm_height(&self.lift[0]);
        let mut early_slip = None;
        let mut hold = HoldMonitor::new(&scene);
        for pair in self.lift.windows(2) {
            scene.track(&pair[0], &pair[1]);
            hold.update(&scene);
            if hold.slip > config.protocol.max_slip {
                return Ok(TrialOutcome::Failed(HoldFailure::Slipped));
            }
            if !protocol.is_short {
                continue;
            }
            let rise = palm_height(&pair[1]) - start_height;
            if rise >= SCREENING_HEIGHTS[0] {
                let early_slip = *early_slip.get_or_insert(hold.slip);
                if hold.slip - early_slip > SCREENING_SLIP {
                    return Ok(TrialOutcome::Failed(HoldFailure::Slipped));
                }
            }
            if rise >= SCREENING_HEIGHTS[1] {
                return Ok(TrialOutcome::Lifted { slip: hold.slip });
            }
        }
        let top = self.lift[self.lift.len() - 1];
        let mut rows = vec![top; 1 + ticks(protocol.hold_seconds)];
        if protocol.is_shaken {
            rows.extend(SHAKES.iter().flat_map(|&(joint, angle)| shake(&top, joint, angle)));
        }
        for pair in rows.windows(2) {
            scene.track(&pair[0], &pair[1]);
            // Check this first: a non-finite state would be reported as a foreign contact.
            if !scene.is_finite() {
                return Ok(TrialOutcome::NotFinite);
            }
            hold.update(&scene);
            if let Some(loss) = hold.failure(&scene, &config.protocol) {
                return Ok(TrialOutcome::Failed(loss));
            }
        }
        Ok(TrialOutcome::Lifted { slip: hold.slip })
    }
}

/// Arm joints that shake the object, with half of their angle (rad): the first joint laterally, the second
/// vertically.
const SHAKES: [(usize, f64); 2] = [(0, 0.05), (1, -0.05)];

/// States (1 s) in which one joint swings out and back. A palm at 0.6 m moves by 6 cm with up to 1.2 m/s².
fn shake(top: &JointState, joint: usize, angle: f64) -> impl Iterator<Item = JointState> {
    (1..=ticks(1.0)).map(move |tick| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * tick as f64 * CONTROL_DT);
        let mut state = *top;
        state.q[joint] += angle * (1.0 - cos);
        state.qd[joint] = angle * std::f64::consts::TAU * sin;
        state
    })
}
