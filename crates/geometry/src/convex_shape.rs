//! Convex shapes at poses: signed distances and closest points between shapes, and from points to shapes.

use crate::{Pose, Vec3};
use mesh::Mesh;
use parry3d::query;
use parry3d::shape::SharedShape;
use std::sync::Arc;

/// Max number of vertices of a hull.
const MAX_HULL_POINTS: usize = 256;

/// Scale of the shapes in distance queries (query units per metre).
///
/// parry's iterations stop at absolute tolerances that suit shapes of about one unit. With hand-sized
/// objects in metres they stop too early, and distances are wrong by centimetres. In centimetres the
/// relative error is 1e-3.
const QUERY_SCALE: f32 = 100.0;

/// A convex shape at a pose.
///
/// ```rust
/// use geometry::convex_shape::ConvexShape;
/// use geometry::{Pose, Vec3};
/// // Two boxes, given by half extents (m), at a distance of 0.17 - 0.1 - 0.05 = 0.02 m.
/// let large = ConvexShape::cuboid(Vec3::splat(0.1));
/// let small = ConvexShape::cuboid(Vec3::splat(0.05));
/// let small = small.transformed(&Pose::from_translation(Vec3::X * 0.17));
/// assert!((large.signed_distance(&small, 1.0) - 0.02).abs() < 1e-4);
/// // A point 0.02 m inside has a negative distance; the normal points outward.
/// let (distance, normal) = large.point_signed_distance(Vec3::X * 0.08);
/// assert!((distance + 0.02).abs() < 1e-4 && normal.distance(Vec3::X) < 1e-4);
/// ```
#[derive(Clone)]
pub struct ConvexShape {
    /// The shape in its own frame.
    pub shape: SharedShape,
    /// Pose `world_from_shape`.
    pub pose: Pose,
    /// The same shape, scaled by [`QUERY_SCALE`].
    query_shape: SharedShape,
    /// Outward unit normals and offsets (m) of a hull's faces, shape frame; empty for other shapes.
    faces: Arc<[(Vec3, f32)]>,
    /// Min and max corner of the bounding box (m), shape frame.
    bounds: [Vec3; 2],
}

/// Closest points of two shapes: the point on the second shape, with the signed distance.
#[derive(Clone, Copy, Debug)]
pub struct ClosestPoints {
    /// Signed distance (m), negative in penetration.
    pub distance: f32,
    /// Point on the second shape's surface, world frame.
    pub point: Vec3,
    /// Outward unit normal of the second shape at that point, world frame.
    pub normal: Vec3,
}

impl ConvexShape {
    /// Box with these half extents (m), centred at the origin.
    pub fn cuboid(half: Vec3) -> Self {
        let shape = |half: Vec3| SharedShape::cuboid(half.x, half.y, half.z);
        Self::new(shape(half), shape(half * QUERY_SCALE))
    }

    /// Capsule along z: radius and half the length of its axis (m).
    pub fn capsule(radius: f32, half_length: f32) -> Self {
        let shape = |scale| SharedShape::capsule_z(half_length * scale, radius * scale);
        Self::new(shape(1.0), shape(QUERY_SCALE))
    }

    /// Convex hull of points (m); `None` if it has no volume.
    pub fn hull(points: &[Vec3]) -> Option<Self> {
        // parry's own hull calls the system's trigonometry; this one is bit-identical on every machine.
        let hull = mesh::convex_hull(points, MAX_HULL_POINTS)?;
        let corner = |i: u32| hull.vertices[i as usize];
        let face = |t: &[u32; 3]| {
            let normal =
                (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).normalize();
            (normal, normal.dot(corner(t[0])))
        };
        let faces = hull.triangles.iter().map(face).collect();
        let scaled = hull.vertices.iter().map(|vertex| *vertex * QUERY_SCALE).collect();
        let scaled = SharedShape::convex_mesh(scaled, &hull.triangles)?;
        let shape = SharedShape::convex_mesh(hull.vertices, &hull.triangles)?;
        Some(Self { faces, ..Self::new(shape, scaled) })
    }

