//! Voxel grid of a mesh: cells are outside, on the surface, or inside.
//!
//! A hole wider than a cell makes the inside part of the outside: only a thin wall of surface cells remains.

use crate::Mesh;
use glamx::DVec3;

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

/// Voxel grid with a border of outside cells around the mesh.
pub(super) struct VoxelGrid {
    /// Lowest corner (m).
    pub(super) origin: DVec3,
    /// Edge length of a cell (m).
    pub(super) cell_size: f64,
    /// Cells along each axis.
    pub(super) size: [usize; 3],
    cells: Vec<Cell>,
    /// For each lattice point, twice the volume (cells) below it. A surface cell counts one half.
    prefix_sums: Vec<u32>,
}

/// Block: an axis-aligned box of cells from `low` to `high`, `high` excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellBox {
    pub(super) low: [usize; 3],
    pub(super) high: [usize; 3],
}

/// Max number of cell-triangle tests, a few seconds. Only meshes of many huge triangles exceed it.
const MAX_TESTS: usize = 100_000_000;

/// Width of the border (cells).
///
/// With this value, the faces of a box are near the centres of the outermost cells. Faces at simple
/// fractions of the length, common in CAD models, are not on a boundary between cells.
const BORDER_WIDTH: f64 = 1.5371;

impl VoxelGrid {
    /// Grid with `resolution` - 1 cells along the longest side.
    ///
    /// Returns `None` above the test limit, or for a mesh of zero size.
    pub(super) fn new(mesh: &Mesh, resolution: u32) -> Option<Self> {
        let [low, high] = mesh.bounds().map(|corner| corner.as_dvec3());
        let cell = (high - low).max_element() / f64::from(resolution.clamp(4, 256) - 1);
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let origin = low - BORDER_WIDTH * cell;
        let size = ((high - low) / cell).to_array().map(|x| x.ceil() as usize + 4);
        let count = size.iter().product();
        let mut grid = Self {
            origin,
            cell_size: cell,
            size,
            cells: vec![Cell::Inside; count],
            prefix_sums: Vec::new(),
        };
        grid.mark_surface(mesh)?;
        grid.flood_outside();
        grid.build_prefix_sums();
        Some(grid)
    }

    pub(super) fn full_block(&self) -> CellBox {
        CellBox { low: [0; 3], high: self.size }
    }

    pub(super) fn cell_at(&self, [x, y, z]: [usize; 3]) -> Cell {
        self.cells[self.index([x, y, z])]
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// Volume within a block (cells).
    pub(super) fn volume(&self, block: &CellBox) -> f64 {
        let [width, depth, _] = self.size.map(|n| n + 1);
        let sum =
            |x: usize, y: usize, z: usize| i64::from(self.prefix_sums[x + width * (y + depth * z)]);
        let ([x0, y0, z0], [x1, y1, z1]) = (block.low, block.high);
        let layer = |z| sum(x1, y1, z) - sum(x0, y1, z) - sum(x1, y0, z) + sum(x0, y0, z);
        (layer(z1) - layer(z0)) as f64 / 2.0
    }

    fn mark_surface(&mut self, mesh: &Mesh) -> Option<()> {
        let mut tests = 0;
        for triangle in &mesh.triangles {
            let corners = triangle
                .map(|i| (mesh.vertices[i as usize].as_dvec3() - self.origin) / self.cell_size);
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

    fn build_prefix_sums(&mut self) {
        let [width, depth, height] = self.size.map(|n| n + 1);
        let mut sums = vec![0_u32; width * depth * height];
        for z in 1..height {
            for y in 1..depth {
                let mut row = 0;
                for x in 1..width {
                    row += match self.cell_at([x - 1, y - 1, z - 1]) {
                        Cell::Outside => 0,
                        Cell::Surface => 1,
                        Cell::Inside => 2,
                    };
                    let at = |y: usize, z: usize| x + width * (y + depth * z);
                    sums[at(y, z)] =
                        row + sums[at(y - 1, z)] + sums[at(y, z - 1)] - sums[at(y - 1, z - 1)];
                }
            }
        }
        self.prefix_sums = sums;
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
    use glamx::Vec3;

    #[test]
    fn grid_volume_matches_the_box() {
        let mesh = test_meshes::cuboid(Vec3::ZERO, Vec3::new(0.2, 0.1, 0.05));
        let grid = VoxelGrid::new(&mesh, 41).unwrap();
        let got = grid.volume(&grid.full_block()) * grid.cell_size.powi(3);
        assert!((got / 0.001 - 1.0).abs() < 0.1, "wanted 0.001, got {got}");
        assert_eq!(grid.cell_at([0; 3]), Cell::Outside);
        assert_eq!(grid.cell_at([20, 10, 6]), Cell::Inside);
    }

    #[test]
    fn volumes_of_two_blocks_add_up() {
        let grid = VoxelGrid::new(&test_meshes::l_shape(), 32).unwrap();
        let (mut left, mut right) = (grid.full_block(), grid.full_block());
        left.high[0] = 13;
        right.low[0] = 13;
        assert_eq!(grid.volume(&left) + grid.volume(&right), grid.volume(&grid.full_block()));
    }

    #[test]
    fn open_box_becomes_a_thin_wall() {
        let mut mesh = test_meshes::cube();
        mesh.triangles.truncate(10);
        let grid = VoxelGrid::new(&mesh, 32).unwrap();
        let center = grid.size.map(|n| n / 2);
        assert_eq!(grid.cell_at(center), Cell::Outside);
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
