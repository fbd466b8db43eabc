//! Reduced simulation: the hand without the arm, in a frame in which the palm is fixed.
//!
//! A stiff position-controlled arm moves the palm as commanded, independently of the load. Therefore only the
//! fingers are simulated, each as its own multibody: four mass matrices of four joints instead of one of 23.
//! The palm is fixed. The arm motion acts on the object through the motion of the table, the direction of
//! gravity and the acceleration of the palm. Inertial forces of the palm's rotation are neglected, because
//! demonstrations and lifts rotate the palm slowly.

use crate::colliders;
use crate::config::{CONTROL_DT, Motors, SceneConfig, SceneError};
use crate::links;
use crate::simulation::{ContactState, Simulation};
use crate::tabletop::{GRAVITY, TabletopWorld};
use geometry::{Pose, Vec3};
use objects::object::Object;
use rapier3d::prelude::{
    MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, RigidBodyType,
};
use robot::{ARM_DOF, DOF, FINGER_DOF, JointState, JointVector, KinematicTree, rotation};

/// Physics steps per control period: half as many as the full scene, because the mass matrices are small.
const SUBSTEPS: usize = 4;

/// Table, object and hand. The simulation frame is fixed to the palm and equals the world frame at the grasp.
pub struct FloatingHandScene<'a> {
    tree: &'a KinematicTree,
    tabletop: TabletopWorld,
    motors: Motors,
    /// Palm body, then the 16 finger links.
    bodies: Vec<RigidBodyHandle>,
    /// First joint of each finger.
    fingers: Vec<MultibodyJointHandle>,
    world_from_table: Pose,
    /// World pose of the palm body at the grasp.
    world_from_grasp_palm: Pose,
    /// Current world pose of the palm body and its velocity (m/s).
    world_from_palm: Pose,
    palm_velocity: Vec3,
}

impl<'a> FloatingHandScene<'a> {
    /// Sets up table, `object` at `world_from_object` and the hand in the state `start`. `grasp` is the joint
    /// position (rad) that defines the palm pose of the simulation frame.
    pub fn new(
        config: &SceneConfig,
        tree: &'a KinematicTree,
        object: &Object,
        world_from_object: &Pose,
        start: &JointState,
        grasp: &JointVector,
    ) -> Result<Self, SceneError> {
        let grasp = palm_body_pose(tree, grasp);
        let palm = palm_body_pose(tree, &start.q);
        let kinematics = tree.forward_kinematics(&start.q);
        let velocities = kinematics.velocities(&start.qd);
        let velocity_at = |point: Vec3| {
            rotation::to_vec3(&velocities.velocity(ARM_DOF, &rotation::to_vector(point)))
        };
        let velocity = velocity_at(palm.translation);
        let sim_from_world = grasp * palm.inverse();

        let table = RigidBodyBuilder::new(RigidBodyType::KinematicPositionBased);
        let (mut world, table) = TabletopWorld::create_world(config, table);
        world.integration_parameters.dt = (CONTROL_DT / SUBSTEPS as f64) as f32;
        let (bodies, fingers) = insert_hand(&mut world, config, tree, &grasp)?;
        let sim_from_object = sim_from_world * *world_from_object;
        let mut tabletop =
            TabletopWorld::add_object(world, table, config, object, &sim_from_object)?;
        let table = &mut tabletop.world.bodies[tabletop.table];
        let world_from_table = *table.position();
        table.set_position(sim_from_world * world_from_table, true);
        let center_of_mass = object.center_of_mass;
        let object = &mut tabletop.world.bodies[tabletop.object];
        let linvel = -velocity_at(*world_from_object * center_of_mass);
        object.set_linvel(sim_from_world.rotation * linvel, true);
        let angvel = -rotation::to_vec3(&velocities.angular_velocity(ARM_DOF));
        object.set_angvel(sim_from_world.rotation * angvel, true);
        let mut scene = Self {
            tree,
            tabletop,
            motors: config.motors.clone(),
            bodies,
            fingers,
            world_from_table,
            world_from_grasp_palm: grasp,
            world_from_palm: palm,
            palm_velocity: velocity,
        };
        scene.set_finger_positions(&start.q);
        scene.set_motor_targets(start);
        Ok(scene)
    }

