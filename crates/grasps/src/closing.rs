//! Closing the hand by geometry: every finger curls until it touches the object.

use geometry::solid::{Contact, Solid};
use robot::solids::RobotSolids;
use robot::{ARM, FINGERS, HAND, JointVector, Tree};

/// How the fingers curl.
#[derive(Clone, Debug)]
pub struct ClosingConfig {
    /// Curl of the three joints of a finger that flex it (index to ring), per step of the curl (rad).
    pub finger_rates: [f64; 3],
    /// The same for the thumb's joints 1 to 3.
    pub thumb_rates: [f64; 3],
    /// Step of the curl.
    pub step: f64,
    /// A link touches when its gap is at most this (m).
    pub touch_gap: f32,
}

/// A closed hand.
#[derive(Clone, Debug)]
pub struct Closed {
    /// Hand joints (rad).
    pub hand: [f64; HAND],
    /// The contact of each finger with its body, if it reached the object.
    pub contacts: [Option<(usize, Contact)>; FINGERS],
}

/// Distances beyond this (m) are not measured.
const REACH: f32 = 0.02;

/// Curls all fingers of the robot, which stands in `open`, until they touch one of `solids`.
///
/// When a link touches, the joints before it stop and those after it go on; joints also stop at
/// their limits. A finger that never touches stays where its limits end it.
pub fn close(
    tree: &Tree,
    robot: &RobotSolids,
    open: &JointVector,
    solids: &[Solid],
    config: &ClosingConfig,
) -> Closed {
    let mut q = *open;
    let mut contacts = [None; FINGERS];
    for (finger, contact) in contacts.iter_mut().enumerate() {
        let first = ARM + 4 * finger;
        let rates = if finger == FINGERS - 1 { config.thumb_rates } else { config.finger_rates };
        let mut free_from = 1;
        while free_from < 4 {
            let before = q;
            let mut moved = false;
            for joint in free_from..4 {
                let i = first + joint;
                let next = q[i] + rates[joint - 1] * config.step;
                let limit = tree.limits.upper[i] - 0.02;
                moved |= next <= limit && rates[joint - 1] > 0.0;
                q[i] = next.min(limit);
            }
            if !moved {
                break;
            }
            let kinematics = tree.kinematics(&q);
            // Body i + 1 is the link that joint i moves.
            let touching = (free_from..4).rev().find_map(|joint| {
                let body = first + joint + 1;
                let nearest = nearest_contact(robot, &kinematics, body, solids)?;
                (nearest.gap <= config.touch_gap).then_some((joint, body, nearest))
            });
            if let Some((joint, body, nearest)) = touching {
                if nearest.gap < 0.0 {
                    q = before;
                }
                *contact = Some((body, nearest));
                free_from = joint + 1;
            }
        }
    }
    Closed { hand: robot::hand_of(&q), contacts }
}

/// The contact of body `body` with the least gap.
pub fn nearest_contact(
    robot: &RobotSolids,
    kinematics: &robot::Kinematics,
    body: usize,
    solids: &[Solid],
) -> Option<Contact> {
    let pose = robot::rotation::to_pose(&kinematics.world_from_body[body]);
    let links = robot.of_body(body).iter().map(|link| link.moved(&pose));
    links
        .flat_map(|link| solids.iter().filter_map(move |solid| link.contact(solid, REACH)))
        .min_by(|a, b| a.gap.total_cmp(&b.gap))
}
