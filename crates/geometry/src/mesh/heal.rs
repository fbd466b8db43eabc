//! Repairs what exporters and scanners leave behind: split vertices, spare triangles, turned faces.
//!
//! In: any mesh. Out: shared vertices, triangles that turn the same way round and outward, and a report.
//! Holes are counted, not filled. Triangles without area but with three distinct corners stay: they close
//! the gaps that long edges beside short ones would leave.

use super::{Mesh, MeshError, Place, bounds};
use crate::Vec3;
use glamx::DVec3;
use std::collections::HashMap;

/// What was repaired, and what is still open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Healing {
    /// Vertices dropped because another lies in the same place, or because no triangle uses them.
    pub merged_vertices: usize,
    /// Triangles dropped because two of their corners coincide.
    pub degenerate_triangles: usize,
    /// Triangles dropped because another has the same corners.
    pub duplicate_triangles: usize,
    /// Triangles turned round.
    pub flipped_triangles: usize,
    /// Pieces that share no edge with each other.
    pub components: usize,
    /// Edges of one triangle: the rims of holes.
    pub open_edges: usize,
    /// Edges of more than two triangles, or of two that cannot turn the same way round.
    pub tangled_edges: usize,
    /// Whether every edge joins exactly two triangles that turn the same way round.
    pub watertight: bool,
}

/// Vertices this near are one (fraction of the diagonal): coarser than f32 noise, finer than any scan.
const MERGE: f64 = 1e-6;
/// A surface smaller than this (fraction of the squared diagonal) is a line or a point.
const NO_AREA: f64 = 1e-6;

/// Heals a mesh; an error only if a corner index is wrong or no surface is left.
pub fn heal(mesh: Mesh) -> Result<(Mesh, Healing), MeshError> {
    let (num_vertices, num_triangles) = (mesh.vertices.len(), mesh.triangles.len());
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        if let Some(&index) = triangle.iter().find(|&&index| index as usize >= num_vertices) {
            let limits = format!("there are {num_vertices}, counted from 0");
            let (place, index) = (Place::Entry("triangle", i), i64::from(index));
            return Err(MeshError::BadIndex { place, index, limits });
        }
    }
    let mut mesh = merge_vertices(mesh);
    let mut healing = Healing::default();
    mesh.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    healing.degenerate_triangles = num_triangles - mesh.triangles.len();
    if !has_area(&mesh) {
        return Err(MeshError::ZeroArea { triangles: num_triangles });
    }
    healing.duplicate_triangles = drop_duplicates(&mut mesh);
    orient(&mut mesh, &mut healing);
    drop_unused(&mut mesh);
    healing.merged_vertices = num_vertices - mesh.vertices.len();
    Ok((mesh, healing))
}

/// Lets the triangles use one vertex where several lie within the tolerance: the first of them.
fn merge_vertices(mut mesh: Mesh) -> Mesh {
    let mut is_used = vec![false; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|&i| is_used[i as usize] = true);
    let used: Vec<usize> = (0..is_used.len()).filter(|&i| is_used[i]).collect();
    let points: Vec<Vec3> = used.iter().map(|&i| mesh.vertices[i]).collect();
    let [low, high] = bounds(&points).map(|corner| corner.as_dvec3());
    let tolerance = MERGE * low.distance(high);
    // Cells so wide that most vertices need to look into their own only. The map is asked, never listed.
    let cell = 8.0 * tolerance;
    let at = |p: DVec3| ((p - low) / cell).floor().as_ivec3().to_array();
    let mut firsts: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    let mut renamed: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
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
            Some(first) => renamed[i] = first,
            None => firsts.entry(at(p)).or_default().push(i as u32),
        }
    }
    mesh.triangles.iter_mut().flatten().for_each(|i| *i = renamed[*i as usize]);
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
    total > NO_AREA * low.as_dvec3().distance_squared(high.as_dvec3())
}

