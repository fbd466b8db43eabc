//! Convex decomposition of a mesh into few parts, for physics engines that collide convex shapes only.
//!
//! In: a repaired mesh. Out: the hull vertices of each part. A nearly convex mesh is one part. For any other:
//!
//! 1. `voxel_grid`: cells along the principal axes are outside, on the surface, or inside.
//! 2. `empty_space`, `openings`: samples of the space outside the mesh and inside its hull, with weights.
//! 3. `decomposer`: planes (`cut_search`) cut the mesh into parts (`part`), so that their hulls contain few
//!    samples. Hulls whose joint hull contains few more are merged (`filled_hull`).
//!
//! No step panics, and all results are bit-identical on every machine.

mod cut_search;
mod decomposer;
mod distance_transform;
mod empty_space;
mod filled_hull;
mod openings;
mod part;
mod part_hull;
mod principal_axes;
mod voxel_grid;

use crate::convex_hull::{convex_hull, convex_hull_within};
use crate::{Mesh, bounds, mass_properties};
use decomposer::Limits;
use empty_space::EmptySpace;
use filled_hull::FilledHull;
use glamx::Vec3;
use part::Solid;
use part_hull::PartHull;
use voxel_grid::VoxelGrid;

/// Method of the decomposition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Cut along planes.
    Planes,
    /// Single hull: the mesh is nearly convex, or too large for the grid.
    Hull,
}

/// Convex parts of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexDecomposition {
    /// Vertices of each part's hull (m), mesh frame.
    pub hulls: Vec<Vec<Vec3>>,
    /// Method that produced the parts.
    pub method: Method,
    /// Fraction of the empty space in the hull of the mesh that the parts fill.
    ///
    /// Up to about 1 % of the size of the object, a layer next to the surface does not count.
    pub filled_fraction: f64,
}

/// Max number of parts of a mesh.
pub(super) const MAX_PARTS: usize = 24;
/// Number of cells of the grid's bounding box.
const NUM_CELLS: u32 = 800_000;
/// Max number of surface points that the search for cuts uses.
const MAX_SURFACE_POINTS: usize = 6000;
/// Weight (cells²) of the empty space that a part may fill without further cuts.
const TOLERANCE: f64 = 2.0;
/// Max number of vertices of a part.
const MAX_PART_POINTS: usize = 64;
/// Min distance of an added vertex from the hull (fraction of the part's longest side).
///
/// Physics engines fail on slivers.
const MIN_DETAIL: f64 = 1e-3;
/// Max number of vertices of the hull in the convexity test.
const HULL_POINTS: usize = 2000;
/// Min fraction of its hull's volume that a convex mesh fills.
const CONVEX_FRACTION: f64 = 0.97;
/// Thickness added to flat parts (fraction of the longest side).
const SHEET_THICKNESS: f32 = 0.004;

/// Decomposes a repaired mesh; falls back to a single hull.
///
/// ```rust
/// use glamx::Vec3;
/// let cuboid = |low: Vec3, high: Vec3| {
///     let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
///     let corners = (0..8).map(|i| Vec3::new(pick(i, 0), pick(i, 1), pick(i, 2)));
///     mesh::convex_hull(&corners.collect::<Vec<_>>(), 8).expect("a solid")
/// };
/// assert_eq!(mesh::decompose(&cuboid(Vec3::ZERO, Vec3::splat(0.1))).hulls.len(), 1);
/// // An L of two bars, 30 mm thick, is concave.
/// let mut bars = cuboid(Vec3::ZERO, Vec3::new(0.1, 0.03, 0.03));
/// let other = cuboid(Vec3::new(0.0, 0.03, 0.0), Vec3::new(0.03, 0.1, 0.03));
/// let first = bars.vertices.len() as u32;
/// bars.vertices.extend(other.vertices);
/// bars.triangles.extend(other.triangles.iter().map(|corners| corners.map(|i| first + i)));
/// assert!(mesh::decompose(&bars).hulls.len() >= 2);
/// ```
pub fn decompose(mesh: &Mesh) -> ConvexDecomposition {
    let is_convex = is_convex(mesh);
    if !is_convex && let Some(decomposition) = decompose_by_planes(mesh, MAX_PARTS) {
        return decomposition;
    }
    let hulls = vec![hull_vertices(&mesh.vertices)];
    // The hull of a concave mesh fills all of its empty space.
    let filled_fraction = if is_convex { 0.0 } else { 1.0 };
    ConvexDecomposition { hulls, method: Method::Hull, filled_fraction }
}

