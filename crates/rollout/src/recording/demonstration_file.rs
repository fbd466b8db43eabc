//! Demonstration file of a dataset, for replay without a policy.

use crate::attempt::{Attempt, Controller};
use crate::recording::check_provenance;
use crate::recording::joint_targets::{check_states, parse_states};
use crate::rollout_context::{RolloutContext, RolloutError};
use objects::object::Object;
use scene::scene_hash;

/// Max joint speed (rad/s) of a valid demonstration.
const MAX_JOINT_SPEED: f64 = 20.0;

/// A demonstration with its scene and object (JSON).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemonstrationFile {
    /// Description of the demonstration, for display.
    pub description: String,
    /// Hash of the scene file and the robot description (hex).
    pub scene_hash: String,
    /// Hash of the object (hex).
    pub object_hash: String,
    /// Name of the object.
    pub object_name: String,
    /// Pose of the object: x, y (m), yaw (rad).
    pub object_pose: [f32; 3],
    /// Commanded q (rad), then q̇ (rad/s), of all joints, one row per control period.
    pub states: Vec<Vec<f64>>,
}

impl DemonstrationFile {
    /// Starts the replay. A spline leads from home to the first state; the lift follows the last one.
    pub fn start_replay(
        &self,
        context: &RolloutContext,
        object: &Object,
    ) -> Result<Attempt, RolloutError> {
        check_provenance("scene", scene_hash(), &self.scene_hash)?;
        check_provenance("object", object.hash(), &self.object_hash)?;
        let states = parse_states(&self.states)?;
        if states.is_empty() {
            return Err(RolloutError::NoStates);
        }
        check_states(context, &states, MAX_JOINT_SPEED)?;
        let [x, y, yaw] = self.object_pose;
        if !(context.robot.config.table.contains([x, y]) && yaw.is_finite()) {
            return Err(RolloutError::OffTheTable);
        }
        let controller = Controller::Demonstration(states);
        Attempt::new(context, object, &self.object_name, Some(self.object_pose), 0, controller)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::recording::joint_targets::to_row;
    use crate::{Outcome, Phase};
    use grasps::PlacedObject;

    #[test]
    fn demonstration_replays_to_its_outcome_and_invalid_file_is_rejected() {
        let context = RolloutContext::new().unwrap();
        let robot = &context.robot;
        let object = Object::from_catalog("sugar_box").unwrap();
        let pose = [0.6, 0.05, 0.4];
        let world_from_object = robot.config.object_pose(pose[0], pose[1], pose[2]);
        let placed = PlacedObject::new(robot, &object, &world_from_object);
        let found = fixtures::demonstration(&placed);
        let file = DemonstrationFile {
            description: "one".into(),
            scene_hash: scene_hash(),
            object_hash: object.hash(),
            object_name: "sugar_box".into(),
            object_pose: pose,
            states: found.states.iter().map(to_row).collect(),
        };
        let text = serde_json::to_string(&file).unwrap();
        let file: DemonstrationFile = serde_json::from_str(&text).unwrap();
        let mut attempt = file.start_replay(&context, &object).unwrap();
        let mut phases = vec![attempt.phase()];
        while attempt.outcome().is_none() {
            attempt.step(&context);
            if phases.last() != Some(&attempt.phase()) {
                phases.push(attempt.phase());
            }
        }
        assert!(matches!(attempt.outcome(), Some(Outcome::Lifted { .. })), "{phases:?}");
        use Phase::{Approach, Done, Hold, Lift, Policy};
        assert_eq!(phases, [Approach, Policy, Lift, Hold, Done]);

        let error = |change: &dyn Fn(&mut DemonstrationFile)| {
            let mut bad = file.clone();
            change(&mut bad);
            bad.start_replay(&context, &object).err().unwrap().to_string()
        };
        assert!(error(&|f| f.object_hash = "other".into()).contains("another object"));
        assert!(error(&|f| f.states[3].truncate(5)).contains("row 3"));
        assert!(error(&|f| f.states.clear()).contains("no states"));
        assert!(error(&|f| f.states[7][3] = 1e308).contains("row 7"));
        assert!(error(&|f| f.states[2][30] = f64::NAN).contains("row 2"));
        assert!(error(&|f| f.object_pose[0] = f32::INFINITY).contains("table"));
    }
}
