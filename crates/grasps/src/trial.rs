//! The trial of a grasp in physics: close, squeeze, lift, hold, shake.

use crate::Setting;
use crate::grasp::Posture;
use robot::{JointState, JointVector};
use scene::config::CONTROL_PERIOD;
use scene::{HandScene, Hold, Loss, Scene, SceneConfig, SceneError, Simulation};

/// What became of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrialOutcome {
    /// Held to the end; the greatest slip in the palm (m).
    Lifted {
        /// Greatest slip (m).
        slip: f32,
    },
    /// Not held.
    Lost(Loss),
    /// Physics left the finite numbers.
    NotFinite,
}

/// Ticks of a segment that lasts `seconds`.
fn ticks(seconds: f64) -> usize {
    (seconds / CONTROL_PERIOD).round() as usize
}

/// States from `from` at rest to `to` at rest in an even number of `count` ticks: constant
/// acceleration, then constant deceleration (Eq. 6, 7 hold in every row).
pub fn straight(from: &JointVector, to: &JointVector, count: usize) -> Vec<JointVector> {
    let half = (count / 2).max(1);
    let size = (half * half) as f64 * CONTROL_PERIOD * CONTROL_PERIOD;
    let qdd = (to - from) / size;
    let mut rows = vec![qdd; half];
    rows.extend(std::iter::repeat_n(-qdd, half));
    rows
}

/// Which world a trial takes place in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Physics {
    /// The hand alone: several times as fast.
    Hand,
    /// Arm and hand.
    Full,
}

/// What a grasp has to bear once the object is in the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Endurance {
    /// How long it is held still (s).
    pub hold_seconds: f64,
    /// Whether the arm then swings it, sideways and up and down.
    pub is_shaken: bool,
}

impl Endurance {
    /// For many trials: what slips at all slips within the first half second.
    pub const BRIEF: Self = Self { hold_seconds: 0.5, is_shaken: false };
    /// As long as the protocol's attempt, and shaken.
    pub const FULL: Self = Self { hold_seconds: 2.0, is_shaken: true };
}

/// Tries a grasp: fingers close in 16 rows and squeeze in 10, hold for 0.3 s, and the arm goes along `lift`.
pub fn try_grasp(
    physics: Physics,
    setting: &Setting,
    posture: &Posture,
    lift: &[JointState],
    endurance: Endurance,
) -> Result<TrialOutcome, SceneError> {
    let mut state = JointState::at_rest(posture.open);
    let mut states = vec![state];
    let closing = straight(&posture.open, &posture.touch, 16);
    for qdd in closing.iter().chain(&straight(&posture.touch, &posture.squeeze, 10)) {
        state = robot::integrator::step(&state, qdd, CONTROL_PERIOD);
        states.push(state);
    }
    let pressing = JointState::at_rest(posture.squeeze);
    states.extend(std::iter::repeat_n(pressing, 1 + ticks(0.3)));
    let motion = Motion { states: &states, grasp: posture.touch, lift };
    motion.play(physics, setting, endurance)
}

/// A grasp and a lift to be played in physics.
pub struct Motion<'a> {
    /// Into the grasp, a control period apart.
    pub states: &'a [JointState],
    /// The posture in which the palm is where it grasps.
    pub grasp: JointVector,
    /// The lift; see [`crate::lift`].
    pub lift: &'a [JointState],
}

impl Motion<'_> {
    /// Plays and judges it.
    pub fn play(
        &self,
        physics: Physics,
        setting: &Setting,
        endurance: Endurance,
    ) -> Result<TrialOutcome, SceneError> {
        let (config, tree) = (&setting.robot.config, &setting.robot.tree);
        let (object, place, start) = (setting.object, &setting.world_from_object, &self.states[0]);
        match physics {
            Physics::Hand => {
                let mut scene = HandScene::new(config, tree, object, place, start, &self.grasp)?;
                Ok(self.play_in(&mut scene, config, endurance))
            }
            Physics::Full => {
                let mut scene = Scene::new(config, tree, object, place, &start.q)?;
                Ok(self.play_in(&mut scene, config, endurance))
            }
        }
    }

    fn play_in(
        &self,
        scene: &mut impl Simulation,
        config: &SceneConfig,
        endurance: Endurance,
    ) -> TrialOutcome {
        for pair in self.states.windows(2) {
            scene.follow(&pair[0], &pair[1]);
        }
        let mut hold = Hold::begin(scene);
        for pair in self.lift.windows(2) {
            scene.follow(&pair[0], &pair[1]);
            hold.observe(scene);
            if hold.slip > config.attempt.held_distance {
                return TrialOutcome::Lost(Loss::Slipped);
            }
        }
        let top = self.lift[self.lift.len() - 1];
        let mut rows = vec![top; 1 + ticks(endurance.hold_seconds)];
        if endurance.is_shaken {
            rows.extend(SWINGS.iter().flat_map(|&(joint, angle)| swing(&top, joint, angle)));
        }
        for pair in rows.windows(2) {
            scene.follow(&pair[0], &pair[1]);
            // What is not finite would look as if it leaned on something.
            if !scene.is_finite() {
                return TrialOutcome::NotFinite;
            }
            hold.observe(scene);
            if let Some(loss) = hold.loss(scene, &config.attempt) {
                return TrialOutcome::Lost(loss);
            }
        }
        TrialOutcome::Lifted { slip: hold.slip }
    }
}

/// Arm joints that shake what the hand holds, and half of the angle (rad) by which they swing: the first one
/// sideways, the second one up.
const SWINGS: [(usize, f64); 2] = [(0, 0.05), (1, -0.05)];

/// A second of states in which one joint swings out and back: at a palm 0.6 m away by 6 cm with up to 1.2 m/s².
fn swing(top: &JointState, joint: usize, angle: f64) -> impl Iterator<Item = JointState> {
    (1..=ticks(1.0)).map(move |tick| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * tick as f64 * CONTROL_PERIOD);
        let mut state = *top;
        state.q[joint] += angle * (1.0 - cos);
        state.qd[joint] = angle * std::f64::consts::TAU * sin;
        state
    })
}
