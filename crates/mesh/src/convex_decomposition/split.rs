//! Splits a cell grid by axis-aligned planes into blocks with nearly convex content.
//!
//! The method is that of V-HACD (Mamou, Volumetric hierarchical approximate convex decomposition): the cut
//! minimises the empty volume in the hulls of both sides. The block with the most empty volume is cut first.
//! parry's V-HACD is not used: it calls the system's `acosf`, so its cuts may differ on wasm, and it panics
//! if a hull fails (parry issue 347).

use super::voxel_grid::{Cell, CellBox, VoxelGrid};
use crate::convex_hull::convex_hull;
use crate::mass_properties;
use glamx::Vec3;

/// Max empty volume in the hull of a block's content (fraction of the volume of the mesh's hull).
const MAX_CONCAVITY: f64 = 0.01;
/// Weight of unequal halves relative to empty volume.
const BALANCE_WEIGHT: f64 = 0.3;
/// Spacing (cells) of the planes in the coarse search; the fine search fills the gaps around the best plane.
const STRIDE: usize = 4;
/// Max number of vertices of a hull.
const HULL_POINTS: usize = 64;

/// Up to `max_blocks` disjoint blocks that together cover all cells.
pub(super) fn split(grid: &VoxelGrid, max_blocks: usize) -> Vec<CellBox> {
    let whole = grid.full_block();
    let max_concavity = MAX_CONCAVITY * hull_volume(grid, &whole);
    let mut blocks = vec![(concavity(grid, &whole), whole)];
    while blocks.len() < max_blocks {
        let worst =
            (0..blocks.len()).max_by(|&i, &j| blocks[i].0.total_cmp(&blocks[j].0).then(j.cmp(&i)));
        let Some(worst) = worst.filter(|&i| blocks[i].0 > max_concavity) else { break };
        match best_cut(grid, &blocks[worst].1, blocks[worst].0) {
            Some([low, high]) => {
                blocks[worst] = (concavity(grid, &low), low);
                blocks.push((concavity(grid, &high), high));
            }
            None => blocks[worst].0 = 0.0,
        }
    }
    blocks.into_iter().map(|(_, block)| block).collect()
}

/// Two sides of the best plane through a block; `None` if no plane has content on both sides.
fn best_cut(grid: &VoxelGrid, block: &CellBox, concavity_before: f64) -> Option<[CellBox; 2]> {
    let volume = grid.volume(block);
    let mut best = (f64::INFINITY, 0, 0);
    let mut evaluate = |axis: usize, at: usize| {
        let [low, high] = halves(block, axis, at);
        let (v, w) = (grid.volume(&low), grid.volume(&high));
        if v > 0.0 && w > 0.0 {
            let balance = BALANCE_WEIGHT * concavity_before * (v - w).abs() / volume;
            let cost = concavity(grid, &low) + concavity(grid, &high) + balance;
            if cost < best.0 {
                best = (cost, axis, at);
            }
        }
        best
    };
    for axis in 0..3 {
        for at in (block.low[axis] + 1..block.high[axis]).step_by(STRIDE) {
            evaluate(axis, at);
        }
    }
    // With an empty side, `evaluate` changes nothing and returns the best plane.
    let (_, axis, middle) = evaluate(0, block.low[0]);
    for at in (middle + 1).saturating_sub(STRIDE)..middle + STRIDE {
        if at != middle && at > block.low[axis] && at < block.high[axis] {
            evaluate(axis, at);
        }
    }
    let (cost, axis, at) = best;
    cost.is_finite().then(|| halves(block, axis, at))
}

fn halves(block: &CellBox, axis: usize, at: usize) -> [CellBox; 2] {
    let (mut low, mut high) = (*block, *block);
    low.high[axis] = at;
    high.low[axis] = at;
    [low, high]
}

/// Empty volume (cells) in the hull of a block's content.
fn concavity(grid: &VoxelGrid, block: &CellBox) -> f64 {
    (hull_volume(grid, block) - grid.volume(block)).max(0.0)
}

fn hull_volume(grid: &VoxelGrid, block: &CellBox) -> f64 {
    convex_hull(&block_hull_points(grid, block), HULL_POINTS)
        .map_or(0.0, |mesh| mass_properties::volume(&mesh))
}

/// Points (cells) whose hull is that of a block's content.
///
/// The surface passes through the centres of its cells, but extends to the wall at a cut.
fn block_hull_points(grid: &VoxelGrid, block: &CellBox) -> Vec<Vec3> {
    // Range of a cell's content along an axis.
    let span = |axis: usize, cell: usize| {
        let is_cut_low = cell == block.low[axis] && cell > 0;
        let is_cut_high = cell + 1 == block.high[axis] && block.high[axis] < grid.size[axis];
        let middle = cell as f32 + 0.5;
        [
            if is_cut_low { middle - 0.5 } else { middle },
            if is_cut_high { middle + 0.5 } else { middle },
        ]
    };
    let mut points = Vec::new();
    for z in block.low[2]..block.high[2] {
        for y in block.low[1]..block.high[1] {
            // Only the first and last cell of a row can be on the hull.
            let mut row = block.low[0]..block.high[0];
            let Some(first) = row.find(|&x| grid.cell_at([x, y, z]) != Cell::Outside) else {
                continue;
            };
            let last = row.rfind(|&x| grid.cell_at([x, y, z]) != Cell::Outside).unwrap_or(first);
            let (x, y, z) = ([span(0, first)[0], span(0, last)[1]], span(1, y), span(2, z));
            for &z in distinct(&z) {
                for &y in distinct(&y) {
                    points.extend(distinct(&x).iter().map(|&x| Vec3::new(x, y, z)));
                }
            }
        }
    }
    points
}

/// Both ends of a span, or a single end if its length is zero.
fn distinct(ends: &[f32; 2]) -> &[f32] {
    if ends[0] == ends[1] { &ends[..1] } else { ends }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes;

    #[test]
    fn first_cut_of_an_l_shape_follows_an_arm() {
        let grid = VoxelGrid::new(&test_meshes::l_shape(), 64).unwrap();
        let blocks = split(&grid, 2);
        let inner_corner = (0.03 - grid.origin.x) / grid.cell_size;
        let [at] = [0, 1]
            .map(|axis| blocks[1].low[axis])
            .into_iter()
            .filter(|&at| at > 0)
            .collect::<Vec<_>>()[..]
        else {
            panic!("wanted a cut across x or y, got {blocks:?}");
        };
        assert!((at as f64 - inner_corner).abs() < 2.0, "wanted {inner_corner}, got {at}");
    }

    #[test]
    fn convex_body_is_not_cut() {
        for mesh in
            [test_meshes::cube(), convex_hull(&test_meshes::l_shape().vertices, 99).unwrap()]
        {
            let grid = VoxelGrid::new(&mesh, 64).unwrap();
            assert_eq!(split(&grid, 16), [grid.full_block()]);
        }
    }

    #[test]
    fn blocks_contain_every_cell_once() {
        let grid = VoxelGrid::new(&test_meshes::l_shape(), 32).unwrap();
        let blocks = split(&grid, 7);
        let sum: f64 = blocks.iter().map(|block| grid.volume(block)).sum();
        assert_eq!(sum, grid.volume(&grid.full_block()));
    }
}
