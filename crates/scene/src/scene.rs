//! Full scene in rapier: physics steps, joint tracking, poses and contacts.

use crate::colliders;
use crate::config::{SceneConfig, SceneError};
use crate::contacts::{ContactForce, ContactState};
use crate::links::{self, set_motor_target};
use crate::tabletop::TabletopWorld;
use geometry::{Pose, Vec3};
use objects::object::Object;
use rapier3d::prelude::{
    JointAxis, MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};
use robot::{ARM_DOF, DOF, FINGER_DOF, JointState, JointVector, KinematicTree, NUM_FINGERS};

/// Table, object and robot under physics.
///
/// ```rust
/// use robot::{JointState, KinematicTree};
/// use scene::{Scene, SceneConfig};
/// let (config, tree) = (SceneConfig::standard()?, KinematicTree::iiwa7_allegro()?);
/// let object = objects::Object::from_catalog("sugar_box").expect("a built-in object");
/// let world_from_object = config.object_pose(0.6, 0.0, 0.0); // x, y (m), yaw (rad)
/// let home = JointState::at_rest(config.home());
/// let new = || Scene::new(&config, &tree, &object, &world_from_object, &home.q);
/// let (mut scene, mut twin) = (new()?, new()?);
/// // One control period of 1/30 s. Physics is deterministic: equal scenes stay equal.
/// scene.track(&home, &home);
/// twin.track(&home, &home);
/// assert_eq!(scene.steps(), config.physics.substeps as u64);
/// assert_eq!(scene.state_hash(), twin.state_hash());
/// assert!(scene.object_height().abs() < 0.005); // m above the table
/// # Ok::<(), scene::SceneError>(())
/// ```
pub struct Scene {
    tabletop: TabletopWorld,
    substeps: usize,
    motors: crate::config::Motors,
    bodies: Vec<RigidBodyHandle>,
    joints: Vec<MultibodyJointHandle>,
    /// Index of each joint in rapier's generalized vectors.
    dof_index: [usize; DOF],
    steps: u64,
    /// Spring of the user's drag; `None` without one.
    drag_spring: Option<DragSpring>,
}

/// A damped spring between a point of the object and a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DragSpring {
    /// Point of application (m), object frame.
    pub point: Vec3,
    /// Target of the spring (m), world frame.
    pub target: Vec3,
    /// Stiffness (N/m). The damping is chosen to avoid oscillation.
    pub stiffness: f32,
    /// Max force (N).
    pub max_force: f32,
}

impl Scene {
    /// Sets up the table, the robot at rest in `q` (rad), and `object` at `world_from_object`.
    pub fn new(
        config: &SceneConfig,
        tree: &KinematicTree,
        object: &Object,
        world_from_object: &Pose,
        q: &JointVector,
    ) -> Result<Self, SceneError> {
        let (mut world, table) = TabletopWorld::create_world(config);
        let (bodies, joints) = insert_robot(&mut world, config, tree)?;
        let tabletop = TabletopWorld::add_object(world, table, config, object, world_from_object)?;
        let mut scene = Self {
            tabletop,
            substeps: config.physics.substeps,
            motors: config.motors.clone(),
            bodies,
            joints,
            dof_index: [0; DOF],
            steps: 0,
            drag_spring: None,
        };
        scene.set_joint_positions(q);
        scene.set_motor_targets(&JointState::at_rest(*q));
        Ok(scene)
    }

    /// Steps physics for one control period. The joint targets follow the cubic from `from` to `to`, which is
    /// exact for the constant acceleration of Eq. 6-7.
    pub fn track(&mut self, from: &JointState, to: &JointState) {
        for substep in 1..=self.substeps {
            let s = substep as f64 / self.substeps as f64;
            self.set_motor_targets(&links::hermite(from, to, s));
            if self.drag_spring.is_some() {
                self.tabletop.apply_drag_spring(self.drag_spring.as_ref());
            }
            self.tabletop.world.step();
            self.steps += 1;
        }
    }

    /// Pose of the palm body.
    pub fn palm_pose(&self) -> Pose {
        self.body_pose(ARM_DOF)
    }

    /// Pose of the object.
    pub fn object_pose(&self) -> Pose {
        self.tabletop.object_pose()
    }

    /// Extents (m) of the object's bounding box, object frame.
    pub fn object_size(&self) -> Vec3 {
        self.tabletop.object_size
    }

    /// Height (m) of the lowest point of the object above the table top.
    pub fn object_height(&self) -> f32 {
        self.tabletop.object_height()
    }

    /// Current contacts of the object.
    pub fn contact_state(&self) -> ContactState {
        let body_of = |parent| self.bodies.iter().position(|&body| Some(body) == parent);
        self.tabletop.contact_state(|parent| body_of(parent).map(|body| body >= ARM_DOF))
    }

