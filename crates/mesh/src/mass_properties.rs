//! Volume, centre of mass and inertia of a solid, from its surface by the divergence theorem.
//!
//! Sums in double precision about the centre of the bounding box.

use crate::convex_hull::convex_hull;
use crate::{Mesh, MeshError};
use glamx::Vec3;
use glamx::{DMat3, DVec3};
use serde::Serialize;

/// Mass properties for a density of 1 kg/m³; multiply by the density (kg/m³).
#[derive(Clone, Debug, PartialEq)]
pub struct MassProperties {
    /// Volume (m³).
    pub volume: f64,
    /// Centre of mass (m), mesh frame.
    pub center_of_mass: Vec3,
    /// Inertia about the centre of mass for a density of 1 kg/m³ (m⁵), rows, axes of the mesh frame.
    pub inertia: [[f32; 3]; 3],
    /// Solid from which the values are computed.
    pub source: VolumeSource,
}

/// Solid from which volume, centre of mass and inertia are computed; serialized in snake case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum VolumeSource {
    /// The closed surface.
    Surface,
    /// The closed surfaces of the mesh, without open ones that enclose no volume.
    ClosedSurfaces,
    /// The union of solids that overlap: their common volume counts once.
    Union,
    /// The convex parts, because the surface is open.
    ConvexParts,
    /// The convex hull, because neither the surface nor the convex parts have a valid volume.
    Hull,
}

/// Max number of vertices of the hull that replaces a mesh or bounds its volume.
pub(super) const HULL_POINTS: usize = 2000;
/// Max ratio of a mesh's volume to its hull's: the limited hull of a round solid is slightly too small.
pub(super) const MAX_HULL_RATIO: f64 = 1.01;

/// Mass properties of a mesh (m) if it is watertight and 0 < volume <= hull volume; else those of its hull.
///
/// `watertight` is [`RepairReport::watertight`](crate::RepairReport::watertight). Fails if the mesh is flat.
pub fn mass_properties(mesh: &Mesh, watertight: bool) -> Result<MassProperties, MeshError> {
    let hull = convex_hull(&mesh.vertices, HULL_POINTS).ok_or(MeshError::Flat)?;
    let (of_mesh, of_hull) = (VolumeIntegrals::of(mesh), VolumeIntegrals::of(&hull));
    let is_valid = of_mesh.volume > 0.0
        && of_mesh.volume <= MAX_HULL_RATIO * of_hull.volume
        && of_mesh.is_physical();
    match watertight && is_valid {
        true => of_mesh.properties(VolumeSource::Surface),
        false => of_hull.properties(VolumeSource::Hull),
    }
}

impl MassProperties {
    /// Values after a translation (m) of the mesh.
    pub fn translated(self, offset: Vec3) -> Self {
        Self { center_of_mass: self.center_of_mass + offset, ..self }
    }

    /// Values after a rotation of the mesh about the origin.
    pub fn rotated(self, rotation: &DMat3) -> Self {
        let rows = self.inertia.map(|row| DVec3::from_array(row.map(f64::from)));
        // The inertia is symmetric: its rows are its columns.
        let inertia =
            *rotation * DMat3::from_cols(rows[0], rows[1], rows[2]) * rotation.transpose();
        let center_of_mass = (*rotation * self.center_of_mass.as_dvec3()).as_vec3();
        Self { center_of_mass, inertia: rows_of(&inertia), ..self }
    }
}

fn rows_of(matrix: &DMat3) -> [[f32; 3]; 3] {
    [0, 1, 2].map(|row| matrix.row(row).to_array().map(|x| x as f32))
}

/// Enclosed volume (m³), negative if the faces point inward.
pub(super) fn volume(mesh: &Mesh) -> f64 {
    VolumeIntegrals::of(mesh).volume
}

/// Integrals of 1, x and x xᵀ over the solid, with x relative to `origin`.
#[derive(Clone)]
pub(super) struct VolumeIntegrals {
    pub(super) origin: DVec3,
    pub(super) volume: f64,
    pub(super) first: DVec3,
    pub(super) second: DMat3,
}

