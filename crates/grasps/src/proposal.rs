//! Proposals: palm poses around an object from which closing may give a grasp.

use crate::Robot;
use crate::closing::{self, ClosingConfig};
use crate::grasp::{Grasp, object_solids, table_solid};
use crate::squeeze::{self, SqueezeConfig};
use geometry::object::Object;
use geometry::solid::Solid;
use geometry::{Pose, Vec3};
use rand::{Rng, RngExt};
use robot::{ARM, DOF, HAND, Isometry, Vector, rotation};
use scene::SceneConfig;

/// Middle between fingertips and thumb, palm frame (m).
pub const GRASP_CENTER: [f64; 3] = [0.085, 0.0, 0.012];

/// What is proposed and what is kept.
#[derive(Clone, Debug)]
pub struct ProposalConfig {
    /// Hand joints (rad) before closing.
    pub open: [f64; HAND],
    /// Point of the palm frame (m) that is brought onto the object.
    pub center: [f64; 3],
    /// How far (m) the point may lie from the object's axis, in half sizes of its bounding box.
    pub spread: f64,
    /// Greatest angle (rad) of the palm's normal from straight down.
    pub tilt: f64,
    /// Step (m) by which a palm that collides backs off along its normal.
    pub retreat: f64,
    /// How many such steps it takes at most.
    pub retreat_steps: usize,
    /// Least gap (m) of the open hand from object and table.
    pub clearance: f32,
    /// Greatest residual of the squeeze.
    pub residual: f64,
    /// Least reserve of the squeeze.
    pub reserve: f64,
    /// Closing.
    pub closing: ClosingConfig,
    /// Pressing.
    pub squeeze: SqueezeConfig,
}

impl ProposalConfig {
    /// Our values; the paper takes its proposals from a published data set.
    pub fn standard(scene: &SceneConfig) -> Self {
        Self {
            open: scene.robot.open,
            center: GRASP_CENTER,
            spread: 0.5,
            tilt: 1.5,
            retreat: 0.004,
            retreat_steps: 12,
            clearance: 0.002,
            residual: 0.05,
            reserve: 1.0,
            closing: ClosingConfig {
                finger_rates: [1.0, 0.8, 0.6],
                thumb_rates: [0.3, 0.8, 0.8],
                step: 0.01,
                touch_gap: 0.0005,
            },
            squeeze: SqueezeConfig {
                least_force: 1.0,
                friction: 0.7,
                stiffness: f64::from(scene.motors.hand_stiffness),
                torque: 0.7,
                press: 1.4,
            },
        }
    }
}

/// Why a proposal came to nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Refusal {
    /// The open hand touches object or table.
    Collides,
    /// Thumb or both neighbours of it miss the object.
    Misses,
    /// The contact forces do not balance.
    Unbalanced,
    /// The motors cannot press as hard as the weight needs.
    TooHeavy,
}

/// What a palm is brought to: an object that stands at the origin, and the table there.
pub struct Subject<'a> {
    object: &'a Object,
    solids: Vec<Solid>,
    table: Solid,
}

impl<'a> Subject<'a> {
    /// The object on the table of the scene.
    pub fn new(object: &'a Object, scene: &SceneConfig) -> Self {
        let mut table = table_solid(scene);
        // The frame of an object that stands in the middle of the table.
        table.pose.translation = -Vec3::Z * scene.table.half[2];
        Self { object, solids: object_solids(object, &Pose::IDENTITY), table }
    }
}

