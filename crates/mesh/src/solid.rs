//! Mass properties of an imported mesh, whose surface may be open or consist of solids that overlap.
//!
//! The hull of something hollow is many times its volume. An open mesh is therefore measured by its convex
//! parts, and open pieces of an otherwise closed mesh are left out.

use crate::convex_hull::convex_hull;
use crate::mass_properties::{HULL_POINTS, MAX_HULL_RATIO, VolumeIntegrals};
use crate::overlap::overlap;
use crate::repair::closed_surface;
use crate::{MassProperties, Mesh, MeshError, VolumeSource, decompose};

/// Min area of the closed surfaces (fraction of the mesh) if open ones are left out.
const MIN_CLOSED_AREA: f64 = 0.75;
/// Min size of the closed surfaces (fraction of the diagonal of the mesh) if open ones are left out.
const MIN_CLOSED_SIZE: f64 = 0.9;
/// Min common volume of overlapping solids (fraction) that is subtracted; below it, the surface is exact.
const MIN_OVERLAP: f64 = 0.01;

/// Mass properties of a repaired mesh (m); fails if the mesh is flat.
///
/// `watertight` is [`RepairReport::watertight`](crate::RepairReport::watertight).
pub fn solid_properties(mesh: &Mesh, watertight: bool) -> Result<MassProperties, MeshError> {
    let hull = convex_hull(&mesh.vertices, HULL_POINTS).ok_or(MeshError::Flat)?;
    let of_hull = VolumeIntegrals::of(&hull);
    let max_volume = MAX_HULL_RATIO * of_hull.volume;
    let measured = match watertight {
        true => without_overlap(mesh, VolumeSource::Surface, max_volume),
        false => dominant_closed_surface(mesh)
            .and_then(|closed| without_overlap(&closed, VolumeSource::ClosedSurfaces, max_volume)),
    };
    let measured = measured.or_else(|| {
        let parts = union_of_hulls(&decompose(mesh).hulls);
        without_overlap(&parts, VolumeSource::ConvexParts, max_volume)
    });
    measured.map_or_else(|| of_hull.properties(VolumeSource::Hull), Ok)
}

/// Mass properties of closed surfaces; common volume counts once. `None` if they are not valid.
fn without_overlap(mesh: &Mesh, source: VolumeSource, max_volume: f64) -> Option<MassProperties> {
    let mut integrals = VolumeIntegrals::of(mesh);
    let mut source = source;
    if let Some(overlap) = overlap(mesh, integrals.origin)
        && overlap.volume > MIN_OVERLAP * integrals.volume
    {
        integrals.volume -= overlap.volume;
        integrals.first -= overlap.first;
        integrals.second -= overlap.second;
        if source == VolumeSource::Surface {
            source = VolumeSource::Union;
        }
    }
    let is_valid = integrals.volume > 0.0 && integrals.volume <= max_volume;
    if is_valid { integrals.properties(source).ok() } else { None }
}

/// The closed surfaces of a mesh, if they are nearly all of it.
fn dominant_closed_surface(mesh: &Mesh) -> Option<Mesh> {
    let closed = closed_surface(mesh, MIN_CLOSED_AREA)?;
    let corners = closed.triangles.iter().flatten().map(|&i| closed.vertices[i as usize]);
    let [low, high] = crate::bounds(&corners.collect::<Vec<_>>());
    (low.distance(high) >= MIN_CLOSED_SIZE as f32 * mesh.extent().length()).then_some(closed)
}

