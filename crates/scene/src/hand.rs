//! A cheap world: the hand without the arm, seen from the palm.
//!
//! A stiff arm under position control moves the palm as commanded, whatever the hand holds. So nothing but
//! the fingers is simulated, each as a multibody of its own: four mass matrices of four joints instead of one
//! of 23. The palm stays where it is; what the arm does to it reaches the object as the table's motion, as the
//! direction of gravity and as the palm's acceleration. Forces of inertia that come from turning are left out:
//! demonstrations and lifts turn the palm slowly.

use crate::colliders;
use crate::config::{CONTROL_PERIOD, Motors, SceneConfig, SceneError};
use crate::links;
use crate::simulation::{Simulation, Touching};
use crate::tabletop::{GRAVITY, Tabletop};
use geometry::object::Object;
use geometry::{Pose, Vec3};
use rapier3d::prelude::{
    MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, RigidBodyType,
};
use robot::{ARM, DOF, FINGERS, JointState, JointVector, Tree, rotation};

/// Physics steps in a control period: with mass matrices this small, half as many as the full scene takes.
const SUBSTEPS: usize = 4;

/// Joints of a finger.
const FINGER: usize = (DOF - ARM) / FINGERS;

/// Table, object and hand, in the frame that stands still in the palm and is the world's when it grasps.
pub struct HandScene<'a> {
    tree: &'a Tree,
    tabletop: Tabletop,
    motors: Motors,
    /// Palm body, then the 16 links of the fingers.
    bodies: Vec<RigidBodyHandle>,
    /// First joint of each finger.
    fingers: Vec<MultibodyJointHandle>,
    world_from_table: Pose,
    /// The palm when it grasps.
    grasp: Pose,
    /// Where the arm has the palm now, and its velocity (m/s), in the world.
    palm: Pose,
    velocity: Vec3,
}

impl<'a> HandScene<'a> {
    /// Sets up table, `object` at `world_from_object` and the hand in `start`; the palm is turned as the arm
    /// of `grasp` turns it.
    pub fn new(
        config: &SceneConfig,
        tree: &'a Tree,
        object: &Object,
        world_from_object: &Pose,
        start: &JointState,
        grasp: &JointVector,
    ) -> Result<Self, SceneError> {
        let grasp = palm_at(tree, grasp);
        let palm = palm_at(tree, &start.q);
        let kinematics = tree.kinematics(&start.q);
        let motion = kinematics.motion(&start.qd);
        let velocity_at =
            |point: Vec3| rotation::to_vec3(&motion.velocity(ARM, &rotation::to_vector(point)));
        let velocity = velocity_at(palm.translation);
        let here_from_world = grasp * palm.inverse();

        let table = RigidBodyBuilder::new(RigidBodyType::KinematicPositionBased);
        let (mut world, table) = Tabletop::begin(config, table);
        world.integration_parameters.dt = (CONTROL_PERIOD / SUBSTEPS as f64) as f32;
        let (bodies, fingers) = insert_hand(&mut world, config, tree, &grasp)?;
        let place = here_from_world * *world_from_object;
        let mut tabletop = Tabletop::finish(world, table, config, object, &place)?;
        let table = &mut tabletop.world.bodies[tabletop.table];
        let world_from_table = *table.position();
        table.set_position(here_from_world * world_from_table, true);
        let middle = object.center_of_mass;
        let object = &mut tabletop.world.bodies[tabletop.object];
        let passing = -velocity_at(*world_from_object * middle);
        object.set_linvel(here_from_world.rotation * passing, true);
        let turning = -rotation::to_vec3(&motion.angular_velocity(ARM));
        object.set_angvel(here_from_world.rotation * turning, true);
        let mut scene = Self {
            tree,
            tabletop,
            motors: config.motors.clone(),
            bodies,
            fingers,
            world_from_table,
            grasp,
            palm,
            velocity,
        };
        scene.place_fingers(&start.q);
        scene.drive(start);
        Ok(scene)
    }

    /// Puts the fingers where `q` has them.
    fn place_fingers(&mut self, q: &JointVector) {
        let world = &mut self.tabletop.world;
        for (finger, &first) in self.fingers.iter().enumerate() {
            let Some((multibody, _)) = world.multibody_joints.get_mut(first) else { continue };
            // Only now does the engine learn that the root is fixed, and numbers its joints for good.
            multibody.forward_kinematics(&world.bodies, true);
            let mut displacement = vec![0.0; multibody.ndofs()];
            let joints = ARM + FINGER * finger..;
            let indices: Vec<usize> = multibody.links().skip(1).map(|l| l.assembly_id()).collect();
            for (index, joint) in indices.into_iter().zip(joints) {
                displacement[index] = q[joint] as f32;
                links::set_passive(multibody, index, joint, &self.motors);
            }
            multibody.apply_displacements(&displacement);
            multibody.forward_kinematics(&world.bodies, false);
            multibody.update_rigid_bodies(&mut world.bodies, true);
        }
    }

