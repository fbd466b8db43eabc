//! Table and object under physics, without the robot.

use crate::colliders;
use crate::config::{SceneConfig, SceneError, vec3};
use crate::contacts::{ContactForce, ContactState};
use crate::convex_dispatcher::ConvexDispatcher;
use crate::links::mass_properties;
use crate::scene::DragSpring;
use geometry::{Pose, Vec3};
use nalgebra::Matrix3;
use objects::object::Object;
use rapier3d::prelude::{
    ColliderHandle, NarrowPhase, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

pub(crate) struct TabletopWorld {
    pub(crate) world: PhysicsWorld,
    pub(crate) object: RigidBodyHandle,
    /// Extents (m) of the object's bounding box.
    pub(crate) object_size: Vec3,
    table_collider: ColliderHandle,
    object_colliders: Vec<ColliderHandle>,
    object_points: Vec<Vec3>,
    /// Height (m) of the table top, world frame.
    table_top: f32,
}

impl TabletopWorld {
    /// Creates a physics world with the table. The robot must be inserted next and the object last: the order
    /// of bodies determines the order of floating-point sums.
    pub(crate) fn create_world(config: &SceneConfig) -> (PhysicsWorld, ColliderHandle) {
        let mut world = empty_world();
        let parameters = &mut world.integration_parameters;
        parameters.dt = config.physics_dt() as f32;
        let physics = &config.physics;
        parameters.num_solver_iterations = physics.solver_iterations;
        parameters.num_internal_pgs_iterations = physics.pgs_iterations;
        parameters.num_internal_stabilization_iterations = physics.stabilization_iterations;
        parameters.friction_in_bias_pass = physics.friction_in_bias_pass;
        parameters.length_unit = physics.length_unit;
        // Contact recycling is designed for metre-sized objects; fingers are 2 cm wide.
        parameters.contact_recycling = false;
        let body = RigidBodyBuilder::fixed().translation(vec3(config.table.center));
        let (_, table_collider) = world.insert(body, colliders::table_collider(config));
        (world, table_collider)
    }

    /// Inserts the object and completes the world.
    pub(crate) fn add_object(
        mut world: PhysicsWorld,
        table_collider: ColliderHandle,
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
            object: body,
            object_size: object.size(),
            table_collider,
            object_colliders,
            object_points: object.parts.concat(),
            table_top: config.table_top(),
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

    /// Height (m) of the lowest point of the object above the table top.
    pub(crate) fn object_height(&self) -> f32 {
        let pose = self.object_pose();
        let lowest = self.object_points.iter().map(|&p| (pose * p).z).fold(f32::INFINITY, f32::min);
        lowest - self.table_top
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

#[cfg(test)]
mod tests {
    use super::*;
    use glamx::Quat;
    use mesh::Mesh;

    fn hull(points: &[Vec3]) -> Mesh {
        mesh::convex_hull(points, points.len()).unwrap()
    }

    fn object(name: &str, parts: Vec<Vec<Vec3>>, mass: f32) -> Object {
        let mut whole = Mesh { vertices: vec![], triangles: vec![] };
        for part in parts.iter().map(|part| hull(part)) {
            let first = whole.vertices.len() as u32;
            whole.triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + first)));
            whole.vertices.extend(part.vertices);
        }
        Object::new(name, whole, true, parts, mass, 0.8).unwrap()
    }

    fn cuboid(min: [f32; 3], max: [f32; 3]) -> Vec<Vec3> {
        let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { min[axis] } else { max[axis] };
        (0..8).map(|i| Vec3::new(pick(i, 0), pick(i, 1), pick(i, 2))).collect()
    }

    /// Cylinder of 16 sides along x, lying.
    fn rod(length: f32, radius: f32) -> Vec<Vec3> {
        let ring = |x: f32| {
            (0..16).map(move |i| {
                let (sin, cos) = libm::sincosf(i as f32 * std::f32::consts::TAU / 16.0);
                Vec3::new(x, radius * cos, radius * sin)
            })
        };
        ring(0.0).chain(ring(length)).collect()
    }

    fn ball(radius: f32) -> Vec<Vec3> {
        let direction = |i: usize| {
            let z = 1.0 - (2 * i + 1) as f32 / 120.0;
            let (sin, cos) = libm::sincosf(2.399_963 * i as f32);
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * cos, r * sin, z) * radius
        };
        (0..120).map(direction).collect()
    }

    /// Thin, round, heavy and hollow objects.
    fn objects() -> Vec<Object> {
        let cup = vec![
            cuboid([0.0, 0.0, 0.0], [0.08, 0.08, 0.004]),
            cuboid([0.0, 0.0, 0.0], [0.004, 0.08, 0.09]),
            cuboid([0.076, 0.0, 0.0], [0.08, 0.08, 0.09]),
            cuboid([0.0, 0.0, 0.0], [0.08, 0.004, 0.09]),
            cuboid([0.0, 0.076, 0.0], [0.08, 0.08, 0.09]),
        ];
        vec![
            object("plate of 12 mm", vec![cuboid([0.0; 3], [0.12, 0.18, 0.012])], 0.2),
            object("rod of 15 mm", vec![rod(0.16, 0.0075)], 0.1),
            object("heavy box", vec![cuboid([0.0; 3], [0.06, 0.09, 0.2])], 2.5),
            object("ball of 4 cm", vec![ball(0.02)], 0.02),
            object("cup", cup, 0.3),
        ]
    }

    impl TabletopWorld {
        /// Kinetic and potential energy of the object (J).
        fn energy(&self) -> f32 {
            let body = &self.world.bodies[self.object];
            body.kinetic_energy() - body.mass() * GRAVITY.z.abs() * -body.center_of_mass().z
        }

        /// Depth (m) of the deepest contact of the object.
        fn penetration(&self) -> f32 {
            let pairs =
                self.object_colliders.iter().flat_map(|&c| self.world.contact_pairs_with(c));
            let points = pairs.flat_map(|pair| {
                pair.manifolds().iter().flat_map(|manifold| manifold.points.iter().map(|p| -p.dist))
            });
            points.fold(0.0, f32::max)
        }
    }

    /// Penetration and energy of an object over 10 s of simulation.
    struct Course {
        /// Max. penetration (m) in the whole time, and at its end.
        max_depth: f32,
        final_depth: f32,
        /// Max. energy gain over any period, as a height (m) of the object.
        energy_gain: f32,
    }

    fn simulate(config: &SceneConfig, object: &Object, pose: &Pose) -> Course {
        let (world, table) = TabletopWorld::create_world(config);
        let mut tabletop = TabletopWorld::add_object(world, table, config, object, pose).unwrap();
        let (mut max_depth, mut min_energy, mut gain) = (0.0_f32, f32::INFINITY, 0.0_f32);
        for _ in 0..(10.0 / config.physics_dt()).round() as usize {
            tabletop.world.step();
            let energy = tabletop.energy();
            min_energy = min_energy.min(energy);
            gain = gain.max(energy - min_energy);
            max_depth = max_depth.max(tabletop.penetration());
        }
        assert!(tabletop.is_finite());
        let energy_gain = gain / (object.mass * GRAVITY.z.abs());
        let course = Course { max_depth, final_depth: tabletop.penetration(), energy_gain };
        println!(
            "{}: {:.3} mm deep, {:.3} mm at the end, energy gain {:.4} mm",
            object.name,
            1e3 * max_depth,
            1e3 * course.final_depth,
            1e3 * energy_gain
        );
        course
    }

    #[test]
    fn object_at_rest_neither_penetrates_the_table_nor_gains_energy() {
        let config = SceneConfig::standard().unwrap();
        let [x, y, _] = config.table.center;
        for object in objects() {
            let course = simulate(&config, &object, &config.object_pose(x, y, 0.3));
            assert!(course.max_depth < 1e-3, "{}: {} m deep", object.name, course.max_depth);
            assert!(course.energy_gain < 1e-4, "{}: {} m", object.name, course.energy_gain);
        }
    }

    /// An impact at 1.3 m/s penetrates by a centimetre, because a step is 1/120 s and contacts are not
    /// predicted. The object must leave the table top again, with less energy than it had.
    #[test]
    fn fallen_object_ends_on_the_table_top() {
        let config = SceneConfig::standard().unwrap();
        let [x, y, _] = config.table.center;
        let height = 0.08;
        for object in objects() {
            let mut pose = config.object_pose(x, y, 0.3);
            pose.translation.z += height;
            pose.rotation = Quat::from_rotation_x(0.3) * pose.rotation;
            let course = simulate(&config, &object, &pose);
            assert!(course.final_depth < 1e-3, "{}: {} m deep", object.name, course.final_depth);
            let gain = course.energy_gain / height;
            assert!(gain < 0.1, "{}: gains {gain} of the energy of the fall", object.name);
        }
    }
}
