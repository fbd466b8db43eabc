//! Candidates: palm poses around an object from which closing the hand may give a grasp.

use crate::RobotContext;
use crate::search::closing::{self, ClosingConfig};
use crate::search::contact_forces::{self, SqueezeConfig};
use crate::search::pinch::{ClosedPinch, PinchPlan};
use crate::set::grasp::{Grasp, object_shapes, table_shape};
use geometry::convex_shape::ConvexShape;
use geometry::{Pose, Vec3};
use objects::object::Object;
use rand::{Rng, RngExt};
use robot::{ARM_DOF, DOF, HAND_DOF, HandModel, Isometry, Vector, rotation};
use scene::SceneConfig;

/// How candidates are sampled, closed and rejected.
#[derive(Clone, Debug)]
pub struct CandidateConfig {
    /// Hand joints (rad) before closing.
    pub pregrasp: [f64; HAND_DOF],
    /// Point of the palm frame (m) that is placed in the object.
    pub grasp_center: [f64; 3],
    /// Maximum lateral offset of that point from the object's axis, as a fraction of the bounding box's half
    /// extents.
    pub lateral_range: f64,
    /// Maximum angle (rad) of the palm's normal from straight down.
    pub max_tilt: f64,
    /// Minimum number of fingers that touch the object, besides the thumb. With one finger, the grasp is a pinch.
    pub min_fingers: usize,
    /// Step (m) by which a hand that collides with object or table backs off along the palm's normal.
    pub backoff: f64,
    /// Maximum number of such steps.
    pub max_backoff_steps: usize,
    /// Minimum distance (m) of the open hand from object and table.
    pub min_clearance: f32,
    /// Maximum wrench residual of the squeeze (dimensionless).
    pub max_residual: f64,
    /// Minimum force margin of the squeeze (dimensionless).
    pub min_force_margin: f64,
    /// Flexion of the fingers; each candidate samples its own proportions.
    pub closing: ClosingConfig,
    /// Contact forces and squeeze posture.
    pub squeeze: SqueezeConfig,
}

impl CandidateConfig {
    /// Our values; the paper uses grasps of a published dataset as candidates.
    pub fn standard(scene: &SceneConfig, hand: &HandModel) -> Self {
        Self {
            pregrasp: scene.robot.open,
            grasp_center: hand.grasp.center,
            lateral_range: 0.5,
            max_tilt: 1.5,
            min_fingers: 1,
            backoff: 0.004,
            max_backoff_steps: 12,
            min_clearance: 0.002,
            max_residual: 0.05,
            min_force_margin: 1.0,
            closing: ClosingConfig {
                finger_rates: hand.closing.finger_rates,
                thumb_rates: hand.closing.thumb_rates,
                step: 0.01,
                contact_distance: 0.0005,
                table_clearance: 0.001,
            },
            squeeze: SqueezeConfig {
                min_force: hand.squeeze.min_force,
                friction: 0.7,
                stiffness: f64::from(scene.motors.hand_stiffness),
                max_torque: hand.squeeze.max_torque,
                squeeze_gain: hand.squeeze.gain,
                max_scale: f64::INFINITY,
            },
        }
    }
}

/// Why a candidate is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rejection {
    /// The open hand collides with object or table.
    Collision,
    /// The thumb, or too many of the fingers, miss the object.
    TooFewContacts,
    /// The contact forces do not balance.
    Unbalanced,
    /// The motors cannot press hard enough for the object's weight.
    TooHeavy,
}

/// A rejected candidate.
#[derive(Clone, Debug)]
pub struct Rejected {
    /// Why it is rejected.
    pub reason: Rejection,
    /// How close it was to a grasp; `None` if the hand collides or misses the object.
    pub near_miss: Option<Box<NearMiss>>,
}

impl From<Rejection> for Rejected {
    fn from(reason: Rejection) -> Self {
        Self { reason, near_miss: None }
    }
}

