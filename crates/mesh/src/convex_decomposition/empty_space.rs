//! Samples of the empty space around a mesh, weighted by the width of the opening.
//!
//! Volume alone does not rank empty space: the hole of a handle is 1 % of the volume of a mug's hull.

use super::distance_transform::distances;
use super::filled_hull::FilledHull;
use super::openings::Openings;
use super::part_hull::PartHull;
use super::voxel_grid::{Cell, VoxelGrid};
use glamx::Vec3;

/// Empty cells that sample the concavities of a mesh.
pub(super) struct EmptySpace {
    /// Centres (cells).
    pub(super) points: Vec<Vec3>,
    /// Cost of filling the sample: volume x depth / width² of the opening.
    pub(super) weights: Vec<f64>,
    /// Volumes that the samples represent (cells).
    volumes: Vec<f64>,
}

/// Max number of samples of openings of one width.
const SAMPLES_PER_WIDTH: usize = 1500;
/// Distance (cells) from the surface below which a cell is not a sample: the resolution of the grid.
const MIN_DEPTH: f32 = 1.2;
/// Width below which openings weigh the same (fraction of the longest side): grooves and scanner noise.
const MIN_WIDTH: f32 = 0.05;

impl EmptySpace {
    /// Samples the outside cells within the hull of all cells.
    pub(super) fn new(grid: &VoxelGrid, hull: &PartHull) -> Self {
        let depths = distances(grid.size, |i| grid.cell(i) != Cell::Outside);
        let openings = Openings::new(grid);
        let mut by_width: Vec<(f32, Vec<(Vec3, f32)>)> = Vec::new();
        for (i, &depth) in depths.iter().enumerate() {
            let center = grid.center(i);
            if depth < MIN_DEPTH || !hull.contains(center) {
                continue;
            }
            let width = openings.radius_at(center);
            match by_width.iter_mut().find(|(w, _)| *w == width) {
                Some((_, cells)) => cells.push((center, depth)),
                None => by_width.push((width, vec![(center, depth)])),
            }
        }
        let min_width = MIN_WIDTH * grid.size.into_iter().fold(0, usize::max) as f32;
        let mut space = Self { points: Vec::new(), weights: Vec::new(), volumes: Vec::new() };
        for (width, cells) in by_width {
            let stride = cells.len().div_ceil(SAMPLES_PER_WIDTH);
            let volume = cells.len() as f64 / cells.len().div_ceil(stride) as f64;
            let width = f64::from(width.max(min_width));
            for chunk in cells.chunks(stride) {
                // Not the same place in every chunk: samples in rows would alias with the grid.
                let (point, depth) = chunk[space.points.len() * 7919 % chunk.len()];
                space.points.push(point);
                space.weights.push(volume * f64::from(depth) / (width * width));
                space.volumes.push(volume);
            }
        }
        space
    }

    /// Fraction of the volume of the samples that is inside a hull.
    pub(super) fn filled_fraction(&self, hulls: &[FilledHull]) -> f64 {
        let mut is_filled = vec![false; self.points.len()];
        hulls.iter().flat_map(|hull| &hull.empty).for_each(|&i| is_filled[i as usize] = true);
        let filled = self.volumes.iter().zip(is_filled).filter(|(_, is_filled)| *is_filled);
        let total: f64 = self.volumes.iter().sum();
        if total > 0.0 { filled.fold(0.0, |sum, (volume, _)| sum + volume) / total } else { 0.0 }
    }
}