    /// Sets the motors' targets.
    fn drive(&mut self, state: &JointState) {
        for (finger, &first) in self.fingers.iter().enumerate() {
            let multibodies = &mut self.tabletop.world.multibody_joints;
            let Some((multibody, _)) = multibodies.get_mut(first) else { continue };
            for (link, joint) in multibody.links_mut().skip(1).zip(ARM + FINGER * finger..) {
                links::set_target(link, joint, state, &self.motors);
            }
        }
    }

    /// Moves table and object past the palm, which the arm brings to `palm` within a physics step of `dt` (s).
    fn carry(&mut self, palm: Pose, dt: f32) {
        let velocity = (palm.translation - self.palm.translation) / dt;
        let acceleration = (velocity - self.velocity) / dt;
        (self.palm, self.velocity) = (palm, velocity);
        let here_from_world = self.here_from_world();
        self.tabletop.world.gravity = here_from_world.rotation * (GRAVITY - acceleration);
        let table = &mut self.tabletop.world.bodies[self.tabletop.table];
        table.set_next_kinematic_position(here_from_world * self.world_from_table);
    }

    fn here_from_world(&self) -> Pose {
        self.grasp * self.palm.inverse()
    }
}

impl Simulation for HandScene<'_> {
    fn follow(&mut self, from: &JointState, to: &JointState) {
        let dt = self.tabletop.world.integration_parameters.dt;
        for substep in 1..=SUBSTEPS {
            let state = links::hermite(from, to, substep as f64 / SUBSTEPS as f64);
            self.drive(&state);
            self.carry(palm_at(self.tree, &state.q), dt);
            self.tabletop.world.step();
        }
    }

    fn palm_pose(&self) -> Pose {
        *self.tabletop.world.bodies[self.bodies[0]].position()
    }

    fn object_pose(&self) -> Pose {
        self.tabletop.object_pose()
    }

    fn object_size(&self) -> Vec3 {
        self.tabletop.object_size
    }

    fn object_height(&self) -> f32 {
        let world_from_here = self.here_from_world().inverse();
        self.tabletop.object_height(&world_from_here, &self.world_from_table)
    }

    fn touching(&self) -> Touching {
        self.tabletop.touching(|parent| parent.filter(|b| self.bodies.contains(b)).map(|_| true))
    }

    fn is_finite(&self) -> bool {
        let poses = self.bodies.iter().map(|&body| self.tabletop.world.bodies[body].position());
        poses.into_iter().all(Pose::is_finite) && self.tabletop.is_finite()
    }
}

/// Where the arm has the palm's body.
fn palm_at(tree: &Tree, q: &JointVector) -> Pose {
    rotation::to_pose(&tree.kinematics(q).world_from_body[ARM])
}

