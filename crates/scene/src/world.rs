//! The rapier world of one attempt: stepping, following joint targets, poses and contacts.

use crate::colliders;
use crate::config::{CONTROL_PERIOD, SceneConfig, SceneError, vec3};
use geometry::object::Object;
use geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rapier3d::prelude::{
    ColliderHandle, GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MassProperties,
    MotorModel, MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};
use robot::{ARM, DOF, JointState, JointVector, Tree, rotation};

/// Table, object and robot under physics.
pub struct Scene {
    world: PhysicsWorld,
    substeps: usize,
    motors: crate::config::Motors,
    bodies: Vec<RigidBodyHandle>,
    joints: Vec<MultibodyJointHandle>,
    /// Position of each joint in the engine's generalized vectors.
    dof_index: [usize; DOF],
    table: ColliderHandle,
    object: RigidBodyHandle,
    object_colliders: Vec<ColliderHandle>,
    object_points: Vec<Vec3>,
    object_size: Vec3,
    table_top: f32,
    steps: u64,
}

/// What an object touches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touching {
    /// The table.
    pub table: bool,
    /// A finger or the palm.
    pub hand: bool,
    /// An arm link.
    pub arm: bool,
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
        let mut world = PhysicsWorld { gravity: Vec3::new(0.0, 0.0, -9.81), ..Default::default() };
        let parameters = &mut world.integration_parameters;
        parameters.dt = config.physics_dt() as f32;
        parameters.num_solver_iterations = config.physics.solver_iterations;
        parameters.length_unit = config.physics.length_unit;
        // Recycled contact points are good for metre-sized things; fingers are 2 cm wide.
        parameters.contact_recycling = false;

        let table_body = RigidBodyBuilder::fixed().translation(vec3(config.table.center));
        let (_, table) = world.insert(table_body, colliders::of_table(config));
        let (bodies, joints) = insert_robot(&mut world, config, tree)?;

        let inertia = Matrix3::from(object.inertia.map(|row| row.map(|x| x as f64)));
        let mass = mass_properties(object.center_of_mass, object.mass, &inertia);
        let body = RigidBodyBuilder::dynamic()
            .pose(*world_from_object)
            .additional_mass_properties(mass)
            .can_sleep(false);
        let body = world.insert_body(body);
        let object_colliders = colliders::of_object(object)?
            .into_iter()
            .map(|collider| world.insert_collider(collider, Some(body)))
            .collect();

        let mut scene = Self {
            world,
            substeps: config.physics.substeps,
            motors: config.motors.clone(),
            bodies,
            joints,
            dof_index: [0; DOF],
            table,
            object: body,
            object_colliders,
            object_points: object.parts.concat(),
            object_size: object.bounds[1] - object.bounds[0],
            table_top: config.table_top(),
            steps: 0,
        };
        scene.place_robot(q);
        scene.drive(&JointState::at_rest(*q));
        Ok(scene)
    }

    /// Steps physics for one control period while the joints are commanded along the cubic that
    /// joins `from` to `to`; exact for the constant acceleration of Eq. 6-7.
    pub fn follow(&mut self, from: &JointState, to: &JointState) {
        for substep in 1..=self.substeps {
            let s = substep as f64 / self.substeps as f64;
            self.drive(&hermite(from, to, s));
            self.world.step();
            self.steps += 1;
        }
    }

    /// Measured joint positions (rad).
    pub fn joint_positions(&self) -> JointVector {
        JointVector::from_fn(|i, _| match self.world.multibody_joints.get(self.joints[i]) {
            Some((multibody, link)) => match multibody.link(link) {
                Some(link) => link.joint().coords()[JointAxis::AngX as usize] as f64,
                None => f64::NAN,
            },
            None => f64::NAN,
        })
    }

    /// Pose of every robot body, base first.
    pub fn body_poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.bodies.iter().map(|&body| *self.world.bodies[body].position())
    }

    /// Pose of one robot body; body 0 is the base.
    pub fn body_pose(&self, body: usize) -> Pose {
        *self.world.bodies[self.bodies[body]].position()
    }

    /// Pose of the object.
    pub fn object_pose(&self) -> Pose {
        *self.world.bodies[self.object].position()
    }

    /// Extent (m) of the object's bounding box in its own frame.
    pub fn object_size(&self) -> Vec3 {
        self.object_size
    }

    /// Puts the object somewhere else, at rest.
    pub fn place_object(&mut self, world_from_object: &Pose) {
        let body = &mut self.world.bodies[self.object];
        body.set_position(*world_from_object, true);
        body.set_linvel(Vec3::ZERO, true);
        body.set_angvel(Vec3::ZERO, true);
    }

    /// Height (m) of the object's lowest point over the table's top.
    pub fn object_height(&self) -> f32 {
        let pose = self.object_pose();
        let lowest = self.object_points.iter().map(|&p| (pose * p).z).fold(f32::INFINITY, f32::min);
        lowest - self.table_top
    }

    /// What the object touches now.
    pub fn touching(&self) -> Touching {
        let mut touching = Touching::default();
        for &collider in &self.object_colliders {
            for pair in self.world.contact_pairs_with(collider) {
                if !pair.has_any_active_contact() {
                    continue;
                }
                let other =
                    if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
                if other == self.table {
                    touching.table = true;
                    continue;
                }
                let parent = self.world.colliders[other].parent();
                match self.bodies.iter().position(|&body| Some(body) == parent) {
                    Some(body) if body >= ARM => touching.hand = true,
                    Some(_) => touching.arm = true,
                    None => {}
                }
            }
        }
        touching
    }

    /// Whether every pose is a finite number and the engine has given up on no body.
    pub fn is_finite(&self) -> bool {
        let q_is_finite = self.joint_positions().iter().all(|x| x.is_finite());
        q_is_finite && self.object_pose().is_finite() && self.world.quarantine().is_empty()
    }

    /// Physics steps so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// BLAKE3 over the bits of all poses and velocities.
    pub fn state_hash(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        for &handle in self.bodies.iter().chain([&self.object]) {
            let body = &self.world.bodies[handle];
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
        let Some((multibody, _)) = self.world.multibody_joints.get_mut(first) else { return };
        // Only now does the engine learn that the root is fixed, and numbers its joints for good.
        multibody.forward_kinematics(&self.world.bodies, true);
        let mut displacement = vec![0.0; multibody.ndofs()];
        for (i, link) in multibody.links().skip(1).enumerate() {
            self.dof_index[i] = link.assembly_id();
            displacement[link.assembly_id()] = q[i] as f32;
        }
        for (i, &index) in self.dof_index.iter().enumerate() {
            let is_arm = i < ARM;
            let motors = &self.motors;
            multibody.armature_mut()[index] =
                if is_arm { motors.arm_armature } else { motors.hand_armature };
            multibody.damping_mut()[index] = motors.joint_damping[usize::from(!is_arm)];
        }
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&self.world.bodies, false);
        multibody.update_rigid_bodies(&mut self.world.bodies, true);
    }

    /// Sets the motors' targets.
    fn drive(&mut self, state: &JointState) {
        let Some(&first) = self.joints.first() else { return };
        let Some((multibody, _)) = self.world.multibody_joints.get_mut(first) else { return };
        for (i, link) in multibody.links_mut().skip(1).enumerate() {
            let (stiffness, damping) = if i < ARM {
                (self.motors.arm_stiffness, self.motors.arm_damping)
            } else {
                (self.motors.hand_stiffness, self.motors.hand_damping)
            };
            let (q, qd) = (state.q[i] as f32, state.qd[i] as f32);
            link.joint.data.set_motor(JointAxis::AngX, q, qd, stiffness, damping);
        }
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
        let builder = if i == 0 {
            RigidBodyBuilder::fixed()
        } else {
            RigidBodyBuilder::dynamic().additional_mass_properties(mass_properties(
                rotation::to_vec3(&body.com),
                body.mass as f32,
                &body.inertia,
            ))
        };
        // The controller compensates gravity, as on the real robot.
        let handle = world.insert_body(builder.gravity_scale(0.0).can_sleep(false));
        for collider in colliders::of_body(tree, i, config.robot.friction) {
            world.insert_collider(collider, Some(handle));
        }
        bodies.push(handle);
    }
    let mut joints = Vec::new();
    for (i, joint) in tree.joints.iter().enumerate() {
        let handles = (bodies[joint.parent], bodies[i + 1]);
        let data = revolute(joint, tree.limits.effort[i] as f32);
        let no_loop = "a tree has no loops";
        joints.push(
            world
                .insert_multibody_joint(handles.0, handles.1, data)
                .ok_or_else(|| robot::UrdfError::Tree(no_loop.into()))?,
        );
    }
    Ok((bodies, joints))
}

