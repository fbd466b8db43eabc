//! Winding of triangles: consistent within each patch, outward for shells, inward for cavities.

use super::edges::{HalfEdge, edges, find_root, half_edges, is_forward, twins, union};
use crate::{Mesh, bounds};
use glamx::{DVec3, Vec3};

/// Max number of triangles at an edge of a closed patch, because the test takes the square of the time.
const MAX_EDGE_TRIANGLES: usize = 64;

/// Makes the winding consistent within each patch, then flips patches outward; returns the number of flipped
/// triangles.
pub(super) fn orient_triangles(mesh: &mut Mesh) -> usize {
    let half_edges = half_edges(mesh);
    let (patch_of, mut is_flipped, mut patches) = find_patches(mesh, &twins(&half_edges));
    find_closed_patches(mesh, &half_edges, &patch_of, &is_flipped, &mut patches);
    let flips_patch = patches_to_flip(mesh, &patch_of, &patches);
    let flips_group = groups_to_flip(mesh, &half_edges, &patch_of, &patches);
    let mut num_flipped = 0;
    for (i, triangle) in mesh.triangles.iter_mut().enumerate() {
        let patch = patch_of[i];
        is_flipped[i] = flips_group[patch].unwrap_or(is_flipped[i] ^ flips_patch[patch]);
        if is_flipped[i] {
            triangle.swap(1, 2);
            num_flipped += 1;
        }
    }
    num_flipped
}

/// Triangles of the closed patches, if they are a part of the mesh that has this fraction of its area.
///
/// Open patches, such as a loose triangle, enclose no volume.
pub(crate) fn closed_surface(mesh: &Mesh, min_area: f64) -> Option<Mesh> {
    let half_edges = half_edges(mesh);
    let (patch_of, is_flipped, mut patches) = find_patches(mesh, &twins(&half_edges));
    find_closed_patches(mesh, &half_edges, &patch_of, &is_flipped, &mut patches);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.vertices[i as usize].as_dvec3());
        (b - a).cross(c - a).length()
    };
    let total: f64 = mesh.triangles.iter().map(area).sum();
    let triangles = mesh.triangles.iter().zip(&patch_of);
    let closed: Vec<[u32; 3]> =
        triangles.filter(|(_, patch)| patches[**patch].is_closed).map(|(t, _)| *t).collect();
    let fraction = closed.iter().map(area).sum::<f64>() / total;
    let vertices = || mesh.vertices.clone();
    (fraction >= min_area).then(|| Mesh { vertices: vertices(), triangles: closed })
}

/// Triangles connected across edges with exactly two triangles.
struct Patch {
    /// Signed volume about the centre of the bounding box, negative if the faces point inward.
    volume: f64,
    bounds: [Vec3; 2],
    /// Position of one vertex.
    corner: DVec3,
    /// Whether each edge has as many triangles of the patch in one direction as in the other.
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
        while let Some(&current) = members.get(next) {
            next += 1;
            for side in [0, 1, 2].map(|k| 3 * current + k) {
                let twin = twins[side];
                if twin != usize::MAX && patch_of[twin / 3] == usize::MAX {
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
        patches.push(Patch { volume, bounds, corner, is_closed: true });
    }
    (patch_of, is_flipped, patches)
}

/// Clears [`Patch::is_closed`] of each patch that has an open edge.
///
/// At an edge of more than two triangles, two patches may touch that are closed without each other.
fn find_closed_patches(
    mesh: &Mesh,
    half_edges: &[HalfEdge],
    patch_of: &[usize],
    is_flipped: &[bool],
    patches: &mut [Patch],
) {
    for edge in edges(half_edges).filter(|edge| edge.len() != 2) {
        let direction = |side: &HalfEdge| {
            if is_forward(mesh, side.2) != is_flipped[side.2 / 3] { 1 } else { -1 }
        };
        for side in edge {
            let patch = patch_of[side.2 / 3];
            if edge.len() > MAX_EDGE_TRIANGLES {
                patches[patch].is_closed = false;
                continue;
            }
            let of_patch = edge.iter().filter(|other| patch_of[other.2 / 3] == patch);
            patches[patch].is_closed &= of_patch.map(direction).sum::<i32>() == 0;
        }
    }
}

/// Whether to flip each open patch that closes a volume together with others in the winding of the file.
///
/// `None` for any other patch. Faces of touching blocks, each bounded by edges of four triangles, are such
/// patches; alone, they have no outer side.
fn groups_to_flip(
    mesh: &Mesh,
    half_edges: &[HalfEdge],
    patch_of: &[usize],
    patches: &[Patch],
) -> Vec<Option<bool>> {
    let is_open = |side: &HalfEdge| !patches[patch_of[side.2 / 3]].is_closed;
    let mut group: Vec<usize> = (0..patches.len()).collect();
    for edge in edges(half_edges) {
        let mut open = edge.iter().filter(|side| is_open(side)).map(|side| patch_of[side.2 / 3]);
        if let Some(first) = open.next() {
            open.for_each(|other| union(&mut group, first, other));
        }
    }
    let roots: Vec<usize> = (0..patches.len()).map(|i| find_root(&mut group, i)).collect();
    let mut is_balanced: Vec<bool> = patches.iter().map(|patch| !patch.is_closed).collect();
    for edge in edges(half_edges) {
        let open = || edge.iter().filter(|side| is_open(side));
        let forward = open().filter(|side| is_forward(mesh, side.2)).count();
        if let Some(side) = open().next().filter(|_| 2 * forward != open().count()) {
            is_balanced[roots[patch_of[side.2 / 3]]] = false;
        }
    }
    let [low, high] = mesh.bounds().map(|corner| corner.as_dvec3());
    let center = (low + high) / 2.0;
    let mut volumes = vec![0.0; patches.len()];
    for (triangle, &patch) in mesh.triangles.iter().zip(patch_of) {
        let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize].as_dvec3() - center);
        volumes[roots[patch]] += a.dot(b.cross(c));
    }
    let flip = |i: usize| {
        let is_member = !patches[i].is_closed && is_balanced[roots[i]];
        is_member.then_some(volumes[roots[i]] < 0.0)
    };
    (0..patches.len()).map(flip).collect()
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
