//! Stable poses of a solid on a plane: it rests on a hull face whose area contains the projected centre of
//! mass.
//!
//! In: points and the centre of mass (m), mesh frame. Out: rotations, the most stable first. Uses only
//! sums, products, quotients and square roots, so that the results are bit-identical on every machine.

use crate::Mesh;
use crate::convex_hull::convex_hull;
use glamx::Vec3;
use glamx::{DMat3, DVec3};

/// A stable pose: rotation and stability.
#[derive(Clone, Debug, PartialEq)]
pub struct StablePose {
    /// Rotation `posed_from_mesh` that puts the resting face at the bottom.
    pub rotation: DMat3,
    /// Tangent of the min angle that tips the solid over; larger is more stable.
    pub tip_angle_tan: f64,
}

/// Max difference of the normals of one face (1 - cosine of the angle).
const NORMAL_TOLERANCE: f64 = 1e-4;
/// Min tip angle (tangent) of a stable pose.
const MIN_TIP_ANGLE_TAN: f64 = 0.05;
/// Max distance from the ground of a supporting vertex (fraction of the size).
const CONTACT_TOLERANCE: f64 = 1e-3;
/// The same for a base that is not flat, as in scans.
const UNEVEN_TOLERANCE: f64 = 1e-2;
/// Max number of vertices of the hull.
const HULL_POINTS: usize = 256;

impl StablePose {
    /// Whether the pose is the orientation of the mesh (within 3 degrees).
    pub fn is_identity(&self) -> bool {
        self.tilt_cos() > 0.9986
    }

    /// Cosine of the tilt from the orientation of the mesh to this pose.
    pub fn tilt_cos(&self) -> f64 {
        self.rotation.z_axis.z
    }

    /// Whether the y axis of the mesh points up in this pose (within 3 degrees).
    pub fn is_y_up(&self) -> bool {
        self.rotation.y_axis.z > 0.9986
    }
}

/// All stable poses, the most stable first; empty if the points have no hull. `center` is the centre of mass.
///
/// ```rust
/// use glamx::Vec3;
/// // A box of 60 x 40 x 120 mm about its centre of mass.
/// let half = Vec3::new(0.03, 0.02, 0.06);
/// let sign = |i: u32, axis: u32| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
/// let corner = |i| half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2));
/// let poses = mesh::stable_poses(&(0..8).map(corner).collect::<Vec<_>>(), Vec3::ZERO);
/// assert_eq!(poses.len(), 6);
/// // On its largest face, the box tips at an angle with the tangent 30 mm / 20 mm.
/// assert!((poses[0].tip_angle_tan - 1.5).abs() < 1e-6);
/// ```
pub fn stable_poses(points: &[Vec3], center: Vec3) -> Vec<StablePose> {
    let Some(hull) = convex_hull(points, HULL_POINTS) else { return Vec::new() };
    let center = center.as_dvec3();
    let mut normals: Vec<(DVec3, f64)> = Vec::new();
    for triangle in &hull.triangles {
        let [a, b, c] = triangle.map(|i| hull.vertices[i as usize].as_dvec3());
        let doubled = (b - a).cross(c - a);
        let area = doubled.length();
        if area > 0.0 {
            normals.push((doubled / area, area));
        }
    }
    // The largest triangle of a face has the most accurate normal.
    normals.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut faces: Vec<DVec3> = Vec::new();
    for (normal, _) in normals {
        if faces.iter().all(|known| known.dot(normal) < 1.0 - NORMAL_TOLERANCE) {
            faces.push(normal);
        }
    }
    let mut poses: Vec<StablePose> = faces
        .into_iter()
        .filter_map(|normal| stable_pose_on(&hull, normal, center, CONTACT_TOLERANCE))
        .collect();
    poses.sort_by(|a, b| b.tip_angle_tan.total_cmp(&a.tip_angle_tan));
    poses
}

/// Whether the mesh rests stably on the ground as it is, with z up. The base may be uneven, so the solid may
/// rock. `center` is the centre of mass.
pub fn is_stable(points: &[Vec3], center: Vec3) -> bool {
    let hull = convex_hull(points, HULL_POINTS);
    hull.and_then(|hull| stable_pose_on(&hull, -DVec3::Z, center.as_dvec3(), UNEVEN_TOLERANCE))
        .is_some()
}

