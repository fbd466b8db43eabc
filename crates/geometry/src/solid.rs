//! Convex solids in the world: signed gaps between them, and from points to them.

use crate::{Pose, Vec3, mesh};
use parry3d::query;
use parry3d::shape::SharedShape;
use std::sync::Arc;

/// Points that a hull keeps at most.
const MAX_HULL_POINTS: usize = 256;

/// A convex solid at a place.
#[derive(Clone)]
pub struct Solid {
    /// The shape in its own frame.
    pub shape: SharedShape,
    /// Its place.
    pub pose: Pose,
    /// Outward unit normals of a hull's faces and their distances from the origin, shape frame.
    faces: Arc<[(Vec3, f32)]>,
}

/// The closest points of two solids, seen from the second one.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Signed distance (m), negative in penetration.
    pub gap: f32,
    /// Point on the second solid's surface, world.
    pub point: Vec3,
    /// Unit normal of the second solid there, pointing out of it, world.
    pub outward: Vec3,
}

impl Solid {
    /// A box by its half sizes (m).
    pub fn cuboid(half: Vec3) -> Self {
        Self::new(SharedShape::cuboid(half.x, half.y, half.z))
    }

    /// A capsule along z: radius and half of its axis (m).
    pub fn capsule(radius: f32, half_length: f32) -> Self {
        Self::new(SharedShape::capsule_z(half_length, radius))
    }

    /// The hull of a set of points; `None` if it spans no volume.
    pub fn hull(points: &[Vec3]) -> Option<Self> {
        // The engine's own hull goes through trigonometry of the system; this one has the same bits
        // everywhere.
        let hull = mesh::hull(points, MAX_HULL_POINTS)?;
        let corner = |i: u32| hull.vertices[i as usize];
        let face = |t: &[u32; 3]| {
            let normal =
                (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).normalize();
            (normal, normal.dot(corner(t[0])))
        };
        let faces = hull.triangles.iter().map(face).collect();
        let shape = SharedShape::convex_mesh(hull.vertices, &hull.triangles)?;
        Some(Self { shape, pose: Pose::IDENTITY, faces })
    }

    /// A prism along z whose flat sides touch the cylinder of `radius` from outside; its ends are
    /// closed by rings of 0.6 the size, `cap` (m) further out.
    pub fn prism(radius: f32, half_length: f32, cap: f32, sides: usize) -> Option<Self> {
        let step = std::f32::consts::TAU / sides as f32;
        let corner = radius / libm::cosf(0.5 * step);
        let mut points = Vec::new();
        for i in 0..sides {
            let (sin, cos) = libm::sincosf((i as f32 + 0.5) * step);
            let (x, y) = (corner * cos, corner * sin);
            for side in [-1.0, 1.0] {
                points.push(Vec3::new(x, y, side * half_length));
                if cap > 0.0 {
                    points.push(Vec3::new(0.6 * x, 0.6 * y, side * (half_length + cap)));
                }
            }
        }
        Self::hull(&points)
    }

    fn new(shape: SharedShape) -> Self {
        Self { shape, pose: Pose::IDENTITY, faces: Arc::new([]) }
    }

    /// The same solid moved by `pose`, which maps its present frame to the new one.
    pub fn moved(&self, pose: &Pose) -> Self {
        Self { pose: *pose * self.pose, ..self.clone() }
    }

    /// Signed distance (m) to another solid, negative in penetration; `reach` where it is farther.
    pub fn gap(&self, other: &Self, reach: f32) -> f32 {
        let contact = query::contact(&self.pose, &*self.shape, &other.pose, &*other.shape, reach);
        contact.ok().flatten().map_or(reach, |contact| contact.dist.min(reach))
    }

    /// Where this solid comes closest to, or deepest into, another one; `None` beyond `reach` (m).
    pub fn contact(&self, other: &Self, reach: f32) -> Option<Contact> {
        let contact = query::contact(&self.pose, &*self.shape, &other.pose, &*other.shape, reach);
        let contact = contact.ok().flatten()?;
        Some(Contact { gap: contact.dist, point: contact.point2, outward: contact.normal2 })
    }

    /// Signed distance (m) of a point from the surface, negative inside, and the outward direction there.
    pub fn point_gap(&self, point: Vec3) -> (f32, Vec3) {
        // The engine's projection is inexact for points on or inside a hull; its faces are not.
        let local = self.pose.inverse() * point;
        let signed = |(normal, offset): &(Vec3, f32)| (normal.dot(local) - offset, *normal);
        let nearest_face = self.faces.iter().map(signed).max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((gap, normal)) = nearest_face
            && gap <= 0.0
        {
            return (gap, self.pose.rotation * normal);
        }
        let projection = self.shape.project_point(&self.pose, point, false);
        let offset = point - projection.point;
        let distance = offset.length();
        let inside = projection.is_inside && self.faces.is_empty();
        // Inside, the way out leads from the point to the surface.
        let sign = if inside { -1.0 } else { 1.0 };
        let outward = if distance > 1e-9 { offset * (sign / distance) } else { Vec3::Z };
        (sign * distance, outward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gap_is_signed() {
        let a = Solid::cuboid(Vec3::splat(0.1));
        let b =
            |x: f32| Solid::cuboid(Vec3::splat(0.05)).moved(&Pose::from_translation(Vec3::X * x));
        assert!((a.gap(&b(0.17), 0.1) - 0.02).abs() < 1e-5);
        assert!((a.gap(&b(0.14), 0.1) + 0.01).abs() < 1e-4);
        assert_eq!(a.gap(&b(0.9), 0.1), 0.1);
        let contact = b(0.17).contact(&a, 0.1).unwrap();
        assert!(
            (contact.outward - Vec3::X).length() < 1e-4 && (contact.point.x - 0.1).abs() < 1e-5
        );
    }

    #[test]
    fn the_way_out_points_outward_on_both_sides() {
        let a = Solid::cuboid(Vec3::splat(0.1));
        for x in [0.08, 0.12] {
            let (gap, outward) = a.point_gap(Vec3::new(x, 0.0, 0.0));
            assert!((gap - (x - 0.1)).abs() < 1e-6, "gap {gap} at {x}");
            assert!((outward - Vec3::X).length() < 1e-4, "outward {outward} at {x}");
        }
    }

    #[test]
    fn prism_sides_lie_on_the_cylinder() {
        let prism = Solid::prism(0.012, 0.01, 0.008, 8).unwrap();
        let (gap, _) = prism.point_gap(Vec3::new(0.012, 0.0, 0.0));
        assert!(gap.abs() < 1e-6, "gap {gap}");
    }
}
