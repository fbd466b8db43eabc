//! Voxel grid of a mesh: cells are outside, on the surface, or inside.
//!
//! A hole wider than a cell makes the inside part of the outside: only a thin wall of surface cells remains.

use super::principal_axes::principal_axes;
use crate::Mesh;
use glamx::{DMat3, DVec3, Vec3};

/// Class of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// Connected to the border without crossing the surface.
    Outside,
    /// Touched by a triangle.
    Surface,
    /// Enclosed.
    Inside,
}

/// Voxel grid along the principal axes of the mesh, with a border of outside cells around it.
///
/// Grid coordinates count cells: the cell with the indices (i, j, k) extends from (i, j, k) to (i + 1, j + 1, k + 1).
pub(super) struct VoxelGrid {
    /// Rotation from the mesh frame.
    rotation: DMat3,
    /// Lowest corner (m), rotated frame.
    origin: DVec3,
    /// Edge length of a cell (m).
    cell_size: f64,
    /// Cells along each axis.
    pub(super) size: [usize; 3],
    cells: Vec<Cell>,
}

/// Max number of cell-triangle tests, a few seconds. Only meshes of many huge triangles exceed it.
const MAX_TESTS: usize = 100_000_000;

/// Width of the border (cells).
///
/// With this value, the faces of a box are near the centres of the outermost cells. Faces at simple
/// fractions of the length, common in CAD models, are not on a boundary between cells.
const BORDER_WIDTH: f64 = 1.5371;

/// Min side of the box that is divided into cells (fraction of its longest side).
const MIN_SIDE: f64 = 0.02;

impl VoxelGrid {
    /// Grid of about `num_cells` cells.
    ///
    /// Returns `None` above the test limit, or for a mesh of zero size.
    pub(super) fn new(mesh: &Mesh, num_cells: u32) -> Option<Self> {
        let corners = |t: &[u32; 3]| t.map(|i| mesh.vertices[i as usize].as_dvec3());
        // Over a triangle, the second moments are those of its corners, 1/12 each, and its centre, 9/12.
        let rotation = principal_axes(mesh.triangles.iter().flat_map(|t| {
            let [a, b, c] = corners(t);
            let twelfth = (b - a).cross(c - a).length() / 12.0;
            [(a, twelfth), (b, twelfth), (c, twelfth), ((a + b + c) / 3.0, 9.0 * twelfth)]
        }));
        let rotated = mesh.vertices.iter().map(|p| rotation * p.as_dvec3());
        let low = rotated.clone().fold(DVec3::MAX, DVec3::min);
        let high = rotated.fold(DVec3::MIN, DVec3::max);
        let side = (high - low).max(DVec3::splat(MIN_SIDE * (high - low).max_element()));
        let cell = libm::cbrt(side.element_product() / f64::from(num_cells));
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let origin = low - BORDER_WIDTH * cell;
        let size = ((high - low) / cell).to_array().map(|x| x.ceil() as usize + 4);
        let cells = vec![Cell::Inside; size.iter().product()];
        let mut grid = Self { rotation, origin, cell_size: cell, size, cells };
        grid.mark_surface(mesh)?;
        grid.flood_outside();
        Some(grid)
    }

    /// Grid coordinates of a point (m, mesh frame).
    pub(super) fn to_cells(&self, point: Vec3) -> DVec3 {
        (self.rotation * point.as_dvec3() - self.origin) / self.cell_size
    }

    /// Point (m, mesh frame) at grid coordinates.
    pub(super) fn to_mesh(&self, point: Vec3) -> Vec3 {
        (self.rotation.transpose() * (point.as_dvec3() * self.cell_size + self.origin)).as_vec3()
    }

    /// Axes of the mesh frame, in grid coordinates.
    pub(super) fn file_axes(&self) -> [Vec3; 3] {
        [0, 1, 2].map(|axis| self.rotation.col(axis).as_vec3())
    }

    /// Class of the cell with this index.
    pub(super) fn cell(&self, index: usize) -> Cell {
        self.cells[index]
    }

    /// Class of the cell at grid coordinates within the grid.
    pub(super) fn cell_at(&self, point: DVec3) -> Cell {
        let cell = point.to_array().map(|x| x.floor());
        let is_within = (0..3).all(|axis| (0.0..self.size[axis] as f64).contains(&cell[axis]));
        if is_within { self.cells[self.index(cell.map(|x| x as usize))] } else { Cell::Outside }
    }

    /// Indices along each axis of the cell with this index.
    fn indices(&self, index: usize) -> [usize; 3] {
        let [width, depth, _] = self.size;
        [index % width, index / width % depth, index / (width * depth)]
    }

    /// Centre of the cell with this index, in grid coordinates.
    pub(super) fn center(&self, index: usize) -> Vec3 {
        Vec3::from_array(self.indices(index).map(|i| i as f32 + 0.5))
    }

