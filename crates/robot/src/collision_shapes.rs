//! Convex collision shapes of the robot, for physics and distance queries.

use crate::hand_model::LinkRole;
use crate::tree::{CollisionShape, KinematicTree, Primitive};
use crate::{DOF, Kinematics, rotation};
use geometry::convex_shape::ConvexShape;

/// Sides of the prism that approximates a round fingertip. Flat sides give several contact points.
const FINGERTIP_SIDES: usize = 8;
/// Sides of the prism that approximates a cylinder.
const CYLINDER_SIDES: usize = 16;
/// Height of the faceted cap of a fingertip, in radii.
const FINGERTIP_CAP_RATIO: f32 = 0.7;

impl CollisionShape {
    /// Converts to a convex shape in the body frame; `None` if the shape has no volume.
    pub fn convex_shape(&self) -> Option<ConvexShape> {
        let solid = match self.primitive {
            Primitive::Box { half_extents: half } => ConvexShape::cuboid(rotation::to_vec3(&half)),
            Primitive::Cylinder { radius, half_length } => {
                ConvexShape::prism(radius as f32, half_length as f32, 0.0, CYLINDER_SIDES)?
            }
            Primitive::Capsule { radius, half_length } if self.role == LinkRole::Distal => {
                let radius = radius as f32;
                ConvexShape::prism(
                    radius,
                    half_length as f32,
                    FINGERTIP_CAP_RATIO * radius,
                    FINGERTIP_SIDES,
                )?
            }
            Primitive::Capsule { radius, half_length } => {
                ConvexShape::capsule(radius as f32, half_length as f32)
            }
        };
        Some(solid.transformed(&rotation::to_pose(&self.origin)))
    }
}

/// Convex collision shapes of all bodies, each in its body frame.
#[derive(Clone)]
pub struct CollisionModel {
    bodies: Vec<Vec<ConvexShape>>,
}

impl CollisionModel {
    /// Converts the collision shapes of `tree`.
    pub fn new(tree: &KinematicTree) -> Self {
        let shapes = |body: &crate::tree::Body| {
            body.shapes.iter().filter_map(CollisionShape::convex_shape).collect()
        };
        Self { bodies: tree.bodies.iter().map(shapes).collect() }
    }

    /// Shapes of one body, body frame.
    pub fn body_shapes(&self, body: usize) -> &[ConvexShape] {
        &self.bodies[body]
    }

    /// Min signed distance (m) between body `body` and `others`, clamped to `max_distance`.
    pub fn body_distance(
        &self,
        kinematics: &Kinematics,
        body: usize,
        others: &[ConvexShape],
        max_distance: f32,
    ) -> f32 {
        let pose = rotation::to_pose(&kinematics.world_from_body[body]);
        let mut min = max_distance;
        for solid in &self.bodies[body] {
            let solid = solid.transformed(&pose);
            for other in others {
                min = min.min(solid.signed_distance(other, max_distance));
            }
        }
        min
    }

    /// Min signed distance (m) between all moving bodies and `others`, clamped to `max_distance`.
    pub fn min_distance(
        &self,
        kinematics: &Kinematics,
        others: &[ConvexShape],
        max_distance: f32,
    ) -> f32 {
        (1..=DOF)
            .map(|body| self.body_distance(kinematics, body, others, max_distance))
            .fold(max_distance, f32::min)
    }
}
