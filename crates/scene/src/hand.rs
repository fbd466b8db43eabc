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
        let middle = rotation::to_vector(palm.translation);
        let velocity = tree.kinematics(&start.q).motion(&start.qd).velocity(ARM, &middle);
        let velocity = rotation::to_vec3(&velocity);
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
        let object = &mut tabletop.world.bodies[tabletop.object];
        object.set_linvel(here_from_world.rotation * -velocity, true);
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
