//! A mesh as a grid of cells: outside, cut by the surface, or inside.
//!
//! A hole wider than a cell lets the outside in: then only the surface remains, as a thin wall.

use super::Mesh;
use glamx::DVec3;

/// What a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// Reached from the border without crossing the surface.
    Outside,
    /// Touched by a triangle.
    Surface,
    /// Enclosed.
    Inside,
}

/// The grid; a border of outside cells surrounds the mesh.
pub(super) struct Grid {
    /// Lowest corner (m).
    pub(super) origin: DVec3,
    /// Side of a cell (m).
    pub(super) cell: f64,
    /// Cells along each axis.
    pub(super) size: [usize; 3],
    cells: Vec<Cell>,
    /// For each lattice point, twice the volume (cells) below it; a surface cell counts as half full.
    sums: Vec<u32>,
}

/// A box of cells, `high` excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) low: [usize; 3],
    pub(super) high: [usize; 3],
}

/// Cells tested against triangles before giving up: some seconds. Only meshes of many huge triangles need more.
const MAX_TESTS: usize = 100_000_000;

/// Width of the border (cells).
///
/// The faces of a box then lie near the middle of its outermost cells, and no face at a simple fraction of its
/// length, as things drawn by hand have them, lies between two cells.
const MARGIN: f64 = 1.5371;

impl Grid {
    /// Cuts the longest side into `resolution` - 1 cells; `None` if that takes too long or the mesh has no size.
    pub(super) fn new(mesh: &Mesh, resolution: u32) -> Option<Self> {
        let [low, high] = mesh.bounds().map(|corner| corner.as_dvec3());
        let cell = (high - low).max_element() / f64::from(resolution.clamp(4, 256) - 1);
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let origin = low - MARGIN * cell;
        let size = ((high - low) / cell).to_array().map(|x| x.ceil() as usize + 4);
        let count = size.iter().product();
        let mut grid =
            Self { origin, cell, size, cells: vec![Cell::Inside; count], sums: Vec::new() };
        grid.mark_surface(mesh)?;
        grid.flood_outside();
        grid.sum_up();
        Some(grid)
    }

    pub(super) fn all(&self) -> Block {
        Block { low: [0; 3], high: self.size }
    }

    pub(super) fn at(&self, [x, y, z]: [usize; 3]) -> Cell {
        self.cells[self.index([x, y, z])]
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// Volume within a block (cells).
    pub(super) fn volume(&self, block: &Block) -> f64 {
        let [width, depth, _] = self.size.map(|n| n + 1);
        let sum = |x: usize, y: usize, z: usize| i64::from(self.sums[x + width * (y + depth * z)]);
        let ([x0, y0, z0], [x1, y1, z1]) = (block.low, block.high);
        let layer = |z| sum(x1, y1, z) - sum(x0, y1, z) - sum(x1, y0, z) + sum(x0, y0, z);
        (layer(z1) - layer(z0)) as f64 / 2.0
    }

    fn mark_surface(&mut self, mesh: &Mesh) -> Option<()> {
        let mut tests = 0;
        for triangle in &mesh.triangles {
            let corners =
                triangle.map(|i| (mesh.vertices[i as usize].as_dvec3() - self.origin) / self.cell);
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
                        if self.cells[index] == Cell::Inside && touches(corners.map(|p| p - center))
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

    fn sum_up(&mut self) {
        let [width, depth, height] = self.size.map(|n| n + 1);
        let mut sums = vec![0_u32; width * depth * height];
        for z in 1..height {
            for y in 1..depth {
                let mut row = 0;
                for x in 1..width {
                    row += match self.at([x - 1, y - 1, z - 1]) {
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
        self.sums = sums;
    }
}

/// Whether a triangle touches the cube of side 1 about the origin, by the thirteen separating axes.
fn touches(corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners;
    let edges = [b - a, c - b, a - c];
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let is_apart = |axis: DVec3| {
        let [p, q, r] = corners.map(|corner| axis.dot(corner));
        // A little more than touching, so that no crack opens between cells.
        let reach = 0.5 * (axis.x.abs() + axis.y.abs() + axis.z.abs()) * (1.0 + 1e-9);
        p.min(q).min(r) > reach || p.max(q).max(r) < -reach
    };
    !(axes.into_iter().any(is_apart)
        || is_apart(edges[0].cross(edges[1]))
        || edges.iter().any(|&edge| axes.into_iter().any(|axis| is_apart(edge.cross(axis)))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::mesh::samples;

    #[test]
    fn the_cells_of_a_box_have_its_volume() {
        let mesh = samples::cuboid(Vec3::ZERO, Vec3::new(0.2, 0.1, 0.05));
        let grid = Grid::new(&mesh, 41).unwrap();
        let got = grid.volume(&grid.all()) * grid.cell.powi(3);
        assert!((got / 0.001 - 1.0).abs() < 0.1, "wanted 0.001, got {got}");
        assert_eq!(grid.at([0; 3]), Cell::Outside);
        assert_eq!(grid.at([20, 10, 6]), Cell::Inside);
    }

    #[test]
    fn blocks_add_up() {
        let grid = Grid::new(&samples::l_shape(), 32).unwrap();
        let (mut left, mut right) = (grid.all(), grid.all());
        left.high[0] = 13;
        right.low[0] = 13;
        assert_eq!(grid.volume(&left) + grid.volume(&right), grid.volume(&grid.all()));
    }

    #[test]
    fn an_open_box_is_a_thin_wall() {
        let mut mesh = samples::cube();
        mesh.triangles.truncate(10);
        let grid = Grid::new(&mesh, 32).unwrap();
        let middle = grid.size.map(|n| n / 2);
        assert_eq!(grid.at(middle), Cell::Outside);
    }

    #[test]
    fn touching_is_told_from_passing_by() {
        let triangle =
            |x: f64| [DVec3::new(x, -9.0, -9.0), DVec3::new(x, 9.0, 0.0), DVec3::new(x, 0.0, 9.0)];
        assert!(touches(triangle(0.49)) && touches(triangle(0.5)) && !touches(triangle(0.51)));
        // Past the corner of the cube, though every face's plane cuts it.
        let corner =
            [DVec3::new(1.6, 0.0, 0.0), DVec3::new(0.0, 1.6, 0.0), DVec3::new(0.0, 0.0, 1.6)];
        assert!(!touches(corner) && touches(corner.map(|p| p * 0.9)));
    }
}
