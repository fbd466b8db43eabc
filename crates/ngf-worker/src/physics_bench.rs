//! Time of the physics of a control period, with a state file from which MuJoCo simulates the same scene.

use crate::bench::{Row, measure, median_or_nan};
use anyhow::Result;
use files::atomic_file;
use objects::object::Object;
use robot::{JointState, JointVector};
use rollout::{Attempt, Controller, Phase, RolloutContext};
use scene::Scene;
use std::path::Path;
use std::time::Instant;

/// Attempts whose hold phases are measured. Each holds for the same number of control periods.
const REPEATS: usize = 5;

/// State at the start of the hold phase. The object is described as a box.
#[derive(serde::Serialize)]
pub(crate) struct HoldingState {
    /// Measured joint positions (rad).
    q: JointVector,
    /// Commanded joint positions (rad).
    target: JointVector,
    /// Half extents (m) of the box.
    half_extents: [f32; 3],
    /// Mass (kg) of the box.
    mass: f32,
    world_from_center: CenterPose,
}

/// Pose of the box's centre, world frame.
#[derive(serde::Serialize)]
struct CenterPose {
    /// Position (m).
    translation: [f32; 3],
    /// Unit quaternion, w first.
    rotation_wxyz: [f32; 4],
}

impl HoldingState {
    fn of(attempt: &Attempt, object: &Object) -> Self {
        let [min, max] = object.bounds;
        let pose = attempt.scene().object_pose();
        let (p, r) = (pose * ((min + max) / 2.0), pose.rotation);
        Self {
            q: attempt.scene().joint_positions(),
            target: attempt.commanded_state().q,
            half_extents: ((max - min) / 2.0).to_array(),
            mass: object.mass,
            world_from_center: CenterPose {
                translation: p.to_array(),
                rotation_wxyz: [r.w, r.x, r.y, r.z],
            },
        }
    }
}

/// Rows (ms per control period) for the robot at home and while it holds `object`, the catalog's `name`. Writes
/// the holding state to `state_file` if given.
pub(crate) fn rows(
    context: &RolloutContext,
    object: &Object,
    name: &str,
    state_file: Option<&Path>,
) -> Result<Vec<Row>> {
    let robot = &context.robot;
    let pose = robot.config.object_pose(0.6, 0.0, 0.4);
    let home = JointState::at_rest(robot.config.home());
    let mut scene = Scene::new(&robot.config, &robot.tree, object, &pose, &home.q)?;
    let at_home = measure("physics_tick_home", 200, || scene.track(&home, &home));

    let mut times = Vec::new();
    for repeat in 0..REPEATS {
        let mut attempt = Attempt::new(context, object, name, None, 0, Controller::Planner)?;
        let mut is_first = repeat == 0;
        while attempt.outcome().is_none() {
            let is_holding = attempt.phase() == Phase::Hold;
            if let Some(file) = state_file.filter(|_| is_holding && is_first) {
                atomic_file::write(
                    file,
                    &serde_json::to_vec(&HoldingState::of(&attempt, object))?,
                )?;
                is_first = false;
            }
            let start = Instant::now();
            attempt.step(context);
            if is_holding {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let value = median_or_nan(times);
    Ok(vec![at_home, Row { name: "physics_tick_holding", value, unit: "ms" }])
}
