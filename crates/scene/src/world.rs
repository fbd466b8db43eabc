//! The rapier world of one attempt: stepping, following joint targets, poses and contacts.

use crate::colliders;
use crate::config::{SceneConfig, SceneError};
use crate::links::{self, set_target};
use crate::simulation::{Contact, Simulation, Touching};
use crate::tabletop::Tabletop;
use geometry::object::Object;
use geometry::{Pose, Vec3};
use rapier3d::prelude::{
    JointAxis, MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};
use robot::{ARM, DOF, JointState, JointVector, Tree};

/// Table, object and robot under physics.
pub struct Scene {
    tabletop: Tabletop,
    substeps: usize,
    motors: crate::config::Motors,
    bodies: Vec<RigidBodyHandle>,
    joints: Vec<MultibodyJointHandle>,
    /// Position of each joint in the engine's generalized vectors.
    dof_index: [usize; DOF],
    steps: u64,
    /// Who pulls at the object, if somebody does.
    pull: Option<Pull>,
}

/// Somebody pulls at a point of the object as if by a spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// The point, in the object's frame (m).
    pub point: Vec3,
    /// Where to (m).
    pub towards: Vec3,
    /// Of the spring (N/m); it is damped so that it does not swing.
    pub stiffness: f32,
    /// The greatest force (N).
    pub most: f32,
}

impl Scene {
    /// Sets up table, robot at rest in `q`, and `object` at `world_from_object`.
    pub fn new(
        config: &SceneConfig,
        tree: &Tree,
        object: &Object,
        world_from_object: &Pose,
        q: &JointVector,
    ) -> Result<Self, SceneError> {
        let (mut world, table) = Tabletop::begin(config, RigidBodyBuilder::fixed());
        let (bodies, joints) = insert_robot(&mut world, config, tree)?;
        let tabletop = Tabletop::finish(world, table, config, object, world_from_object)?;
        let mut scene = Self {
            tabletop,
            substeps: config.physics.substeps,
            motors: config.motors.clone(),
            bodies,
            joints,
            dof_index: [0; DOF],
            steps: 0,
            pull: None,
        };
        scene.place_robot(q);
        scene.drive(&JointState::at_rest(*q));
        Ok(scene)
    }

    /// Measured joint positions (rad).
    pub fn joint_positions(&self) -> JointVector {
        JointVector::from_fn(|i, _| {
            match self.tabletop.world.multibody_joints.get(self.joints[i]) {
                Some((multibody, link)) => match multibody.link(link) {
                    Some(link) => link.joint().coords()[JointAxis::AngX as usize] as f64,
                    None => f64::NAN,
                },
                None => f64::NAN,
            }
        })
    }

    /// Measured joint velocities (rad/s).
    pub fn joint_velocities(&self) -> JointVector {
        let joints = &self.tabletop.world.multibody_joints;
        let robot = self.joints.first().and_then(|joint| joints.get(*joint));
        let velocity = robot.map(|(multibody, _)| multibody.generalized_velocity());
        JointVector::from_fn(|i, _| velocity.map_or(f64::NAN, |v| v[self.dof_index[i]] as f64))
    }