/// A palm pose near which there may be grasps.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct NearMiss {
    /// Palm pose in the object's frame.
    pub object_from_palm: Isometry,
    /// Parameters of the pinch; `None` if the hand was closed at the palm pose.
    pub pinch: Option<PinchPlan>,
    /// Ratio of the wrench residual to its maximum plus the ratio of the minimum force margin to the margin.
    pub error: f64,
}

/// Numbers of rejected candidates by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Rejections {
    /// [`Rejection::Collision`].
    pub collision: usize,
    /// [`Rejection::TooFewContacts`].
    pub too_few_contacts: usize,
    /// [`Rejection::Unbalanced`].
    pub unbalanced: usize,
    /// [`Rejection::TooHeavy`].
    pub too_heavy: usize,
}

impl Rejections {
    /// Counts one candidate.
    pub fn count(&mut self, reason: Rejection) {
        match reason {
            Rejection::Collision => self.collision += 1,
            Rejection::TooFewContacts => self.too_few_contacts += 1,
            Rejection::Unbalanced => self.unbalanced += 1,
            Rejection::TooHeavy => self.too_heavy += 1,
        }
    }
}

impl std::ops::AddAssign for Rejections {
    fn add_assign(&mut self, other: Self) {
        self.collision += other.collision;
        self.too_few_contacts += other.too_few_contacts;
        self.unbalanced += other.unbalanced;
        self.too_heavy += other.too_heavy;
    }
}

/// The object of a search, at the origin, with the table in the same frame.
pub struct SearchTarget<'a> {
    object: &'a Object,
    shapes: Vec<ConvexShape>,
    table: ConvexShape,
}

impl<'a> SearchTarget<'a> {
    /// Places the object on the table of the scene.
    pub fn new(object: &'a Object, scene: &SceneConfig) -> Self {
        let mut table = table_shape(scene);
        // The frame of an object at the centre of the table.
        table.pose.translation = -Vec3::Z * scene.table.half_extents[2];
        Self { object, shapes: object_shapes(object, &Pose::IDENTITY), table }
    }
}

/// Evaluates one candidate: backs the open palm off the object, closes the hand and balances the contact
/// forces.
///
/// `rng` samples the proportions in which the finger joints close.
pub fn evaluate_candidate(
    robot: &RobotContext,
    target: &SearchTarget,
    config: &CandidateConfig,
    object_from_palm: Isometry,
    rng: &mut impl Rng,
) -> Result<(Grasp, contact_forces::Squeeze), Rejected> {
    let closing = sample_closing(&config.closing, rng);
    close_in_proportion(robot, target, config, object_from_palm, &closing)
}

