//! Part of a mesh: its surface within a convex region, and the hull of the solid there.

use super::empty_space::EmptySpace;
use super::filled_hull::FilledHull;
use super::voxel_grid::{Cell, VoxelGrid};
use glamx::{DMat3, DVec3, Vec3};

/// Half-space: a point inside has `normal.dot(point) <= offset` (cells).
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) normal: Vec3,
    pub(super) offset: f32,
}

impl HalfSpace {
    pub(super) fn opposite(&self) -> Self {
        Self { normal: -self.normal, offset: -self.offset }
    }

    /// Height (cells) of a point above the plane.
    pub(super) fn height(&self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.offset
    }
}

/// Grid, surface and empty space of the mesh that is decomposed, in grid coordinates.
pub(super) struct Solid<'a> {
    pub(super) grid: &'a VoxelGrid,
    /// Points on the surface, for the search for cuts.
    pub(super) surface: Vec<Vec3>,
    pub(super) space: EmptySpace,
}

/// Part that can be cut.
pub(super) struct Part {
    /// Half-spaces whose intersection is the region.
    sides: Vec<HalfSpace>,
    /// Surface within the region.
    polygons: Vec<Vec<DVec3>>,
    /// Corners of the region that are inside the solid.
    corners: Vec<Vec3>,
    /// Indices of the surface points within the region.
    pub(super) points: Vec<u32>,
    pub(super) hull: FilledHull,
}

impl Part {
    /// The whole mesh.
    pub(super) fn whole(solid: &Solid, triangles: Vec<Vec<DVec3>>) -> Self {
        let points = (0..solid.surface.len() as u32).collect();
        Self::new(solid, Vec::new(), triangles, Vec::new(), points)
    }

    fn new(
        solid: &Solid,
        sides: Vec<HalfSpace>,
        polygons: Vec<Vec<DVec3>>,
        corners: Vec<Vec3>,
        points: Vec<u32>,
    ) -> Self {
        let surface = polygons.iter().flatten().map(|p| p.as_vec3());
        let content: Vec<Vec3> = surface.chain(corners.iter().copied()).collect();
        let hull = FilledHull::new(&content, &solid.space);
        Self { sides, polygons, corners, points, hull }
    }

    /// Both sides of a plane; `None` if one has no surface.
    pub(super) fn cut(&self, solid: &Solid, plane: &HalfSpace) -> Option<[Self; 2]> {
        Some([self.side(solid, plane)?, self.side(solid, &plane.opposite())?])
    }

    fn side(&self, solid: &Solid, side: &HalfSpace) -> Option<Self> {
        let (normal, offset) = (side.normal.as_dvec3(), f64::from(side.offset));
        let clipped = self.polygons.iter().map(|polygon| clip(polygon, |p| offset - normal.dot(p)));
        let polygons: Vec<_> = clipped.filter(|polygon| !polygon.is_empty()).collect();
        if polygons.is_empty() {
            return None;
        }
        let mut corners = self.corners.clone();
        corners.retain(|p| side.height(*p) <= 0.0);
        corners.extend(corners_on(solid.grid, &self.sides, side));
        let mut points = self.points.clone();
        points.retain(|&i| side.height(solid.surface[i as usize]) <= 0.0);
        let sides = [&self.sides[..], &[*side]].concat();
        Some(Self::new(solid, sides, polygons, corners, points))
    }
}

/// Corners of a region on its new side that are inside the solid.
fn corners_on(grid: &VoxelGrid, sides: &[HalfSpace], side: &HalfSpace) -> Vec<Vec3> {
    let in_double = |side: &HalfSpace| (side.normal.as_dvec3(), f64::from(side.offset));
    let (normal, offset) = in_double(side);
    let sides: Vec<(DVec3, f64)> = sides.iter().map(in_double).collect();
    let mut corners = Vec::new();
    for (i, (normal_i, offset_i)) in sides.iter().enumerate() {
        for (normal_j, offset_j) in &sides[..i] {
            let matrix = DMat3::from_cols(normal, *normal_i, *normal_j).transpose();
            if matrix.determinant().abs() < MIN_DETERMINANT {
                continue;
            }
            let corner = matrix.inverse() * DVec3::new(offset, *offset_i, *offset_j);
            let is_within = sides.iter().all(|(n, d)| n.dot(corner) <= d + 1e-6);
            if is_within && grid.cell_at(corner) == Cell::Inside {
                corners.push(corner.as_vec3());
            }
        }
    }
    corners
}

/// Determinant of three unit normals below which their planes have no common point.
const MIN_DETERMINANT: f64 = 1e-6;

/// Clips a convex polygon to the half-space where `height` >= 0 (Sutherland-Hodgman).
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
