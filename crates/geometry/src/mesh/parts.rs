//! A mesh as few convex parts, because physics collides convex bodies only.
//!
//! In: a healed mesh. Out: for each part the corners of its hull. A nearly convex mesh is one part; any other
//! is cut into blocks of cells (`split`), each part the hull of the true surface within its block, and parts
//! that fit one hull are joined again. No step can panic and all are the same bit for bit on every machine.

use super::hull::hull_within;
use super::split::split;
use super::voxels::{Block, Cell, Grid};
use super::{Mesh, bounds, hull, mass};
use crate::Vec3;
use glamx::DVec3;

/// How parts were found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Cut along a grid.
    Decomposed {
        /// Cells along the longest side.
        resolution: u32,
    },
    /// One hull: the mesh is nearly convex, or could not be cut.
    Hull,
}

/// The convex parts of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// Corners of each hull (m).
    pub hulls: Vec<Vec<Vec3>>,
    /// How they were found.
    pub method: Method,
}

/// Most parts of an object.
pub(super) const MAX_PARTS: u32 = 24;
/// Cells along the longest side, tried in this order.
const RESOLUTIONS: [u32; 2] = [64, 32];
/// Most corners of a part.
const PART_POINTS: usize = 64;
/// Corners that stand out by less are left out (fraction of the part's longest side): physics engines stumble
/// over slivers.
const DETAIL: f64 = 1e-3;
/// Points of the hull that a mesh is compared with.
const HULL_POINTS: usize = 2000;
/// A mesh that fills this fraction of its hull is convex.
const CONVEX: f64 = 0.97;
/// Parts are joined if that adds less empty space than this (fraction of the volume of all).
const JOIN: f64 = 0.005;
/// Thickness given to flat parts (fraction of the longest side).
const SHEET: f32 = 0.004;

/// The parts with the finest grid that can be had in time, else the hull; `mesh` is healed.
pub fn convex_parts_or_hull(mesh: &Mesh) -> Parts {
    if !is_convex(mesh) {
        for resolution in RESOLUTIONS {
            if let Some(hulls) = decompose(mesh, resolution, MAX_PARTS) {
                return Parts { hulls, method: Method::Decomposed { resolution } };
            }
        }
    }
    Parts { hulls: vec![corners(&mesh.vertices)], method: Method::Hull }
}

/// At most `max_parts` parts from a grid of `resolution` cells along the longest side; `mesh` is healed.
///
/// One part if the mesh is nearly convex, or if it cannot be cut.
pub fn convex_parts(mesh: &Mesh, resolution: u32, max_parts: u32) -> Vec<Vec<Vec3>> {
    let parts = if is_convex(mesh) { None } else { decompose(mesh, resolution, max_parts) };
    parts.unwrap_or_else(|| vec![corners(&mesh.vertices)])
}

fn is_convex(mesh: &Mesh) -> bool {
    let Some(hull) = hull(&mesh.vertices, HULL_POINTS) else { return true };
    let share = mass::volume(mesh) / mass::volume(&hull);
    // What fills more than its hull counts some of it twice, and the hull may be hollow.
    (CONVEX..=mass::HULL_SLACK).contains(&share)
}

fn decompose(mesh: &Mesh, resolution: u32, max_parts: u32) -> Option<Vec<Vec<Vec3>>> {
    let grid = Grid::new(mesh, resolution)?;
    let max_parts = max_parts.max(1) as usize;
    let blocks = split(&grid, 2 * max_parts);
    let contents = blocks.iter().map(|block| contents(mesh, &grid, block));
    let parts =
        contents.filter(|points| !points.is_empty()).map(|points| Part::new(corners(&points)));
    let parts = join(parts.collect(), max_parts);
    (!parts.is_empty()).then(|| parts.into_iter().map(|part| part.corners).collect())
}

/// A convex part and its volume (m³).
struct Part {
    corners: Vec<Vec3>,
    volume: f64,
}

impl Part {
    fn new(corners: Vec<Vec3>) -> Self {
        let volume = hull(&corners, usize::MAX).map_or(0.0, |mesh| mass::volume(&mesh));
        Self { corners, volume }
    }