/// Evaluates one candidate with given proportions in which the finger joints close.
pub(crate) fn close_in_proportion(
    robot: &RobotContext,
    target: &SearchTarget,
    config: &CandidateConfig,
    mut object_from_palm: Isometry,
    closing: &ClosingConfig,
) -> Result<(Grasp, contact_forces::Squeeze), Rejected> {
    let RobotContext { tree, collision_model: robot, .. } = robot;
    let pregrasp = robot::joint_vector(&[0.0; ARM_DOF], &config.pregrasp);
    // The hand is fixed; object and table are moved to it.
    let kinematics = tree.forward_kinematics(&pregrasp);
    let palm = kinematics.palm_pose();
    let transform = |object_from_palm: &Isometry| {
        let world_from_object = rotation::to_pose(&(palm * object_from_palm.inverse()));
        let moved = |shape: &ConvexShape| shape.transformed(&world_from_object);
        let shapes: Vec<ConvexShape> = target.shapes.iter().map(moved).collect();
        (world_from_object, shapes)
    };
    let gap_to = |shapes: &[ConvexShape]| {
        let gaps = (ARM_DOF..=DOF).map(|body| robot.body_distance(&kinematics, body, shapes, 0.01));
        gaps.fold(f32::INFINITY, f32::min)
    };
    let (mut world_from_object, mut shapes) = transform(&object_from_palm);
    let mut steps = config.max_backoff_steps;
    // The open fingers are longer than low objects are high.
    let mut table = target.table.transformed(&world_from_object);
    while gap_to(std::slice::from_ref(&table)) < config.min_clearance
        || gap_to(&shapes) < config.min_clearance
    {
        if steps == 0 {
            return Err(Rejection::Collision.into());
        }
        steps -= 1;
        object_from_palm *= Isometry::translation(-config.backoff, 0.0, 0.0);
        (world_from_object, shapes) = transform(&object_from_palm);
        table = target.table.transformed(&world_from_object);
    }
    let closed = closing::close_hand(tree, robot, &pregrasp, &shapes, &table, closing);
    let [index, middle, ring, thumb] = closed.contacts.map(|c| c.is_some());
    if !thumb
        || [index, middle, ring].iter().filter(|touches| **touches).count() < config.min_fingers
    {
        return Err(Rejection::TooFewContacts.into());
    }
    let posture = ClosedPosture { pregrasp, closed, object_from_palm, world_from_object };
    balance(tree, target, config, &posture)
}

/// Evaluates a pinch: closes the fingers along their paths and balances the contact forces.
pub(crate) fn evaluate_pinch(
    robot: &RobotContext,
    target: &SearchTarget,
    config: &CandidateConfig,
    plan: &PinchPlan,
) -> Result<(Grasp, contact_forces::Squeeze), Rejected> {
    let tree = &robot.tree;
    let open = robot::joint_vector(&[0.0; ARM_DOF], &config.pregrasp);
    let palm = tree.forward_kinematics(&open).palm_pose();
    let object_from_palm = plan.object_from_palm(tree);
    let world_from_object = palm * object_from_palm.inverse();
    let pose = rotation::to_pose(&world_from_object);
    let shapes: Vec<_> = target.shapes.iter().map(|shape| shape.transformed(&pose)).collect();
    let table = target.table.transformed(&pose);
    let contact_distance = config.closing.contact_distance;
    let pinch = plan.close(robot, &open, &world_from_object, &shapes, contact_distance);
    let ClosedPinch { pregrasp, closed } = pinch.ok_or(Rejection::TooFewContacts)?;
    let gap = |q: &robot::JointVector, others: &[ConvexShape]| {
        let kinematics = tree.forward_kinematics(q);
        let model = &robot.collision_model;
        let gaps = (ARM_DOF..=DOF).map(|body| model.body_distance(&kinematics, body, others, 0.01));
        gaps.fold(f32::INFINITY, f32::min)
    };
    let touch = robot::joint_vector(&[0.0; ARM_DOF], &closed.hand);
    let table = std::slice::from_ref(&table);
    if gap(&pregrasp, table) < config.closing.table_clearance
        || gap(&touch, table) < config.closing.table_clearance
        || gap(&pregrasp, &shapes) < config.min_clearance
    {
        return Err(Rejection::Collision.into());
    }
    let posture = ClosedPosture { pregrasp, closed, object_from_palm, world_from_object: pose };
    balance(tree, target, config, &posture).map_err(|mut rejected| {
        if let Some(near_miss) = &mut rejected.near_miss {
            near_miss.pinch = Some(plan.clone());
        }
        rejected
    })
}

/// The hand at an object, closed from `pregrasp`.
struct ClosedPosture {
    pregrasp: robot::JointVector,
    closed: closing::ClosedHand,
    object_from_palm: Isometry,
    world_from_object: Pose,
}