fn is_convex(mesh: &Mesh) -> bool {
    let Some(hull) = convex_hull(&mesh.vertices, HULL_POINTS) else { return true };
    let fraction = mass_properties::volume(mesh) / mass_properties::volume(&hull);
    // Above 1, some volume counts twice, and the mesh may still be concave.
    (CONVEX_FRACTION..=mass_properties::MAX_HULL_RATIO).contains(&fraction)
}

/// Cuts a mesh into up to `max_parts` parts; `None` if the grid fails.
fn decompose_by_planes(mesh: &Mesh, max_parts: usize) -> Option<ConvexDecomposition> {
    let grid = VoxelGrid::new(mesh, NUM_CELLS)?;
    let surface = grid.surface_points(MAX_SURFACE_POINTS);
    let whole = PartHull::new(&surface);
    let space = EmptySpace::new(&grid, &whole);
    let solid = Solid { grid: &grid, surface, space };
    let corners = |t: &[u32; 3]| t.map(|i| grid.to_cells(mesh.vertices[i as usize])).to_vec();
    let triangles = mesh.triangles.iter().map(corners).collect();
    let limits = Limits { max_parts, tolerance: TOLERANCE };
    let hulls = decomposer::decompose(&solid, triangles, &limits);
    let filled_fraction = solid.space.filled_fraction(&hulls);
    let to_mesh = |hull: &FilledHull| hull.vertices.iter().map(|&p| grid.to_mesh(p)).collect();
    let hulls = hulls.iter().map(to_mesh).collect();
    Some(ConvexDecomposition { hulls, method: Method::Planes, filled_fraction })
}

/// Hull vertices of points; a flat set is thickened first, and a degenerate set is replaced by a box.
fn hull_vertices(points: &[Vec3]) -> Vec<Vec3> {
    let part_hull = |points: &[Vec3]| convex_hull_within(points, MAX_PART_POINTS, MIN_DETAIL);
    let hull = part_hull(points).or_else(|| part_hull(&thickened(points)));
    hull.map_or_else(|| bounding_box_corners(points), |mesh| mesh.vertices)
}

/// Coplanar points, duplicated with an offset to each side of their plane.
fn thickened(points: &[Vec3]) -> Vec<Vec3> {
    let first = points.first().copied().unwrap_or_default();
    let longer = |a: Vec3, b: Vec3| if b.length_squared() > a.length_squared() { b } else { a };
    let along = points.iter().map(|&p| p - first).fold(Vec3::ZERO, longer);
    let across = points.iter().map(|&p| along.cross(p - first)).fold(Vec3::ZERO, longer);
    let offset = across.normalize_or_zero() * (0.5 * SHEET_THICKNESS * along.length());
    points.iter().flat_map(|&p| [p + offset, p - offset]).collect()
}