    fn joined(&self, other: &Self) -> Self {
        Self::new(corners(&[&self.corners[..], &other.corners].concat()))
    }
}

/// Joins the pair that adds the least empty space, as long as it adds little or there are too many parts.
fn join(mut parts: Vec<Part>, max_parts: usize) -> Vec<Part> {
    let enough = JOIN * parts.iter().map(|part| part.volume).sum::<f64>();
    let added = |a: &Part, b: &Part| a.joined(b).volume - a.volume - b.volume;
    let mut pairs = Vec::new();
    for i in 0..parts.len() {
        pairs.extend((0..i).map(|j| (added(&parts[i], &parts[j]), i, j)));
    }
    // The place of a joined part is kept until the end, so that the indices in `pairs` stay right.
    let mut is_left = vec![true; parts.len()];
    let mut num_parts = parts.len();
    while let Some(&(cost, i, j)) = pairs.iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
        if cost > enough && num_parts <= max_parts {
            break;
        }
        parts[j] = parts[i].joined(&parts[j]);
        is_left[i] = false;
        num_parts -= 1;
        pairs.retain(|&(_, a, b)| ![a, b].contains(&i) && ![a, b].contains(&j));
        let others = (0..parts.len()).filter(|&k| is_left[k] && k != j);
        pairs.extend(others.map(|k| (added(&parts[k], &parts[j]), k.max(j), k.min(j))));
    }
    let parts = parts.into_iter().zip(is_left);
    parts.filter_map(|(part, is_left)| is_left.then_some(part)).collect()
}

/// Points whose hull is that of the solid within a block: its surface there, and the block's corners inside it.
fn contents(mesh: &Mesh, grid: &Grid, block: &Block) -> Vec<Vec3> {
    let plane =
        |cells: [usize; 3]| grid.origin + DVec3::from_array(cells.map(|i| i as f64)) * grid.cell;
    // The grid's border keeps the outermost planes off the mesh.
    let [low, high] = [plane(block.low), plane(block.high)];
    let mut points = Vec::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.vertices[i as usize].as_dvec3());
        let least = corners[0].min(corners[1]).min(corners[2]);
        let most = corners[0].max(corners[1]).max(corners[2]);
        if least.cmpgt(high).any() || most.cmplt(low).any() {
            continue;
        }
        let mut polygon = corners.to_vec();
        for axis in 0..3 {
            polygon = clip(&polygon, |p| p[axis] - low[axis]);
            polygon = clip(&polygon, |p| high[axis] - p[axis]);
        }
        points.extend(polygon.iter().map(|p| p.as_vec3()));
    }
    for corner in 0..8 {
        let at = [0, 1, 2]
            .map(|axis| if corner >> axis & 1 == 0 { block.low[axis] } else { block.high[axis] });
        let touches_inside = (0..8).any(|side| {
            // The eight cells around a lattice point; those beyond the grid wrap and are not there.
            let cell = [0, 1, 2].map(|axis| at[axis].wrapping_sub(side >> axis & 1));
            (0..3).all(|axis| cell[axis] < grid.size[axis]) && grid.at(cell) == Cell::Inside
        });
        if touches_inside {
            points.push(plane(at).as_vec3());
        }
    }
    points
}

/// The part of a convex polygon where `height` is not negative (Sutherland-Hodgman).
fn clip(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (a, b) = (height(p), height(q));
        if a >= 0.0 {
            kept.push(p);
        }
        if (a < 0.0) != (b < 0.0) {
            kept.push(p + (q - p) * (a / (a - b)));
        }
    }
    kept
}

/// The corners of the hull of some points; a sheet is given a little thickness first.
fn corners(points: &[Vec3]) -> Vec<Vec3> {
    let of = |points: &[Vec3]| hull_within(points, PART_POINTS, DETAIL);
    let hull = of(points).or_else(|| of(&thickened(points)));
    hull.map_or_else(|| box_around(points), |mesh| mesh.vertices)
}

