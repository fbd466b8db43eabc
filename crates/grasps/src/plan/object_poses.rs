//! Object poses at which grasps are planned and tried, and at which their coverage is counted.

use crate::plan::lift;
use crate::search::parallel;
use crate::search::trial::{self, TrialOutcome, TrialProtocol};
use crate::set::grasp::{Grasp, Posture};
use crate::set::symmetry::expand_by_symmetry;
use crate::{PlacedObject, RobotContext};
use geometry::Pose;
use objects::object::Object;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::JointState;
use scene::SceneError;

/// Number of object poses at which coverage is counted.
pub const NUM_COVERAGE_POSES: usize = 200;

/// Fixed random sample of object poses over the workspace, at which coverage is counted.
pub(crate) fn coverage_poses(robot: &RobotContext) -> Vec<Pose> {
    // A separate generator with a fixed seed: coverage must not depend on the object poses of attempts,
    // whose seeds are numbers. The bytes are arbitrary; changing them changes the poses.
    let mut rng = ChaCha8Rng::from_seed(*b"where a kind of grasp is in reac");
    (0..NUM_COVERAGE_POSES)
        .map(|_| sample_planar_pose(robot, &mut rng))
        .map(|[x, y, yaw]| robot.config.object_pose(x, y, yaw))
        .collect()
}

/// Coverage of each cluster: the number of object poses, of [`NUM_COVERAGE_POSES`], at which it is the first
/// reachable cluster.
pub fn coverage(robot: &RobotContext, object: &Object, grasps: &[Grasp]) -> Vec<usize> {
    let grasps = &expand_by_symmetry(object, grasps);
    let mut coverage = vec![0; grasps.iter().map(|grasp| grasp.cluster + 1).max().unwrap_or(0)];
    let at_origin = PlacedObject::at_origin(robot, object);
    let first_cluster = |pose: &Pose| {
        let (first, _) = at_origin.at_pose(pose).reachable(grasps).next()?;
        Some(grasps[first.grasp].cluster)
    };
    for cluster in parallel::map(&coverage_poses(robot), first_cluster).into_iter().flatten() {
        coverage[cluster] += 1;
    }
    coverage
}

/// Whether the grasp is reachable at each of `poses`.
pub(crate) fn reachability(at_origin: &PlacedObject, poses: &[Pose], grasp: &Grasp) -> Vec<bool> {
    poses.iter().map(|pose| at_origin.at_pose(pose).plan(grasp).is_some()).collect()
}

/// A grasp that is planned for a placed object, with its lift.
pub struct PlannedGrasp<'a> {
    /// The object at the planned pose.
    pub placed: PlacedObject<'a>,
    /// Robot posture of the grasp at that pose.
    pub posture: Posture,
    /// Index of the object yaw, of [`NUM_YAWS`].
    pub(crate) yaw_index: usize,
    lift: Vec<JointState>,
}

/// Number of object yaws at which a grasp may be tried.
const NUM_YAWS: usize = 12;

impl<'a> PlannedGrasp<'a> {
    /// Plans a grasp for an object at the centre of the workspace; `None` if it is unreachable.
    ///
    /// Of twelve object yaws, selects the one with the arm closest to its nominal posture. The pose of the
    /// argument is ignored.
    pub fn plan_at_easiest_yaw(
        at_origin: &PlacedObject<'a>,
        grasp: &Grasp,
    ) -> Result<Option<Self>, SceneError> {
        let nominal = at_origin.robot.nominal;
        let mut best: Option<(f64, Self)> = None;
        for yaw_index in 0..NUM_YAWS {
            let Some(planned) = Self::without_lift(at_origin, grasp, yaw_index) else { continue };
            let distance = (planned.posture.pregrasp - nominal).norm();
            if best.as_ref().is_none_or(|(min, _)| distance < *min) {
                best = Some((distance, planned));
            }
        }
        best.map_or(Ok(None), |(_, planned)| planned.with_lift())
    }

    /// Plans a grasp at one of the object yaws; `None` if it is unreachable.
    pub(crate) fn plan_at_yaw(
        at_origin: &PlacedObject<'a>,
        grasp: &Grasp,
        yaw_index: usize,
    ) -> Result<Option<Self>, SceneError> {
        let planned = Self::without_lift(at_origin, grasp, yaw_index);
        planned.map_or(Ok(None), Self::with_lift)
    }

    fn without_lift(at_origin: &PlacedObject<'a>, grasp: &Grasp, yaw_index: usize) -> Option<Self> {
        let [x, y, yaw] = planar_pose(at_origin.robot, yaw_index);
        let placed = at_origin.at_pose(&at_origin.robot.config.object_pose(x, y, yaw));
        let posture = placed.plan(grasp)?;
        Some(Self { placed, posture, yaw_index, lift: Vec::new() })
    }

    fn with_lift(self) -> Result<Option<Self>, SceneError> {
        let lift = lift::plan_from_grasp(&self.placed, &self.posture)?;
        Ok(lift.map(|lift| Self { lift, ..self }))
    }

    /// Executes the planned grasp with the object displaced by `[x, y, yaw]` (m, rad) from the planned pose.
    pub fn try_perturbed(
        &self,
        [dx, dy, dyaw]: [f32; 3],
        protocol: TrialProtocol,
    ) -> Result<TrialOutcome, SceneError> {
        let [x, y, yaw] = planar_pose(self.placed.robot, self.yaw_index);
        let displaced = self.placed.robot.config.object_pose(x + dx, y + dy, yaw + dyaw);
        let placed = self.placed.at_pose(&displaced);
        trial::try_grasp(&placed, &self.posture, &self.lift, protocol)
    }
}

/// Object pose `[x, y, yaw]` (m, rad) at the centre of the workspace, with the yaw of this index.
fn planar_pose(robot: &RobotContext, yaw_index: usize) -> [f32; 3] {
    let [x, y] =
        [robot.config.workspace.x, robot.config.workspace.y].map(|[min, max]| 0.5 * (min + max));
    [x, y, yaw_index as f32 * (std::f32::consts::TAU / NUM_YAWS as f32)]
}

/// Samples an object pose `[x, y, yaw]` (m, rad), uniform over the workspace.
pub fn sample_planar_pose(robot: &RobotContext, rng: &mut impl Rng) -> [f32; 3] {
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [rng.random_range(x[0]..x[1]), rng.random_range(y[0]..y[1]), rng.random_range(-pi..pi)]
}
