//! Mesh simplification by vertex clustering (Rossignac and Borrel 1993): one mean vertex per grid cell.
//!
//! In: any mesh. Out: a mesh displaced by less than the cell diagonal. Walls thinner than a cell collapse.

use crate::{Mesh, bounds};
use glamx::DVec3;
use glamx::Vec3;
use std::collections::HashMap;

/// Max number of cells along the longest side: 1 mm each for an object of 25 cm.
const MAX_GRID_CELLS: u16 = 256;

/// Result of a simplification.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct SimplifyReport {
    /// Triangles before the simplification.
    pub triangles_before: usize,
    /// Max displacement of a vertex (units of the mesh; m after [`import`](crate::import)).
    pub max_displacement: f32,
}

/// Merges vertices in the finest grid that leaves up to `max_triangles`. Invalid corner indices stay invalid.
pub(super) fn simplify(mesh: &Mesh, max_triangles: usize) -> (Mesh, SimplifyReport) {
    let mut cells = MAX_GRID_CELLS;
    loop {
        let (simple, max_displacement) = cluster(mesh, cells);
        if simple.triangles.len() <= max_triangles || cells == 1 {
            let report =
                SimplifyReport { triangles_before: mesh.triangles.len(), max_displacement };
            return (simple, report);
        }
        cells /= 2;
    }
}

/// The mesh with one vertex per cell, and the max displacement of a vertex.
fn cluster(mesh: &Mesh, cells: u16) -> (Mesh, f32) {
    // Unused vertices are not part of the shape.
    let mut is_used = vec![false; mesh.vertices.len()];
    for &corner in mesh.triangles.iter().flatten() {
        is_used.get_mut(corner as usize).into_iter().for_each(|used| *used = true);
    }
    let used = || mesh.vertices.iter().zip(&is_used).filter(|(_, used)| **used).map(|(v, _)| *v);
    let [low, high] = bounds(&used().collect::<Vec<Vec3>>());
    let cell = ((high - low).max_element() / f32::from(cells)).max(f32::MIN_POSITIVE);
    let mut cell_index = HashMap::new();
    let mut sums: Vec<(DVec3, u32)> = Vec::new();
    let mut add_to_cell = |vertex: Vec3| {
        let key = ((vertex - low) / cell).floor().to_array().map(|x| x as u16);
        let index = *cell_index.entry(key).or_insert(sums.len());
        if index == sums.len() {
            sums.push((DVec3::ZERO, 0));
        }
        let (sum, count) = &mut sums[index];
        *sum += vertex.as_dvec3();
        *count += 1;
        index as u32
    };
    let add = |(vertex, used): (&Vec3, &bool)| if *used { add_to_cell(*vertex) } else { u32::MAX };
    let indices: Vec<u32> = mesh.vertices.iter().zip(&is_used).map(add).collect();
    let new_index = |corner: u32| indices.get(corner as usize).copied().unwrap_or(u32::MAX);
    let triangles = mesh.triangles.iter().map(|corners| corners.map(new_index));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let mean = |(sum, count): (DVec3, u32)| (sum / f64::from(count)).as_vec3();
    let vertices: Vec<Vec3> = sums.into_iter().map(mean).collect();
    let displacement = |(vertex, index): (&Vec3, &u32)| {
        vertices.get(*index as usize).map_or(0.0, |mean| vertex.distance(*mean))
    };
    let displacements = mesh.vertices.iter().zip(&indices).map(displacement);
    let max_displacement = displacements.fold(0.0, f32::max);
    (Mesh { vertices, triangles: remove_coincident_triangles(triangles) }, max_displacement)
}

/// Replaces coincident triangles by the first one of the majority winding, or by none in a tie.
///
/// In a tie, the triangles enclose no volume.
fn remove_coincident_triangles(triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut keys: Vec<([u32; 3], bool, usize)> = triangles.iter().zip(0..).map(sort_key).collect();
    keys.sort_unstable();
    let mut kept: Vec<usize> = Vec::new();
    for group in keys.chunk_by(|(a, ..), (b, ..)| a == b) {
        let num_reversed = group.iter().filter(|(_, is_reversed, _)| *is_reversed).count();
        let majority = 2 * num_reversed > group.len();
        if 2 * num_reversed != group.len() {
            let first = group.iter().find(|(_, is_reversed, _)| *is_reversed == majority);
            kept.extend(first.map(|(.., i)| *i));
        }
    }
    kept.sort_unstable();
    kept.into_iter().map(|i| triangles[i]).collect()
}