/// Brings the open palm to a pose on the object, closes the hand, its joints in drawn proportions, and
/// keeps the grasp if its forces balance.
pub fn propose(
    robot: &Robot,
    subject: &Subject,
    config: &ProposalConfig,
    mut object_from_palm: Isometry,
    rng: &mut impl Rng,
) -> Result<(Grasp, squeeze::Squeeze), Refusal> {
    let Robot { tree, solids: robot, .. } = robot;
    let open = robot::join(&[0.0; ARM], &config.open);
    // The hand stays where it is, and object and table are brought to it.
    let kinematics = tree.kinematics(&open);
    let palm = kinematics.palm();
    let place = |object_from_palm: &Isometry| {
        let world_from_object = rotation::to_pose(&(palm * object_from_palm.inverse()));
        let moved = |solid: &Solid| solid.moved(&world_from_object);
        let solids: Vec<Solid> = subject.solids.iter().map(moved).collect();
        (world_from_object, solids)
    };
    let gap_to = |solids: &[Solid]| {
        let gaps = (ARM..=DOF).map(|body| robot.gap(&kinematics, body, solids, 0.01));
        gaps.fold(f32::INFINITY, f32::min)
    };
    let (mut world_from_object, mut solids) = place(&object_from_palm);
    let mut steps = config.retreat_steps;
    while gap_to(&solids) < config.clearance {
        if steps == 0 {
            return Err(Refusal::Collides);
        }
        steps -= 1;
        object_from_palm *= Isometry::translation(-config.retreat, 0.0, 0.0);
        (world_from_object, solids) = place(&object_from_palm);
    }
    if gap_to(&[subject.table.moved(&world_from_object)]) < config.clearance {
        return Err(Refusal::Collides);
    }
    let closing = draw_closing(&config.closing, rng);
    let closed = closing::close(tree, robot, &open, &solids, &closing);
    let [index, middle, ring, thumb] = closed.contacts.map(|c| c.is_some());
    if !thumb || [index, middle, ring].iter().filter(|touches| **touches).count() < 2 {
        return Err(Refusal::Misses);
    }
    let squeeze =
        squeeze::squeeze(tree, &open, &closed, subject.object, &world_from_object, &config.squeeze)
            .ok_or(Refusal::Misses)?;
    if squeeze.residual > config.residual {
        return Err(Refusal::Unbalanced);
    }
    if squeeze.reserve < config.reserve {
        return Err(Refusal::TooHeavy);
    }
    let grasp = Grasp {
        kind: 0,
        object_from_palm,
        open: config.open,
        touch: closed.hand,
        squeeze: squeeze.hand,
    };
    Ok((grasp, squeeze))
}

/// Curls whose joints share the motion in other proportions.
fn draw_closing(config: &ClosingConfig, rng: &mut impl Rng) -> ClosingConfig {
    let mut draw = |rates: [f64; 3]| rates.map(|rate| rate * rng.random_range(0.4..1.3));
    ClosingConfig {
        finger_rates: draw(config.finger_rates),
        thumb_rates: draw(config.thumb_rates),
        ..*config
    }
}

/// A palm pose near another one, at most `shift` (m) and `turn` (rad) along each axis of it.
pub fn vary_palm(pose: &Isometry, shift: f64, turn: f64, rng: &mut impl Rng) -> Isometry {
    let mut draw = |reach: f64| [0; 3].map(|_| rng.random_range(-reach..=reach));
    let (shift, turn) = (draw(shift), draw(turn));
    pose * Isometry::from_parts(Vector::from(shift).into(), rotation::from_rpy(turn))
}

/// A palm pose whose grasp centre lies in the object and whose normal points down to sideways.
pub fn draw_palm(object: &Object, config: &ProposalConfig, rng: &mut impl Rng) -> Isometry {
    let [min, max] = object.bounds.map(rotation::to_vector);
    let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let mut draw = |reach: f64| rng.random_range(-reach..=reach);
    let offset = Vector::new(draw(config.spread), draw(config.spread), draw(0.9));
    let point = middle + half.component_mul(&offset);
    let (around, roll) = (draw(std::f64::consts::PI), draw(std::f64::consts::PI));
    let tilt = 0.5 * (draw(config.tilt) + config.tilt);
    // The palm's x axis is its normal; it starts out pointing down.
    let down = rotation::about(&Vector::y(), std::f64::consts::FRAC_PI_2);
    let turn = rotation::about(&Vector::z(), around)
        * rotation::about(&Vector::y(), -tilt)
        * rotation::about(&Vector::z(), -around)
        * rotation::about(&Vector::z(), roll)
        * down;
    let center = turn * Vector::from(config.center);
    Isometry::from_parts((point - center).into(), turn)
}