    /// Up to `max_count` points in surface cells, in grid coordinates.
    ///
    /// They alternate between two heights: hulls of one layer of cells are not flat.
    pub(super) fn surface_points(&self, max_count: usize) -> Vec<Vec3> {
        let surface: Vec<usize> =
            (0..self.cells.len()).filter(|&i| self.cells[i] == Cell::Surface).collect();
        let stride = surface.len().div_ceil(max_count).max(1);
        let point = |(k, chunk): (usize, &[usize])| {
            let index = chunk[k * 7919 % chunk.len()];
            let is_even = self.indices(index).iter().sum::<usize>() % 2 == 0;
            self.center(index) + if is_even { 0.25 } else { -0.25 }
        };
        surface.chunks(stride).enumerate().map(point).collect()
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    fn mark_surface(&mut self, mesh: &Mesh) -> Option<()> {
        let mut tests = 0;
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| self.to_cells(mesh.vertices[i as usize]));
            let low = corners[0].min(corners[1]).min(corners[2]).to_array().map(|x| x as usize);
            let high = corners[0].max(corners[1]).max(corners[2]).to_array().map(|x| x as usize);
            tests += (0..3).map(|axis| high[axis] - low[axis] + 1).product::<usize>();
            if tests > MAX_TESTS {
                return None;
            }
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        let center = DVec3::new(x as f64, y as f64, z as f64) + 0.5;
                        let index = self.index([x, y, z]);
                        if self.cells[index] == Cell::Inside
                            && touches_unit_cube(corners.map(|p| p - center))
                        {
                            self.cells[index] = Cell::Surface;
                        }
                    }
                }
            }
        }
        Some(())
    }

    fn flood_outside(&mut self) {
        let mut stack = vec![[0_usize; 3]];
        self.cells[0] = Cell::Outside;
        while let Some(cell) = stack.pop() {
            for axis in 0..3 {
                for step in [usize::MAX, 1] {
                    let mut next = cell;
                    next[axis] = cell[axis].wrapping_add(step);
                    if next[axis] >= self.size[axis] {
                        continue;
                    }
                    let index = self.index(next);
                    if self.cells[index] == Cell::Inside {
                        self.cells[index] = Cell::Outside;
                        stack.push(next);
                    }
                }
            }
        }
    }
}

/// Whether a triangle touches the unit cube centred at the origin, by the 13 separating axes.
fn touches_unit_cube(corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners;
    let edges = [b - a, c - b, a - c];
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let separates = |axis: DVec3| {
        let [p, q, r] = corners.map(|corner| axis.dot(corner));
        // Slightly enlarged, so that no gap opens between cells.
        let half_width = 0.5 * (axis.x.abs() + axis.y.abs() + axis.z.abs()) * (1.0 + 1e-9);
        p.min(q).min(r) > half_width || p.max(q).max(r) < -half_width
    };
    !(axes.into_iter().any(separates)
        || separates(edges[0].cross(edges[1]))
        || edges.iter().any(|&edge| axes.into_iter().any(|axis| separates(edge.cross(axis)))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes;

    /// Volume of the grid (m³); a surface cell counts one half.
    fn volume(grid: &VoxelGrid) -> f64 {
        let share = |cell: &Cell| match cell {
            Cell::Outside => 0.0,
            Cell::Surface => 0.5,
            Cell::Inside => 1.0,
        };
        grid.cells.iter().map(share).sum::<f64>() * grid.cell_size.powi(3)
    }

    #[test]
    fn volume_of_a_rotated_box_is_that_of_its_cells() {
        let mut mesh = test_meshes::cuboid(Vec3::ZERO, Vec3::new(0.2, 0.1, 0.05));
        let rotation = glamx::Quat::from_xyzw(0.3, -0.2, 0.5, 1.0).normalize();
        mesh.vertices.iter_mut().for_each(|p| *p = rotation * *p);
        let grid = VoxelGrid::new(&mesh, 50_000).unwrap();
        assert!((volume(&grid) / 0.001 - 1.0).abs() < 0.02, "{}", volume(&grid));
        let mut size = grid.size;
        size.sort_unstable();
        // Along the principal axes the cells count as the sides do: 4 : 2 : 1, and 4 for the border.
        let [short, middle, long] = size.map(|n| n as f64 - 4.0);
        assert!((long / short - 4.0).abs() < 0.2 && (middle / short - 2.0).abs() < 0.1, "{size:?}");
        assert_eq!(grid.cell(0), Cell::Outside);
        let center = rotation * Vec3::new(0.1, 0.05, 0.025);
        assert_eq!(grid.cell_at(grid.to_cells(center)), Cell::Inside);
        assert!((grid.to_mesh(grid.to_cells(center).as_vec3()) - center).length() < 1e-6);
    }

    #[test]
    fn open_box_becomes_a_thin_wall() {
        let mut mesh = test_meshes::cube();
        mesh.triangles.truncate(10);
        let grid = VoxelGrid::new(&mesh, 30_000).unwrap();
        assert_eq!(grid.cell_at(grid.to_cells(Vec3::splat(0.5))), Cell::Outside);
        assert_eq!(grid.cell_at(DVec3::splat(-1.0)), Cell::Outside);
    }

    #[test]
    fn triangle_that_only_passes_the_cube_does_not_touch() {
        let triangle =
            |x: f64| [DVec3::new(x, -9.0, -9.0), DVec3::new(x, 9.0, 0.0), DVec3::new(x, 0.0, 9.0)];
        assert!(
            touches_unit_cube(triangle(0.49))
                && touches_unit_cube(triangle(0.5))
                && !touches_unit_cube(triangle(0.51))
        );
        // Misses a corner of the cube, although it crosses the plane of each face.
        let corner =
            [DVec3::new(1.6, 0.0, 0.0), DVec3::new(0.0, 1.6, 0.0), DVec3::new(0.0, 0.0, 1.6)];
        assert!(!touches_unit_cube(corner) && touches_unit_cube(corner.map(|p| p * 0.9)));
    }
}
