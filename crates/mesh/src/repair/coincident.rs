//! Coincident triangles: duplicates of a face, or the two faces of solids that touch.

use super::edges::{edges, half_edges};
use crate::Mesh;

/// Min area (fraction) that remains if coincident pairs are removed; below it, the surface is double-sided.
const MIN_REMAINING_AREA: f64 = 0.5;

/// Removes triangles with the same corners as another one; returns the number removed.
///
/// One of each group remains. If that leaves the walls between touching solids in the surface, such as blocks
/// that share faces, the pairs are removed completely.
pub(super) fn remove_coincident_triangles(mesh: &mut Mesh) -> usize {
    let count = mesh.triangles.len();
    let first = remaining(mesh, |_| true);
    if first.triangles.len() < count {
        // An odd number of triangles leaves one of them on the surface.
        let odd = remaining(mesh, |num_coincident| num_coincident % 2 == 1);
        let is_single_sided = area(&odd) >= MIN_REMAINING_AREA * area(&first);
        let is_better = is_single_sided && num_odd_edges(&odd) < num_odd_edges(&first);
        *mesh = if is_better { odd } else { first };
    }
    count - mesh.triangles.len()
}

/// The mesh with the first triangle of each group of coincident ones whose size is accepted.
fn remaining(mesh: &Mesh, is_kept: impl Fn(usize) -> bool) -> Mesh {
    let mut keys: Vec<([u32; 3], usize)> = mesh.triangles.iter().copied().zip(0..).collect();
    keys.iter_mut().for_each(|(key, _)| key.sort_unstable());
    keys.sort_unstable();
    let groups = keys.chunk_by(|(a, _), (b, _)| a == b).filter(|group| is_kept(group.len()));
    let mut kept: Vec<usize> = groups.filter_map(|group| group.first()).map(|(_, i)| *i).collect();
    kept.sort_unstable();
    let triangles = kept.into_iter().map(|i| mesh.triangles[i]).collect();
    Mesh { vertices: mesh.vertices.clone(), triangles }
}

fn num_odd_edges(mesh: &Mesh) -> usize {
    edges(&half_edges(mesh)).filter(|edge| edge.len() % 2 == 1).count()
}

fn area(mesh: &Mesh) -> f64 {
    let corner = |i: u32| mesh.vertices[i as usize].as_dvec3();
    let doubled =
        |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length();
    mesh.triangles.iter().map(doubled).sum()
}
