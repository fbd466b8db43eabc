//! How a solid can stand on a table: on the faces of its hull over which its centre of mass lies.
//!
//! In: a convex hull and the centre of mass. Out: rotations, the steadiest first. Only + - * / and square roots:
//! what stands there is part of what must be the same on every machine.

use super::{Mesh, hull};
use crate::Vec3;
use glamx::{DMat3, DVec3};

/// A way to stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// Turns the solid so that it stands: columns of the rotation matrix.
    pub rotation: DMat3,
    /// Tangent of the angle by which it must be tipped to fall.
    pub steadiness: f64,
}

/// Faces whose normals differ by less are one (1 - cosine of the angle).
const FLAT: f64 = 1e-4;
/// What falls at a touch is no way to stand.
const LEAST: f64 = 0.05;
/// What is so near to the floor bears, as a share of the size; and of a foot that is not flat, as scans have it.
const BEARS: f64 = 1e-3;
const UNEVEN: f64 = 1e-2;
/// Corners of the hull that is looked at.
const HULL_POINTS: usize = 256;

impl Rest {
    /// Whether it already stands so (within 3 degrees).
    pub fn is_as_it_is(&self) -> bool {
        self.upright() > 0.9986
    }

    /// Cosine of the angle by which it is tipped to stand so.
    pub fn upright(&self) -> f64 {
        self.rotation.z_axis.z
    }

    /// Whether what was along y is up then (within 3 degrees).
    pub fn is_y_up(&self) -> bool {
        self.rotation.y_axis.z > 0.9986
    }
}

/// All ways to stand, the steadiest first; none if the points have no hull.
pub fn rests(points: &[Vec3], center: Vec3) -> Vec<Rest> {
    let Some(hull) = hull(points, HULL_POINTS) else { return Vec::new() };
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
    // The greatest triangle of a face has the best normal.
    normals.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut faces: Vec<DVec3> = Vec::new();
    for (normal, _) in normals {
        if faces.iter().all(|known| known.dot(normal) < 1.0 - FLAT) {
            faces.push(normal);
        }
    }
    let mut rests: Vec<Rest> =
        faces.into_iter().filter_map(|normal| rest(&hull, normal, center, BEARS)).collect();
    rests.sort_by(|a, b| b.steadiness.total_cmp(&a.steadiness));
    rests
}

/// Whether it stands as it is, on a foot that need not be flat: it may rock there.
pub fn stands(points: &[Vec3], center: Vec3) -> bool {
    let hull = hull(points, HULL_POINTS);
    hull.and_then(|hull| rest(&hull, -DVec3::Z, center.as_dvec3(), UNEVEN)).is_some()
}

/// Standing on the face with this outward normal, if that holds; what is nearer to the floor than `bears` bears.
fn rest(hull: &Mesh, normal: DVec3, center: DVec3, bears: f64) -> Option<Rest> {
    let rotation = turn_down(normal);
    let turned: Vec<DVec3> =
        hull.vertices.iter().map(|v| rotation * (v.as_dvec3() - center)).collect();
    let floor = turned.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let height = -floor;
    let size = turned.iter().map(|p| p.length()).fold(0.0, f64::max);
    let standing: Vec<[f64; 2]> =
        turned.iter().filter(|p| p.z - floor < bears * size).map(|p| [p.x, p.y]).collect();
    // How far the centre lies inside of what it stands on.
    let mut margin = f64::INFINITY;
    for (i, a) in standing.iter().enumerate() {
        for b in &standing[i + 1..] {
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
            if length == 0.0 {
                continue;
            }
            let side =
                |p: &[f64; 2]| (along[0] * (p[1] - a[1]) - along[1] * (p[0] - a[0])) / length;
            let (least, most) = standing
                .iter()
                .map(side)
                .fold((0.0_f64, 0.0_f64), |(low, high), s| (low.min(s), high.max(s)));
            let inside = side(&[0.0, 0.0]);
            // An edge has all corners on one side, and some of them off its line: on a line nothing stands.
            let off = 1e-6 * size;
            if least > -off && most > off {
                margin = margin.min(inside);
            } else if most < off && least < -off {
                margin = margin.min(-inside);
            }
        }
    }
    let steadiness = margin / height;
    (margin.is_finite() && steadiness >= LEAST).then_some(Rest { rotation, steadiness })
}

/// The least rotation that turns a unit vector to look down.
fn turn_down(n: DVec3) -> DMat3 {
    // Rodrigues' formula about n x (-z); where there is no such axis, half a turn about x or none.
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
    /// The mesh turned about the origin.
    pub fn turned(mut self, rotation: &DMat3) -> Self {
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
    fn a_cuboid_stands_on_six_sides_flattest_first() {
        let half = Vec3::new(0.05, 0.03, 0.1);
        let rests = rests(&cuboid(half), Vec3::ZERO);
        assert_eq!(rests.len(), 6);
        // Its least half side over its height, for each pair of sides.
        let tangents = [0.05 / 0.03, 0.05 / 0.03, 0.03 / 0.05, 0.03 / 0.05, 0.3, 0.3];
        for (rest, tangent) in rests.iter().zip(tangents) {
            assert!((rest.steadiness - tangent).abs() < 1e-6, "{} {tangent}", rest.steadiness);
            let r = rest.rotation;
            let identity = r * r.transpose();
            assert!((identity - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, 1e-12));
            assert!((r.determinant() - 1.0).abs() < 1e-12);
        }
        let mesh = Mesh { vertices: cuboid(half), ..Mesh::default() };
        assert!((mesh.turned(&rests[0].rotation).extent().z - 0.06).abs() < 1e-6);
    }

    #[test]
    fn what_is_heavy_on_one_side_stands_on_that_or_on_the_one_across() {
        let half = Vec3::new(0.05, 0.05, 0.05);
        let rests = rests(&cuboid(half), Vec3::new(0.049, 0.0, 0.0));
        assert_eq!(rests.len(), 2, "over its edge it falls");
        let down = rests[0].rotation * DVec3::X;
        assert!((down - -DVec3::Z).length() < 1e-9, "{down}");
        assert!(rests[0].steadiness > 40.0 && (rests[1].steadiness - 50.0 / 99.0).abs() < 1e-3);
    }

    #[test]
    fn every_direction_is_turned_down() {
        for n in [
            DVec3::Z,
            -DVec3::Z,
            DVec3::X,
            DVec3::new(0.6, 0.0, 0.8),
            DVec3::new(0.36, -0.48, -0.8),
        ] {
            assert!((turn_down(n) * n - -DVec3::Z).length() < 1e-12, "{n}");
        }
    }

    #[test]
    fn what_is_flat_stands_nowhere() {
        assert!(rests(&[Vec3::ZERO, Vec3::X, Vec3::Y], Vec3::ZERO).is_empty());
    }
}
