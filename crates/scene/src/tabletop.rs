//! Table and object under physics: what every world has, whatever the robot in it.

use crate::colliders;
use crate::config::{SceneConfig, SceneError, vec3};
use crate::links::mass_properties;
use crate::simulation::{Contact, Touching};
use crate::world::Pull;
use geometry::object::Object;
use geometry::{Pose, Vec3};
use nalgebra::Matrix3;
use rapier3d::prelude::{ColliderHandle, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle};

pub(crate) struct Tabletop {
    pub(crate) world: PhysicsWorld,
    pub(crate) table: RigidBodyHandle,
    pub(crate) object: RigidBodyHandle,
    /// Extent (m) of the object's bounding box.
    pub(crate) object_size: Vec3,
    table_collider: ColliderHandle,
    object_colliders: Vec<ColliderHandle>,
    object_points: Vec<Vec3>,
    /// Height (m) of the table's top over the middle of its body.
    table_half: f32,
}

/// The handles of the table.
pub(crate) type Table = (RigidBodyHandle, ColliderHandle);

impl Tabletop {
    /// An engine with the table in it. The robot comes next, the object last: the order of bodies decides
    /// the order of sums.
    pub(crate) fn begin(config: &SceneConfig, table: RigidBodyBuilder) -> (PhysicsWorld, Table) {
        let mut world = PhysicsWorld { gravity: GRAVITY, ..Default::default() };
        let parameters = &mut world.integration_parameters;
        parameters.dt = config.physics_dt() as f32;
        parameters.num_solver_iterations = config.physics.solver_iterations;
        parameters.length_unit = config.physics.length_unit;
        // Recycled contact points are good for metre-sized things; fingers are 2 cm wide.
        parameters.contact_recycling = false;
        let body = table.translation(vec3(config.table.center));
        let table = world.insert(body, colliders::of_table(config));
        (world, table)
    }

    /// Adds the object.
    pub(crate) fn finish(
        mut world: PhysicsWorld,
        (table, table_collider): Table,
        config: &SceneConfig,
        object: &Object,
        world_from_object: &Pose,
    ) -> Result<Self, SceneError> {
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
        Ok(Self {
            world,
            table,
            object: body,
            object_size: object.size(),
            table_collider,
            object_colliders,
            object_points: object.parts.concat(),
            table_half: config.table.half[2],
        })
    }

    pub(crate) fn object_pose(&self) -> Pose {
        *self.world.bodies[self.object].position()
    }

    /// Puts the object somewhere else, at rest.
    pub(crate) fn place_object(&mut self, world_from_object: &Pose) {
        let body = &mut self.world.bodies[self.object];
        body.set_position(*world_from_object, true);
        body.set_linvel(Vec3::ZERO, true);
        body.set_angvel(Vec3::ZERO, true);
    }

    /// Height (m) of the object's lowest point over the table's top; the world frame may move.
    pub(crate) fn object_height(&self, world_from_here: &Pose, world_from_table: &Pose) -> f32 {
        let pose = *world_from_here * self.object_pose();
        let lowest = self.object_points.iter().map(|&p| (pose * p).z).fold(f32::INFINITY, f32::min);
        lowest - (world_from_table.translation.z + self.table_half)
    }

    /// What the object touches now; `is_hand` tells the bodies of hand and arm, and gives `None` for others.
    pub(crate) fn touching(
        &self,
        is_hand: impl Fn(Option<RigidBodyHandle>) -> Option<bool>,
    ) -> Touching {
        let mut touching = Touching::default();
        for &collider in &self.object_colliders {
            for pair in self.world.contact_pairs_with(collider) {
                if !pair.has_any_active_contact() {
                    continue;
                }
                let other =
                    if pair.collider1 == collider { pair.collider2 } else { pair.collider1 };
                if other == self.table_collider {
                    touching.table = true;
                    continue;
                }
                match is_hand(self.world.colliders[other].parent()) {
                    Some(true) => touching.hand = true,
                    Some(false) => touching.arm = true,
                    None => {}
                }
            }
        }
        touching
    }

    /// Where something presses on the object, as of the last step.
    pub(crate) fn contacts(&self) -> Vec<Contact> {
        let dt = self.world.integration_parameters.dt;
        let mut contacts = Vec::new();
        for &collider in &self.object_colliders {
            for pair in self.world.contact_pairs_with(collider) {
                // The normal leads from the first to the second, and so does what presses on the second.
                let sign = if pair.collider2 == collider { 1.0 } else { -1.0 };
                let first = *self.world.colliders[pair.collider1].position();
                for manifold in pair.manifolds() {
                    let place = manifold.subshape_pos1().map_or(first, |part| first * part);
                    for point in manifold.points.iter().filter(|point| point.data.impulse > 0.0) {
                        let data = &point.data;
                        // The engine gives friction of the whole step in a basis that it keeps to itself, and
                        // that of the last iteration in the world: length of the one, direction of the other.
                        let friction = data.warmstart_tangent_world.normalize_or_zero()
                            * data.tangent_impulse.norm();
                        let impulse = manifold.data.normal * data.impulse - friction;
                        let force = impulse * (sign / dt);
                        contacts.push(Contact { point: place * point.local_p1, force });
                    }
                }
            }
        }
        contacts
    }

    /// Pulls at the object with a force (N) for the next step; `None` lets go.
    pub(crate) fn pull(&mut self, pull: Option<&Pull>) {
        let body = &mut self.world.bodies[self.object];
        body.reset_forces(true);
        body.reset_torques(true);
        let Some(pull) = pull else { return };
        let at = *body.position() * pull.point;
        let off = pull.towards - at;
        let brake = 2.0 * (pull.stiffness * body.mass()).sqrt();
        let force = off * pull.stiffness - body.velocity_at_point(at) * brake;
        body.add_force_at_point(force.clamp_length_max(pull.most), at, true);
    }

    /// Whether the object's pose is finite and the engine has given up on no body.
    pub(crate) fn is_finite(&self) -> bool {
        self.object_pose().is_finite() && self.world.quarantine().is_empty()
    }
}

/// Acceleration of free fall (m/s²).
pub(crate) const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81);