    /// Prism along z with `sides` flat faces, circumscribed about the cylinder of `radius` (m).
    ///
    /// If `cap` (m) is positive, a ring of 0.6 times the size is added that far beyond each end.
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

    /// Triangle mesh of the surface for rendering, world frame.
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

    fn new(shape: SharedShape, scaled: SharedShape) -> Self {
        let aabb = shape.compute_local_aabb();
        let bounds = [aabb.mins, aabb.maxs];
        Self { shape, query_shape: scaled, pose: Pose::IDENTITY, faces: Arc::new([]), bounds }
    }

    /// Centre and radius (m) of a bounding sphere, world frame.
    fn bounding_sphere(&self) -> (Vec3, f32) {
        let [min, max] = self.bounds;
        (self.pose * (0.5 * (min + max)), 0.5 * min.distance(max))
    }

    /// Pose in query units; see [`QUERY_SCALE`].
    fn query_pose(&self) -> Pose {
        Pose { translation: self.pose.translation * QUERY_SCALE, ..self.pose }
    }

    /// The shape transformed by `pose`, which maps the current frame to the new one.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self { pose: *pose * self.pose, ..self.clone() }
    }

    /// Signed distance (m) to another shape, negative in penetration, clamped to `max_distance` (m).
    pub fn signed_distance(&self, other: &Self, max_distance: f32) -> f32 {
        let closest = self.closest_points(other, max_distance);
        closest.map_or(max_distance, |closest| closest.distance.min(max_distance))
    }

    /// Closest or deepest points of this shape and another one; `None` beyond `max_distance` (m).
    pub fn closest_points(&self, other: &Self, max_distance: f32) -> Option<ClosestPoints> {
        let ((center, radius), (other_center, other_radius)) =
            (self.bounding_sphere(), other.bounding_sphere());
        if center.distance(other_center) > radius + other_radius + max_distance {
            return None;
        }
        let (a, b) = (self.query_pose(), other.query_pose());
        let contact = query::contact(
            &a,
            &*self.query_shape,
            &b,
            &*other.query_shape,
            max_distance * QUERY_SCALE,
        );
        let contact = contact.ok().flatten()?;
        Some(ClosestPoints {
            distance: contact.dist / QUERY_SCALE,
            point: contact.point2 / QUERY_SCALE,
            normal: contact.normal2,
        })
    }

    /// Signed distance (m) from the surface to a point, negative inside, and the outward normal there.
    pub fn point_signed_distance(&self, point: Vec3) -> (f32, Vec3) {
        // parry's projection is inexact for points on or inside a hull; the face planes are exact.
        let local = self.pose.inverse() * point;
        let [min, max] = self.bounds;
        if local.cmpge(min).all() && local.cmple(max).all() {
            let signed = |(normal, offset): &(Vec3, f32)| (normal.dot(local) - offset, *normal);
            let nearest_face = self.faces.iter().map(signed).max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((distance, normal)) = nearest_face
                && distance <= 0.0
            {
                return (distance, self.pose.rotation * normal);
            }
        }
        let projection =
            self.query_shape.project_point(&self.query_pose(), point * QUERY_SCALE, false);
        let offset = point - projection.point / QUERY_SCALE;
        let distance = offset.length();
        let inside = projection.is_inside && self.faces.is_empty();
        // Inside, the outward direction is from the point to the surface.
        let sign = if inside { -1.0 } else { 1.0 };
        let outward = if distance > 1e-9 { offset * (sign / distance) } else { Vec3::Z };
        (sign * distance, outward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signed_distance_is_negative_in_penetration() {
        let a = ConvexShape::cuboid(Vec3::splat(0.1));
        let b = |x: f32| {
            ConvexShape::cuboid(Vec3::splat(0.05)).transformed(&Pose::from_translation(Vec3::X * x))
        };
        assert!((a.signed_distance(&b(0.17), 0.1) - 0.02).abs() < 1e-5);
        assert!((a.signed_distance(&b(0.14), 0.1) + 0.01).abs() < 1e-4);
        assert_eq!(a.signed_distance(&b(0.9), 0.1), 0.1);
        let closest = b(0.17).closest_points(&a, 0.1).unwrap();
        assert!((closest.normal - Vec3::X).length() < 1e-4 && (closest.point.x - 0.1).abs() < 1e-5);
    }

    #[test]
    fn point_normal_is_outward_on_both_sides_of_the_surface() {
        let a = ConvexShape::cuboid(Vec3::splat(0.1));
        for x in [0.08, 0.12] {
            let (distance, normal) = a.point_signed_distance(Vec3::new(x, 0.0, 0.0));
            assert!((distance - (x - 0.1)).abs() < 1e-6, "distance {distance} at {x}");
            assert!((normal - Vec3::X).length() < 1e-4, "normal {normal} at {x}");
        }
    }

    #[test]
    fn prism_faces_touch_the_cylinder() {
        let prism = ConvexShape::prism(0.012, 0.01, 0.008, 8).unwrap();
        let (distance, _) = prism.point_signed_distance(Vec3::new(0.012, 0.0, 0.0));
        assert!(distance.abs() < 1e-6, "distance {distance}");
    }

    /// Corner points of the sugar box, and points on the faces of its hull with the face normals.
    fn points_on_faces() -> (Vec<Vec3>, Vec<(Vec3, Vec3)>) {
        let points = objects::Object::from_catalog("sugar_box").unwrap().parts.remove(0);
        let hull = mesh::convex_hull(&points, MAX_HULL_POINTS).unwrap();
        let inside = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| hull.vertices[i as usize]);
            let normal = (b - a).cross(c - a).normalize();
            [[0.4, 0.3], [0.1, 0.1], [0.8, 0.1], [0.1, 0.8]]
                .map(|[u, v]| (a + (b - a) * u + (c - a) * v, normal))
        };
        let on_faces = hull.triangles.iter().flat_map(inside).collect();
        (points, on_faces)
    }

    #[test]
    fn point_signed_distance_is_accurate_near_a_face() {
        let (points, on_faces) = points_on_faces();
        let shape = ConvexShape::hull(&points).unwrap();
        for (on_face, normal) in on_faces {
            for wanted in [0.0003f32, 0.002, 0.01, 0.05] {
                let (distance, outward) = shape.point_signed_distance(on_face + normal * wanted);
                assert!((distance - wanted).abs() < 1e-4, "got {distance}, wanted {wanted}");
                let angle = outward.angle_between(normal);
                assert!(angle < 0.1, "the normal is off by {angle} rad at {wanted} m");
            }
        }
    }

    #[test]
    fn signed_distance_of_a_fingertip_is_accurate_near_a_face() {
        let (points, on_faces) = points_on_faces();
        let shape = ConvexShape::hull(&points).unwrap();
        let tip = ConvexShape::prism(0.012, 0.01, 0.008, 8).unwrap();
        let corners = tip.shape.as_convex_polyhedron().unwrap().points().to_vec();
        for (k, (on_face, normal)) in on_faces.into_iter().enumerate() {
            for wanted in [0.0003f32, 0.002, 0.01, 0.05] {
                let sin = |shift: f32| libm::sinf(k as f32 * 1.3 + shift);
                let rotation =
                    glamx::Quat::from_xyzw(sin(0.0), sin(1.0), sin(2.0), 0.5).normalize();
                // Place the closest corner over the point on the face.
                let nearest = corners
                    .iter()
                    .map(|corner| rotation * *corner)
                    .min_by(|a, b| a.dot(normal).total_cmp(&b.dot(normal)))
                    .unwrap();
                let pose = Pose::from_parts(on_face + normal * wanted - nearest, rotation);
                let closest = tip.transformed(&pose).closest_points(&shape, 0.1).unwrap();
                assert!(
                    (closest.distance - wanted).abs() < 1e-4,
                    "{} for {wanted}",
                    closest.distance
                );
                let angle = closest.normal.angle_between(normal);
                assert!(angle < 0.1, "the normal is off by {angle} rad at {wanted} m");
            }
        }
    }
}