/// Mass properties from an inertia tensor about the centre of mass (kg m²). The engine's own way to
/// principal axes goes through trigonometry of the system; this one has the same bits everywhere.
fn mass_properties(com: Vec3, mass: f32, inertia: &Matrix3<f64>) -> MassProperties {
    let eigen = inertia.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let moments = rotation::to_vec3(&eigen.eigenvalues);
    let turn = Rotation3::from_matrix_unchecked(axes);
    let frame = robot::Isometry::from_parts(
        robot::Vector::zeros().into(),
        UnitQuaternion::from_rotation_matrix(&turn),
    );
    MassProperties::with_principal_inertia_frame(
        com,
        mass,
        moments,
        rotation::to_pose(&frame).rotation,
    )
}

/// A motor-driven hinge about the joint's axis, which is the x axis of the engine's joint frames.
fn revolute(joint: &robot::tree::Joint, effort: f32) -> GenericJoint {
    let axis = rotation::to_vec3(&joint.axis);
    let frame = Pose::from_rotation(GenericJoint::complete_ang_frame(axis));
    GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
        .local_frame1(rotation::to_pose(&joint.parent_from_child) * frame)
        .local_frame2(frame)
        .motor_model(JointAxis::AngX, MotorModel::ForceBased)
        .motor_max_force(JointAxis::AngX, effort)
        .contacts_enabled(false)
        .build()
}

