//! Fewer triangles: vertices that share a cell of a grid become one, in their middle (Rossignac and Borrel 1993).
//!
//! In: any mesh. Out: one whose surface moved by less than the diagonal of a cell. Walls thinner than a cell collapse.

use super::{Mesh, bounds};
use crate::Vec3;
use glamx::DVec3;
use std::collections::HashMap;

/// Cells along the longest side: of an object of 25 cm each has a millimetre.
const CELLS: u16 = 256;

/// What was made of a mesh of too many triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simplified {
    /// Triangles in the file.
    pub from: usize,
    /// No vertex moved further (units of the mesh).
    pub moved: f32,
}

/// Merges vertices cell by cell, in cells as fine as `most` triangles allow. A corner that is not a vertex stays wrong.
pub(super) fn simplify(mesh: &Mesh, most: usize) -> (Mesh, Simplified) {
    let mut cells = CELLS;
    loop {
        let (simple, moved) = cluster(mesh, cells);
        if simple.triangles.len() <= most || cells == 1 {
            return (simple, Simplified { from: mesh.triangles.len(), moved });
        }
        cells /= 2;
    }
}

/// The mesh with one vertex in a cell, and how far one was moved at most.
fn cluster(mesh: &Mesh, cells: u16) -> (Mesh, f32) {
    // What no triangle uses tells nothing of the shape.
    let mut is_used = vec![false; mesh.vertices.len()];
    for &corner in mesh.triangles.iter().flatten() {
        is_used.get_mut(corner as usize).into_iter().for_each(|used| *used = true);
    }
    let used = || mesh.vertices.iter().zip(&is_used).filter(|(_, used)| **used).map(|(v, _)| *v);
    let [low, high] = bounds(&used().collect::<Vec<Vec3>>());
    let cell = ((high - low).max_element() / f32::from(cells)).max(f32::MIN_POSITIVE);
    let mut numbers = HashMap::new();
    let mut sums: Vec<(DVec3, u32)> = Vec::new();
    let mut in_cell = |vertex: Vec3| {
        let place = ((vertex - low) / cell).floor().to_array().map(|x| x as u16);
        let number = *numbers.entry(place).or_insert(sums.len());
        if number == sums.len() {
            sums.push((DVec3::ZERO, 0));
        }
        let (sum, count) = &mut sums[number];
        *sum += vertex.as_dvec3();
        *count += 1;
        number as u32
    };
    let number = |(vertex, used): (&Vec3, &bool)| if *used { in_cell(*vertex) } else { u32::MAX };
    let numbers: Vec<u32> = mesh.vertices.iter().zip(&is_used).map(number).collect();
    let renamed = |corner: u32| numbers.get(corner as usize).copied().unwrap_or(u32::MAX);
    let triangles = mesh.triangles.iter().map(|corners| corners.map(renamed));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let middle = |(sum, count): (DVec3, u32)| (sum / f64::from(count)).as_vec3();
    let vertices: Vec<Vec3> = sums.into_iter().map(middle).collect();
    let off = |(vertex, number): (&Vec3, &u32)| {
        vertices.get(*number as usize).map_or(0.0, |middle| vertex.distance(*middle))
    };
    let moved = mesh.vertices.iter().zip(&numbers).map(off).fold(0.0, f32::max);
    (Mesh { vertices, triangles: without_flaps(triangles) }, moved)
}

/// Of the triangles that came to lie on each other: none if as many face one way as the other, for they bound nothing,
/// else the first of those that face as most do.
fn without_flaps(triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut keys: Vec<([u32; 3], bool, usize)> = triangles.iter().zip(0..).map(key).collect();
    keys.sort_unstable();
    let mut kept: Vec<usize> = Vec::new();
    for alike in keys.chunk_by(|(a, ..), (b, ..)| a == b) {
        let turned = alike.iter().filter(|(_, is_turned, _)| *is_turned).count();
        let wanted = 2 * turned > alike.len();
        if 2 * turned != alike.len() {
            kept.extend(alike.iter().find(|(_, turned, _)| *turned == wanted).map(|(.., i)| *i));
        }
    }
    kept.sort_unstable();
    kept.into_iter().map(|i| triangles[i]).collect()
}