/// Keeps the first of the triangles with the same corners; returns how many were dropped.
fn drop_duplicates(mesh: &mut Mesh) -> usize {
    let mut keys: Vec<([u32; 3], usize)> = mesh.triangles.iter().copied().zip(0..).collect();
    keys.iter_mut().for_each(|(key, _)| key.sort_unstable());
    keys.sort_unstable();
    keys.dedup_by_key(|(key, _)| *key);
    let mut kept: Vec<usize> = keys.into_iter().map(|(_, index)| index).collect();
    kept.sort_unstable();
    let num_dropped = mesh.triangles.len() - kept.len();
    mesh.triangles = kept.into_iter().map(|i| mesh.triangles[i]).collect();
    num_dropped
}

fn drop_unused(mesh: &mut Mesh) {
    let mut renamed = vec![u32::MAX; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|&i| renamed[i as usize] = 0);
    let mut kept = Vec::new();
    for (name, &vertex) in renamed.iter_mut().zip(&mesh.vertices) {
        if *name == 0 {
            *name = kept.len() as u32;
            kept.push(vertex);
        }
    }
    mesh.vertices = kept;
    mesh.triangles.iter_mut().flatten().for_each(|i| *i = renamed[*i as usize]);
}

/// One side of a triangle: its edge's vertices, the lower first, and its number 3 * triangle + side.
type Side = (u32, u32, usize);

/// The sides of all triangles, those of one edge together.
fn sides(mesh: &Mesh) -> Vec<Side> {
    let sides = |(i, t): (usize, &[u32; 3])| {
        [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            (a.min(b), a.max(b), 3 * i + k)
        })
    };
    let mut sides: Vec<Side> = mesh.triangles.iter().enumerate().flat_map(sides).collect();
    sides.sort_unstable();
    sides
}

/// Whether a side runs from the lower vertex to the higher.
fn runs_up(mesh: &Mesh, side: usize) -> bool {
    let triangle = mesh.triangles[side / 3];
    triangle[side % 3] < triangle[(side + 1) % 3]
}

/// Turns all triangles the same way round, patch by patch, then each patch outward; fills in the report.
fn orient(mesh: &mut Mesh, healing: &mut Healing) {
    let sides = sides(mesh);
    let edges = || sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
    let mut twins = vec![usize::MAX; sides.len()];
    for edge in edges() {
        if let [a, b] = edge {
            twins[a.2] = b.2;
            twins[b.2] = a.2;
        }
    }
    let (patch_of, mut is_turned, patches) = patches(mesh, &twins);
    let turns = outward(mesh, &patch_of, &patches);
    for (turned, &patch) in is_turned.iter_mut().zip(&patch_of) {
        *turned ^= turns[patch];
    }
    for (triangle, _) in mesh.triangles.iter_mut().zip(&is_turned).filter(|(_, turned)| **turned) {
        triangle.swap(1, 2);
        healing.flipped_triangles += 1;
    }
    let mut leader: Vec<usize> = (0..patches.len()).collect();
    // Turning a triangle moves its sides to other numbers but not to other edges.
    for edge in edges() {
        let ups = edge.iter().filter(|side| {
            let triangle = mesh.triangles[side.2 / 3];
            (0..3).any(|k| (triangle[k], triangle[(k + 1) % 3]) == (side.0, side.1))
        });
        match (edge.len(), ups.count()) {
            (1, _) => healing.open_edges += 1,
            (2, 1) => {}
            _ => healing.tangled_edges += 1,
        }
        for side in edge {
            let [a, b] = [edge[0].2, side.2].map(|s| lead(&mut leader, patch_of[s / 3]));
            leader[a.max(b)] = a.min(b);
        }
    }
    healing.components = (0..leader.len()).filter(|&i| leader[i] == i).count();
    healing.watertight = healing.open_edges == 0 && healing.tangled_edges == 0;
}

/// The first of the patches that were found to hang together with `patch`.
fn lead(leader: &mut [usize], mut patch: usize) -> usize {
    while leader[patch] != patch {
        leader[patch] = leader[leader[patch]];
        patch = leader[patch];
    }
    patch
}

/// Triangles connected across edges of two.
struct Patch {
    /// Enclosed volume about its middle, negative if it is inside out.
    volume: f64,
    bounds: [Vec3; 2],
    /// One of its corners.
    corner: DVec3,
    is_closed: bool,
}

