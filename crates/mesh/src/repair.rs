//! Mesh repair: duplicate vertices, degenerate and duplicate triangles, inconsistent winding, debris, holes.
//!
//! Winding is the order of a triangle's corners, which defines its outer side.
//!
//! In: any mesh. Out: shared vertices, triangles with consistent outward winding, and a report.
//! Small holes are closed, larger ones counted. Triangles with three distinct corners but zero area stay: they close the
//! gaps at T-junctions.

mod coincident;
mod debris;
mod edges;
mod holes;
mod winding;

use crate::{Location, Mesh, MeshError, bounds};
use coincident::remove_coincident_triangles;
use debris::remove_debris;
use edges::{EdgeDefects, components, half_edges};
use glamx::DVec3;
use glamx::Vec3;
use holes::fill_holes;
use std::collections::HashMap;
pub(crate) use winding::closed_surface;
use winding::orient_triangles;

/// Counts of the repairs and of the remaining defects.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
pub struct RepairReport {
    /// Vertices removed as duplicates within `WELD_TOLERANCE`, or because no triangle uses them.
    pub removed_vertices: usize,
    /// Triangles removed because two of their corners coincide.
    pub degenerate_triangles: usize,
    /// Triangles removed because another one has the same corners: duplicates, and walls between touching
    /// solids.
    pub duplicate_triangles: usize,
    /// Triangles with reversed winding.
    pub flipped_triangles: usize,
    /// Components removed as debris: small ones around the object, or far from it.
    pub debris: usize,
    /// Small holes that were closed.
    pub filled_holes: usize,
    /// Connected components: sets of triangles joined by edges.
    pub components: usize,
    /// Edges with one triangle: the boundaries of holes.
    pub boundary_edges: usize,
    /// Edges with more than two triangles, or with two of inconsistent winding.
    pub non_manifold_edges: usize,
    /// Whether the surface is closed: the triangles run along every edge equally often in both directions.
    pub watertight: bool,
}

/// Max distance of merged vertices (fraction of the diagonal): above f32 noise, below scan resolution.
const WELD_TOLERANCE: f64 = 1e-6;
/// Min surface area (fraction of the squared diagonal); a smaller mesh is a line or a point.
const MIN_AREA: f64 = 1e-6;

/// Repairs a mesh; fails only if a corner index is invalid or no surface remains.
pub fn repair(mesh: Mesh) -> Result<(Mesh, RepairReport), MeshError> {
    let (num_vertices, num_triangles) = (mesh.vertices.len(), mesh.triangles.len());
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        if let Some(&index) = triangle.iter().find(|&&index| index as usize >= num_vertices) {
            let limits = format!("there are {num_vertices}, counted from 0");
            let (location, index) = (Location::Entry("triangle", i), i64::from(index));
            return Err(MeshError::BadIndex { location, index, limits });
        }
    }
    let mut mesh = weld_vertices(mesh);
    let mut report = RepairReport::default();
    mesh.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    report.degenerate_triangles = num_triangles - mesh.triangles.len();
    if !has_area(&mesh) {
        return Err(MeshError::ZeroArea { triangles: num_triangles });
    }
    report.duplicate_triangles = remove_coincident_triangles(&mut mesh);
    report.flipped_triangles = orient_triangles(&mut mesh);
    report.debris = remove_debris(&mut mesh);
    report.filled_holes = fill_holes(&mut mesh);
    let half_edges = half_edges(&mesh);
    let defects = EdgeDefects::of(&mesh, &half_edges);
    report.boundary_edges = defects.boundary;
    report.non_manifold_edges = defects.non_manifold;
    report.watertight = defects.unbalanced == 0;
    (_, report.components) = components(mesh.triangles.len(), &half_edges);
    remove_unused_vertices(&mut mesh);
    report.removed_vertices = num_vertices - mesh.vertices.len();
    Ok((mesh, report))
}