/// The corners of a triangle in order, whether they turn the other way round so, and its number.
fn key((&[a, b, c], number): (&[u32; 3], usize)) -> ([u32; 3], bool, usize) {
    let mut sorted = [a, b, c];
    sorted.sort_unstable();
    let is_turned = ![[a, b, c], [b, c, a], [c, a, b]].contains(&sorted);
    (sorted, is_turned, number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{heal, samples};

    /// A ball of radius 1, of so many rings of twice as many quadrilaterals.
    fn ball(rings: usize) -> Mesh {
        let round = 2 * rings;
        let at = |ring: usize, k: usize| {
            let (sin, cos) = libm::sincosf(std::f32::consts::PI * ring as f32 / rings as f32);
            let (y, x) = libm::sincosf(std::f32::consts::PI * (k % round) as f32 / rings as f32);
            // At the poles all are one.
            let sin = if ring.is_multiple_of(rings) { 0.0 } else { sin };
            Vec3::new(sin * x, sin * y, cos)
        };
        let corners = (0..=rings).flat_map(|ring| (0..round).map(move |k| (ring, k)));
        let vertices = corners.map(|(ring, k)| at(ring, k)).collect();
        let number = |ring: usize, k: usize| (ring * round + k % round) as u32;
        let quads = (0..rings).flat_map(|ring| (0..round).map(move |k| (ring, k)));
        let split = |(ring, k)| {
            let [a, b] = [number(ring, k), number(ring, k + 1)];
            let [c, d] = [number(ring + 1, k), number(ring + 1, k + 1)];
            [[a, c, d], [a, d, b]]
        };
        Mesh { vertices, triangles: quads.flat_map(split).collect() }
    }

    /// More than any mesh here has.
    const ANY: usize = usize::MAX;

    fn volume(mesh: &Mesh) -> f64 {
        f64::from(samples::volume(mesh))
    }

    #[test]
    fn a_fine_hollow_ball_stays_closed_and_hollow() {
        let outer = ball(600);
        let inner = ball(150).scaled(0.7);
        let shift = outer.vertices.len() as u32;
        let fine = Mesh {
            vertices: [outer.vertices, inner.vertices].concat(),
            triangles: outer
                .triangles
                .into_iter()
                .chain(inner.triangles.into_iter().map(|[a, b, c]| [a, c, b].map(|i| i + shift)))
                .collect(),
        };
        let (simple, told) = simplify(&fine, ANY);
        assert_eq!(told.from, 1_440_000 + 90_000);
        assert!(simple.triangles.len() < 700_000, "{}", simple.triangles.len());
        let cell = 2.0 / f32::from(CELLS);
        assert!(told.moved > 0.1 * cell && told.moved < 3.0f32.sqrt() * cell, "{}", told.moved);
        let off = |v: &Vec3| (v.length() - 1.0).abs().min((v.length() - 0.7).abs());
        let off = simple.vertices.iter().map(off).fold(0.0, f32::max);
        assert!(off < cell, "{off}");
        let wanted = 4.0 / 3.0 * std::f64::consts::PI * (1.0 - 0.7f64.powi(3));
        assert!((volume(&simple) - wanted).abs() < 0.01 * wanted, "{}", volume(&simple));
        let (_, healing) = heal(simple).unwrap();
        assert!(healing.watertight && healing.components == 2, "{healing:?}");
        assert_eq!((healing.duplicate_triangles, healing.open_edges), (0, 0));
    }

    #[test]
    fn no_more_triangles_are_left_than_may_be() {
        let fine = ball(100);
        let counts = [20_000, 5000, 500].map(|most| {
            let (simple, told) = simplify(&fine, most);
            assert!(simple.triangles.len() <= most && told.from == 40_000);
            assert!(heal(simple.clone()).unwrap().1.components == 1);
            simple.triangles.len()
        });
        assert!(counts.is_sorted_by(|a, b| a > b), "{counts:?}");
    }

    #[test]
    fn what_is_coarser_than_the_grid_keeps_its_shape_whatever_else_is_in_the_file() {
        let mut cube = samples::cube();
        let (simple, told) = simplify(&cube, ANY);
        assert_eq!((simple.triangles.len(), told.moved), (12, 0.0));
        assert_eq!(volume(&simple), volume(&cube));
        // A point that no triangle uses is no part of it, however far away.
        cube.vertices.push(Vec3::splat(1e6));
        assert_eq!(simplify(&cube, ANY).0, simple);
    }

    #[test]
    fn a_sheet_that_is_folded_flat_is_nothing_and_one_that_lies_double_is_one() {
        let [front, back] = [[0, 1, 2], [2, 1, 0]];
        for (triangles, left) in [
            (vec![front, back], vec![]),
            (vec![front, [1, 2, 0]], vec![front]),
            (vec![back, front, [1, 0, 2]], vec![back]),
        ] {
            assert_eq!(without_flaps(triangles), left);
        }
    }

    #[test]
    fn nothing_and_wrong_corners_do_not_panic() {
        assert_eq!(simplify(&Mesh::default(), ANY).0, Mesh::default());
        let wrong = Mesh { triangles: vec![[0, 1, 77]], ..samples::cube() };
        assert!(heal(simplify(&wrong, ANY).0).is_err());
        let point = Mesh { vertices: vec![Vec3::ONE; 3], triangles: vec![[0, 1, 2]] };
        assert!(simplify(&point, ANY).0.triangles.is_empty());
    }
}