/// For each triangle its patch and whether it must turn to go with the first of the patch; and the patches.
fn patches(mesh: &Mesh, twins: &[usize]) -> (Vec<usize>, Vec<bool>, Vec<Patch>) {
    let count = mesh.triangles.len();
    let mut patch_of = vec![usize::MAX; count];
    let mut is_turned = vec![false; count];
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
                    // Neighbours that go together run along their edge in opposite directions.
                    let is_against = runs_up(mesh, side) == runs_up(mesh, twin);
                    is_turned[twin / 3] = is_turned[current] ^ is_against;
                    members.push(twin / 3);
                }
            }
        }
        let corners = |i: usize| mesh.triangles[i].map(|v| mesh.vertices[v as usize]);
        let points: Vec<Vec3> = members.iter().flat_map(|&i| corners(i)).collect();
        let bounds = bounds(&points);
        let middle = (bounds[0].as_dvec3() + bounds[1].as_dvec3()) / 2.0;
        let volumes = members.iter().map(|&i| {
            let [a, b, c] = corners(i).map(|p| p.as_dvec3() - middle);
            a.dot(b.cross(c)) / if is_turned[i] { -6.0 } else { 6.0 }
        });
        let (volume, corner) = (volumes.sum(), corners(seed)[0].as_dvec3());
        patches.push(Patch { volume, bounds, corner, is_closed });
    }
    (patch_of, is_turned, patches)
}

/// Which patches must turn to face outward.
///
/// A closed patch inside the largest that faces the other way in the file is a cavity and faces inward.
fn outward(mesh: &Mesh, patch_of: &[usize], patches: &[Patch]) -> Vec<bool> {
    let closed = (0..patches.len()).filter(|&i| patches[i].is_closed);
    let largest =
        closed.max_by(|&a, &b| patches[a].volume.abs().total_cmp(&patches[b].volume.abs()));
    let is_cavity = |patch: &Patch| {
        largest.is_some_and(|largest| {
            let shell = &patches[largest];
            let is_within = patch.bounds[0].cmpgt(shell.bounds[0]).all()
                && patch.bounds[1].cmplt(shell.bounds[1]).all();
            let is_against = patch.volume * shell.volume < 0.0;
            // What lies in a cup is within its bounds, but not inside.
            let triangles = mesh.triangles.iter().zip(patch_of);
            let triangles = triangles.filter(|(_, of)| **of == largest);
            let corners = triangles.map(|(t, _)| t.map(|v| mesh.vertices[v as usize].as_dvec3()));
            patch.is_closed && is_within && is_against && is_inside(patch.corner, corners)
        })
    };
    patches.iter().map(|patch| (patch.volume < 0.0) != is_cavity(patch)).collect()
}