    /// Pose of every robot body, base first.
    pub fn body_poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.bodies.iter().map(|&body| *self.tabletop.world.bodies[body].position())
    }

    /// Pose of one robot body; body 0 is the base.
    pub fn body_pose(&self, body: usize) -> Pose {
        *self.tabletop.world.bodies[self.bodies[body]].position()
    }

    /// Puts the object somewhere else, at rest.
    pub fn place_object(&mut self, world_from_object: &Pose) {
        self.tabletop.place_object(world_from_object);
    }

    /// Lets somebody pull at the object from now on, or let go.
    pub fn pull(&mut self, pull: Option<Pull>) {
        self.pull = pull;
        self.tabletop.pull(None);
    }

    /// Where something presses on the object, as of the last step.
    pub fn contacts(&self) -> Vec<Contact> {
        self.tabletop.contacts()
    }

    /// Physics steps so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// BLAKE3 over the bits of all poses and velocities.
    pub fn state_hash(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        for &handle in self.bodies.iter().chain([&self.tabletop.object]) {
            let body = &self.tabletop.world.bodies[handle];
            let (p, r) = (body.position().translation, body.position().rotation);
            let (v, w) = (body.linvel(), body.angvel());
            for x in [p.x, p.y, p.z, r.x, r.y, r.z, r.w, v.x, v.y, v.z, w.x, w.y, w.z] {
                hasher.update(&x.to_bits().to_le_bytes());
            }
        }
        hasher.finalize()
    }

    fn place_robot(&mut self, q: &JointVector) {
        let Some(&first) = self.joints.first() else { return };
        let Some((multibody, _)) = self.tabletop.world.multibody_joints.get_mut(first) else {
            return;
        };
        // Only now does the engine learn that the root is fixed, and numbers its joints for good.
        multibody.forward_kinematics(&self.tabletop.world.bodies, true);
        let mut displacement = vec![0.0; multibody.ndofs()];
        for (i, link) in multibody.links().skip(1).enumerate() {
            self.dof_index[i] = link.assembly_id();
            displacement[link.assembly_id()] = q[i] as f32;
        }
        for (i, &index) in self.dof_index.iter().enumerate() {
            links::set_passive(multibody, index, i, &self.motors);
        }
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&self.tabletop.world.bodies, false);
        multibody.update_rigid_bodies(&mut self.tabletop.world.bodies, true);
    }

    /// Sets the motors' targets.
    fn drive(&mut self, state: &JointState) {
        let Some(&first) = self.joints.first() else { return };
        let multibodies = &mut self.tabletop.world.multibody_joints;
        let Some((multibody, _)) = multibodies.get_mut(first) else { return };
        for (i, link) in multibody.links_mut().skip(1).enumerate() {
            set_target(link, i, state, &self.motors);
        }
    }
}

impl Simulation for Scene {
    fn follow(&mut self, from: &JointState, to: &JointState) {
        for substep in 1..=self.substeps {
            let s = substep as f64 / self.substeps as f64;
            self.drive(&links::hermite(from, to, s));
            if self.pull.is_some() {
                self.tabletop.pull(self.pull.as_ref());
            }
            self.tabletop.world.step();
            self.steps += 1;
        }
    }

    fn palm_pose(&self) -> Pose {
        self.body_pose(ARM)
    }

    fn object_pose(&self) -> Pose {
        self.tabletop.object_pose()
    }

    fn object_size(&self) -> Vec3 {
        self.tabletop.object_size
    }

    fn object_height(&self) -> f32 {
        let table = self.tabletop.world.bodies[self.tabletop.table].position();
        self.tabletop.object_height(&Pose::IDENTITY, table)
    }

    fn touching(&self) -> Touching {
        let body_of = |parent| self.bodies.iter().position(|&body| Some(body) == parent);
        self.tabletop.touching(|parent| body_of(parent).map(|body| body >= ARM))
    }

    fn is_finite(&self) -> bool {
        self.joint_positions().iter().all(|x| x.is_finite()) && self.tabletop.is_finite()
    }
}

/// Inserts bodies, joints and colliders of the robot; the base stays where it is.
fn insert_robot(
    world: &mut PhysicsWorld,
    config: &SceneConfig,
    tree: &Tree,
) -> Result<(Vec<RigidBodyHandle>, Vec<MultibodyJointHandle>), SceneError> {
    let mut bodies = Vec::new();
    for (i, body) in tree.bodies.iter().enumerate() {
        let builder = if i == 0 { RigidBodyBuilder::fixed() } else { links::moving(body) };
        let handle = world.insert_body(builder.gravity_scale(0.0).can_sleep(false));
        for collider in colliders::of_body(tree, i, config.robot.friction) {
            world.insert_collider(collider, Some(handle));
        }
        bodies.push(handle);
    }
    let mut joints = Vec::new();
    for (i, joint) in tree.joints.iter().enumerate() {
        let handles = (bodies[joint.parent], bodies[i + 1]);
        let data = links::revolute(joint, tree.limits.effort[i] as f32);
        let no_loop = "a tree has no loops";
        joints.push(
            world
                .insert_multibody_joint(handles.0, handles.1, data)
                .ok_or_else(|| robot::UrdfError::Tree(no_loop.into()))?,
        );
    }
    Ok((bodies, joints))
}