/// Inserts the palm and the fingers, each on a root of its own in the palm's place.
fn insert_hand(
    world: &mut PhysicsWorld,
    config: &SceneConfig,
    tree: &Tree,
    world_from_palm: &Pose,
) -> Result<(Vec<RigidBodyHandle>, Vec<MultibodyJointHandle>), SceneError> {
    let root = || RigidBodyBuilder::fixed().pose(*world_from_palm);
    let mut bodies = vec![world.insert_body(root())];
    let mut fingers = Vec::new();
    for collider in colliders::of_body(tree, ARM, config.robot.friction) {
        world.insert_collider(collider, Some(bodies[0]));
    }
    for joint in ARM..DOF {
        let handle = world.insert_body(links::moving(&tree.bodies[joint + 1]));
        for collider in colliders::of_body(tree, joint + 1, config.robot.friction) {
            world.insert_collider(collider, Some(handle));
        }
        let hinge = &tree.joints[joint];
        let is_first = hinge.parent == ARM;
        let parent = if is_first { world.insert_body(root()) } else { bodies[joint - ARM] };
        let data = links::revolute(hinge, tree.limits.effort[joint] as f32);
        let joint = world
            .insert_multibody_joint(parent, handle, data)
            .ok_or_else(|| robot::UrdfError::Tree("a finger has no loops".into()))?;
        if is_first {
            fingers.push(joint);
        }
        bodies.push(handle);
    }
    Ok((bodies, fingers))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use robot::integrator;

    /// A pose of the arm over the table and one beside it, hand open.
    fn two_postures(config: &SceneConfig) -> [JointVector; 2] {
        let hand = config.robot.open;
        let here = [0.1, 1.2, 0.0, -1.7, 0.0, -1.5, 2.0];
        let there = [0.4, 1.1, 0.1, -1.6, 0.1, -1.3, 1.8];
        [here, there].map(|arm| robot::join(&arm, &hand))
    }

    /// From rest to rest in 30 rows.
    fn motion(from: &JointVector, to: &JointVector) -> Vec<JointState> {
        let mut states = vec![JointState::at_rest(*from)];
        let qdd = (to - from) / (0.25);
        for row in 0..30 {
            let sign = if row < 15 { 1.0 } else { -1.0 };
            let last = states[states.len() - 1];
            states.push(integrator::step(&last, &(qdd * sign), CONTROL_PERIOD));
        }
        states
    }

    fn standard() -> (SceneConfig, Tree, Object) {
        let object = Object::built_in("sugar_box").unwrap();
        (SceneConfig::standard().unwrap(), Tree::iiwa7_allegro().unwrap(), object)
    }

    /// The table goes past the palm, and the box with it: seen from the world, it stands still.
    #[test]
    fn what_stands_on_the_table_stays_there_while_the_arm_moves() {
        let (config, tree, object) = standard();
        let [from, to] = two_postures(&config);
        let place = config.upright(0.7, -0.25, 0.3);
        let states = motion(&from, &to);
        let mut scene = HandScene::new(&config, &tree, &object, &place, &states[0], &to).unwrap();
        for pair in states.windows(2) {
            scene.follow(&pair[0], &pair[1]);
        }
        let there = scene.here_from_world().inverse() * scene.object_pose();
        let moved = there.translation.distance(place.translation);
        assert!(moved < 0.002, "the box moved by {moved} m");
        assert!(scene.object_height().abs() < 0.002, "it is {} m high", scene.object_height());
        assert!(scene.touching().table && !scene.touching().hand);
        // Once the arm is in the posture of the grasp, frame and world are one.
        let apart = scene.here_from_world().translation.length();
        assert!(apart < 1e-5, "{apart} m apart");
    }

    /// Where nothing is touched, only the fingers' own dynamics are left, and they are those of the full scene.
    #[test]
    fn fingers_close_in_the_air_as_they_do_on_the_arm() {
        let (config, tree, object) = standard();
        let [open, _] = two_postures(&config);
        let closed = JointVector::from_fn(|i, _| if i < ARM { open[i] } else { open[i] + 0.3 });
        let place = config.upright(0.7, -0.25, 0.3);
        let states = motion(&open, &closed);
        let mut hand = HandScene::new(&config, &tree, &object, &place, &states[0], &open).unwrap();
        let mut full = Scene::new(&config, &tree, &object, &place, &open).unwrap();
        for pair in states.windows(2) {
            hand.follow(&pair[0], &pair[1]);
            full.follow(&pair[0], &pair[1]);
        }
        let to_palm = hand.palm_pose() * full.palm_pose().inverse();
        for body in ARM..=DOF {
            let [a, b] = [
                hand.tabletop.world.bodies[hand.bodies[body - ARM]].position().translation,
                (to_palm * full.body_pose(body)).translation,
            ];
            assert!(a.distance(b) < 5e-4, "body {body} is {} m off", a.distance(b));
        }
    }

    /// An object in free fall falls, whatever the arm does.
    #[test]
    fn a_thrown_box_falls_as_it_does_in_the_world() {
        let (config, tree, object) = standard();
        let [from, to] = two_postures(&config);
        let mut place = config.upright(0.7, -0.25, 0.0);
        place.translation.z += 0.6;
        let states = motion(&from, &to);
        let mut scene = HandScene::new(&config, &tree, &object, &place, &states[0], &to).unwrap();
        for pair in states.windows(2).take(9) {
            scene.follow(&pair[0], &pair[1]);
        }
        let there = scene.here_from_world().inverse() * scene.object_pose();
        let wanted = place.translation - Vec3::Z * (0.5 * 9.81 * 0.3 * 0.3);
        let off = there.translation.distance(wanted);
        // The palm turns by 0.13 rad a second here; what that does to a fall is left out.
        assert!(off < 0.03, "{off} m off its parabola");
    }
}