/// Replaces vertices within the tolerance of each other by the first of them in all triangles.
fn weld_vertices(mut mesh: Mesh) -> Mesh {
    let mut is_used = vec![false; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|&i| is_used[i as usize] = true);
    let used: Vec<usize> = (0..is_used.len()).filter(|&i| is_used[i]).collect();
    let points: Vec<Vec3> = used.iter().map(|&i| mesh.vertices[i]).collect();
    let [low, high] = bounds(&points).map(|corner| corner.as_dvec3());
    let tolerance = WELD_TOLERANCE * low.distance(high);
    // Cells are wide enough that most vertices search a single one.
    // The map is never iterated, because its order is random.
    let cell = 8.0 * tolerance;
    let at = |p: DVec3| ((p - low) / cell).floor().as_ivec3().to_array();
    let mut firsts: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    let mut new_index: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for (&i, p) in used.iter().zip(&points) {
        let p = p.as_dvec3();
        let (from, to) = (at(p - tolerance), at(p + tolerance));
        let mut nearest = None;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    let candidates = firsts.get(&[x, y, z]).into_iter().flatten();
                    let mut near = candidates.filter(|&&j| {
                        mesh.vertices[j as usize].as_dvec3().distance_squared(p)
                            <= tolerance * tolerance
                    });
                    nearest = [nearest, near.next().copied()].into_iter().flatten().min();
                }
            }
        }
        match nearest {
            Some(first) => new_index[i] = first,
            None => firsts.entry(at(p)).or_default().push(i as u32),
        }
    }
    mesh.triangles.iter_mut().flatten().for_each(|i| *i = new_index[*i as usize]);
    mesh
}