/// Sorted corners of a triangle, whether sorting reverses its winding, and its index.
fn sort_key((&[a, b, c], index): (&[u32; 3], usize)) -> ([u32; 3], bool, usize) {
    let mut sorted = [a, b, c];
    sorted.sort_unstable();
    let is_reversed = ![[a, b, c], [b, c, a], [c, a, b]].contains(&sorted);
    (sorted, is_reversed, index)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::repair;
    use crate::test_meshes;

    /// Sphere of radius 1 with `rings` rings of 2 * `rings` quadrilaterals.
    fn sphere(rings: usize) -> Mesh {
        let segments = 2 * rings;
        let at = |ring: usize, k: usize| {
            let (sin, cos) = libm::sincosf(std::f32::consts::PI * ring as f32 / rings as f32);
            let (y, x) = libm::sincosf(std::f32::consts::PI * (k % segments) as f32 / rings as f32);
            // All points of a pole coincide.
            let sin = if ring.is_multiple_of(rings) { 0.0 } else { sin };
            Vec3::new(sin * x, sin * y, cos)
        };
        let corners = (0..=rings).flat_map(|ring| (0..segments).map(move |k| (ring, k)));
        let vertices = corners.map(|(ring, k)| at(ring, k)).collect();
        let number = |ring: usize, k: usize| (ring * segments + k % segments) as u32;
        let quads = (0..rings).flat_map(|ring| (0..segments).map(move |k| (ring, k)));
        let split = |(ring, k)| {
            let [a, b] = [number(ring, k), number(ring, k + 1)];
            let [c, d] = [number(ring + 1, k), number(ring + 1, k + 1)];
            [[a, c, d], [a, d, b]]
        };
        Mesh { vertices, triangles: quads.flat_map(split).collect() }
    }

    /// No limit on the number of triangles.
    const UNLIMITED: usize = usize::MAX;

    fn volume(mesh: &Mesh) -> f64 {
        f64::from(test_meshes::volume(mesh))
    }

    #[test]
    fn fine_hollow_sphere_stays_closed_and_hollow() {
        let outer = sphere(600);
        let inner = sphere(150).scaled(0.7);
        let shift = outer.vertices.len() as u32;
        let fine = Mesh {
            vertices: [outer.vertices, inner.vertices].concat(),
            triangles: outer
                .triangles
                .into_iter()
                .chain(inner.triangles.into_iter().map(|[a, b, c]| [a, c, b].map(|i| i + shift)))
                .collect(),
        };
        let (simple, report) = simplify(&fine, UNLIMITED);
        assert_eq!(report.triangles_before, 1_440_000 + 90_000);
        assert!(simple.triangles.len() < 700_000, "{}", simple.triangles.len());
        let cell = 2.0 / f32::from(MAX_GRID_CELLS);
        let max = report.max_displacement;
        assert!(max > 0.1 * cell && max < 3.0f32.sqrt() * cell, "{max}");
        let error = |v: &Vec3| (v.length() - 1.0).abs().min((v.length() - 0.7).abs());
        let error = simple.vertices.iter().map(error).fold(0.0, f32::max);
        assert!(error < cell, "{error}");
        let wanted = 4.0 / 3.0 * std::f64::consts::PI * (1.0 - 0.7f64.powi(3));
        assert!((volume(&simple) - wanted).abs() < 0.01 * wanted, "{}", volume(&simple));
        let (_, repair) = repair(simple).unwrap();
        assert!(repair.watertight && repair.components == 2, "{repair:?}");
        assert_eq!((repair.duplicate_triangles, repair.boundary_edges), (0, 0));
    }

    #[test]
    fn result_respects_the_triangle_limit() {
        let fine = sphere(100);
        let counts = [20_000, 5000, 500].map(|max_triangles| {
            let (simple, report) = simplify(&fine, max_triangles);
            assert!(simple.triangles.len() <= max_triangles && report.triangles_before == 40_000);
            assert!(repair(simple.clone()).unwrap().1.components == 1);
            simple.triangles.len()
        });
        assert!(counts.is_sorted_by(|a, b| a > b), "{counts:?}");
    }

    #[test]
    fn mesh_coarser_than_the_grid_is_unchanged_despite_unused_vertices() {
        let mut cube = test_meshes::cube();
        let (simple, report) = simplify(&cube, UNLIMITED);
        assert_eq!((simple.triangles.len(), report.max_displacement), (12, 0.0));
        assert_eq!(volume(&simple), volume(&cube));
        // An unused vertex does not change the grid, at any distance.
        cube.vertices.push(Vec3::splat(1e6));
        assert_eq!(simplify(&cube, UNLIMITED).0, simple);
    }

    #[test]
    fn coincident_triangles_reduce_to_the_majority_winding() {
        let [front, back] = [[0, 1, 2], [2, 1, 0]];
        for (triangles, left) in [
            (vec![front, back], vec![]),
            (vec![front, [1, 2, 0]], vec![front]),
            (vec![back, front, [1, 0, 2]], vec![back]),
        ] {
            assert_eq!(remove_coincident_triangles(triangles), left);
        }
    }

    #[test]
    fn empty_and_invalid_meshes_do_not_panic() {
        assert_eq!(simplify(&Mesh::default(), UNLIMITED).0, Mesh::default());
        let wrong = Mesh { triangles: vec![[0, 1, 77]], ..test_meshes::cube() };
        assert!(repair(simplify(&wrong, UNLIMITED).0).is_err());
        let point = Mesh { vertices: vec![Vec3::ONE; 3], triangles: vec![[0, 1, 2]] };
        assert!(simplify(&point, UNLIMITED).0.triangles.is_empty());
    }
}
