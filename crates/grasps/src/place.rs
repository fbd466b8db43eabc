//! Places: where objects stand when grasps are tried, and where their reach is counted.

use crate::grasp::{Grasp, Posture};
use crate::sides::all_sides;
use crate::trial::{self, Endurance, Physics, TrialOutcome};
use crate::{Robot, Setting, lift};
use geometry::Pose;
use geometry::object::Object;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::JointState;
use scene::SceneError;

/// Object poses at which the reach of a kind is counted.
pub const REACH_POSES: usize = 200;

/// The object poses at which reach is counted.
pub(crate) fn reach_poses(robot: &Robot) -> Vec<Pose> {
    // A generator of its own: attempts are numbered by their seeds, and none of them is looked at here.
    let mut rng = ChaCha8Rng::from_seed(*b"where a kind of grasp is in reac");
    (0..REACH_POSES)
        .map(|_| random_pose(robot, &mut rng))
        .map(|[x, y, yaw]| robot.config.upright(x, y, yaw))
        .collect()
}

/// For each kind of a set the number of object poses, of [`REACH_POSES`], at which it is the first one
/// within reach.
pub fn poses_served(robot: &Robot, object: &Object, grasps: &[Grasp]) -> Vec<usize> {
    let grasps = &all_sides(object, grasps);
    let mut served = vec![0; grasps.iter().map(|grasp| grasp.kind + 1).max().unwrap_or(0)];
    let anywhere = Setting::anywhere(robot, object);
    for pose in reach_poses(robot) {
        if let Some((first, _)) = anywhere.elsewhere(&pose).options(grasps).next() {
            served[grasps[first.grasp].kind] += 1;
        }
    }
    served
}

/// Whether a grasp is in reach at each of a number of object poses.
pub(crate) fn reach(anywhere: &Setting, poses: &[Pose], grasp: &Grasp) -> Vec<bool> {
    poses.iter().map(|pose| anywhere.elsewhere(pose).reach(grasp).is_some()).collect()
}

/// A grasp that is planned for the object at a place.
pub struct Planned<'a> {
    /// The object there.
    pub setting: Setting<'a>,
    /// The posture of the grasp.
    pub posture: Posture,
    place: [f32; 3],
    lift: Vec<JointState>,
}

/// Yaws of the object that are looked at.
const YAWS: usize = 12;

impl<'a> Planned<'a> {
    /// Plans a grasp in the middle of the workspace, with that yaw of the object, of twelve, at which the arm is nearest
    /// to its nominal posture; `None` if it is out of reach. The object may stand `anywhere`.
    pub fn easiest(anywhere: &Setting<'a>, grasp: &Grasp) -> Result<Option<Self>, SceneError> {
        let robot = anywhere.robot;
        let [x, y] = [robot.config.workspace.x, robot.config.workspace.y]
            .map(|[least, most]| 0.5 * (least + most));
        let mut best: Option<(f64, Self)> = None;
        for step in 0..YAWS {
            let yaw = step as f32 * (std::f32::consts::TAU / YAWS as f32);
            let setting = anywhere.elsewhere(&robot.config.upright(x, y, yaw));
            let Some(posture) = setting.reach(grasp) else { continue };
            let distance = (posture.open - robot.nominal).norm();
            if best.as_ref().is_none_or(|(least, _)| distance < *least) {
                let planned = Self { setting, posture, place: [x, y, yaw], lift: Vec::new() };
                best = Some((distance, planned));
            }
        }
        let Some((_, planned)) = best else { return Ok(None) };
        let lift = lift::plan_after(&planned.setting, &planned.posture)?;
        Ok(lift.map(|lift| Self { lift, ..planned }))
    }

    /// Tries it while the object stands `[x, y, yaw]` (m, rad) beside its place.
    pub fn try_beside(
        &self,
        physics: Physics,
        [dx, dy, dyaw]: [f32; 3],
        endurance: Endurance,
    ) -> Result<TrialOutcome, SceneError> {
        let [x, y, yaw] = self.place;
        let here = self.setting.robot.config.upright(x + dx, y + dy, yaw + dyaw);
        let setting = self.setting.elsewhere(&here);
        trial::try_grasp(physics, &setting, &self.posture, &self.lift, endurance)
    }
}

/// Draws a pose of the object uniformly over the workspace.
pub fn random_pose(robot: &Robot, rng: &mut impl Rng) -> [f32; 3] {
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [rng.random_range(x[0]..x[1]), rng.random_range(y[0]..y[1]), rng.random_range(-pi..pi)]
}
