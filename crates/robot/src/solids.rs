//! The collision shapes as solids, for physics and for distances.

use crate::tree::{Geometry, Shape, Tree};
use crate::{DOF, Kinematics, rotation};
use geometry::solid::Solid;

/// Sides of the prism that stands in for a round fingertip, so that it touches at several points.
const TIP_SIDES: usize = 8;
/// Sides of a cylinder.
const CYLINDER_SIDES: usize = 16;
/// How far a fingertip's faceted cap reaches, in radii.
const TIP_CAP: f32 = 0.7;

impl Shape {
    /// The solid in its body's frame; `None` for a shape without volume.
    pub fn solid(&self) -> Option<Solid> {
        let solid = match self.geometry {
            Geometry::Box { half } => Solid::cuboid(rotation::to_vec3(&half)),
            Geometry::Cylinder { radius, half_length } => {
                Solid::prism(radius as f32, half_length as f32, 0.0, CYLINDER_SIDES)?
            }
            Geometry::Capsule { radius, half_length } if self.is_fingertip() => {
                let radius = radius as f32;
                Solid::prism(radius, half_length as f32, TIP_CAP * radius, TIP_SIDES)?
            }
            Geometry::Capsule { radius, half_length } => {
                Solid::capsule(radius as f32, half_length as f32)
            }
        };
        Some(solid.moved(&rotation::to_pose(&self.origin)))
    }

    fn is_fingertip(&self) -> bool {
        matches!(
            self.link.as_str(),
            "index_link_3" | "middle_link_3" | "ring_link_3" | "thumb_link_3"
        )
    }
}

/// Solids of all bodies, each in its body's frame.
#[derive(Clone)]
pub struct RobotSolids {
    bodies: Vec<Vec<Solid>>,
}

impl RobotSolids {
    /// Makes the solids once.
    pub fn new(tree: &Tree) -> Self {
        let solids =
            |body: &crate::tree::Body| body.shapes.iter().filter_map(Shape::solid).collect();
        Self { bodies: tree.bodies.iter().map(solids).collect() }
    }

    /// Solids of one body, body frame.
    pub fn of_body(&self, body: usize) -> &[Solid] {
        &self.bodies[body]
    }

    /// Least signed gap (m) between body `body` and any of `others`; `reach` where it is farther.
    pub fn gap(&self, kinematics: &Kinematics, body: usize, others: &[Solid], reach: f32) -> f32 {
        let pose = rotation::to_pose(&kinematics.world_from_body[body]);
        let mut least = reach;
        for solid in &self.bodies[body] {
            let solid = solid.moved(&pose);
            for other in others {
                least = least.min(solid.gap(other, reach));
            }
        }
        least
    }

    /// Least signed gap (m) between all moving bodies and any of `others`.
    pub fn least_gap(&self, kinematics: &Kinematics, others: &[Solid], reach: f32) -> f32 {
        (1..=DOF).map(|body| self.gap(kinematics, body, others, reach)).fold(reach, f32::min)
    }
}