/// Whether a closed surface is round a point: a ray, along no axis, leaves it once more than it enters.
fn is_inside(point: DVec3, surface: impl Iterator<Item = [DVec3; 3]>) -> bool {
    const RAY: DVec3 = DVec3::new(0.437, 0.293, 0.851);
    let is_crossed = |triangle: [DVec3; 3]| {
        let [a, b, c] = triangle.map(|corner| corner - point);
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|side| side.dot(RAY));
        let passes = sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0);
        let normal = (b - a).cross(c - a);
        passes && a.dot(normal) * RAY.dot(normal) > 0.0
    };
    surface.filter(|&triangle| is_crossed(triangle)).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{read, samples};

    fn turned(mesh: &Mesh, which: impl Fn(usize) -> bool) -> Mesh {
        let mut mesh = mesh.clone();
        let chosen = mesh.triangles.iter_mut().enumerate().filter(|(i, _)| which(*i));
        chosen.for_each(|(_, triangle)| triangle.swap(0, 1));
        mesh
    }

    #[test]
    fn a_soup_becomes_a_watertight_cube() {
        let (mesh, healing) = heal(read(&samples::stl_binary(&samples::cube())).unwrap()).unwrap();
        let wanted =
            Healing { merged_vertices: 28, components: 1, watertight: true, ..Healing::default() };
        assert_eq!((mesh.vertices.len(), healing), (8, wanted));
    }

    #[test]
    fn a_cube_is_turned_outward() {
        for which in [|_| true, |i| i % 3 == 0, |i| i == 0, |i| i > 2] {
            let (mesh, healing) = heal(turned(&samples::cube(), which)).unwrap();
            assert_eq!(samples::volume(&mesh), 1.0);
            assert_eq!(healing.flipped_triangles, (0..12).filter(|&i| which(i)).count());
            assert!(healing.watertight);
        }
    }

    #[test]
    fn spare_triangles_and_vertices_go() {
        let mut cube = samples::cube();
        cube.vertices.extend([
            Vec3::splat(9.0),
            Vec3::splat(1e-7),
            Vec3::new(1.0, 1.0, 1.0 - 1e-7),
        ]);
        cube.triangles.extend([[0, 9, 1], [7, 1, 3], [1, 10, 5]]);
        let (mesh, healing) = heal(cube).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12), "{healing:?}");
        assert_eq!((healing.merged_vertices, healing.degenerate_triangles), (3, 1));
        assert_eq!(healing.duplicate_triangles, 2);
    }

    #[test]
    fn holes_and_pieces_are_counted() {
        let mut open = samples::cube();
        open.triangles.truncate(10);
        let (_, healing) = heal(open).unwrap();
        assert_eq!((healing.open_edges, healing.watertight), (4, false));
        let far = samples::cube().translated(Vec3::X * 3.0);
        let (mesh, healing) =
            heal(samples::union(&[turned(&far, |_| true), samples::cube()])).unwrap();
        assert_eq!((healing.components, samples::volume(&mesh)), (2, 2.0));
        // Two cubes that share an edge: one piece, but its four triangles there cannot be paired.
        let diagonal = samples::cube().translated(Vec3::new(1.0, 1.0, 0.0));
        let (mesh, healing) = heal(samples::union(&[samples::cube(), diagonal])).unwrap();
        assert_eq!((healing.components, healing.tangled_edges, healing.open_edges), (1, 1, 0));
        assert_eq!((samples::volume(&mesh), healing.watertight), (2.0, false));
    }

    #[test]
    fn a_cavity_stays_hollow() {
        let inner = samples::cuboid(Vec3::splat(0.25), Vec3::splat(0.75));
        let hollow = samples::union(&[samples::cube(), turned(&inner, |_| true)]);
        for mesh in [hollow.clone(), turned(&hollow, |_| true)] {
            let (mesh, healing) = heal(mesh).unwrap();
            assert_eq!((samples::volume(&mesh), healing.watertight), (0.875, true));
        }
    }

    #[test]
    fn what_lies_in_a_cup_is_no_cavity() {
        // A gutter, 4 by 4 by 3, whose walls and floor are 1 thick, and a cube of 0.5 in it.
        let outline =
            [[0., 0.], [4., 0.], [4., 4.], [3., 4.], [3., 1.], [1., 1.], [1., 4.], [0., 4.]];
        let caps = [[0, 1, 5], [1, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]];
        let gutter = samples::prism(&outline, &caps, 3.0);
        let at = |x: f32, y: f32| {
            samples::cuboid(Vec3::new(x, y, 1.0), Vec3::new(x + 0.5, y + 0.5, 1.5))
        };
        for (cube, volume) in [(at(1.75, 2.0), 30.0 + 0.125), (at(0.25, 2.0), 30.0 - 0.125)] {
            let (mesh, _) =
                heal(samples::union(&[gutter.clone(), turned(&cube, |_| true)])).unwrap();
            assert_eq!(samples::volume(&mesh), volume);
        }
    }

    #[test]
    fn what_has_no_area_is_refused() {
        let line = (0..3).map(|i| Vec3::splat(i as f32)).collect::<Vec<_>>();
        let needle = Mesh { vertices: line, triangles: vec![[0, 1, 2]] };
        assert_eq!(heal(needle), Err(MeshError::ZeroArea { triangles: 1 }));
        let point = Mesh { vertices: vec![Vec3::ONE; 3], triangles: vec![[0, 1, 2]] };
        assert_eq!(heal(point), Err(MeshError::ZeroArea { triangles: 1 }));
        let wrong = Mesh { vertices: vec![Vec3::ONE; 2], triangles: vec![[0, 1, 2]] };
        assert!(matches!(heal(wrong), Err(MeshError::BadIndex { index: 2, .. })));
    }
}
