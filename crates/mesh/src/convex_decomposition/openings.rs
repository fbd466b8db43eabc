//! Width of the openings of a mesh.

use super::distance_transform::distances;
use super::voxel_grid::{Cell, VoxelGrid};
use glamx::Vec3;

/// Radius of the largest ball of empty space that contains each place: an opening by balls of growing radius, as in
/// granulometry.
///
/// Its grid is coarser, and wider: the ball that fits into a shallow recess has its centre far outside.
pub(super) struct Openings {
    size: [usize; 3],
    /// Radii (cells of the fine grid).
    radii: Vec<f32>,
}

/// Edge length of a cell (fine cells).
const COARSE: usize = 4;
/// Width of the border (cells).
const BORDER: usize = 12;
/// Ratio of consecutive radii.
const RADIUS_RATIO: f32 = std::f32::consts::SQRT_2;

impl Openings {
    pub(super) fn new(grid: &VoxelGrid) -> Self {
        let size = grid.size.map(|n| n.div_ceil(COARSE) + 2 * BORDER);
        let mut openings = Self { size, radii: Vec::new() };
        let mut is_solid = vec![false; size.iter().product()];
        for i in (0..grid.size.iter().product()).filter(|&i| grid.cell(i) != Cell::Outside) {
            is_solid[openings.index(grid.center(i))] = true;
        }
        let depths = distances(size, |i| is_solid[i]);
        let max = depths.iter().fold(0.0, |max: f32, d| max.max(*d));
        let mut radii = vec![1.0_f32; depths.len()];
        let mut radius = RADIUS_RATIO;
        while radius <= max {
            let from_centers = distances(size, |i| depths[i] >= radius);
            for (largest, distance) in radii.iter_mut().zip(from_centers) {
                if distance < radius {
                    *largest = radius;
                }
            }
            radius *= RADIUS_RATIO;
        }
        openings.radii = radii.into_iter().map(|radius| radius * COARSE as f32).collect();
        openings
    }

    fn index(&self, point: Vec3) -> usize {
        let [x, y, z] = point.to_array().map(|x| x as usize / COARSE + BORDER);
        x + self.size[0] * (y + self.size[1] * z)
    }

    pub(super) fn radius_at(&self, point: Vec3) -> f32 {
        self.radii[self.index(point)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes;

    #[test]
    fn slot_is_as_wide_as_the_ball_that_fits() {
        // Two plates, 4 cm apart, that are much longer and deeper.
        let plate =
            |x: f32| test_meshes::cuboid(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 0.02, 0.2, 0.2));
        let mesh = test_meshes::union(&[plate(0.0), plate(0.06)]);
        let grid = VoxelGrid::new(&mesh, 400_000).unwrap();
        let openings = Openings::new(&grid);
        let radius = |p: Vec3| openings.radius_at(grid.to_cells(p).as_vec3());
        let cell = (grid.to_cells(Vec3::X) - grid.to_cells(Vec3::ZERO)).length() as f32;
        let between = radius(Vec3::new(0.04, 0.1, 0.1)) / cell;
        assert!((0.012..0.022).contains(&between), "{between} m");
        // Nothing limits the ball on top of a plate.
        assert!(radius(Vec3::new(0.01, 0.1, 0.23)) / cell > 0.03);
    }
}