fn has_area(mesh: &Mesh) -> bool {
    let corner = |i: u32| mesh.vertices[i as usize].as_dvec3();
    let corners: Vec<Vec3> =
        mesh.triangles.iter().flatten().map(|&i| mesh.vertices[i as usize]).collect();
    let [low, high] = bounds(&corners);
    let area = |t: &[u32; 3]| {
        (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length() / 2.0
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    total > MIN_AREA * low.as_dvec3().distance_squared(high.as_dvec3())
}

fn remove_unused_vertices(mesh: &mut Mesh) {
    let mut new_index = vec![u32::MAX; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|&i| new_index[i as usize] = 0);
    let mut kept = Vec::new();
    for (index, &vertex) in new_index.iter_mut().zip(&mesh.vertices) {
        if *index == 0 {
            *index = kept.len() as u32;
            kept.push(vertex);
        }
    }
    mesh.vertices = kept;
    mesh.triangles.iter_mut().flatten().for_each(|i| *i = new_index[*i as usize]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;

    fn flipped(mesh: &Mesh, which: impl Fn(usize) -> bool) -> Mesh {
        let mut mesh = mesh.clone();
        let chosen = mesh.triangles.iter_mut().enumerate().filter(|(i, _)| which(*i));
        chosen.for_each(|(_, triangle)| triangle.swap(0, 1));
        mesh
    }

    #[test]
    fn triangle_soup_becomes_a_watertight_cube() {
        let soup = read(&test_meshes::stl_binary(&test_meshes::cube())).unwrap();
        let (mesh, report) = repair(soup).unwrap();
        let wanted = RepairReport {
            removed_vertices: 28,
            components: 1,
            watertight: true,
            ..RepairReport::default()
        };
        assert_eq!((mesh.vertices.len(), report), (8, wanted));
    }

    #[test]
    fn inward_triangles_are_flipped_outward() {
        for which in [|_| true, |i| i % 3 == 0, |i| i == 0, |i| i > 2] {
            let (mesh, report) = repair(flipped(&test_meshes::cube(), which)).unwrap();
            assert_eq!(test_meshes::volume(&mesh), 1.0);
            assert_eq!(report.flipped_triangles, (0..12).filter(|&i| which(i)).count());
            assert!(report.watertight);
        }
    }

    #[test]
    fn redundant_triangles_and_vertices_are_removed() {
        let mut cube = test_meshes::cube();
        cube.vertices.extend([
            Vec3::splat(9.0),
            Vec3::splat(1e-7),
            Vec3::new(1.0, 1.0, 1.0 - 1e-7),
        ]);
        cube.triangles.extend([[0, 9, 1], [7, 1, 3], [1, 10, 5]]);
        let (mesh, report) = repair(cube).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12), "{report:?}");
        assert_eq!((report.removed_vertices, report.degenerate_triangles), (3, 1));
        assert_eq!(report.duplicate_triangles, 2);
    }

    #[test]
    fn boundary_edges_and_components_are_counted() {
        let mut open = test_meshes::cube();
        open.triangles.truncate(10);
        let (_, report) = repair(open).unwrap();
        assert_eq!((report.boundary_edges, report.watertight), (4, false));
        let far = test_meshes::cube().translated(Vec3::X * 3.0);
        let (mesh, report) =
            repair(test_meshes::union(&[flipped(&far, |_| true), test_meshes::cube()])).unwrap();
        assert_eq!((report.components, test_meshes::volume(&mesh)), (2, 2.0));
        // Two cubes that share an edge: one closed component, with four triangles on a non-manifold edge.
        let diagonal = test_meshes::cube().translated(Vec3::new(1.0, 1.0, 0.0));
        let (mesh, report) = repair(test_meshes::union(&[test_meshes::cube(), diagonal])).unwrap();
        assert_eq!(
            (report.components, report.non_manifold_edges, report.boundary_edges),
            (1, 1, 0)
        );
        assert_eq!((test_meshes::volume(&mesh), report.watertight), (2.0, true));
    }

    #[test]
    fn cavity_faces_inward() {
        let inner = test_meshes::cuboid(Vec3::splat(0.25), Vec3::splat(0.75));
        let hollow = test_meshes::union(&[test_meshes::cube(), flipped(&inner, |_| true)]);
        for mesh in [hollow.clone(), flipped(&hollow, |_| true)] {
            let (mesh, report) = repair(mesh).unwrap();
            assert_eq!((test_meshes::volume(&mesh), report.watertight), (0.875, true));
        }
    }

    #[test]
    fn object_in_a_cup_is_not_a_cavity() {
        // A gutter of 4 x 4 x 3 with walls of thickness 1, and a cube of 0.5: first in it, then in its wall.
        let outline =
            [[0., 0.], [4., 0.], [4., 4.], [3., 4.], [3., 1.], [1., 1.], [1., 4.], [0., 4.]];
        let caps = [[0, 1, 5], [1, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]];
        let gutter = test_meshes::prism(&outline, &caps, 3.0);
        let at = |x: f32, y: f32| {
            test_meshes::cuboid(Vec3::new(x, y, 1.0), Vec3::new(x + 0.5, y + 0.5, 1.5))
        };
        for (cube, volume) in [(at(1.75, 2.0), 30.0 + 0.125), (at(0.25, 2.0), 30.0 - 0.125)] {
            let (mesh, _) =
                repair(test_meshes::union(&[gutter.clone(), flipped(&cube, |_| true)])).unwrap();
            assert_eq!(test_meshes::volume(&mesh), volume);
        }
    }

    #[test]
    fn mesh_without_area_is_rejected() {
        let line = (0..3).map(|i| Vec3::splat(i as f32)).collect::<Vec<_>>();
        let needle = Mesh { vertices: line, triangles: vec![[0, 1, 2]] };
        assert_eq!(repair(needle), Err(MeshError::ZeroArea { triangles: 1 }));
        let point = Mesh { vertices: vec![Vec3::ONE; 3], triangles: vec![[0, 1, 2]] };
        assert_eq!(repair(point), Err(MeshError::ZeroArea { triangles: 1 }));
        let wrong = Mesh { vertices: vec![Vec3::ONE; 2], triangles: vec![[0, 1, 2]] };
        assert!(matches!(repair(wrong), Err(MeshError::BadIndex { index: 2, .. })));
    }
}