/// Balances the contact forces of a closed hand.
fn balance(
    tree: &robot::KinematicTree,
    target: &SearchTarget,
    config: &CandidateConfig,
    posture: &ClosedPosture,
) -> Result<(Grasp, contact_forces::Squeeze), Rejected> {
    let ClosedPosture { pregrasp, closed, object_from_palm, world_from_object } = posture;
    let object_from_palm = *object_from_palm;
    let squeeze = contact_forces::compute_squeeze(
        tree,
        pregrasp,
        closed,
        target.object,
        world_from_object,
        &config.squeeze,
    )
    .ok_or(Rejection::TooFewContacts)?;
    let [unbalance, overload] = [
        squeeze.wrench_residual / config.max_residual,
        config.min_force_margin / squeeze.force_margin,
    ];
    if unbalance > 1.0 || overload > 1.0 {
        let reason = if unbalance > 1.0 { Rejection::Unbalanced } else { Rejection::TooHeavy };
        let error = unbalance.max(1.0) + overload.max(1.0);
        let near_miss = NearMiss { object_from_palm, pinch: None, error };
        return Err(Rejected { reason, near_miss: Some(Box::new(near_miss)) });
    }
    let grasp = Grasp {
        cluster: 0,
        object_from_palm,
        pregrasp: robot::hand_joints(pregrasp),
        grasp: closed.hand,
        squeeze: squeeze.hand,
    };
    Ok((grasp, squeeze))
}

/// Samples the proportions in which the joints of a finger share the closing motion.
fn sample_closing(config: &ClosingConfig, rng: &mut impl Rng) -> ClosingConfig {
    let mut draw = |rates: [f64; 3]| rates.map(|rate| rate * rng.random_range(0.4..1.3));
    ClosingConfig {
        finger_rates: draw(config.finger_rates),
        thumb_rates: draw(config.thumb_rates),
        ..*config
    }
}

/// Samples a palm pose near `pose`: up to `shift` (m) along and `turn` (rad) about each of its axes.
pub fn perturb_palm(pose: &Isometry, shift: f64, turn: f64, rng: &mut impl Rng) -> Isometry {
    let mut draw = |reach: f64| [0; 3].map(|_| rng.random_range(-reach..=reach));
    let (shift, turn) = (draw(shift), draw(turn));
    pose * Isometry::from_parts(Vector::from(shift).into(), rotation::from_rpy(turn))
}

/// Samples a palm pose whose grasp centre is inside the object and whose normal points down to sideways. Half of
/// the poses are sampled about the centre of the bounding box, half about the centre of mass: a hammer is
/// balanced only near its head.
pub fn sample_palm(object: &Object, config: &CandidateConfig, rng: &mut impl Rng) -> Isometry {
    let [min, max] = object.bounds.map(rotation::to_vector);
    let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let mut draw = |reach: f64| rng.random_range(-reach..=reach);
    let offset = Vector::new(draw(config.lateral_range), draw(config.lateral_range), draw(0.9));
    let com = rotation::to_vector(object.center_of_mass);
    let center = if draw(1.0) < 0.0 { middle } else { Vector::new(com.x, com.y, middle.z) };
    let point = (center + half.component_mul(&offset)).sup(&min).inf(&max);
    let (around, roll) = (draw(std::f64::consts::PI), draw(std::f64::consts::PI));
    let tilt = 0.5 * (draw(config.max_tilt) + config.max_tilt);
    // The palm's normal is its x axis; `down` points it straight down.
    let down = rotation::from_axis_angle(&Vector::y(), std::f64::consts::FRAC_PI_2);
    let turn = rotation::from_axis_angle(&Vector::z(), around)
        * rotation::from_axis_angle(&Vector::y(), -tilt)
        * rotation::from_axis_angle(&Vector::z(), -around)
        * rotation::from_axis_angle(&Vector::z(), roll)
        * down;
    let center = turn * Vector::from(config.grasp_center);
    Isometry::from_parts((point - center).into(), turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mass_range_of_imports_is_that_of_the_hand() {
        assert_eq!(objects::import::MASS_RANGE, HandModel::standard().graspable.mass);
    }
}
