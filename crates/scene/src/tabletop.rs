//! Table and object under physics, shared by the full scene and the floating hand.

use crate::colliders;
use crate::config::{SceneConfig, SceneError, vec3};
use crate::convex_dispatcher::ConvexDispatcher;
use crate::links::mass_properties;
use crate::scene::DragSpring;
use crate::simulation::{ContactForce, ContactState};
use geometry::{Pose, Vec3};
use nalgebra::Matrix3;
use objects::object::Object;
use rapier3d::prelude::{
    ColliderHandle, NarrowPhase, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

pub(crate) struct TabletopWorld {
    pub(crate) world: PhysicsWorld,
    pub(crate) table: RigidBodyHandle,
    pub(crate) object: RigidBodyHandle,
    /// Extents (m) of the object's bounding box.
    pub(crate) object_size: Vec3,
    table_collider: ColliderHandle,
    object_colliders: Vec<ColliderHandle>,
    object_points: Vec<Vec3>,
    /// Height (m) of the table top above the centre of the table body.
    table_half_height: f32,
}

/// Rigid body and collider of the table.
pub(crate) type TableHandles = (RigidBodyHandle, ColliderHandle);

impl TabletopWorld {
    /// Creates a physics world with the table. The robot must be inserted next and the object last: the order
    /// of bodies determines the order of floating-point sums.
    pub(crate) fn create_world(
        config: &SceneConfig,
        table: RigidBodyBuilder,
    ) -> (PhysicsWorld, TableHandles) {
        let mut world = empty_world();
        let parameters = &mut world.integration_parameters;
        parameters.dt = config.physics_dt() as f32;
        parameters.num_solver_iterations = config.physics.solver_iterations;
        parameters.length_unit = config.physics.length_unit;
        // Contact recycling is designed for metre-sized objects; fingers are 2 cm wide.
        parameters.contact_recycling = false;
        let body = table.translation(vec3(config.table.center));
        let table = world.insert(body, colliders::table_collider(config));
        (world, table)
    }

    /// Inserts the object and completes the world.
    pub(crate) fn add_object(
        mut world: PhysicsWorld,
        (table, table_collider): TableHandles,
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
        let object_colliders = colliders::object_colliders(object)?
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
            table_half_height: config.table.half_extents[2],
        })
    }

    pub(crate) fn object_pose(&self) -> Pose {
        *self.world.bodies[self.object].position()
    }

    /// Sets the object pose and zeroes its velocity.
    pub(crate) fn place_object(&mut self, world_from_object: &Pose) {
        let body = &mut self.world.bodies[self.object];
        body.set_position(*world_from_object, true);
        body.set_linvel(Vec3::ZERO, true);
        body.set_angvel(Vec3::ZERO, true);
    }

    /// Height (m) of the lowest point of the object above the table top; the simulation frame may move.
    pub(crate) fn object_height(&self, world_from_here: &Pose, world_from_table: &Pose) -> f32 {
        let pose = *world_from_here * self.object_pose();
        let lowest = self.object_points.iter().map(|&p| (pose * p).z).fold(f32::INFINITY, f32::min);
        lowest - (world_from_table.translation.z + self.table_half_height)
    }

    /// Current contacts of the object. `is_hand` returns true for hand bodies, false for arm bodies, else
    /// `None`.
    pub(crate) fn contact_state(
        &self,
        is_hand: impl Fn(Option<RigidBodyHandle>) -> Option<bool>,
    ) -> ContactState {
        let mut touching = ContactState::default();
        for other in self.touching_colliders() {
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
        touching
    }

    /// Colliders in contact with the object, once per contact pair.
    fn touching_colliders(&self) -> impl Iterator<Item = ColliderHandle> + '_ {
        self.object_colliders.iter().flat_map(|&collider| {
            let pairs = self.world.contact_pairs_with(collider);
            pairs.filter(|pair| pair.has_any_active_contact()).map(move |pair| {
                if pair.collider1 == collider { pair.collider2 } else { pair.collider1 }
            })
        })
    }

    /// Bodies in contact with the object, once per contact pair.
    pub(crate) fn touching_bodies(&self) -> impl Iterator<Item = RigidBodyHandle> + '_ {
        self.touching_colliders().filter_map(|collider| self.world.colliders[collider].parent())
    }

    /// Contact forces on the object in the last physics step.
    pub(crate) fn contact_forces(&self) -> Vec<ContactForce> {
        let dt = self.world.integration_parameters.dt;
        let mut contacts = Vec::new();
        for &collider in &self.object_colliders {
            for pair in self.world.contact_pairs_with(collider) {
                // The normal points from the first to the second collider, as does the force on the second.
                let sign = if pair.collider2 == collider { 1.0 } else { -1.0 };
                let first = *self.world.colliders[pair.collider1].position();
                for manifold in pair.manifolds() {
                    let pose = manifold.subshape_pos1().map_or(first, |part| first * part);
                    for point in manifold.points.iter().filter(|point| point.data.impulse > 0.0) {
                        let data = &point.data;
                        // rapier gives the friction impulse of the whole step in a private basis, and that of
                        // the last iteration in world coordinates: take the magnitude of the first, the
                        // direction of the second.
                        let friction = data.warmstart_tangent_world.normalize_or_zero()
                            * data.tangent_impulse.norm();
                        let impulse = manifold.data.normal * data.impulse - friction;
                        let force = impulse * (sign / dt);
                        contacts.push(ContactForce { point: pose * point.local_p1, force });
                    }
                }
            }
        }
        contacts
    }

    /// Applies the spring force (N) to the object for the next physics step; `None` removes it.
    pub(crate) fn apply_drag_spring(&mut self, spring: Option<&DragSpring>) {
        let body = &mut self.world.bodies[self.object];
        body.reset_forces(true);
        body.reset_torques(true);
        let Some(spring) = spring else { return };
        let at = *body.position() * spring.point;
        let offset = spring.target - at;
        let damping = 2.0 * (spring.stiffness * body.mass()).sqrt();
        let force = offset * spring.stiffness - body.velocity_at_point(at) * damping;
        body.add_force_at_point(force.clamp_length_max(spring.max_force), at, true);
    }

    /// Whether the object pose is finite and rapier has quarantined no body.
    pub(crate) fn is_finite(&self) -> bool {
        self.object_pose().is_finite() && self.world.quarantine().is_empty()
    }
}

/// Gravitational acceleration (m/s²).
pub(crate) const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81);

/// A world whose colliders are convex. `PhysicsWorld::default` would link parry's dispatcher of all shapes.
fn empty_world() -> PhysicsWorld {
    PhysicsWorld {
        gravity: GRAVITY,
        integration_parameters: Default::default(),
        physics_pipeline: Default::default(),
        collision_pipeline: Default::default(),
        islands: Default::default(),
        broad_phase: Default::default(),
        narrow_phase: NarrowPhase::with_query_dispatcher(ConvexDispatcher),
        bodies: Default::default(),
        colliders: Default::default(),
        impulse_joints: Default::default(),
        multibody_joints: Default::default(),
        soft_bodies: Default::default(),
        ccd_solver: Default::default(),
    }
}
