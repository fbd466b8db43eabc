//! What planning a grasp needs to know of the robot, and where grasps are within reach.

use crate::grasp::{Grasp, Posture, object_solids, table_solid};
use geometry::Pose;
use geometry::object::Object;
use geometry::solid::Solid;
use robot::ik::{self, IkConfig};
use robot::solids::RobotSolids;
use robot::{DOF, Isometry, JointVector, Tree};
use scene::{SceneConfig, SceneError};
use std::collections::BTreeSet;

/// The robot in its scene.
pub struct Robot {
    /// The scene file.
    pub config: SceneConfig,
    /// Kinematics.
    pub tree: Tree,
    /// Collision shapes.
    pub solids: RobotSolids,
    /// Posture from which inverse kinematics starts and to which it is pulled.
    pub nominal: JointVector,
    /// Those from which it starts where the first leads nowhere, one after the other.
    drawn_in: [JointVector; 2],
    ik: IkConfig,
}

/// Hand over the middle of the workspace, palm down, fingers forward, elbow up.
const NOMINAL_ARM: [f64; robot::ARM] = [0.0, 1.45, 0.0, -1.8, 0.0, -1.75, 2.3];

/// Elbow bent further, or lower and to the side: for what stands near, or is seized from behind.
///
/// The two of 400 arms, drawn within 1.1 rad of the nominal one, that together bring most poses of the bleach bottle and its
/// variants into reach: with the bottle's eleven grasps of then 18 of 2,200 were out of reach, and 161 from the nominal arm
/// alone (counted once).
const DRAWN_IN_ARMS: [[f64; robot::ARM]; 2] =
    [[0.25, 1.7, 0.5, -2.55, -0.9, -1.0, 1.55], [0.8, 0.65, -0.95, -1.0, 0.9, -0.95, 1.3]];

/// Least gap (m) of the open hand and the arm from table and object.
const CLEARANCE: f32 = 0.002;

impl Robot {
    /// The standard robot in the standard scene.
    pub fn standard() -> Result<Self, SceneError> {
        let config = SceneConfig::standard()?;
        let tree = Tree::iiwa7_allegro()?;
        let solids = RobotSolids::new(&tree);
        let nominal = robot::join(&NOMINAL_ARM, &config.robot.open);
        let drawn_in = DRAWN_IN_ARMS.map(|arm| robot::join(&arm, &config.robot.open));
        Ok(Self { config, tree, solids, nominal, drawn_in, ik: IkConfig::precise() })
    }

    /// Whether the arm, from where it grasps, can bring the palm to a pose.
    pub fn reaches(&self, world_from_palm: &Isometry, grasping: &Posture) -> bool {
        let config = IkConfig { bend: 0.0, ..self.ik.clone() };
        ik::solve(&self.tree, world_from_palm, &grasping.touch, &config).is_some()
    }

    /// The nominal posture, its first joint turned towards the object.
    ///
    /// That joint's axis is the robot's vertical axis: when object and nominal posture turn about it,
    /// so does all that is planned for the object.
    pub fn nominal_towards(&self, world_from_object: &Pose) -> JointVector {
        towards(world_from_object, self.nominal)
    }

    /// That posture and the others from which inverse kinematics starts, in their order, turned alike.
    fn nominals_towards(&self, world_from_object: &Pose) -> impl Iterator<Item = JointVector> {
        let all = [self.nominal, self.drawn_in[0], self.drawn_in[1]];
        all.map(|nominal| towards(world_from_object, nominal)).into_iter()
    }
}

/// A posture with its first joint turned towards the object.
fn towards(world_from_object: &Pose, mut posture: JointVector) -> JointVector {
    let [x, y] = [world_from_object.translation.x, world_from_object.translation.y];
    posture[0] += libm::atan2(f64::from(y), f64::from(x));
    posture
}

/// How a grasp is come by: postures of one way are neighbours where the object's poses are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Way {
    /// Index of the arm's posture from which inverse kinematics starts; the nominal one is 0.
    pub arm: usize,
    /// Index of the grasp in its set.
    pub grasp: usize,
}

/// An object that stands somewhere before the robot.
pub struct Setting<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// The object.
    pub object: &'a Object,
    /// Where it stands.
    pub world_from_object: Pose,
    /// Its collision parts, world.
    pub solids: Vec<Solid>,
}