    /// Sets the finger joint positions to those of `q` (rad).
    fn set_finger_positions(&mut self, q: &JointVector) {
        let world = &mut self.tabletop.world;
        for (finger, &first) in self.fingers.iter().enumerate() {
            let Some((multibody, _)) = world.multibody_joints.get_mut(first) else { continue };
            // Forward kinematics makes rapier detect the fixed root; only then are the joint indices final.
            multibody.forward_kinematics(&world.bodies, true);
            let mut displacement = vec![0.0; multibody.ndofs()];
            let joints = ARM_DOF + FINGER_DOF * finger..;
            let indices: Vec<usize> = multibody.links().skip(1).map(|l| l.assembly_id()).collect();
            for (index, joint) in indices.into_iter().zip(joints) {
                displacement[index] = q[joint] as f32;
                links::set_joint_damping(multibody, index, joint, &self.motors);
            }
            multibody.apply_displacements(&displacement);
            multibody.forward_kinematics(&world.bodies, false);
            multibody.update_rigid_bodies(&mut world.bodies, true);
        }
    }

    /// Sets the motor targets.
    fn set_motor_targets(&mut self, state: &JointState) {
        for (finger, &first) in self.fingers.iter().enumerate() {
            let multibodies = &mut self.tabletop.world.multibody_joints;
            let Some((multibody, _)) = multibodies.get_mut(first) else { continue };
            for (link, joint) in multibody.links_mut().skip(1).zip(ARM_DOF + FINGER_DOF * finger..)
            {
                links::set_motor_target(link, joint, state, &self.motors);
            }
        }
    }

    /// Moves the table relative to the palm, which reaches `palm` after a physics step of `dt` (s).
    fn advance_table(&mut self, palm: Pose, dt: f32) {
        let velocity = (palm.translation - self.world_from_palm.translation) / dt;
        let acceleration = (velocity - self.palm_velocity) / dt;
        (self.world_from_palm, self.palm_velocity) = (palm, velocity);
        let sim_from_world = self.sim_from_world();
        self.tabletop.world.gravity = sim_from_world.rotation * (GRAVITY - acceleration);
        let table = &mut self.tabletop.world.bodies[self.tabletop.table];
        table.set_next_kinematic_position(sim_from_world * self.world_from_table);
    }

    fn sim_from_world(&self) -> Pose {
        self.world_from_grasp_palm * self.world_from_palm.inverse()
    }
}

impl Simulation for FloatingHandScene<'_> {
    fn track(&mut self, from: &JointState, to: &JointState) {
        let dt = self.tabletop.world.integration_parameters.dt;
        for substep in 1..=SUBSTEPS {
            let state = links::hermite(from, to, substep as f64 / SUBSTEPS as f64);
            self.set_motor_targets(&state);
            self.advance_table(palm_body_pose(self.tree, &state.q), dt);
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
        let world_from_sim = self.sim_from_world().inverse();
        self.tabletop.object_height(&world_from_sim, &self.world_from_table)
    }

    fn contact_state(&self) -> ContactState {
        self.tabletop
            .contact_state(|parent| parent.filter(|b| self.bodies.contains(b)).map(|_| true))
    }

    fn is_finite(&self) -> bool {
        let poses = self.bodies.iter().map(|&body| self.tabletop.world.bodies[body].position());
        poses.into_iter().all(Pose::is_finite) && self.tabletop.is_finite()
    }
}

/// World pose of the palm body at the joint position `q` (rad).
fn palm_body_pose(tree: &KinematicTree, q: &JointVector) -> Pose {
    rotation::to_pose(&tree.forward_kinematics(q).world_from_body[ARM_DOF])
}

