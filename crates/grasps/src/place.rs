//! Places: where objects stand when grasps are tried, and where their reach is counted.

use crate::grasp::{Grasp, Posture};
use crate::trial::{self, Endurance, Physics, TrialOutcome};
use crate::{Robot, Setting, demonstration};
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
    let mut served = vec![0; grasps.iter().map(|grasp| grasp.kind + 1).max().unwrap_or(0)];
    let setting = Setting::new(robot, object, &Pose::IDENTITY);
    for pose in reach_poses(robot) {
        if let Some((first, _)) = setting.elsewhere(&pose).options(grasps).first() {
            served[grasps[*first].kind] += 1;
        }
    }
    served
}

/// Whether a grasp is in reach at each of a number of object poses.
pub(crate) fn reach(robot: &Robot, object: &Object, poses: &[Pose], grasp: &Grasp) -> Vec<bool> {
    let setting = Setting::new(robot, object, &Pose::IDENTITY);
    poses.iter().map(|pose| setting.elsewhere(pose).reach(grasp).is_some()).collect()
}

/// Where trials take place: the middle of the workspace.
fn middle(robot: &Robot) -> (f32, f32) {
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))
}

/// The middle of the workspace with that yaw, of twelve, at which the arm is nearest to its nominal posture:
/// x, y (m), yaw (rad).
pub fn easiest_place(robot: &Robot, object: &Object, grasp: &Grasp) -> Option<[f32; 3]> {
    let (x, y) = middle(robot);
    let setting = Setting::new(robot, object, &Pose::IDENTITY);
    let mut best: Option<(f64, f32)> = None;
    for step in 0..12 {
        let yaw = step as f32 * (std::f32::consts::TAU / 12.0);
        let pose = robot.config.upright(x, y, yaw);
        let Some(posture) = setting.elsewhere(&pose).reach(grasp) else { continue };
        let distance = (posture.open - robot.nominal).norm();
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, yaw));
        }
    }
    best.map(|(_, yaw)| [x, y, yaw])
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

impl<'a> Planned<'a> {
    /// Plans a grasp at its easiest place; `None` if it is out of reach.
    pub fn easiest(
        robot: &'a Robot,
        object: &'a Object,
        grasp: &Grasp,
    ) -> Result<Option<Self>, SceneError> {
        let Some(place) = easiest_place(robot, object, grasp) else { return Ok(None) };
        let [x, y, yaw] = place;
        let setting = Setting::new(robot, object, &robot.config.upright(x, y, yaw));
        let Some(posture) = setting.reach(grasp) else { return Ok(None) };
        let lift = demonstration::lift_of(&setting, &posture)?;
        Ok(lift.map(|lift| Self { setting, posture, place, lift }))
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
