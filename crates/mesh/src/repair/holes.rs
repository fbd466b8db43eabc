//! Holes: small ones are closed, so that a surface with a missing triangle bounds a volume.

use super::edges::{components, edges, half_edges, twins};
use crate::Mesh;
use crate::io::triangulate;
use glamx::DVec3;

/// Max area of a closed hole (fraction of the surface). An opening, such as that of a cup, is larger.
const MAX_AREA: f64 = 0.02;
/// Max area of a closed hole (fraction of its component). The boundary of a sheet encloses all of it.
const MAX_COMPONENT_AREA: f64 = 0.5;
/// Max number of edges of a closed hole.
const MAX_EDGES: usize = 1000;
/// Max number of triangles at a vertex of a closed hole.
const MAX_VERTEX_TRIANGLES: usize = 10_000;

/// Closes holes of one triangle and holes of small area; returns their number.
pub(super) fn fill_holes(mesh: &mut Mesh) -> usize {
    let half_edges = half_edges(mesh);
    let mut is_boundary = vec![false; half_edges.len()];
    for edge in edges(&half_edges) {
        if let [only] = edge {
            is_boundary[only.2] = true;
        }
    }
    if !is_boundary.contains(&true) {
        return 0;
    }
    let twins = twins(&half_edges);
    let (of_triangle, count) = components(mesh.triangles.len(), &half_edges);
    let corner = |i: u32| mesh.vertices[i as usize].as_dvec3();
    let mut areas = vec![0.0; count];
    for (&[a, b, c], &component) in mesh.triangles.iter().zip(&of_triangle) {
        areas[component] += doubled_area(&[a, b, c].map(corner)) / 2.0;
    }
    let total: f64 = areas.iter().sum();
    let mut is_visited = vec![false; half_edges.len()];
    let mut filled = Vec::new();
    let mut num_filled = 0;
    for start in 0..half_edges.len() {
        if !is_boundary[start] || is_visited[start] {
            continue;
        }
        let Some(hole) = trace(mesh, &twins, &is_boundary, &mut is_visited, start) else {
            continue;
        };
        let points: Vec<DVec3> = hole.iter().map(|&i| corner(i)).collect();
        let area = doubled_area(&points) / 2.0;
        let is_small = hole.len() == 3 || area <= MAX_AREA * total;
        if is_small && area <= MAX_COMPONENT_AREA * areas[of_triangle[start / 3]] {
            filled.extend(triangulate(&points).iter().map(|triangle| triangle.map(|k| hole[k])));
            num_filled += 1;
        }
    }
    mesh.triangles.extend(filled);
    num_filled
}

/// Vertices of the hole at a boundary half-edge, in the winding of the missing triangles.
///
/// `None` if the hole has too many edges or ends at an edge with more than two triangles.
fn trace(
    mesh: &Mesh,
    twins: &[usize],
    is_boundary: &[bool],
    is_visited: &mut [bool],
    start: usize,
) -> Option<Vec<u32>> {
    let previous = |half_edge: usize| half_edge - half_edge % 3 + (half_edge + 2) % 3;
    let mut hole = Vec::new();
    let mut current = start;
    loop {
        is_visited[current] = true;
        hole.push(mesh.triangles[current / 3][(current + 1) % 3]);
        // Around the first vertex of the half-edge, to the other boundary there.
        let mut next = previous(current);
        let mut num_steps = 0;
        while twins[next] != usize::MAX {
            next = previous(twins[next]);
            num_steps += 1;
            // On a surface of inconsistent winding, the steps may not end.
            if num_steps > MAX_VERTEX_TRIANGLES {
                return None;
            }
        }
        if next == start {
            return (hole.len() >= 3).then_some(hole);
        }
        if !is_boundary[next] || is_visited[next] || hole.len() >= MAX_EDGES {
            return None;
        }
        current = next;
    }
}

/// Twice the area that a polygon encloses.
fn doubled_area(points: &[DVec3]) -> f64 {
    let Some(&first) = points.first() else { return 0.0 };
    let cross = |pair: &[DVec3]| (pair[0] - first).cross(pair[1] - first);
    points.windows(2).map(cross).sum::<DVec3>().length()
}