/// Corners of the bounding box, with a min thickness along each axis.
fn bounding_box_corners(points: &[Vec3]) -> Vec<Vec3> {
    let [low, high] = bounds(points);
    let side = high - low;
    let min_side = Vec3::splat((SHEET_THICKNESS * side.max_element()).max(1e-4));
    let (center, half) = ((low + high) / 2.0, side.max(min_side) / 2.0);
    let sign = |corner: u32, axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    (0..8).map(|i| center + half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::repair;
    use crate::{RepairReport, test_meshes};
    use rand::{RngExt, SeedableRng};

    fn decompose_parts(mesh: &Mesh, max_parts: usize) -> Vec<Vec<Vec3>> {
        if is_convex(mesh) { None } else { decompose_by_planes(mesh, max_parts) }
            .map_or_else(|| vec![hull_vertices(&mesh.vertices)], |parts| parts.hulls)
    }

    fn sum_of_volumes(hulls: &[Vec<Vec3>]) -> f64 {
        hulls
            .iter()
            .map(|points| mass_properties::volume(&convex_hull(points, usize::MAX).unwrap()))
            .sum()
    }

    /// A physics engine must build the same body from each part.
    fn check(hulls: &[Vec<Vec3>]) {
        for points in hulls {
            assert!((4..=MAX_PART_POINTS).contains(&points.len()), "{} points", points.len());
            let hull = convex_hull(points, usize::MAX).unwrap();
            let shape =
                parry3d::shape::ConvexPolyhedron::from_convex_mesh(hull.vertices, &hull.triangles);
            assert!(shape.is_some());
        }
    }

    #[test]
    fn l_shape_is_filled_by_two_or_three_parts() {
        let parts = decompose(&test_meshes::l_shape());
        assert_eq!(parts.method, Method::Planes);
        assert!((2..=3).contains(&parts.hulls.len()), "{} parts", parts.hulls.len());
        check(&parts.hulls);
        let (got, wanted) =
            (sum_of_volumes(&parts.hulls), f64::from(test_meshes::volume(&test_meshes::l_shape())));
        assert!((got / wanted - 1.0).abs() < 0.02, "wanted {wanted}, got {got}");
    }

    #[test]
    fn duplicated_surface_keeps_its_notch() {
        let mut twice = test_meshes::l_shape();
        let count = twice.vertices.len() as u32;
        let copy = test_meshes::l_shape();
        twice.vertices.extend(copy.vertices.iter().map(|v| *v + Vec3::splat(1e-4)));
        twice.triangles.extend(copy.triangles.iter().map(|t| t.map(|i| i + count)));
        let parts = decompose(&twice);
        assert!(parts.hulls.len() > 1, "{:?}", parts.method);
    }

    #[test]
    fn box_is_one_part_with_eight_vertices() {
        let parts = decompose(&test_meshes::cube());
        assert_eq!((parts.method, parts.hulls.len()), (Method::Hull, 1));
        assert_eq!((parts.hulls[0].len(), parts.filled_fraction), (8, 0.0));
        assert_eq!(decompose_parts(&test_meshes::cube(), 8), parts.hulls);
    }

    /// Table of 10 x 10 x 12 cm with four legs.
    fn table() -> Mesh {
        let leg = |x: f32, y: f32| {
            test_meshes::cuboid(Vec3::new(x, y, 0.0), Vec3::new(x + 0.02, y + 0.02, 0.1))
        };
        let top = test_meshes::cuboid(Vec3::new(0.0, 0.0, 0.1), Vec3::new(0.1, 0.1, 0.12));
        test_meshes::union(&[leg(0.0, 0.0), leg(0.08, 0.0), leg(0.0, 0.08), leg(0.08, 0.08), top])
    }

    #[test]
    fn table_keeps_its_legs_and_the_space_between_them() {
        let table = table();
        let hulls = decompose_parts(&table, 16);
        check(&hulls);
        assert!((5..=8).contains(&hulls.len()), "{} parts", hulls.len());
        let (got, wanted) = (sum_of_volumes(&hulls), f64::from(test_meshes::volume(&table)));
        assert!((got / wanted - 1.0).abs() < 0.1, "wanted {wanted}, got {got}");
        let few = decompose_parts(&table, 3);
        assert!(few.len() <= 3, "{} parts", few.len());
    }

    #[test]
    fn filled_fraction_falls_from_all_to_nearly_none_with_more_parts() {
        let filled = |max_parts| decompose_by_planes(&table(), max_parts).unwrap().filled_fraction;
        let (one, many) = (filled(1), filled(16));
        assert!((0.85..=1.0).contains(&one), "one part fills {one} of the space under the table");
        assert!((0.0..0.1).contains(&many), "16 parts fill {many} of the space under the table");
    }

    #[test]
    fn open_box_stays_hollow() {
        let mut mesh = test_meshes::cuboid(Vec3::ZERO, Vec3::splat(0.1));
        mesh.triangles.retain(|t| t.iter().any(|&i| i < 4));
        let (mesh, repair) = repair(mesh).unwrap();
        assert!(
            matches!(repair, RepairReport { watertight: false, boundary_edges: 4, .. }),
            "{repair:?}"
        );
        let hulls = decompose_parts(&mesh, 16);
        check(&hulls);
        let fraction = sum_of_volumes(&hulls) / 0.001;
        assert!(fraction < 0.2, "walls fill {fraction} of the box");
    }

    /// Four boxes of random sizes and poses that overlap.
    fn heap_of_boxes(rng: &mut impl rand::Rng) -> Mesh {
        let mut vector = || Vec3::from_array([(); 3].map(|()| rng.random_range(-0.1..0.1)));
        let boxes = [(); 4].map(|()| {
            let (half, axis, center) = (vector().abs() + 0.01, vector(), vector());
            let rotation = glamx::Quat::from_xyzw(axis.x, axis.y, axis.z, 0.1).normalize();
            let mut mesh = test_meshes::cuboid(-half, half);
            mesh.vertices.iter_mut().for_each(|p| *p = rotation * *p + center);
            mesh
        });
        test_meshes::union(&boxes)
    }

    #[test]
    fn parts_cover_the_mesh() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        for round in 0..3 {
            let mesh = heap_of_boxes(&mut rng);
            let parts = decompose(&mesh);
            let hulls: Vec<_> =
                parts.hulls.iter().map(|points| convex_hull(points, usize::MAX).unwrap()).collect();
            let outside = |hull: &Mesh, p: Vec3| {
                let planes = hull.triangles.iter().map(|t| t.map(|i| hull.vertices[i as usize]));
                let height =
                    |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).normalize_or_zero().dot(p - a);
                planes.map(height).fold(f32::NEG_INFINITY, f32::max)
            };
            for &p in &mesh.vertices {
                let distance =
                    hulls.iter().map(|hull| outside(hull, p)).fold(f32::INFINITY, f32::min);
                assert!(distance < 0.002, "round {round}: {p} is {distance} m outside all parts");
            }
            for points in &parts.hulls {
                assert!(parry3d::shape::ConvexPolyhedron::from_convex_hull(points).is_some());
            }
        }
    }

    /// Golden values, equal on every machine and in wasm; they change only with the method.
    #[test]
    fn parts_and_mass_properties_are_bit_identical_everywhere() {
        let mesh = heap_of_boxes(&mut rand_chacha::ChaCha8Rng::seed_from_u64(9));
        let parts = decompose_parts(&mesh, 12);
        let properties = crate::mass_properties(&mesh, true).unwrap();
        let floats = parts.iter().flatten().flat_map(|p| p.to_array());
        let floats = floats
            .chain(properties.center_of_mass.to_array())
            .chain(properties.inertia.into_iter().flatten());
        let bytes: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
        let hash = blake3::hash(&bytes).to_hex();
        assert_eq!((parts.len(), &hash[..16]), (4, "feb570863c8425b3"));
    }

    #[test]
    fn sheets_and_needles_get_a_volume() {
        let sheet =
            [[0.0, 0.0, 0.0], [0.1, 0.0, 0.05], [0.1, 0.1, 0.05], [0.0, 0.1, 0.0]].map(Vec3::from);
        let mesh = Mesh { vertices: sheet.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] };
        let parts = decompose(&mesh);
        assert_eq!(parts.method, Method::Hull);
        check(&parts.hulls);
        check(&[hull_vertices(&[Vec3::ZERO, Vec3::X * 0.1, Vec3::X * 0.2]), hull_vertices(&[])]);
    }
}
