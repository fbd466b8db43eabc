//! Mesh repair: duplicate vertices, degenerate and duplicate triangles, inconsistent winding.
//!
//! In: any mesh. Out: shared vertices, triangles with consistent outward winding, and a report.
//! Holes are counted, not filled. Triangles with three distinct corners but zero area stay: they close the
//! gaps at T-junctions.

use crate::{Location, Mesh, MeshError, bounds};
use glamx::DVec3;
use glamx::Vec3;
use std::collections::HashMap;

/// Counts of the repairs and of the remaining defects.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RepairReport {
    /// Vertices removed as duplicates within `WELD_TOLERANCE`, or because no triangle uses them.
    pub removed_vertices: usize,
    /// Triangles removed because two of their corners coincide.
    pub degenerate_triangles: usize,
    /// Triangles removed because another one has the same corners.
    pub duplicate_triangles: usize,
    /// Triangles with reversed winding.
    pub flipped_triangles: usize,
    /// Connected components: sets of triangles joined by edges.
    pub components: usize,
    /// Edges with one triangle: the boundaries of holes.
    pub boundary_edges: usize,
    /// Edges with more than two triangles, or with two of inconsistent winding.
    pub non_manifold_edges: usize,
    /// Whether every edge joins exactly two triangles of consistent winding.
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
    report.duplicate_triangles = remove_duplicate_triangles(&mut mesh);
    orient_triangles(&mut mesh, &mut report);
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

/// Removes all but the first of the triangles with the same corners; returns the number removed.
fn remove_duplicate_triangles(mesh: &mut Mesh) -> usize {
    let mut keys: Vec<([u32; 3], usize)> = mesh.triangles.iter().copied().zip(0..).collect();
    keys.iter_mut().for_each(|(key, _)| key.sort_unstable());
    keys.sort_unstable();
    keys.dedup_by_key(|(key, _)| *key);
    let mut kept: Vec<usize> = keys.into_iter().map(|(_, index)| index).collect();
    kept.sort_unstable();
    let num_removed = mesh.triangles.len() - kept.len();
    mesh.triangles = kept.into_iter().map(|i| mesh.triangles[i]).collect();
    num_removed
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

/// Half-edge: the lower and the higher vertex index of its edge, and its number 3 * triangle + side.
type HalfEdge = (u32, u32, usize);

/// Half-edges of all triangles, sorted by edge.
fn half_edges(mesh: &Mesh) -> Vec<HalfEdge> {
    let of_triangle = |(i, t): (usize, &[u32; 3])| {
        [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            (a.min(b), a.max(b), 3 * i + k)
        })
    };
    let mut all: Vec<HalfEdge> = mesh.triangles.iter().enumerate().flat_map(of_triangle).collect();
    all.sort_unstable();
    all
}

/// Whether a half-edge runs from the lower to the higher vertex index.
fn is_forward(mesh: &Mesh, half_edge: usize) -> bool {
    let triangle = mesh.triangles[half_edge / 3];
    triangle[half_edge % 3] < triangle[(half_edge + 1) % 3]
}

/// Makes the winding consistent within each patch, then flips patches outward; completes the report.
fn orient_triangles(mesh: &mut Mesh, report: &mut RepairReport) {
    let half_edges = half_edges(mesh);
    let edges = || half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
    let mut twins = vec![usize::MAX; half_edges.len()];
    for edge in edges() {
        if let [a, b] = edge {
            twins[a.2] = b.2;
            twins[b.2] = a.2;
        }
    }
    let (patch_of, mut is_flipped, patches) = find_patches(mesh, &twins);
    let flips_patch = patches_to_flip(mesh, &patch_of, &patches);
    for (is_flipped, &patch) in is_flipped.iter_mut().zip(&patch_of) {
        *is_flipped ^= flips_patch[patch];
    }
    for (triangle, _) in mesh.triangles.iter_mut().zip(&is_flipped).filter(|(_, flip)| **flip) {
        triangle.swap(1, 2);
        report.flipped_triangles += 1;
    }
    let mut parent: Vec<usize> = (0..patches.len()).collect();
    // Flipping a triangle renumbers its half-edges but does not change their edges.
    for edge in edges() {
        let forward = edge.iter().filter(|side| {
            let triangle = mesh.triangles[side.2 / 3];
            (0..3).any(|k| (triangle[k], triangle[(k + 1) % 3]) == (side.0, side.1))
        });
        match (edge.len(), forward.count()) {
            (1, _) => report.boundary_edges += 1,
            (2, 1) => {}
            _ => report.non_manifold_edges += 1,
        }
        for side in edge {
            let [a, b] = [edge[0].2, side.2].map(|s| find_root(&mut parent, patch_of[s / 3]));
            parent[a.max(b)] = a.min(b);
        }
    }
    report.components = (0..parent.len()).filter(|&i| parent[i] == i).count();
    report.watertight = report.boundary_edges == 0 && report.non_manifold_edges == 0;
}

