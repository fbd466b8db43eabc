//! Is the object held? The verdict's geometry: height, what it touches, how far it slid in the palm.

use crate::config::Protocol;
use crate::world::{Scene, Touching};
use geometry::{Pose, Vec3};
use robot::ARM;

/// Follows an object in the hand from the moment when the lift begins.
#[derive(Clone, Debug)]
pub struct Hold {
    palm_from_object: Pose,
    /// Greatest distance (m) that the object has moved in the palm since then.
    pub slip: f32,
    /// Greatest angle (rad) that it has turned in the palm since then.
    pub turn: f32,
}

/// Why an object does not count as held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// It touches the table or hangs too low.
    Low,
    /// It touches something that is not the hand.
    Leaning,
    /// It moved or turned too far in the palm.
    Slipped,
}

impl Hold {
    /// Takes the object's present place in the palm as the reference.
    pub fn begin(scene: &Scene) -> Self {
        Self { palm_from_object: palm_from_object(scene), slip: 0.0, turn: 0.0 }
    }

    /// Updates slip and turn.
    pub fn observe(&mut self, scene: &Scene) {
        let now = palm_from_object(scene);
        // The object's middle shows both its translation and its rotation about the palm.
        let middle = Vec3::new(0.0, 0.0, 0.5 * scene.object_size().z);
        let moved = (now * middle).distance(self.palm_from_object * middle);
        let turned = self.palm_from_object.rotation.inverse() * now.rotation;
        let cos = turned.w.abs().min(1.0);
        self.slip = self.slip.max(moved);
        self.turn = self.turn.max(2.0 * libm::acosf(cos));
    }

    /// `None` while the object is held as the protocol wants it.
    pub fn loss(&self, scene: &Scene, protocol: &Protocol) -> Option<Loss> {
        let touching = scene.touching();
        if self.slip > protocol.held_distance || self.turn > protocol.held_angle_deg.to_radians() {
            return Some(Loss::Slipped);
        }
        if scene.object_height() < protocol.held_height {
            return Some(Loss::Low);
        }
        let only_hand = Touching { hand: true, ..Touching::default() };
        (touching != only_hand).then_some(Loss::Leaning)
    }
}

/// Pose of the object in the body that carries the palm.
fn palm_from_object(scene: &Scene) -> Pose {
    scene.body_pose(ARM).inverse() * scene.object_pose()
}