/// Points in a plane, once on each side of it.
fn thickened(points: &[Vec3]) -> Vec<Vec3> {
    let first = points.first().copied().unwrap_or_default();
    let longest = |a: Vec3, b: Vec3| if b.length_squared() > a.length_squared() { b } else { a };
    let along = points.iter().map(|&p| p - first).fold(Vec3::ZERO, longest);
    let across = points.iter().map(|&p| along.cross(p - first)).fold(Vec3::ZERO, longest);
    let offset = across.normalize_or_zero() * (0.5 * SHEET * along.length());
    points.iter().flat_map(|&p| [p + offset, p - offset]).collect()
}

/// The corners of the bounding box, none of its sides zero.
fn box_around(points: &[Vec3]) -> Vec<Vec3> {
    let [low, high] = bounds(points);
    let side = high - low;
    let least = Vec3::splat((SHEET * side.max_element()).max(1e-4));
    let (middle, half) = ((low + high) / 2.0, side.max(least) / 2.0);
    let sign = |corner: u32, axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    (0..8).map(|i| middle + half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Healing, heal, samples};
    use rand::{RngExt, SeedableRng};

    fn sum_of_volumes(hulls: &[Vec<Vec3>]) -> f64 {
        hulls.iter().map(|points| mass::volume(&hull(points, usize::MAX).unwrap())).sum()
    }

    /// What rapier will build from each part must be the same body.
    fn check(hulls: &[Vec<Vec3>]) {
        for points in hulls {
            assert!((4..=PART_POINTS).contains(&points.len()), "{} points", points.len());
            let shape = parry3d::shape::ConvexPolyhedron::from_convex_hull(points).unwrap();
            let got = parry3d::shape::Shape::mass_properties(&shape, 1.0).mass();
            let wanted = mass::volume(&hull(points, usize::MAX).unwrap()) as f32;
            assert!((got / wanted - 1.0).abs() < 1e-3, "wanted {wanted}, got {got}");
        }
    }

    #[test]
    fn an_l_has_two_parts_that_fill_it() {
        let parts = convex_parts_or_hull(&samples::l_shape());
        assert_eq!(parts.method, Method::Decomposed { resolution: 64 });
        assert!((2..=3).contains(&parts.hulls.len()), "{} parts", parts.hulls.len());
        check(&parts.hulls);
        let (got, wanted) =
            (sum_of_volumes(&parts.hulls), f64::from(samples::volume(&samples::l_shape())));
        assert!((got / wanted - 1.0).abs() < 0.02, "wanted {wanted}, got {got}");
    }

    #[test]
    fn what_is_there_twice_keeps_its_notch() {
        let mut twice = samples::l_shape();
        let count = twice.vertices.len() as u32;
        let again = samples::l_shape();
        twice.vertices.extend(again.vertices.iter().map(|v| *v + Vec3::splat(1e-4)));
        twice.triangles.extend(again.triangles.iter().map(|t| t.map(|i| i + count)));
        let parts = convex_parts_or_hull(&twice);
        assert!(parts.hulls.len() > 1, "{:?}", parts.method);
    }

    #[test]
    fn a_box_is_one_part_of_eight_corners() {
        let parts = convex_parts_or_hull(&samples::cube());
        assert_eq!((parts.method, parts.hulls.len()), (Method::Hull, 1));
        assert_eq!(parts.hulls[0].len(), 8);
        assert_eq!(convex_parts(&samples::cube(), 64, 8), parts.hulls);
    }

    #[test]
    fn a_table_keeps_its_legs_and_the_space_between() {
        let leg = |x: f32, y: f32| {
            samples::cuboid(Vec3::new(x, y, 0.0), Vec3::new(x + 0.02, y + 0.02, 0.1))
        };
        let top = samples::cuboid(Vec3::new(0.0, 0.0, 0.1), Vec3::new(0.1, 0.1, 0.12));
        let table =
            samples::union(&[leg(0.0, 0.0), leg(0.08, 0.0), leg(0.0, 0.08), leg(0.08, 0.08), top]);
        let hulls = convex_parts(&table, 64, 16);
        check(&hulls);
        assert!((5..=8).contains(&hulls.len()), "{} parts", hulls.len());
        let (got, wanted) = (sum_of_volumes(&hulls), f64::from(samples::volume(&table)));
        assert!((got / wanted - 1.0).abs() < 0.02, "wanted {wanted}, got {got}");
        let few = convex_parts(&table, 64, 3);
        assert!(few.len() <= 3, "{} parts", few.len());
    }

    #[test]
    fn an_open_box_stays_open() {
        let mut mesh = samples::cuboid(Vec3::ZERO, Vec3::splat(0.1));
        mesh.triangles.retain(|t| t.iter().any(|&i| i < 4));
        let (mesh, healing) = heal(mesh).unwrap();
        assert!(matches!(healing, Healing { watertight: false, open_edges: 4, .. }), "{healing:?}");
        let hulls = convex_parts(&mesh, 64, 16);
        check(&hulls);
        let share = sum_of_volumes(&hulls) / 0.001;
        assert!(share < 0.2, "walls fill {share} of the box");
    }

    /// Boxes of all sizes, turned and stuck together.
    fn heap_of_boxes(rng: &mut impl rand::Rng) -> Mesh {
        let mut vector = || Vec3::from_array([(); 3].map(|()| rng.random_range(-0.1..0.1)));
        let boxes = [(); 4].map(|()| {
            let (half, axis, middle) = (vector().abs() + 0.01, vector(), vector());
            let turn = glamx::Quat::from_xyzw(axis.x, axis.y, axis.z, 0.1).normalize();
            let mut mesh = samples::cuboid(-half, half);
            mesh.vertices.iter_mut().for_each(|p| *p = turn * *p + middle);
            mesh
        });
        samples::union(&boxes)
    }

    #[test]
    fn parts_cover_the_mesh() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        for round in 0..3 {
            let mesh = heap_of_boxes(&mut rng);
            let parts = convex_parts_or_hull(&mesh);
            let hulls: Vec<_> =
                parts.hulls.iter().map(|points| hull(points, usize::MAX).unwrap()).collect();
            let outside = |hull: &Mesh, p: Vec3| {
                let planes = hull.triangles.iter().map(|t| t.map(|i| hull.vertices[i as usize]));
                let height =
                    |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).normalize_or_zero().dot(p - a);
                planes.map(height).fold(f32::NEG_INFINITY, f32::max)
            };
            for &p in &mesh.vertices {
                let gap = hulls.iter().map(|hull| outside(hull, p)).fold(f32::INFINITY, f32::min);
                assert!(gap < 0.002, "round {round}: {p} is {gap} m outside of all parts");
            }
            for points in &parts.hulls {
                assert!(parry3d::shape::ConvexPolyhedron::from_convex_hull(points).is_some());
            }
        }
    }

    /// The constants hold on every machine and in the browser; they change only with the method.
    #[test]
    fn parts_and_mass_are_the_same_bits_everywhere() {
        let mesh = heap_of_boxes(&mut rand_chacha::ChaCha8Rng::seed_from_u64(9));
        let parts = convex_parts(&mesh, 32, 12);
        let solid = crate::mesh::solid(&mesh, true).unwrap();
        let floats = parts.iter().flatten().flat_map(|p| p.to_array());
        let floats =
            floats.chain(solid.center.to_array()).chain(solid.inertia.into_iter().flatten());
        let bytes: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
        let hash = blake3::hash(&bytes).to_hex();
        assert_eq!((parts.len(), &hash[..16]), (7, "e80405c233ac45cc"));
    }

    #[test]
    fn sheets_and_needles_have_a_body() {
        let sheet =
            [[0.0, 0.0, 0.0], [0.1, 0.0, 0.05], [0.1, 0.1, 0.05], [0.0, 0.1, 0.0]].map(Vec3::from);
        let mesh = Mesh { vertices: sheet.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] };
        let parts = convex_parts_or_hull(&mesh);
        assert_eq!(parts.method, Method::Hull);
        check(&parts.hulls);
        check(&[corners(&[Vec3::ZERO, Vec3::X * 0.1, Vec3::X * 0.2]), corners(&[])]);
    }
}