impl VolumeIntegrals {
    pub(super) fn of(mesh: &Mesh) -> Self {
        let [low, high] = mesh.bounds();
        let origin = (low.as_dvec3() + high.as_dvec3()) / 2.0;
        let mut sum = Self { origin, volume: 0.0, first: DVec3::ZERO, second: DMat3::ZERO };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize].as_dvec3() - origin);
            // Tetrahedron from the origin: V = det / 6, ∫x = V s / 4, ∫x xᵀ = V (s sᵀ + Σ v vᵀ) / 20.
            let det = a.dot(b.cross(c));
            let s = a + b + c;
            sum.volume += det / 6.0;
            sum.first += s * (det / 24.0);
            sum.second +=
                (outer_product(s) + outer_product(a) + outer_product(b) + outer_product(c))
                    * (det / 120.0);
        }
        sum
    }

    /// Centre of mass relative to `origin`.
    fn center(&self) -> DVec3 {
        self.first / self.volume
    }

    /// I = tr(C) 1 - C about the centre of mass, with C = ∫x xᵀ - V c cᵀ.
    fn inertia(&self) -> DMat3 {
        let c = self.second - outer_product(self.center()) * self.volume;
        DMat3::IDENTITY * (c.x_axis.x + c.y_axis.y + c.z_axis.z) - c
    }

    /// Mass properties; fails if no body can have them.
    pub(super) fn properties(&self, source: VolumeSource) -> Result<MassProperties, MeshError> {
        if !(self.volume > 0.0 && self.is_physical()) {
            return Err(MeshError::Flat);
        }
        Ok(MassProperties {
            volume: self.volume,
            center_of_mass: (self.origin + self.center()).as_vec3(),
            inertia: rows_of(&self.inertia()),
            source,
        })
    }

    /// Whether a body can have this inertia: each moment is positive and less than the sum of the other two.
    pub(super) fn is_physical(&self) -> bool {
        let i = self.inertia();
        let [x, y, z] = [i.x_axis.x, i.y_axis.y, i.z_axis.z];
        let min = f64::from(f32::MIN_POSITIVE);
        x > min && y > min && z > min && x < y + z && y < z + x && z < x + y
    }
}

pub(super) fn outer_product(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes;

    fn near(got: f32, wanted: f32) {
        assert!(
            (got - wanted).abs() <= 1e-5 * wanted.abs().max(1e-3),
            "wanted {wanted}, got {got}"
        );
    }

    #[test]
    fn box_matches_the_closed_form() {
        let (low, high) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.2, 2.3, 3.4));
        let properties = mass_properties(&test_meshes::cuboid(low, high), true).unwrap();
        let side = high - low;
        let volume = side.x * side.y * side.z;
        assert_eq!(properties.source, VolumeSource::Surface);
        near(properties.volume as f32, volume);
        (0..3).for_each(|i| near(properties.center_of_mass[i], (low[i] + high[i]) / 2.0));
        let square = side * side;
        near(properties.inertia[0][0], volume / 12.0 * (square.y + square.z));
        near(properties.inertia[1][1], volume / 12.0 * (square.x + square.z));
        near(properties.inertia[2][2], volume / 12.0 * (square.x + square.y));
        assert!(properties.inertia[0][1].abs() < 1e-8, "{:?}", properties.inertia);
    }

    #[test]
    fn tetrahedron_matches_the_closed_form() {
        let vertices = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let properties = mass_properties(&Mesh { vertices, triangles }, true).unwrap();
        near(properties.volume as f32, 1.0 / 6.0);
        near(properties.center_of_mass.x, 0.25);
        // ∫x² = 1/60 and ∫xy = 1/120 about the corner, shifted to the centre (1/4, 1/4, 1/4).
        near(properties.inertia[0][0], 2.0 * (1.0 / 60.0 - 1.0 / 96.0));
        near(properties.inertia[0][1], -(1.0 / 120.0 - 1.0 / 96.0));
    }

    #[test]
    fn hull_replaces_a_mesh_without_valid_volume() {
        let mut open = test_meshes::cube();
        open.triangles.truncate(10);
        let inside_out = Mesh {
            triangles: test_meshes::cube().triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
            ..test_meshes::cube()
        };
        let doubled = test_meshes::union(&[test_meshes::cube(), test_meshes::cube()]);
        for (mesh, watertight) in [(open, false), (inside_out, true), (doubled, true)] {
            let properties = mass_properties(&mesh, watertight).unwrap();
            assert_eq!(properties.source, VolumeSource::Hull);
            near(properties.volume as f32, 1.0);
            near(properties.inertia[2][2], 1.0 / 6.0);
        }
    }

    #[test]
    fn sheet_is_rejected_as_flat() {
        let mut sheet = test_meshes::cube();
        sheet.triangles.truncate(2);
        sheet.vertices.truncate(4);
        assert_eq!(mass_properties(&sheet, false), Err(MeshError::Flat));
    }
}