/// Inserts the palm and the fingers. Each finger has its own fixed root at the palm pose.
fn insert_hand(
    world: &mut PhysicsWorld,
    config: &SceneConfig,
    tree: &KinematicTree,
    world_from_palm: &Pose,
) -> Result<(Vec<RigidBodyHandle>, Vec<MultibodyJointHandle>), SceneError> {
    let root = || RigidBodyBuilder::fixed().pose(*world_from_palm);
    let mut bodies = vec![world.insert_body(root())];
    let mut fingers = Vec::new();
    for collider in colliders::body_colliders(tree, ARM_DOF, config.robot.friction) {
        world.insert_collider(collider, Some(bodies[0]));
    }
    for joint in ARM_DOF..DOF {
        let handle = world.insert_body(links::dynamic_link(&tree.bodies[joint + 1]));
        for collider in colliders::body_colliders(tree, joint + 1, config.robot.friction) {
            world.insert_collider(collider, Some(handle));
        }
        let joint_model = &tree.joints[joint];
        let is_first = joint_model.parent == ARM_DOF;
        let parent = if is_first { world.insert_body(root()) } else { bodies[joint - ARM_DOF] };
        let data = links::revolute_joint(joint_model, tree.limits.torque[joint] as f32);
        let joint = world
            .insert_multibody_joint(parent, handle, data)
            .ok_or_else(|| robot::UrdfError::Tree("the finger joints form a loop".into()))?;
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

    /// Two arm postures over the table with the hand open.
    fn two_postures(config: &SceneConfig) -> [JointVector; 2] {
        let hand = config.robot.open;
        let first = [0.1, 1.2, 0.0, -1.7, 0.0, -1.5, 2.0];
        let second = [0.4, 1.1, 0.1, -1.6, 0.1, -1.3, 1.8];
        [first, second].map(|arm| robot::joint_vector(&arm, &hand))
    }

    /// Rest-to-rest trajectory of 30 steps.
    fn trajectory(from: &JointVector, to: &JointVector) -> Vec<JointState> {
        let mut states = vec![JointState::at_rest(*from)];
        let qdd = (to - from) / (0.25);
        for row in 0..30 {
            let sign = if row < 15 { 1.0 } else { -1.0 };
            let last = states[states.len() - 1];
            states.push(integrator::step(&last, &(qdd * sign), CONTROL_DT));
        }
        states
    }

    fn standard() -> (SceneConfig, KinematicTree, Object) {
        let object = Object::from_catalog("sugar_box").unwrap();
        (SceneConfig::standard().unwrap(), KinematicTree::iiwa7_allegro().unwrap(), object)
    }

    /// In the simulation frame, table and box move past the palm; in the world frame, the box is at rest.
    #[test]
    fn object_on_table_stays_at_rest_while_arm_moves() {
        let (config, tree, object) = standard();
        let [from, to] = two_postures(&config);
        let place = config.object_pose(0.7, -0.25, 0.3);
        let states = trajectory(&from, &to);
        let mut scene =
            FloatingHandScene::new(&config, &tree, &object, &place, &states[0], &to).unwrap();
        for pair in states.windows(2) {
            scene.track(&pair[0], &pair[1]);
        }
        let world_from_object = scene.sim_from_world().inverse() * scene.object_pose();
        let moved = world_from_object.translation.distance(place.translation);
        assert!(moved < 0.002, "the box moved by {moved} m");
        assert!(scene.object_height().abs() < 0.002, "height {} m", scene.object_height());
        assert!(scene.contact_state().table && !scene.contact_state().hand);
        // At the grasp posture, simulation frame and world frame are equal.
        let offset = scene.sim_from_world().translation.length();
        assert!(offset < 1e-5, "simulation frame {offset} m off");
    }

    /// Without contact, only the finger dynamics remain. They must equal those of the full scene.
    #[test]
    fn fingers_close_as_in_full_scene_without_contact() {
        let (config, tree, object) = standard();
        let [open, _] = two_postures(&config);
        let closed = JointVector::from_fn(|i, _| if i < ARM_DOF { open[i] } else { open[i] + 0.3 });
        let place = config.object_pose(0.7, -0.25, 0.3);
        let states = trajectory(&open, &closed);
        let mut hand =
            FloatingHandScene::new(&config, &tree, &object, &place, &states[0], &open).unwrap();
        let mut full = Scene::new(&config, &tree, &object, &place, &open).unwrap();
        for pair in states.windows(2) {
            hand.track(&pair[0], &pair[1]);
            full.track(&pair[0], &pair[1]);
        }
        let to_palm = hand.palm_pose() * full.palm_pose().inverse();
        for body in ARM_DOF..=DOF {
            let [a, b] = [
                hand.tabletop.world.bodies[hand.bodies[body - ARM_DOF]].position().translation,
                (to_palm * full.body_pose(body)).translation,
            ];
            assert!(a.distance(b) < 5e-4, "body {body} is {} m off", a.distance(b));
        }
    }

    /// An object in free fall falls independently of the arm motion.
    #[test]
    fn falling_box_follows_its_parabola_while_arm_moves() {
        let (config, tree, object) = standard();
        let [from, to] = two_postures(&config);
        let mut place = config.object_pose(0.7, -0.25, 0.0);
        place.translation.z += 0.6;
        let states = trajectory(&from, &to);
        let mut scene =
            FloatingHandScene::new(&config, &tree, &object, &place, &states[0], &to).unwrap();
        for pair in states.windows(2).take(9) {
            scene.track(&pair[0], &pair[1]);
        }
        let world_from_object = scene.sim_from_world().inverse() * scene.object_pose();
        let wanted = place.translation - Vec3::Z * (0.5 * 9.81 * 0.3 * 0.3);
        let off = world_from_object.translation.distance(wanted);
        // The palm rotates at 0.13 rad/s here; the effect of the rotation on the fall is neglected.
        assert!(off < 0.03, "{off} m off its parabola");
    }
}