    /// Whether all poses are finite and rapier has quarantined no body.
    pub fn is_finite(&self) -> bool {
        self.joint_positions().iter().all(|x| x.is_finite()) && self.tabletop.is_finite()
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

    /// Poses of all robot bodies, base first.
    pub fn body_poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.bodies.iter().map(|&body| *self.tabletop.world.bodies[body].position())
    }

    /// Pose of one robot body; body 0 is the base.
    pub fn body_pose(&self, body: usize) -> Pose {
        *self.tabletop.world.bodies[self.bodies[body]].position()
    }

    /// Sets the object pose and zeroes its velocity.
    pub fn place_object(&mut self, world_from_object: &Pose) {
        self.tabletop.place_object(world_from_object);
    }

    /// Sets or removes the drag spring.
    pub fn set_drag_spring(&mut self, spring: Option<DragSpring>) {
        self.drag_spring = spring;
        self.tabletop.apply_drag_spring(None);
    }

    /// Contact forces on the object in the last physics step.
    pub fn contact_forces(&self) -> Vec<ContactForce> {
        self.tabletop.contact_forces()
    }

    /// Parts of the hand in contact with the object: index, middle and ring finger, thumb; then the palm.
    pub fn hand_contacts(&self) -> ([bool; NUM_FINGERS], bool) {
        let (mut fingers, mut palm) = ([false; NUM_FINGERS], false);
        for touching in self.tabletop.touching_bodies() {
            let body = self.bodies.iter().position(|&body| body == touching);
            // Joint i moves body i + 1. The last body of the arm is the palm; the joints of a finger follow
            // each other.
            let Some(part) = body.and_then(|body| body.checked_sub(ARM_DOF)) else { continue };
            let Some(joint) = part.checked_sub(1) else {
                palm = true;
                continue;
            };
            if let Some(finger) = fingers.get_mut(joint / FINGER_DOF) {
                *finger = true;
            }
        }
        (fingers, palm)
    }

    /// Number of fingers in contact with the object.
    pub fn num_finger_contacts(&self) -> usize {
        let (fingers, _) = self.hand_contacts();
        fingers.into_iter().filter(|touches| *touches).count()
    }

    /// Number of physics steps so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// BLAKE3 hash over the bits of all poses and velocities.
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

    fn set_joint_positions(&mut self, q: &JointVector) {
        let Some(&first) = self.joints.first() else { return };
        let Some((multibody, _)) = self.tabletop.world.multibody_joints.get_mut(first) else {
            return;
        };
        // Forward kinematics makes rapier detect the fixed root; only then are the joint indices final.
        multibody.forward_kinematics(&self.tabletop.world.bodies, true);
        let mut displacement = vec![0.0; multibody.ndofs()];
        for (i, link) in multibody.links().skip(1).enumerate() {
            self.dof_index[i] = link.assembly_id();
            displacement[link.assembly_id()] = q[i] as f32;
        }
        for (i, &index) in self.dof_index.iter().enumerate() {
            links::set_joint_damping(multibody, index, i, &self.motors);
        }
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&self.tabletop.world.bodies, false);
        multibody.update_rigid_bodies(&mut self.tabletop.world.bodies, true);
    }

    /// Sets the motor targets.
    fn set_motor_targets(&mut self, state: &JointState) {
        let Some(&first) = self.joints.first() else { return };
        let multibodies = &mut self.tabletop.world.multibody_joints;
        let Some((multibody, _)) = multibodies.get_mut(first) else { return };
        for (i, link) in multibody.links_mut().skip(1).enumerate() {
            set_motor_target(link, i, state, &self.motors);
        }
    }
}

/// Inserts bodies, joints and colliders of the robot. The base is fixed.
fn insert_robot(
    world: &mut PhysicsWorld,
    config: &SceneConfig,
    tree: &KinematicTree,
) -> Result<(Vec<RigidBodyHandle>, Vec<MultibodyJointHandle>), SceneError> {
    let mut bodies = Vec::new();
    for (i, body) in tree.bodies.iter().enumerate() {
        let builder = if i == 0 { RigidBodyBuilder::fixed() } else { links::dynamic_link(body) };
        let handle = world.insert_body(builder.gravity_scale(0.0).can_sleep(false));
        for collider in colliders::body_colliders(tree, i, config.robot.friction) {
            world.insert_collider(collider, Some(handle));
        }
        bodies.push(handle);
    }
    let mut joints = Vec::new();
    for (i, joint) in tree.joints.iter().enumerate() {
        let handles = (bodies[joint.parent], bodies[i + 1]);
        let data = links::revolute_joint(joint, tree.limits.torque[i] as f32);
        let no_loop = "the joints form a loop";
        joints.push(
            world
                .insert_multibody_joint(handles.0, handles.1, data)
                .ok_or_else(|| robot::UrdfError::Tree(no_loop.into()))?,
        );
    }
    Ok((bodies, joints))
}
