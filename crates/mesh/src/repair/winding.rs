//! Winding of triangles: consistent within each patch, outward for shells, inward for cavities.

use super::RepairReport;
use crate::{Mesh, bounds};
use glamx::{DVec3, Vec3};

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
pub(super) fn orient_triangles(mesh: &mut Mesh, report: &mut RepairReport) {
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
