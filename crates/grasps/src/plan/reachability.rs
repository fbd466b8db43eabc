//! Planning of grasps on a placed object: the robot model, inverse kinematics and reachability.

use crate::set::grasp::{Grasp, Posture, object_shapes, table_shape};
use geometry::Pose;
use geometry::convex_shape::ConvexShape;
use objects::object::Object;
use robot::collision_shapes::CollisionModel;
use robot::ik::{self, IkConfig};
use robot::{DOF, Isometry, JointVector, KinematicTree};
use scene::{SceneConfig, SceneError};
use std::collections::BTreeSet;

/// Models of the robot and its scene that grasp planning needs.
pub struct RobotContext {
    /// Scene configuration.
    pub config: SceneConfig,
    /// Kinematic tree of arm and hand.
    pub tree: KinematicTree,
    /// Collision shapes of the links.
    pub collision_model: CollisionModel,
    /// Nominal posture (rad): the first IK seed, and the target of IK's null-space motion.
    pub nominal: JointVector,
    /// Further IK seeds (rad), tried in order if the nominal one gives no solution.
    alternate_seeds: Vec<JointVector>,
    ik: IkConfig,
}

/// Minimum distance (m) of the open hand and the arm from table and object.
const MIN_CLEARANCE: f32 = 0.002;

impl RobotContext {
    /// Loads the standard robot and the standard scene.
    pub fn standard() -> Result<Self, SceneError> {
        Ok(Self::new(SceneConfig::standard()?, KinematicTree::iiwa7_allegro()?))
    }

    /// Combines a scene and a robot.
    pub fn new(config: SceneConfig, tree: KinematicTree) -> Self {
        let solids = CollisionModel::new(&tree);
        let posture = |arm: &[f64; robot::ARM_DOF]| robot::joint_vector(arm, &config.robot.open);
        let nominal = posture(&tree.hand.arm.nominal);
        let alternate_seeds = tree.hand.arm.alternate_seeds.iter().map(posture).collect();
        let ik = IkConfig::standard(&tree);
        Self { config, tree, collision_model: solids, nominal, alternate_seeds, ik }
    }

    /// The same robot above a table that is lower by `depth` (m). Executed above the real table, what is planned for it
    /// presses the fingertips of low grasps on the table.
    pub fn above_lowered_table(&self, depth: f64) -> Self {
        let mut config = self.config.clone();
        config.table.center[2] -= depth as f32;
        Self::new(config, self.tree.clone())
    }

    /// Whether the arm can reach a palm pose, with IK from the grasp posture.
    pub fn can_reach(&self, world_from_palm: &Isometry, grasping: &Posture) -> bool {
        let config = IkConfig { min_flexion: 0.0, ..self.ik.clone() };
        ik::solve(&self.tree, world_from_palm, &grasping.grasp, &config).is_some()
    }

    /// The nominal posture with its first joint turned towards the object.
    ///
    /// The axis of that joint is the robot's vertical axis. If object and nominal posture turn about it
    /// together, so does every plan for the object.
    pub fn nominal_facing(&self, world_from_object: &Pose) -> JointVector {
        facing(world_from_object, self.nominal)
    }

    /// Number of IK seeds, the nominal posture included.
    pub fn num_ik_seeds(&self) -> usize {
        1 + self.alternate_seeds.len()
    }

    /// All IK seeds in order, the nominal posture first, each turned towards the object.
    fn ik_seeds_facing(&self, world_from_object: &Pose) -> impl Iterator<Item = JointVector> {
        let all = std::iter::once(&self.nominal).chain(&self.alternate_seeds);
        all.map(|nominal| facing(world_from_object, *nominal))
    }
}

/// A posture with its first joint turned towards the object.
fn facing(world_from_object: &Pose, mut posture: JointVector) -> JointVector {
    let [x, y] = [world_from_object.translation.x, world_from_object.translation.y];
    posture[0] += libm::atan2(f64::from(y), f64::from(x));
    posture
}

/// IK seed and grasp that produce a posture. Postures of one branch are close if the object poses are close.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GraspBranch {
    /// Index of the IK seed; the nominal posture is 0.
    pub ik_seed: usize,
    /// Index of the grasp in its set.
    pub grasp: usize,
}

/// An object at a pose in the robot's workspace.
///
/// ```rust
/// use grasps::{GraspSet, PlacedObject, RobotContext};
/// use robot::rotation;
/// let text =
///     include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/grasps/sugar_box.json"));
/// let grasps = serde_json::from_str::<GraspSet>(text)?.grasps;
/// let robot = RobotContext::standard()?;
/// let object = objects::Object::from_catalog("sugar_box").expect("a built-in object");
/// let world_from_object = robot.config.object_pose(0.66, 0.1, 1.44); // x, y (m), yaw (rad)
/// let placed = PlacedObject::new(&robot, &object, &world_from_object);
/// let (branch, posture) = placed.reachable(&grasps).next().expect("a reachable grasp");
/// // Inverse kinematics has placed the palm at the grasp.
/// let grasp = &grasps[branch.grasp];
/// let wanted = rotation::to_isometry(&world_from_object) * grasp.object_from_palm;
/// let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
/// assert!((palm.translation.vector - wanted.translation.vector).norm() < 1e-4); // m
/// # Ok::<(), scene::SceneError>(())
/// ```
pub struct PlacedObject<'a> {
    /// Robot and scene.
    pub robot: &'a RobotContext,
    /// The object, in its own frame.
    pub object: &'a Object,
    /// Pose of the object in the world frame.
    pub world_from_object: Pose,
    /// Convex parts of the object in the world frame.
    pub shapes: Vec<ConvexShape>,
}