/// Pose on the face with this outward normal; `None` if unstable.
///
/// Vertices within `tolerance` of the ground (fraction of the size) support the solid.
fn stable_pose_on(hull: &Mesh, normal: DVec3, center: DVec3, tolerance: f64) -> Option<StablePose> {
    let rotation = rotation_to_down(normal);
    let rotated: Vec<DVec3> =
        hull.vertices.iter().map(|v| rotation * (v.as_dvec3() - center)).collect();
    let ground = rotated.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let height = -ground;
    let size = rotated.iter().map(|p| p.length()).fold(0.0, f64::max);
    let support: Vec<[f64; 2]> =
        rotated.iter().filter(|p| p.z - ground < tolerance * size).map(|p| [p.x, p.y]).collect();
    // Min distance of the projected centre from the edges of the support polygon.
    let mut margin = f64::INFINITY;
    for (i, a) in support.iter().enumerate() {
        for b in &support[i + 1..] {
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
            if length == 0.0 {
                continue;
            }
            let side =
                |p: &[f64; 2]| (along[0] * (p[1] - a[1]) - along[1] * (p[0] - a[0])) / length;
            let (min, max) = support
                .iter()
                .map(side)
                .fold((0.0_f64, 0.0_f64), |(low, high), s| (low.min(s), high.max(s)));
            let inside = side(&[0.0, 0.0]);
            // An edge of the polygon has all vertices on one side, and at least one off its line.
            let epsilon = 1e-6 * size;
            if min > -epsilon && max > epsilon {
                margin = margin.min(inside);
            } else if max < epsilon && min < -epsilon {
                margin = margin.min(-inside);
            }
        }
    }
    let tip_angle_tan = margin / height;
    (margin.is_finite() && tip_angle_tan >= MIN_TIP_ANGLE_TAN)
        .then_some(StablePose { rotation, tip_angle_tan })
}

/// Smallest rotation that maps a unit vector to -z.
fn rotation_to_down(n: DVec3) -> DMat3 {
    // Rodrigues' formula about n x (-z). If that is zero: half a turn about x, or the identity.
    let (axis, cos) = (DVec3::new(-n.y, n.x, 0.0), -n.z);
    if cos <= -1.0 + 1e-12 {
        return DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    }
    let cross = DMat3::from_cols(
        DVec3::new(0.0, axis.z, -axis.y),
        DVec3::new(-axis.z, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    DMat3::IDENTITY + cross + cross * cross * (1.0 / (1.0 + cos))
}

impl Mesh {
    /// The mesh rotated about the origin.
    pub fn rotated(mut self, rotation: &DMat3) -> Self {
        self.vertices.iter_mut().for_each(|v| *v = (*rotation * v.as_dvec3()).as_vec3());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(half: Vec3) -> Vec<Vec3> {
        let sign = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
        (0..8).map(|i| half * Vec3::new(sign(i & 1), sign(i >> 1 & 1), sign(i >> 2 & 1))).collect()
    }

    #[test]
    fn cuboid_has_six_stable_poses_flattest_first() {
        let half = Vec3::new(0.05, 0.03, 0.1);
        let poses = stable_poses(&cuboid(half), Vec3::ZERO);
        assert_eq!(poses.len(), 6);
        // Smaller half side of the base over the height of the centre, for each pair of faces.
        let tangents = [0.05 / 0.03, 0.05 / 0.03, 0.03 / 0.05, 0.03 / 0.05, 0.3, 0.3];
        for (pose, tangent) in poses.iter().zip(tangents) {
            assert!(
                (pose.tip_angle_tan - tangent).abs() < 1e-6,
                "{} {tangent}",
                pose.tip_angle_tan
            );
            let r = pose.rotation;
            let identity = r * r.transpose();
            assert!((identity - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, 1e-12));
            assert!((r.determinant() - 1.0).abs() < 1e-12);
        }
        let mesh = Mesh { vertices: cuboid(half), ..Mesh::default() };
        assert!((mesh.rotated(&poses[0].rotation).extent().z - 0.06).abs() < 1e-6);
    }

    #[test]
    fn off_centre_mass_leaves_two_stable_faces() {
        let half = Vec3::new(0.05, 0.05, 0.05);
        let poses = stable_poses(&cuboid(half), Vec3::new(0.049, 0.0, 0.0));
        assert_eq!(poses.len(), 2, "the other four faces tip over an edge");
        let down = poses[0].rotation * DVec3::X;
        assert!((down - -DVec3::Z).length() < 1e-9, "{down}");
        assert!(
            poses[0].tip_angle_tan > 40.0 && (poses[1].tip_angle_tan - 50.0 / 99.0).abs() < 1e-3
        );
    }

    #[test]
    fn turn_down_maps_every_direction_to_minus_z() {
        for n in [
            DVec3::Z,
            -DVec3::Z,
            DVec3::X,
            DVec3::new(0.6, 0.0, 0.8),
            DVec3::new(0.36, -0.48, -0.8),
        ] {
            assert!((rotation_to_down(n) * n - -DVec3::Z).length() < 1e-12, "{n}");
        }
    }

    #[test]
    fn flat_points_have_no_stable_pose() {
        assert!(stable_poses(&[Vec3::ZERO, Vec3::X, Vec3::Y], Vec3::ZERO).is_empty());
    }
}
