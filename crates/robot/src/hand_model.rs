//! Values that hold only for one arm and one hand, from `hand.toml` in the folder of the robot.
//!
//! The comments of that file state reasons and sources. Parameters of the methods stay with the methods.

use crate::description::RobotDescription;
use crate::tree::KinematicTree;
use crate::{ARM_DOF, DOF, FINGER_DOF, NUM_FINGERS, UrdfError};
use std::sync::LazyLock;

/// Number of flexing joints of a finger.
pub const FINGER_FLEXION_DOF: usize = FINGER_DOF - 1;

/// Values that hold only for one arm and one hand.
///
/// ```rust
/// use robot::hand_model::{HandModel, LinkRole};
/// let hand = HandModel::standard();
/// assert_eq!(hand.links.role("thumb_link_3"), LinkRole::Distal);
/// // A positive angle closes: each joint of a finger flexes by its rate (rad) per unit of closing.
/// assert!(hand.closing.finger_rates.iter().all(|rate| *rate > 0.0));
/// let [lightest, heaviest] = hand.graspable.mass; // kg
/// assert!(lightest < heaviest);
/// ```
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandModel {
    /// Robot type in the metadata of datasets.
    pub name: String,
    /// Names of links with a special role.
    pub links: LinkNames,
    /// Pairs of links whose collision is ignored.
    pub self_collision: SelfCollision,
    /// Bodies between which distances are computed.
    pub avoidance: Avoidance,
    /// Postures and joint groups of the arm.
    pub arm: ArmModel,
    /// Reference point of a grasp.
    pub grasp: GraspFrame,
    /// Flexion of the fingers that closes the hand.
    pub closing: Closing,
    /// Pinches of low objects.
    pub pinch: PinchModel,
    /// Flexion of the fingers that opens the hand.
    pub opening: Opening,
    /// Forces of the fingers on a grasped object.
    pub squeeze: SqueezeForces,
    /// Objects that the hand can grasp.
    pub graspable: Graspable,
}

/// Names of URDF links with a special role.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkNames {
    /// Link whose frame is the palm frame.
    pub palm: String,
    /// Links whose origins are the fingertip centres; the thumb is last.
    pub fingertips: [String; NUM_FINGERS],
    /// Last link with a shape of each finger.
    pub distal: [String; NUM_FINGERS],
    /// Links next to the palm, which overlap it.
    pub finger_bases: Vec<String>,
    /// Link at the end of the arm, drawn in another colour.
    pub flange: String,
}

/// Role of a link in collisions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinkRole {
    /// Any other link.
    #[default]
    Other,
    /// A link next to the palm, which does not collide with it.
    FingerBase,
    /// The last link of a finger: its capsule is the fingertip.
    Distal,
}

impl LinkNames {
    /// Role of the link `name`.
    pub fn role(&self, name: &str) -> LinkRole {
        if self.finger_bases.iter().any(|base| base == name) {
            LinkRole::FingerBase
        } else if self.distal.iter().any(|distal| distal == name) {
            LinkRole::Distal
        } else {
            LinkRole::Other
        }
    }
}

/// Self-collision of the arm.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelfCollision {
    /// Min number of joints between two arm links that collide.
    pub min_arm_joint_gap: usize,
}

/// Bodies between which distances are computed; body 0 is the base.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Avoidance {
    /// First body that is kept clear of table and object.
    pub first_body: usize,
    /// Last arm body from which the spheres of the hand are repelled.
    pub last_self_body: usize,
}

/// Postures (rad) and joint groups of the arm, for inverse kinematics and for distances of configurations.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmModel {
    /// Nominal posture: the first IK seed, and the target of IK's null-space motion.
    pub nominal: [f64; ARM_DOF],
    /// Further IK seeds, in the order in which they are tried. They may be beyond the joint limits.
    pub alternate_seeds: Vec<[f64; ARM_DOF]>,
    /// Names of the joints of elbow and wrist. Two families of solutions meet where such a joint is straight.
    pub flexion_joints: Vec<String>,
    /// Min flexion of these joints (rad), with the sign of the nominal posture.
    pub min_flexion: f64,
    /// Names of the joints that roll upper arm and forearm.
    pub roll_joints: Vec<String>,
    /// Max roll of these joints (rad) from the nominal posture.
    pub max_roll: f64,
    /// Weight of an arm joint in the distance of two configurations; that of a hand joint is 1.
    pub metric_weight: f64,
}

/// Reference point of a grasp.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspFrame {
    /// Midpoint between fingertips and thumb (m, palm frame).
    pub center: [f64; 3],
}

/// Flexion of the fingers that closes the hand.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Closing {
    /// Flexion (rad) of the flexing joints of each finger, base to tip, per unit of closing.
    pub finger_rates: [f64; FINGER_FLEXION_DOF],
    /// Flexion (rad) of the flexing joints of the thumb per unit of closing.
    pub thumb_rates: [f64; FINGER_FLEXION_DOF],
    /// Flexion (rad) of every flexing joint in the scripted closing, a control experiment.
    pub scripted_angle: f64,
}