/// Root of the connected component of `patch` (union-find with path halving).
fn find_root(parent: &mut [usize], mut patch: usize) -> usize {
    while parent[patch] != patch {
        parent[patch] = parent[parent[patch]];
        patch = parent[patch];
    }
    patch
}

/// Triangles connected across edges with exactly two triangles.
struct Patch {
    /// Signed volume about the centre of the bounding box, negative if the faces point inward.
    volume: f64,
    bounds: [Vec3; 2],
    /// Position of one vertex.
    corner: DVec3,
    is_closed: bool,
}

/// Patch of each triangle, whether to flip it for consistency with the first of its patch, and all patches.
fn find_patches(mesh: &Mesh, twins: &[usize]) -> (Vec<usize>, Vec<bool>, Vec<Patch>) {
    let count = mesh.triangles.len();
    let mut patch_of = vec![usize::MAX; count];
    let mut is_flipped = vec![false; count];
    let mut patches = Vec::new();
    for seed in 0..count {
        if patch_of[seed] != usize::MAX {
            continue;
        }
        patch_of[seed] = patches.len();
        let mut members = vec![seed];
        let mut next = 0;
        let mut is_closed = true;
        while let Some(&current) = members.get(next) {
            next += 1;
            for side in [0, 1, 2].map(|k| 3 * current + k) {
                let twin = twins[side];
                if twin == usize::MAX {
                    is_closed = false;
                } else if patch_of[twin / 3] == usize::MAX {
                    patch_of[twin / 3] = patches.len();
                    // Neighbours of consistent winding run along their edge in opposite directions.
                    let is_inconsistent = is_forward(mesh, side) == is_forward(mesh, twin);
                    is_flipped[twin / 3] = is_flipped[current] ^ is_inconsistent;
                    members.push(twin / 3);
                }
            }
        }
        let corners = |i: usize| mesh.triangles[i].map(|v| mesh.vertices[v as usize]);
        let points: Vec<Vec3> = members.iter().flat_map(|&i| corners(i)).collect();
        let bounds = bounds(&points);
        let center = (bounds[0].as_dvec3() + bounds[1].as_dvec3()) / 2.0;
        let volumes = members.iter().map(|&i| {
            let [a, b, c] = corners(i).map(|p| p.as_dvec3() - center);
            a.dot(b.cross(c)) / if is_flipped[i] { -6.0 } else { 6.0 }
        });
        let (volume, corner) = (volumes.sum(), corners(seed)[0].as_dvec3());
        patches.push(Patch { volume, bounds, corner, is_closed });
    }
    (patch_of, is_flipped, patches)
}

/// Whether to flip each patch so that it faces outward.
///
/// A closed patch inside the largest one, with opposite winding in the file, is a cavity and faces inward.
fn patches_to_flip(mesh: &Mesh, patch_of: &[usize], patches: &[Patch]) -> Vec<bool> {
    let closed = (0..patches.len()).filter(|&i| patches[i].is_closed);
    let largest =
        closed.max_by(|&a, &b| patches[a].volume.abs().total_cmp(&patches[b].volume.abs()));
    let is_cavity = |patch: &Patch| {
        largest.is_some_and(|largest| {
            let shell = &patches[largest];
            let is_within = patch.bounds[0].cmpgt(shell.bounds[0]).all()
                && patch.bounds[1].cmplt(shell.bounds[1]).all();
            let is_opposite = patch.volume * shell.volume < 0.0;
            // An object in a cup is within the cup's bounding box, but not inside its surface.
            let triangles = mesh.triangles.iter().zip(patch_of);
            let triangles = triangles.filter(|(_, of)| **of == largest);
            let corners = triangles.map(|(t, _)| t.map(|v| mesh.vertices[v as usize].as_dvec3()));
            patch.is_closed && is_within && is_opposite && is_inside(patch.corner, corners)
        })
    };
    patches.iter().map(|patch| (patch.volume < 0.0) != is_cavity(patch)).collect()
}

/// Whether a closed surface encloses a point: an oblique ray crosses it an odd number of times.
fn is_inside(point: DVec3, surface: impl Iterator<Item = [DVec3; 3]>) -> bool {
    const RAY: DVec3 = DVec3::new(0.437, 0.293, 0.851);
    let is_crossed = |triangle: [DVec3; 3]| {
        let [a, b, c] = triangle.map(|corner| corner - point);
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|side| side.dot(RAY));
        let is_on_line = sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0);
        let normal = (b - a).cross(c - a);
        is_on_line && a.dot(normal) * RAY.dot(normal) > 0.0
    };
    surface.filter(|&triangle| is_crossed(triangle)).count() % 2 == 1
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
        // Two cubes that share an edge: one component, with four triangles on a non-manifold edge.
        let diagonal = test_meshes::cube().translated(Vec3::new(1.0, 1.0, 0.0));
        let (mesh, report) = repair(test_meshes::union(&[test_meshes::cube(), diagonal])).unwrap();
        assert_eq!(
            (report.components, report.non_manifold_edges, report.boundary_edges),
            (1, 1, 0)
        );
        assert_eq!((test_meshes::volume(&mesh), report.watertight), (2.0, false));
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
