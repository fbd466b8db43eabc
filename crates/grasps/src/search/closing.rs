//! Kinematic closing of the hand: each finger flexes until it touches the object.

use geometry::convex_shape::{ClosestPoints, ConvexShape};
use robot::collision_shapes::CollisionModel;
use robot::hand_model::FINGER_FLEXION_DOF;
use robot::{ARM_DOF, FINGER_DOF, HAND_DOF, JointVector, KinematicTree, NUM_FINGERS};

/// Flexion rates of the fingers and the contact threshold.
#[derive(Clone, Debug)]
pub struct ClosingConfig {
    /// Flexion (rad) of the three flexing joints of each finger (index to ring) per unit of closing.
    pub finger_rates: [f64; FINGER_FLEXION_DOF],
    /// Flexion (rad) of the thumb's joints 1 to 3 per unit of closing.
    pub thumb_rates: [f64; FINGER_FLEXION_DOF],
    /// Increment of closing between two distance checks.
    pub step: f64,
    /// A link is in contact if its signed distance (m) from the object is not above this.
    pub contact_distance: f32,
    /// A link stops at this distance (m) from the table.
    pub table_clearance: f32,
}

/// The closed hand and its contacts.
#[derive(Clone, Debug)]
pub struct ClosedHand {
    /// Hand joints (rad).
    pub hand: [f64; HAND_DOF],
    /// For each finger, the touching body and its closest points; `None` if the finger does not reach the
    /// object.
    pub contacts: [Option<(usize, ClosestPoints)>; NUM_FINGERS],
}

/// Maximum distance (m) of a query; farther shapes are ignored.
const MAX_QUERY_DISTANCE: f32 = 0.02;

/// Upper bound of the distance (m) from a finger's first joint to any point of its links. A finger of the Allegro
/// hand with its fingertip is 0.16 m long.
const FINGER_REACH: f64 = 0.2;

/// Flexes all fingers from the posture `pregrasp` until they touch one of `shapes`.
///
/// When a link touches or meets the table, the joints before it stop and those after it continue. Joints also stop
/// at their limits. A finger without contact ends at its limits or above the table: around a low object, the
/// outer fingers would otherwise end inside the table. Distances are not computed where the last one shows
/// that nothing can have touched.
pub fn close_hand(
    tree: &KinematicTree,
    robot: &CollisionModel,
    pregrasp: &JointVector,
    shapes: &[ConvexShape],
    table: &ConvexShape,
    config: &ClosingConfig,
) -> ClosedHand {
    let mut q = *pregrasp;
    let mut contacts = [None; NUM_FINGERS];
    for (finger, contact) in contacts.iter_mut().enumerate() {
        let first = ARM_DOF + FINGER_DOF * finger;
        let rates =
            if finger == NUM_FINGERS - 1 { config.thumb_rates } else { config.finger_rates };
        // Joint 0 of a finger does not flex it.
        let mut free_from = 1;
        // Upper bound of the motion (m) of any point of the finger in one step.
        let max_motion = rates.iter().sum::<f64>() * config.step * FINGER_REACH;
        let mut free_steps = 0;
        while free_from < FINGER_DOF {
            let before = q;
            let mut moved = false;
            for joint in free_from..FINGER_DOF {
                let i = first + joint;
                let next = q[i] + rates[joint - 1] * config.step;
                let limit = tree.limits.upper[i] - 0.02;
                moved |= next <= limit && rates[joint - 1] > 0.0;
                q[i] = next.min(limit);
            }
            if !moved {
                break;
            }
            if free_steps > 0 {
                free_steps -= 1;
                continue;
            }
            let kinematics = tree.forward_kinematics(&q);
            let table = std::slice::from_ref(table);
            let mut min_gap = MAX_QUERY_DISTANCE;
            let meets_table = (free_from..FINGER_DOF).rev().find(|joint| {
                let body = first + joint + 1;
                let gap = robot.body_distance(&kinematics, body, table, MAX_QUERY_DISTANCE)
                    - config.table_clearance;
                min_gap = min_gap.min(gap);
                gap < 0.0
            });
            if let Some(joint) = meets_table {
                q = before;
                free_from = joint + 1;
                continue;
            }
            // Joint i moves body i + 1.
            let touching = (free_from..FINGER_DOF).rev().find_map(|joint| {
                let body = first + joint + 1;
                let nearest = closest_points(robot, &kinematics, body, shapes)?;
                min_gap = min_gap.min(nearest.distance - config.contact_distance);
                (nearest.distance <= config.contact_distance).then_some((joint, body, nearest))
            });
            free_steps = (f64::from(min_gap) / max_motion).max(0.0) as usize;
            if let Some((joint, body, nearest)) = touching {
                if nearest.distance < 0.0 {
                    q = before;
                }
                *contact = Some((body, nearest));
                free_from = joint + 1;
            }
        }
    }
    ClosedHand { hand: robot::hand_joints(&q), contacts }
}

/// Closest points of body `body` and the shapes, for the pair with the smallest signed distance.
pub fn closest_points(
    robot: &CollisionModel,
    kinematics: &robot::Kinematics,
    body: usize,
    shapes: &[ConvexShape],
) -> Option<ClosestPoints> {
    let pose = robot::rotation::to_pose(&kinematics.world_from_body[body]);
    let links = robot.body_shapes(body).iter().map(|link| link.transformed(&pose));
    links
        .flat_map(|link| {
            shapes.iter().filter_map(move |shape| link.closest_points(shape, MAX_QUERY_DISTANCE))
        })
        .min_by(|a, b| a.distance.total_cmp(&b.distance))
}