impl<'a> PlacedObject<'a> {
    /// Places the object at a pose.
    pub fn new(robot: &'a RobotContext, object: &'a Object, world_from_object: &Pose) -> Self {
        let solids = object_shapes(object, world_from_object);
        Self { robot, object, world_from_object: *world_from_object, shapes: solids }
    }

    /// Places the object at the origin, from where [`PlacedObject::at_pose`] moves it.
    pub fn at_origin(robot: &'a RobotContext, object: &'a Object) -> Self {
        Self::new(robot, object, &Pose::IDENTITY)
    }

    /// The same object at another pose.
    pub fn at_pose(&self, world_from_object: &Pose) -> Self {
        let moved = *world_from_object * self.world_from_object.inverse();
        let solids = self.shapes.iter().map(|solid| solid.transformed(&moved)).collect();
        Self { world_from_object: *world_from_object, shapes: solids, ..*self }
    }

    /// Solves IK for a grasp from each seed in turn, without collision check.
    pub(crate) fn solve_posture(&self, grasp: &Grasp) -> Option<Posture> {
        let mut nominals = self.robot.ik_seeds_facing(&self.world_from_object);
        nominals.find_map(|nominal| self.solve_posture_from(&nominal, grasp))
    }

    fn solve_posture_from(&self, nominal: &JointVector, grasp: &Grasp) -> Option<Posture> {
        let RobotContext { tree, ik, .. } = self.robot;
        grasp.posture(tree, &self.world_from_object, nominal, ik)
    }

    /// Plans a grasp: the first IK solution, over the seeds, in which the open hand and the arm are
    /// collision-free.
    pub fn plan(&self, grasp: &Grasp) -> Option<Posture> {
        let mut nominals = self.robot.ik_seeds_facing(&self.world_from_object);
        nominals.find_map(|nominal| self.plan_from(&nominal, grasp))
    }

    fn plan_from(&self, nominal: &JointVector, grasp: &Grasp) -> Option<Posture> {
        let posture = self.solve_posture_from(nominal, grasp)?;
        (self.clearance(&posture.pregrasp, 0.05) >= MIN_CLEARANCE).then_some(posture)
    }

    /// Plans a grasp of a set by its index, see [`PlacedObject::plan`].
    pub fn plan_grasp(&self, grasp: usize, grasps: &[Grasp]) -> Option<(GraspBranch, Posture)> {
        let mut nominals = self.robot.ik_seeds_facing(&self.world_from_object).enumerate();
        nominals.find_map(|(ik_seed, nominal)| {
            let posture = self.plan_from(&nominal, grasps.get(grasp)?)?;
            Some((GraspBranch { ik_seed, grasp }, posture))
        })
    }

    /// Plans a grasp of a given branch; `None` if IK has no solution or the solution collides.
    pub fn plan_branch(&self, branch: GraspBranch, grasps: &[Grasp]) -> Option<Posture> {
        let nominal = self.robot.ik_seeds_facing(&self.world_from_object).nth(branch.ik_seed)?;
        self.plan_from(&nominal, grasps.get(branch.grasp)?)
    }

    /// Iterates over all reachable grasps in order of cluster, then IK seed, then arm motion from that seed.
    /// Evaluated lazily: later clusters cost nothing if the first grasp suffices.
    pub fn reachable<'b>(
        &'b self,
        grasps: &'b [Grasp],
    ) -> impl Iterator<Item = (GraspBranch, Posture)> + 'b {
        let clusters: BTreeSet<usize> = grasps.iter().map(|grasp| grasp.cluster).collect();
        clusters.into_iter().flat_map(move |cluster| {
            let nominals = self.robot.ik_seeds_facing(&self.world_from_object).enumerate();
            nominals.flat_map(move |(ik_seed, nominal)| {
                let branch = move |(grasp, posture)| (GraspBranch { ik_seed, grasp }, posture);
                self.reachable_in_cluster(cluster, nominal, grasps).into_iter().map(branch)
            })
        })
    }

    /// Reachable grasps of one cluster from one IK seed, in order of increasing arm motion.
    fn reachable_in_cluster(
        &self,
        cluster: usize,
        nominal: JointVector,
        grasps: &[Grasp],
    ) -> Vec<(usize, Posture)> {
        let moved = |posture: &Posture| (posture.pregrasp - nominal).norm();
        let of_kind = grasps.iter().enumerate().filter(|(_, grasp)| grasp.cluster == cluster);
        let plan = |(i, grasp)| Some((i, self.plan_from(&nominal, grasp)?));
        let mut options: Vec<_> = of_kind.filter_map(plan).collect();
        options.sort_by(|a, b| moved(&a.1).total_cmp(&moved(&b.1)));
        options
    }

    /// Minimum distance (m) of the robot in `q` from table and object, capped at `max_distance`.
    pub fn clearance(&self, q: &JointVector, max_distance: f32) -> f32 {
        let kinematics = self.robot.tree.forward_kinematics(q);
        let table = table_shape(&self.robot.config);
        // The base of the arm is always close to the table.
        let first_body = self.robot.tree.hand.avoidance.first_body;
        (first_body..=DOF).fold(max_distance, |min, body| {
            let robot = &self.robot.collision_model;
            let min = robot.body_distance(&kinematics, body, &self.shapes, min).min(min);
            robot.body_distance(&kinematics, body, std::slice::from_ref(&table), min).min(min)
        })
    }
}