impl<'a> Setting<'a> {
    /// Places the object.
    pub fn new(robot: &'a Robot, object: &'a Object, world_from_object: &Pose) -> Self {
        let solids = object_solids(object, world_from_object);
        Self { robot, object, world_from_object: *world_from_object, solids }
    }

    /// The object at the origin, from where it can be put [`Setting::elsewhere`].
    pub fn anywhere(robot: &'a Robot, object: &'a Object) -> Self {
        Self::new(robot, object, &Pose::IDENTITY)
    }

    /// The same object somewhere else.
    pub fn elsewhere(&self, world_from_object: &Pose) -> Self {
        let moved = *world_from_object * self.world_from_object.inverse();
        let solids = self.solids.iter().map(|solid| solid.moved(&moved)).collect();
        Self { world_from_object: *world_from_object, solids, ..*self }
    }

    /// The posture of a grasp, if the arm can take it, whatever it touches.
    pub(crate) fn posture(&self, grasp: &Grasp) -> Option<Posture> {
        let mut nominals = self.robot.nominals_towards(&self.world_from_object);
        nominals.find_map(|nominal| self.posture_from(&nominal, grasp))
    }

    fn posture_from(&self, nominal: &JointVector, grasp: &Grasp) -> Option<Posture> {
        let Robot { tree, ik, .. } = self.robot;
        grasp.posture(tree, &self.world_from_object, nominal, ik)
    }

    /// The posture of a grasp, if the arm can take it without touching anything.
    pub fn reach(&self, grasp: &Grasp) -> Option<Posture> {
        let mut nominals = self.robot.nominals_towards(&self.world_from_object);
        nominals.find_map(|nominal| self.reach_from(&nominal, grasp))
    }

    fn reach_from(&self, nominal: &JointVector, grasp: &Grasp) -> Option<Posture> {
        let posture = self.posture_from(nominal, grasp)?;
        (self.clearance(&posture.open, 0.05) >= CLEARANCE).then_some(posture)
    }

    /// The posture of a grasp by one way, if the arm can take it without touching anything.
    pub fn reach_by(&self, way: Way, grasps: &[Grasp]) -> Option<Posture> {
        let nominal = self.robot.nominals_towards(&self.world_from_object).nth(way.arm)?;
        self.reach_from(&nominal, grasps.get(way.grasp)?)
    }

    /// All grasps within reach, kind after kind; of a kind first those from the nominal posture, of these the one that moves
    /// the arm the least. What the first one makes needless is not looked at.
    pub fn options<'b>(&'b self, grasps: &'b [Grasp]) -> impl Iterator<Item = (Way, Posture)> + 'b {
        let kinds: BTreeSet<usize> = grasps.iter().map(|grasp| grasp.kind).collect();
        kinds.into_iter().flat_map(move |kind| {
            let nominals = self.robot.nominals_towards(&self.world_from_object).enumerate();
            nominals.flat_map(move |(arm, nominal)| {
                let way = move |(grasp, posture)| (Way { arm, grasp }, posture);
                self.of_kind(kind, nominal, grasps).into_iter().map(way)
            })
        })
    }

    /// The grasps of a kind within reach from a nominal posture, the least moved arm first.
    fn of_kind(
        &self,
        kind: usize,
        nominal: JointVector,
        grasps: &[Grasp],
    ) -> Vec<(usize, Posture)> {
        let moved = |posture: &Posture| (posture.open - nominal).norm();
        let of_kind = grasps.iter().enumerate().filter(|(_, grasp)| grasp.kind == kind);
        let reach = |(i, grasp)| Some((i, self.reach_from(&nominal, grasp)?));
        let mut options: Vec<_> = of_kind.filter_map(reach).collect();
        options.sort_by(|a, b| moved(&a.1).total_cmp(&moved(&b.1)));
        options
    }

    /// Least gap (m) of the robot in `q` from table and object; `reach` where it is wider.
    pub fn clearance(&self, q: &JointVector, reach: f32) -> f32 {
        let kinematics = self.robot.tree.kinematics(q);
        let table = table_solid(&self.robot.config);
        // The base of the arm stands beside the table anyway.
        (3..=DOF).fold(reach, |least, body| {
            let robot = &self.robot.solids;
            let least = robot.gap(&kinematics, body, &self.solids, least).min(least);
            robot.gap(&kinematics, body, std::slice::from_ref(&table), least).min(least)
        })
    }
}
