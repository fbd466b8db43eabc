//! Hold criterion: height of the object, its contacts, and its slip in the palm.

use crate::config::AttemptProtocol;
use crate::contacts::ContactState;
use crate::scene::Scene;
use geometry::{Pose, Vec3};

/// Tracks the object pose in the palm from the start of the lift.
#[derive(Clone, Debug)]
pub struct HoldMonitor {
    palm_from_object: Pose,
    /// Max displacement (m) of the object in the palm so far.
    pub slip: f32,
    /// Max rotation (rad) of the object in the palm so far.
    pub rotation: f32,
}

/// Reason why an object does not count as held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoldFailure {
    /// The object is below the required height.
    TooLow,
    /// The object has no contact.
    NoContact,
    /// The object touches the table or the arm.
    ForeignContact,
    /// The object moved or rotated too far in the palm.
    Slipped,
}

impl HoldMonitor {
    /// Starts with the current pose of the object in the palm as the reference.
    pub fn new(scene: &Scene) -> Self {
        Self { palm_from_object: palm_from_object(scene), slip: 0.0, rotation: 0.0 }
    }

    /// Updates displacement and rotation.
    pub fn update(&mut self, scene: &Scene) {
        let now = palm_from_object(scene);
        // The displacement of the object's centre includes its translation and its rotation about the palm.
        let center = Vec3::new(0.0, 0.0, 0.5 * scene.object_size().z);
        let displacement = (now * center).distance(self.palm_from_object * center);
        let relative = self.palm_from_object.rotation.inverse() * now.rotation;
        let cos = relative.w.abs().min(1.0);
        self.slip = self.slip.max(displacement);
        self.rotation = self.rotation.max(2.0 * libm::acosf(cos));
    }

    /// Checks the hold criterion of `protocol`; `None` if the object is held.
    pub fn failure(&self, scene: &Scene, protocol: &AttemptProtocol) -> Option<HoldFailure> {
        let touching = scene.contact_state();
        if self.slip > protocol.max_slip || self.rotation > protocol.max_rotation_deg.to_radians() {
            return Some(HoldFailure::Slipped);
        }
        if scene.object_height() < protocol.min_hold_height {
            return Some(HoldFailure::TooLow);
        }
        match touching {
            ContactState { hand: true, arm: false, table: false } => None,
            ContactState { hand: false, arm: false, table: false } => Some(HoldFailure::NoContact),
            _ => Some(HoldFailure::ForeignContact),
        }
    }
}

