//! A kept demonstration of a dataset, to be watched: no policy acts.

use crate::attempt::Attempt;
use crate::controller::Controller;
use crate::episode::{check_states, foreign, state_of};
use crate::workcell::{RolloutError, Workcell};
use geometry::object::Object;
use robot::JointState;
use scene::config::scene_hash;

/// Joint speeds (rad/s) from here on are no robot's.
const FASTEST: f64 = 20.0;

/// A demonstration as a file (JSON).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Demonstration {
    /// Which one it is, for people.
    pub demonstration: String,
    /// Hash of scene file and robot.
    pub scene: String,
    /// Hash of the object.
    pub object: String,
    /// Name of the object.
    pub name: String,
    /// Pose of the object: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Commanded q then q̇ of all joints, a control period apart.
    pub states: Vec<Vec<f64>>,
}

impl Demonstration {
    /// Begins to play it: a spline leads from home to its first state, and the lift follows its last one.
    pub fn begin(&self, workcell: &Workcell, object: &Object) -> Result<Attempt, RolloutError> {
        foreign("scene", scene_hash(), &self.scene)?;
        foreign("object", object.hash(), &self.object)?;
        let states: Vec<JointState> =
            self.states.iter().enumerate().map(state_of).collect::<Result<_, _>>()?;
        if states.is_empty() {
            return Err(RolloutError::NoStates);
        }
        check_states(workcell, &states, FASTEST)?;
        let [x, y, yaw] = self.pose;
        if !(workcell.robot.config.table.contains([x, y]) && yaw.is_finite()) {
            return Err(RolloutError::OffTheTable);
        }
        let controller = Controller::Demonstration(states);
        Attempt::begin(workcell, object, &self.name, Some(self.pose), 0, controller)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use crate::{Phase, Verdict};
    use grasps::Setting;

    #[test]
    fn a_demonstration_is_played_to_its_verdict_and_a_foreign_one_is_not() {
        let workcell = Workcell::new().unwrap();
        let robot = &workcell.robot;
        let object = Object::built_in("sugar_box").unwrap();
        let pose = [0.6, 0.05, 0.4];
        let place = robot.config.upright(pose[0], pose[1], pose[2]);
        let setting = Setting::new(robot, &object, &place);
        let found = samples::demonstration(&setting);
        let row = |state: &JointState| state.q.iter().chain(state.qd.iter()).copied().collect();
        let file = Demonstration {
            demonstration: "one".into(),
            scene: scene_hash(),
            object: object.hash(),
            name: "sugar_box".into(),
            pose,
            states: found.states.iter().map(row).collect(),
        };
        let text = serde_json::to_string(&file).unwrap();
        let file: Demonstration = serde_json::from_str(&text).unwrap();
        let mut attempt = file.begin(&workcell, &object).unwrap();
        let mut phases = vec![attempt.phase()];
        while attempt.verdict().is_none() {
            attempt.tick(&workcell);
            if phases.last() != Some(&attempt.phase()) {
                phases.push(attempt.phase());
            }
        }
        assert!(matches!(attempt.verdict(), Some(Verdict::Lifted { .. })), "{phases:?}");
        use Phase::{Approach, Done, Hold, Lift, Policy};
        assert_eq!(phases, [Approach, Policy, Lift, Hold, Done]);

        let error = |change: &dyn Fn(&mut Demonstration)| {
            let mut bad = file.clone();
            change(&mut bad);
            bad.begin(&workcell, &object).err().unwrap().to_string()
        };
        assert!(error(&|f| f.object = "other".into()).contains("another object"));
        assert!(error(&|f| f.states[3].truncate(5)).contains("row 3"));
        assert!(error(&|f| f.states.clear()).contains("no states"));
        assert!(error(&|f| f.states[7][3] = 1e308).contains("row 7"));
        assert!(error(&|f| f.states[2][30] = f64::NAN).contains("row 2"));
        assert!(error(&|f| f.pose[0] = f32::INFINITY).contains("table"));
    }
}