/// The cubic from `from` to `to` over one control period, at share `s` of it.
fn hermite(from: &JointState, to: &JointState, s: f64) -> JointState {
    let t = CONTROL_PERIOD;
    let (s2, s3) = (s * s, s * s * s);
    let q = from.q * (2.0 * s3 - 3.0 * s2 + 1.0)
        + from.qd * (t * (s3 - 2.0 * s2 + s))
        + to.q * (3.0 * s2 - 2.0 * s3)
        + to.qd * (t * (s3 - s2));
    let qd = (to.q - from.q) * (6.0 * (s - s2) / t)
        + from.qd * (3.0 * s2 - 4.0 * s + 1.0)
        + to.qd * (3.0 * s2 - 2.0 * s);
    JointState { q, qd }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_follow_eq6_eq7_between_ticks() {
        let qdd = JointVector::from_fn(|i, _| i as f64 - 11.0);
        let from = JointState {
            q: JointVector::from_element(0.2),
            qd: JointVector::from_fn(|i, _| 0.1 * i as f64),
        };
        let to = robot::integrator::step(&from, &qdd, CONTROL_PERIOD);
        for s in [0.25, 0.5, 1.0] {
            let wanted = robot::integrator::step(&from, &qdd, s * CONTROL_PERIOD);
            let got = hermite(&from, &to, s);
            assert!((got.q - wanted.q).amax() < 1e-12 && (got.qd - wanted.qd).amax() < 1e-10);
        }
    }
}
