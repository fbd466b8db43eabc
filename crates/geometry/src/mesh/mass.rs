//! Volume, centre of mass and inertia of a solid of density 1, from its surface by the divergence theorem.
//!
//! Sums in double precision about the middle of the bounding box.

use super::{Mesh, MeshError, hull};
use crate::Vec3;
use glamx::{DMat3, DVec3};

/// Mass properties for density 1; multiply by the density.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Volume (m³).
    pub volume: f64,
    /// Centre of mass (m).
    pub center: Vec3,
    /// Inertia about `center` for a density of 1 kg/m³ (m⁵), rows.
    pub inertia: [[f32; 3]; 3],
    /// Whether the convex hull was weighed instead, because the mesh bounds no sensible volume.
    pub from_hull: bool,
}

/// Points of the hull that stands in for a mesh, or that its volume is compared with.
const HULL_POINTS: usize = 2000;
/// A mesh may exceed the volume of that hull by this factor: the hull leaves out a little of round things.
pub(super) const HULL_SLACK: f64 = 1.01;

/// Weighs the mesh if it is watertight and its volume lies between none and its hull's, else its hull.
pub fn solid(mesh: &Mesh, watertight: bool) -> Result<Solid, MeshError> {
    let hull = hull(&mesh.vertices, HULL_POINTS).ok_or(MeshError::Flat)?;
    let (own, most) = (Moments::of(mesh), Moments::of(&hull));
    let is_sensible =
        own.volume > 0.0 && own.volume <= HULL_SLACK * most.volume && own.is_compact();
    let from_hull = !(watertight && is_sensible);
    let moments = if from_hull { most } else { own };
    if !(moments.volume > 0.0 && moments.is_compact()) {
        return Err(MeshError::Flat);
    }
    let inertia = moments.inertia();
    let rows = [0, 1, 2].map(|row| inertia.row(row).to_array().map(|x| x as f32));
    Ok(Solid {
        volume: moments.volume,
        center: (moments.origin + moments.center()).as_vec3(),
        inertia: rows,
        from_hull,
    })
}

/// Enclosed volume (m³), negative if the mesh is inside out.
pub(super) fn volume(mesh: &Mesh) -> f64 {
    Moments::of(mesh).volume
}

/// Integrals over the solid of 1, x and x xᵀ, with x from `origin`.
struct Moments {
    origin: DVec3,
    volume: f64,
    first: DVec3,
    second: DMat3,
}

impl Moments {
    fn of(mesh: &Mesh) -> Self {
        let [low, high] = mesh.bounds();
        let origin = (low.as_dvec3() + high.as_dvec3()) / 2.0;
        let mut sum = Self { origin, volume: 0.0, first: DVec3::ZERO, second: DMat3::ZERO };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize].as_dvec3() - origin);
            // The tetrahedron from the origin: V = det / 6, ∫x = V s / 4, ∫x xᵀ = V (s sᵀ + Σ v vᵀ) / 20.
            let det = a.dot(b.cross(c));
            let s = a + b + c;
            sum.volume += det / 6.0;
            sum.first += s * (det / 24.0);
            sum.second += (outer(s) + outer(a) + outer(b) + outer(c)) * (det / 120.0);
        }
        sum
    }

    /// Centre of mass from `origin`.
    fn center(&self) -> DVec3 {
        self.first / self.volume
    }

    /// I = tr(C) 1 - C about the centre of mass, with C = ∫x xᵀ - V c cᵀ.
    fn inertia(&self) -> DMat3 {
        let c = self.second - outer(self.center()) * self.volume;
        DMat3::IDENTITY * (c.x_axis.x + c.y_axis.y + c.z_axis.z) - c
    }

    /// Whether the moments are those of a body: each moment of inertia positive and less than the others together.
    fn is_compact(&self) -> bool {
        let i = self.inertia();
        let [x, y, z] = [i.x_axis.x, i.y_axis.y, i.z_axis.z];
        let least = f64::from(f32::MIN_POSITIVE);
        x > least && y > least && z > least && x < y + z && y < z + x && z < x + y
    }
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples;

    fn near(got: f32, wanted: f32) {
        assert!(
            (got - wanted).abs() <= 1e-5 * wanted.abs().max(1e-3),
            "wanted {wanted}, got {got}"
        );
    }

    #[test]
    fn a_box_has_its_closed_form() {
        let (low, high) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.2, 2.3, 3.4));
        let solid = solid(&samples::cuboid(low, high), true).unwrap();
        let side = high - low;
        let volume = side.x * side.y * side.z;
        assert!(!solid.from_hull);
        near(solid.volume as f32, volume);
        (0..3).for_each(|i| near(solid.center[i], (low[i] + high[i]) / 2.0));
        let square = side * side;
        near(solid.inertia[0][0], volume / 12.0 * (square.y + square.z));
        near(solid.inertia[1][1], volume / 12.0 * (square.x + square.z));
        near(solid.inertia[2][2], volume / 12.0 * (square.x + square.y));
        assert!(solid.inertia[0][1].abs() < 1e-8, "{:?}", solid.inertia);
    }

    #[test]
    fn a_tetrahedron_has_its_closed_form() {
        let vertices = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let solid = solid(&Mesh { vertices, triangles }, true).unwrap();
        near(solid.volume as f32, 1.0 / 6.0);
        near(solid.center.x, 0.25);
        // ∫x² = 1/60, ∫xy = 1/120 about the corner, moved to the centre (1/4, 1/4, 1/4).
        near(solid.inertia[0][0], 2.0 * (1.0 / 60.0 - 1.0 / 96.0));
        near(solid.inertia[0][1], -(1.0 / 120.0 - 1.0 / 96.0));
    }

    #[test]
    fn the_hull_stands_in_for_what_bounds_no_volume() {
        let mut open = samples::cube();
        open.triangles.truncate(10);
        let inside_out = Mesh {
            triangles: samples::cube().triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
            ..samples::cube()
        };
        let doubled = samples::union(&[samples::cube(), samples::cube()]);
        for (mesh, watertight) in [(open, false), (inside_out, true), (doubled, true)] {
            let solid = solid(&mesh, watertight).unwrap();
            assert!(solid.from_hull);
            near(solid.volume as f32, 1.0);
            near(solid.inertia[2][2], 1.0 / 6.0);
        }
    }

    #[test]
    fn a_sheet_weighs_nothing() {
        let mut sheet = samples::cube();
        sheet.triangles.truncate(2);
        sheet.vertices.truncate(4);
        assert_eq!(solid(&sheet, false), Err(MeshError::Flat));
    }
}
