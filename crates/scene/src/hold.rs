//! Is the object held? The verdict's geometry: height, what it touches, how far it slid in the palm.

use crate::config::Protocol;
use crate::simulation::{Simulation, Touching};
use geometry::{Pose, Vec3};

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
    /// It touches nothing.
    Free,
    /// It touches something that is not the hand.
    Leaning,
    /// It moved or turned too far in the palm.
    Slipped,
}

impl Hold {
    /// Takes the object's present place in the palm as the reference.
    pub fn begin(scene: &impl Simulation) -> Self {
        Self { palm_from_object: palm_from_object(scene), slip: 0.0, turn: 0.0 }
    }

    /// Updates slip and turn.
    pub fn observe(&mut self, scene: &impl Simulation) {
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
    pub fn loss(&self, scene: &impl Simulation, protocol: &Protocol) -> Option<Loss> {
        let touching = scene.touching();
        if self.slip > protocol.held_distance || self.turn > protocol.held_angle_deg.to_radians() {
            return Some(Loss::Slipped);
        }
        if scene.object_height() < protocol.held_height {
            return Some(Loss::Low);
        }
        match touching {
            Touching { hand: true, arm: false, table: false } => None,
            Touching { hand: false, arm: false, table: false } => Some(Loss::Free),
            _ => Some(Loss::Leaning),
        }
    }
}

/// Pose of the object in the body that carries the palm.
fn palm_from_object(scene: &impl Simulation) -> Pose {
    scene.palm_pose().inverse() * scene.object_pose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, SceneConfig};
    use geometry::object::Object;
    use robot::{JointState, Tree};

    /// The arm at home and the sugar box at `world_from_object`, one control period later.
    fn after_a_tick(world_from_object: &Pose) -> (Scene, SceneConfig) {
        let config = SceneConfig::standard().unwrap();
        let tree = Tree::iiwa7_allegro().unwrap();
        let object = Object::built_in("sugar_box").unwrap();
        let home = config.home();
        let mut scene = Scene::new(&config, &tree, &object, world_from_object, &home).unwrap();
        let rest = JointState::at_rest(home);
        scene.follow(&rest, &rest);
        (scene, config)
    }

    /// Where the box overlaps the middle fingertip a little, its long side along the world's z.
    fn at_the_fingertip() -> Pose {
        let config = SceneConfig::standard().unwrap();
        let tree = Tree::iiwa7_allegro().unwrap();
        let tip = tree.tips[1];
        let kinematics = tree.kinematics(&config.home());
        let world_from_tip = kinematics.world_from_body[tip.body] * tip.body_from_frame;
        let at = robot::rotation::to_vec3(&world_from_tip.translation.vector);
        // The tip's radius is 12 mm: it reaches 4 mm into the top of the box.
        Pose::from_translation(at - Vec3::Z * (0.176 + 0.008))
    }

    #[test]
    fn on_the_table_it_touches_the_table_and_is_too_low() {
        let config = SceneConfig::standard().unwrap();
        let (scene, config) = after_a_tick(&config.upright(0.6, 0.0, 0.5));
        assert_eq!(scene.touching(), Touching { table: true, ..Touching::default() });
        let hold = Hold::begin(&scene);
        assert_eq!(hold.loss(&scene, &config.attempt), Some(Loss::Low));
    }

    #[test]
    fn in_the_air_it_is_held_only_by_the_hand() {
        let (scene, config) = after_a_tick(&Pose::from_translation(Vec3::new(0.6, 0.5, 0.3)));
        assert_eq!(scene.touching(), Touching::default());
        assert_eq!(Hold::begin(&scene).loss(&scene, &config.attempt), Some(Loss::Free));

        let (scene, config) = after_a_tick(&at_the_fingertip());
        let hand = Touching { hand: true, ..Touching::default() };
        assert_eq!(scene.touching(), hand, "height {}", scene.object_height());
        assert_eq!(Hold::begin(&scene).loss(&scene, &config.attempt), None);
    }

    #[test]
    fn a_verdict_needs_the_height() {
        let (scene, config) = after_a_tick(&at_the_fingertip());
        let hold = Hold::begin(&scene);
        let mut protocol = config.attempt;
        protocol.held_height = scene.object_height() - 0.001;
        assert_eq!(hold.loss(&scene, &protocol), None);
        protocol.held_height = scene.object_height() + 0.001;
        assert_eq!(hold.loss(&scene, &protocol), Some(Loss::Low));
    }

    #[test]
    fn an_arm_link_is_not_the_hand() {
        let config = SceneConfig::standard().unwrap();
        let tree = Tree::iiwa7_allegro().unwrap();
        let elbow = tree.kinematics(&config.home()).world_from_body[4].translation.vector;
        let (scene, config) = after_a_tick(&Pose::from_translation(
            robot::rotation::to_vec3(&elbow) + Vec3::new(0.0, 0.0, 0.055),
        ));
        assert_eq!(scene.touching(), Touching { arm: true, ..Touching::default() });
        assert_eq!(Hold::begin(&scene).loss(&scene, &config.attempt), Some(Loss::Leaning));
    }

    #[test]
    fn moving_or_turning_in_the_palm_is_slipping() {
        let start = at_the_fingertip();
        let (mut scene, config) = after_a_tick(&start);
        let begun = Hold::begin(&scene);
        let reference = scene.object_pose();
        let mut moved = begun.clone();
        scene.place_object(&Pose {
            translation: reference.translation + Vec3::X * 0.029,
            ..reference
        });
        moved.observe(&scene);
        assert!((moved.slip - 0.029).abs() < 1e-4, "slip {}, wanted 0.029", moved.slip);
        assert_ne!(moved.loss(&scene, &config.attempt), Some(Loss::Slipped));
        scene.place_object(&Pose {
            translation: reference.translation + Vec3::X * 0.031,
            ..reference
        });
        moved.observe(&scene);
        assert_eq!(moved.loss(&scene, &config.attempt), Some(Loss::Slipped));

        // A turn about its long axis moves the box's middle nowhere.
        let mut turned = begun;
        let (sin, cos) = libm::sincosf(0.5 * 31.0f32.to_radians());
        let turn = glamx::Quat::from_xyzw(0.0, 0.0, sin, cos);
        scene.place_object(&Pose { rotation: reference.rotation * turn, ..reference });
        turned.observe(&scene);
        assert!(turned.slip < 1e-4, "slip {}", turned.slip);
        assert!((turned.turn.to_degrees() - 31.0).abs() < 0.1, "{}", turned.turn.to_degrees());
        assert_eq!(turned.loss(&scene, &config.attempt), Some(Loss::Slipped));
        // Back in place it stays lost: the greatest slip counts.
        scene.place_object(&reference);
        moved.observe(&scene);
        assert_eq!(moved.loss(&scene, &config.attempt), Some(Loss::Slipped));
    }
}