/// Pose of the object in the palm body.
fn palm_from_object(scene: &Scene) -> Pose {
    scene.palm_pose().inverse() * scene.object_pose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, SceneConfig};
    use objects::object::Object;
    use robot::{JointState, KinematicTree};

    /// The scene with the arm at home and the sugar box at `world_from_object`, after one control period.
    fn scene_after_one_tick(world_from_object: &Pose) -> (Scene, SceneConfig) {
        let config = SceneConfig::standard().unwrap();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let object = Object::from_catalog("sugar_box").unwrap();
        let home = config.home();
        let mut scene = Scene::new(&config, &tree, &object, world_from_object, &home).unwrap();
        let rest = JointState::at_rest(home);
        scene.track(&rest, &rest);
        (scene, config)
    }

    /// A box pose slightly overlapping the middle fingertip, with the long side along the world's z axis.
    fn at_the_fingertip() -> Pose {
        let config = SceneConfig::standard().unwrap();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let kinematics = tree.forward_kinematics(&config.home());
        let [index, middle] = [0, 1].map(|finger| {
            let tip = tree.fingertips[finger];
            let world_from_tip = kinematics.world_from_body[tip.body] * tip.body_from_frame;
            robot::rotation::to_vec3(&world_from_tip.translation.vector)
        });
        // The fingertip radius is 12 mm; the tip penetrates the top of the box by 4 mm. The narrow side of the
        // box is across the fingers, so that it touches no other finger.
        let across = middle - index;
        let rotation = glamx::Quat::from_rotation_z(libm::atan2f(across.y, across.x));
        Pose::from_parts(middle - Vec3::Z * (0.176 + 0.008), rotation)
    }

    #[test]
    fn object_on_table_is_too_low() {
        let config = SceneConfig::standard().unwrap();
        let (scene, config) = scene_after_one_tick(&config.object_pose(0.6, 0.0, 0.5));
        assert_eq!(scene.contact_state(), ContactState { table: true, ..ContactState::default() });
        let hold = HoldMonitor::new(&scene);
        assert_eq!(hold.failure(&scene, &config.protocol), Some(HoldFailure::TooLow));
    }

    #[test]
    fn object_in_air_is_held_only_with_hand_contact() {
        let (scene, config) =
            scene_after_one_tick(&Pose::from_translation(Vec3::new(0.6, 0.5, 0.3)));
        assert_eq!(scene.contact_state(), ContactState::default());
        assert_eq!(
            HoldMonitor::new(&scene).failure(&scene, &config.protocol),
            Some(HoldFailure::NoContact)
        );

        let (scene, config) = scene_after_one_tick(&at_the_fingertip());
        let hand = ContactState { hand: true, ..ContactState::default() };
        assert_eq!(scene.contact_state(), hand, "height {}", scene.object_height());
        assert_eq!(
            scene.hand_contacts(),
            ([false, true, false, false], false),
            "the middle finger"
        );
        assert_eq!(HoldMonitor::new(&scene).failure(&scene, &config.protocol), None);
    }

    #[test]
    fn hold_requires_min_height() {
        let (scene, config) = scene_after_one_tick(&at_the_fingertip());
        let hold = HoldMonitor::new(&scene);
        let mut protocol = config.protocol;
        protocol.min_hold_height = scene.object_height() - 0.001;
        assert_eq!(hold.failure(&scene, &protocol), None);
        protocol.min_hold_height = scene.object_height() + 0.001;
        assert_eq!(hold.failure(&scene, &protocol), Some(HoldFailure::TooLow));
    }

    #[test]
    fn arm_contact_is_not_a_hold() {
        let config = SceneConfig::standard().unwrap();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let elbow = tree.forward_kinematics(&config.home()).world_from_body[4].translation.vector;
        let (scene, config) = scene_after_one_tick(&Pose::from_translation(
            robot::rotation::to_vec3(&elbow) + Vec3::new(0.0, 0.0, 0.055),
        ));
        assert_eq!(scene.contact_state(), ContactState { arm: true, ..ContactState::default() });
        assert_eq!(
            HoldMonitor::new(&scene).failure(&scene, &config.protocol),
            Some(HoldFailure::ForeignContact)
        );
    }

    #[test]
    fn displacement_or_rotation_in_palm_is_a_slip() {
        let start = at_the_fingertip();
        let (mut scene, config) = scene_after_one_tick(&start);
        let initial = HoldMonitor::new(&scene);
        let reference = scene.object_pose();
        let mut moved = initial.clone();
        scene.place_object(&Pose {
            translation: reference.translation + Vec3::X * 0.029,
            ..reference
        });
        moved.update(&scene);
        assert!((moved.slip - 0.029).abs() < 1e-4, "slip {}, wanted 0.029", moved.slip);
        assert_ne!(moved.failure(&scene, &config.protocol), Some(HoldFailure::Slipped));
        scene.place_object(&Pose {
            translation: reference.translation + Vec3::X * 0.031,
            ..reference
        });
        moved.update(&scene);
        assert_eq!(moved.failure(&scene, &config.protocol), Some(HoldFailure::Slipped));

        // A rotation about the long axis does not move the centre of the box.
        let mut rotated = initial;
        let (sin, cos) = libm::sincosf(0.5 * 31.0f32.to_radians());
        let rotation = glamx::Quat::from_xyzw(0.0, 0.0, sin, cos);
        scene.place_object(&Pose { rotation: reference.rotation * rotation, ..reference });
        rotated.update(&scene);
        assert!(rotated.slip < 1e-4, "slip {}", rotated.slip);
        assert!(
            (rotated.rotation.to_degrees() - 31.0).abs() < 0.1,
            "{}",
            rotated.rotation.to_degrees()
        );
        assert_eq!(rotated.failure(&scene, &config.protocol), Some(HoldFailure::Slipped));
        // The slip remains after the object returns, because the max displacement counts.
        scene.place_object(&reference);
        moved.update(&scene);
        assert_eq!(moved.failure(&scene, &config.protocol), Some(HoldFailure::Slipped));
    }
}
