//! Edges of a mesh: half-edges, components and defects.

use crate::Mesh;

/// Half-edge: the lower and the higher vertex index of its edge, and its number 3 * triangle + side.
pub(crate) type HalfEdge = (u32, u32, usize);

/// Half-edges of all triangles, sorted by edge.
pub(crate) fn half_edges(mesh: &Mesh) -> Vec<HalfEdge> {
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

/// Groups of half-edges with the same edge.
pub(crate) fn edges(half_edges: &[HalfEdge]) -> impl Iterator<Item = &[HalfEdge]> {
    half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
}

/// Whether a half-edge runs from the lower to the higher vertex index.
pub(super) fn is_forward(mesh: &Mesh, half_edge: usize) -> bool {
    let triangle = mesh.triangles[half_edge / 3];
    triangle[half_edge % 3] < triangle[(half_edge + 1) % 3]
}

/// For each half-edge, the other half-edge of an edge with exactly two triangles; `usize::MAX` if there is none.
pub(super) fn twins(half_edges: &[HalfEdge]) -> Vec<usize> {
    let mut twins = vec![usize::MAX; half_edges.len()];
    for edge in edges(half_edges) {
        if let [a, b] = edge {
            twins[a.2] = b.2;
            twins[b.2] = a.2;
        }
    }
    twins
}

/// Counts of defective edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EdgeDefects {
    /// Edges with one triangle.
    pub(super) boundary: usize,
    /// Edges with more than two triangles, or with two of inconsistent winding.
    pub(super) non_manifold: usize,
    /// Edges whose triangles do not run along it equally often in both directions.
    pub(super) unbalanced: usize,
}

impl EdgeDefects {
    pub(super) fn of(mesh: &Mesh, half_edges: &[HalfEdge]) -> Self {
        let mut defects = Self::default();
        for edge in edges(half_edges) {
            let forward = edge.iter().filter(|side| is_forward(mesh, side.2)).count();
            match (edge.len(), forward) {
                (1, _) => defects.boundary += 1,
                (2, 1) => {}
                _ => defects.non_manifold += 1,
            }
            defects.unbalanced += usize::from(2 * forward != edge.len());
        }
        defects
    }
}

/// Connected component of each triangle, numbered from 0, and the number of components.
///
/// Triangles that share an edge are connected.
pub(super) fn components(num_triangles: usize, half_edges: &[HalfEdge]) -> (Vec<usize>, usize) {
    let mut parent: Vec<usize> = (0..num_triangles).collect();
    for edge in edges(half_edges) {
        let first = edge.first().map_or(0, |side| side.2 / 3);
        for side in edge {
            union(&mut parent, first, side.2 / 3);
        }
    }
    let mut number = vec![usize::MAX; num_triangles];
    let mut count = 0;
    for triangle in 0..num_triangles {
        let root = find_root(&mut parent, triangle);
        // The root is the lowest index of its component.
        if root == triangle {
            number[triangle] = count;
            count += 1;
        } else {
            number[triangle] = number[root];
        }
    }
    (number, count)
}

/// Joins two sets (union-find); the lower root becomes the root of both.
pub(super) fn union(parent: &mut [usize], a: usize, b: usize) {
    let (a, b) = (find_root(parent, a), find_root(parent, b));
    parent[a.max(b)] = a.min(b);
}

/// Root of a set (union-find with path halving).
pub(super) fn find_root(parent: &mut [usize], mut item: usize) -> usize {
    while parent[item] != item {
        parent[item] = parent[parent[item]];
        item = parent[item];
    }
    item
}