/// Where the fingertips can slide along a table towards each other. Ranges of random values.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PinchModel {
    /// Point between the fingertips along the palm's normal (m, palm frame).
    pub center_x: [f64; 2],
    /// The same point along the fingers (m, palm frame).
    pub center_z: [f64; 2],
    /// Angle (rad) of the palm's normal from straight down.
    pub tilt: [f64; 2],
    /// Sets of fingers that oppose the thumb; 0 is the index finger.
    pub finger_sets: Vec<Vec<usize>>,
}

/// Flexion of the fingers that opens the hand.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Opening {
    /// Angle (rad) by which each flexing joint opens beyond the pregrasp posture on the way out of a grasp.
    pub demonstration: f64,
    /// Angle (rad) by which each flexing joint of an imported grasp opens before it closes again.
    pub imported: f64,
}

/// Forces of the fingers on a grasped object.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SqueezeForces {
    /// Min normal force (N) of each touching finger.
    pub min_force: f64,
    /// Max torque (N·m) of a finger joint.
    pub max_torque: f64,
    /// Factor on the commanded joint offset beyond the surface, relative to the offset that yields
    /// `max_torque`.
    pub gain: f64,
}

/// Objects that the hand can grasp.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Graspable {
    /// Max width (m) that the hand encloses.
    pub max_width: f32,
    /// Min height (m) of an object on a table.
    pub min_height: f32,
    /// Min and max mass (kg) that the hand lifts.
    pub mass: [f64; 2],
}

impl HandModel {
    /// The hand of this project, from `assets/robot/iiwa7_allegro/hand.toml`.
    pub fn standard() -> &'static Self {
        static HAND: LazyLock<HandModel> = LazyLock::new(|| {
            // The file is embedded at compile time, and tests parse it.
            let text = RobotDescription::STANDARD.hand;
            HandModel::parse(text).expect("the embedded hand file is valid")
        });
        &HAND
    }

    /// Parses a hand file in JSON.
    pub(crate) fn parse(text: &str) -> Result<Self, UrdfError> {
        serde_json::from_slice(text.as_bytes()).map_err(|error| UrdfError::Hand(error.to_string()))
    }

    /// Weight of a joint in the distance of two configurations.
    pub fn joint_weight(&self, joint: usize) -> f64 {
        if joint < ARM_DOF { self.arm.metric_weight } else { 1.0 }
    }

    /// Checks names, nominal posture, bodies and torque against the kinematic tree.
    pub(crate) fn check(&self, tree: &KinematicTree) -> Result<(), UrdfError> {
        let error = |text: String| Err(UrdfError::Hand(text));
        let links = &self.links;
        let linked = links.fingertips.iter().chain(&links.distal).chain(&links.finger_bases);
        for link in linked.chain([&links.palm, &links.flange]) {
            if !tree.frames.contains_key(link) {
                return error(format!("the URDF has no link {link}"));
            }
        }
        for joint in self.arm.flexion_joints.iter().chain(&self.arm.roll_joints) {
            if tree.joint_index(joint).is_none_or(|index| index >= ARM_DOF) {
                return error(format!("the arm has no joint {joint}"));
            }
        }
        // Seeds may be beyond the limits: inverse kinematics clamps its solutions.
        let (limits, nominal) = (&tree.limits, &self.arm.nominal);
        if !(0..ARM_DOF).all(|i| (limits.lower[i]..=limits.upper[i]).contains(&nominal[i])) {
            return error(format!("the posture {nominal:?} is beyond the limits of the arm"));
        }
        if self.avoidance.first_body > DOF || self.avoidance.last_self_body > ARM_DOF {
            return error(format!("{:?} names a body that does not exist", self.avoidance));
        }
        let [torque, effort] =
            [self.squeeze.max_torque, tree.limits.torque.rows_range(ARM_DOF..).min()];
        if torque > effort {
            return error(format!(
                "max_torque {torque} N·m is above the effort limit {effort} N·m"
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_hand_file_is_rejected_with_its_cause() {
        let good = RobotDescription::STANDARD;
        let message = |from: &str, to: &str| {
            assert!(good.hand.contains(from), "{from}");
            let hand = good.hand.replace(from, to);
            let description = RobotDescription { hand: &hand, ..good };
            KinematicTree::load(&description).unwrap_err().to_string()
        };
        assert!(message("max_roll", "max_rall").contains("max_rall"));
        assert!(message("link_7", "link_9").contains("no link link_9"));
        assert!(message("joint_6", "joint_8").contains("no joint joint_8"));
        assert!(message("joint_6", "thumb_joint_1").contains("no joint thumb_joint_1"));
        assert!(message("-1.75,2.3", "-1.75,3.3").contains("beyond the limits"));
        assert!(message("\"first_body\":3", "\"first_body\":24").contains("does not exist"));
        assert!(message("\"max_torque\":0.7", "\"max_torque\":0.8").contains("effort limit"));
    }

    #[test]
    fn hand_of_the_tree_is_the_standard_one() {
        assert_eq!(&KinematicTree::iiwa7_allegro().unwrap().hand, HandModel::standard());
    }
}
