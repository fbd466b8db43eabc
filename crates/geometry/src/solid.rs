//! Convex solids in the world: signed gaps between them, and from points to them.

use crate::mesh::{self, Mesh};
use crate::{Pose, Vec3};
use parry3d::query;
use parry3d::shape::SharedShape;
use std::sync::Arc;

/// Points that a hull keeps at most.
const MAX_HULL_POINTS: usize = 256;

/// How many units of distance queries make a metre. The engine's iterations end at absolute tolerances
/// that are made for things of about one unit: in metres they stall on what a hand can hold, and a gap
/// comes out wrong by centimetres. In centimetres it is right to a thousandth of itself.
const FINE: f32 = 100.0;

/// A convex solid at a place.
#[derive(Clone)]
pub struct Solid {
    /// The shape in its own frame.
    pub shape: SharedShape,
    /// Its place.
    pub pose: Pose,
    /// The same shape, [`FINE`] times as large.
    fine: SharedShape,
    /// Outward unit normals of a hull's faces and their distances from the origin, shape frame.
    faces: Arc<[(Vec3, f32)]>,
    /// Least and greatest corner of its bounding box, shape frame.
    bounds: [Vec3; 2],
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
        let shape = |half: Vec3| SharedShape::cuboid(half.x, half.y, half.z);
        Self::new(shape(half), shape(half * FINE))
    }

    /// A capsule along z: radius and half of its axis (m).
    pub fn capsule(radius: f32, half_length: f32) -> Self {
        let shape = |scale| SharedShape::capsule_z(half_length * scale, radius * scale);
        Self::new(shape(1.0), shape(FINE))
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
        let large = hull.vertices.iter().map(|vertex| *vertex * FINE).collect();
        let fine = SharedShape::convex_mesh(large, &hull.triangles)?;
        let shape = SharedShape::convex_mesh(hull.vertices, &hull.triangles)?;
        Some(Self { faces, ..Self::new(shape, fine) })
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

    /// Its surface as triangles, world, to be looked at.
    pub fn mesh(&self) -> Mesh {
        let (vertices, triangles) = if let Some(cuboid) = self.shape.as_cuboid() {
            cuboid.to_trimesh()
        } else if let Some(capsule) = self.shape.as_capsule() {
            capsule.to_trimesh(12, 6)
        } else if let Some(hull) = self.shape.as_convex_polyhedron() {
            hull.to_trimesh()
        } else {
            (Vec::new(), Vec::new())
        };
        Mesh { vertices: vertices.into_iter().map(|p| self.pose * p).collect(), triangles }
    }

    fn new(shape: SharedShape, fine: SharedShape) -> Self {
        let aabb = shape.compute_local_aabb();
        let bounds = [aabb.mins, aabb.maxs];
        Self { shape, fine, pose: Pose::IDENTITY, faces: Arc::new([]), bounds }
    }

    /// Centre and radius (m) of a ball that holds the solid, world.
    fn ball(&self) -> (Vec3, f32) {
        let [min, max] = self.bounds;
        (self.pose * (0.5 * (min + max)), 0.5 * min.distance(max))
    }

    /// Its place among shapes that are [`FINE`] times as large.
    fn fine_pose(&self) -> Pose {
        Pose { translation: self.pose.translation * FINE, ..self.pose }
    }

    /// The same solid moved by `pose`, which maps its present frame to the new one.
    pub fn moved(&self, pose: &Pose) -> Self {
        Self { pose: *pose * self.pose, ..self.clone() }
    }

    /// Signed distance (m) to another solid, negative in penetration; `reach` where it is farther.
    pub fn gap(&self, other: &Self, reach: f32) -> f32 {
        self.contact(other, reach).map_or(reach, |contact| contact.gap.min(reach))
    }

    /// Where this solid comes closest to, or deepest into, another one; `None` beyond `reach` (m).
    pub fn contact(&self, other: &Self, reach: f32) -> Option<Contact> {
        let ((middle, radius), (others, its)) = (self.ball(), other.ball());
        if middle.distance(others) > radius + its + reach {
            return None;
        }
        let (a, b) = (self.fine_pose(), other.fine_pose());
        let contact = query::contact(&a, &*self.fine, &b, &*other.fine, reach * FINE);
        let contact = contact.ok().flatten()?;
        Some(Contact {
            gap: contact.dist / FINE,
            point: contact.point2 / FINE,
            outward: contact.normal2,
        })
    }

    /// Signed distance (m) of a point from the surface, negative inside, and the outward direction there.
    pub fn point_gap(&self, point: Vec3) -> (f32, Vec3) {
        // The engine's projection is inexact for points on or inside a hull; its faces are not.
        let local = self.pose.inverse() * point;
        let [min, max] = self.bounds;
        if local.cmpge(min).all() && local.cmple(max).all() {
            let signed = |(normal, offset): &(Vec3, f32)| (normal.dot(local) - offset, *normal);
            let nearest_face = self.faces.iter().map(signed).max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((gap, normal)) = nearest_face
                && gap <= 0.0
            {
                return (gap, self.pose.rotation * normal);
            }
        }
        let projection = self.fine.project_point(&self.fine_pose(), point * FINE, false);
        let offset = point - projection.point / FINE;
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

    /// Points inside the faces of the sugar box's hull, with the faces' normals.
    fn on_faces() -> (Vec<Vec3>, Vec<(Vec3, Vec3)>) {
        let points = crate::object::Object::built_in("sugar_box").unwrap().parts.remove(0);
        let hull = mesh::hull(&points, MAX_HULL_POINTS).unwrap();
        let inside = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| hull.vertices[i as usize]);
            let normal = (b - a).cross(c - a).normalize();
            [[0.4, 0.3], [0.1, 0.1], [0.8, 0.1], [0.1, 0.8]]
                .map(|[u, v]| (a + (b - a) * u + (c - a) * v, normal))
        };
        let places = hull.triangles.iter().flat_map(inside).collect();
        (points, places)
    }

    #[test]
    fn points_beside_a_face_are_as_far_as_they_are() {
        let (points, places) = on_faces();
        let solid = Solid::hull(&points).unwrap();
        for (on, normal) in places {
            for wanted in [0.0003f32, 0.002, 0.01, 0.05] {
                let (gap, outward) = solid.point_gap(on + normal * wanted);
                assert!((gap - wanted).abs() < 1e-4, "gap {gap}, wanted {wanted}");
                let turn = outward.angle_between(normal);
                assert!(turn < 0.1, "outward is {turn} rad off at {wanted} m");
            }
        }
    }

    #[test]
    fn a_fingertip_beside_a_face_is_as_far_as_it_is() {
        let (points, places) = on_faces();
        let solid = Solid::hull(&points).unwrap();
        let tip = Solid::prism(0.012, 0.01, 0.008, 8).unwrap();
        let corners = tip.shape.as_convex_polyhedron().unwrap().points().to_vec();
        for (k, (on, normal)) in places.into_iter().enumerate() {
            for wanted in [0.0003f32, 0.002, 0.01, 0.05] {
                let turn = |shift: f32| libm::sinf(k as f32 * 1.3 + shift);
                let rotation =
                    glamx::Quat::from_xyzw(turn(0.0), turn(1.0), turn(2.0), 0.5).normalize();
                // The corner that comes closest is put over the point of the face.
                let nearest = corners
                    .iter()
                    .map(|corner| rotation * *corner)
                    .min_by(|a, b| a.dot(normal).total_cmp(&b.dot(normal)))
                    .unwrap();
                let place = Pose::from_parts(on + normal * wanted - nearest, rotation);
                let contact = tip.moved(&place).contact(&solid, 0.1).unwrap();
                assert!((contact.gap - wanted).abs() < 1e-4, "{} for {wanted}", contact.gap);
                let turn = contact.outward.angle_between(normal);
                assert!(turn < 0.1, "outward is {turn} rad off at {wanted} m");
            }
        }
    }
}