/// Surfaces of the hulls, as one mesh.
fn union_of_hulls(hulls: &[Vec<glamx::Vec3>]) -> Mesh {
    let mut all = Mesh::default();
    for hull in hulls.iter().filter_map(|points| convex_hull(points, usize::MAX)) {
        let first = all.vertices.len() as u32;
        all.vertices.extend(hull.vertices);
        all.triangles.extend(hull.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::repair;
    use crate::test_meshes;
    use glamx::Vec3;

    fn near(got: f64, wanted: f64, tolerance: f64) {
        assert!((got / wanted - 1.0).abs() < tolerance, "wanted {wanted}, got {got}");
    }

    fn measure(mesh: Mesh) -> (Mesh, MassProperties) {
        let (mesh, report) = repair(mesh).unwrap();
        let properties = solid_properties(&mesh, report.watertight).unwrap();
        (mesh, properties)
    }

    /// C-shaped bracket of 80 x 80 x 40 mm and 126 cm³.
    fn bracket() -> Mesh {
        let outline = [
            [0.0, 0.0],
            [0.08, 0.0],
            [0.08, 0.015],
            [0.015, 0.015],
            [0.015, 0.065],
            [0.08, 0.065],
            [0.08, 0.08],
            [0.0, 0.08],
        ];
        let caps = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 7], [4, 5, 6], [4, 6, 7]];
        test_meshes::prism(&outline, &caps, 0.04)
    }

    #[test]
    fn loose_triangle_in_a_closed_mesh_has_no_volume() {
        // One shares an edge with the bracket, the other floats 0.2 mm above it.
        let mut fin = bracket();
        fin.triangles.push([0, 8, 12]);
        let decal = [[5.0, 5.0], [35.0, 5.0], [5.0, 12.0]]
            .map(|[x, y]: [f32; 2]| Vec3::new(x, y, 40.2) / 1000.0);
        let decal = Mesh { vertices: decal.to_vec(), triangles: vec![[0, 1, 2]] };
        for mesh in [fin, test_meshes::union(&[bracket(), decal])] {
            let (_, properties) = measure(mesh);
            assert_eq!(properties.source, VolumeSource::ClosedSurfaces);
            near(properties.volume, 126e-6, 1e-4);
            near(properties.center_of_mass.z.into(), 0.02, 1e-4);
        }
    }

    #[test]
    fn common_volume_of_overlapping_solids_counts_once() {
        // Jack of three bars, 20 x 20 x 100 mm: 3 x 40 cm³, less twice the cube of 8 cm³ that they share.
        let bar = |half: Vec3| test_meshes::cuboid(-half, half);
        let [s, l] = [0.01, 0.05];
        let jack = test_meshes::union(&[
            bar(Vec3::new(l, s, s)),
            bar(Vec3::new(s, l, s)),
            bar(Vec3::new(s, s, l)),
        ]);
        let (_, properties) = measure(jack);
        assert_eq!(properties.source, VolumeSource::Union);
        near(properties.volume, 104e-6, 0.01);
        // Solid bars: (m_bar (w² + l²) / 12) twice and m_bar w² / 6 once, less the shared cube twice.
        let (w, l): (f64, f64) = (0.02, 0.1);
        let wanted =
            2.0 * 40e-6 * (w * w + l * l) / 12.0 + 40e-6 * w * w / 6.0 - 16e-6 * w * w / 6.0;
        near(properties.inertia[2][2].into(), wanted, 0.01);
        assert!(properties.center_of_mass.length() < 2e-4, "{}", properties.center_of_mass);
    }

    #[test]
    fn doubled_solid_counts_once() {
        let shifted = test_meshes::cube().translated(Vec3::splat(1e-3));
        let (_, properties) = measure(test_meshes::union(&[test_meshes::cube(), shifted]));
        near(properties.volume, 1.0, 0.01);
    }

    #[test]
    fn open_box_is_measured_by_its_walls() {
        let mut mesh = test_meshes::cuboid(Vec3::ZERO, Vec3::splat(0.1));
        mesh.triangles.retain(|t| t.iter().any(|&i| i < 4));
        let (_, properties) = measure(mesh);
        assert_eq!(properties.source, VolumeSource::ConvexParts);
        assert!(properties.volume < 0.25e-3, "{} m³", properties.volume);
        assert!(properties.center_of_mass.z < 0.045, "{}", properties.center_of_mass);
    }

    #[test]
    fn closed_mesh_has_the_values_of_its_surface() {
        let wanted = crate::mass_properties(&test_meshes::l_shape(), true).unwrap();
        assert_eq!(solid_properties(&test_meshes::l_shape(), true).unwrap(), wanted);
    }
}
