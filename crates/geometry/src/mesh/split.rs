//! Cuts a grid of cells by axis-aligned planes into blocks whose contents are nearly convex.
//!
//! The idea of V-HACD (Mamou, Volumetric hierarchical approximate convex decomposition): cut where the hulls
//! of both sides leave the least empty space. Always the most hollow block first. Our own because parry's asks
//! the system's `acosf` and so may cut elsewhere on wasm, and panics where its hulls fail (parry issue 347).

use super::voxels::{Block, Cell, Grid};
use super::{hull, mass};
use crate::Vec3;

/// A block is convex enough if its hull has at most this much empty space (fraction of the whole hull's volume).
const HOLLOW: f64 = 0.01;
/// Weight of unequal halves against empty space.
const BALANCE: f64 = 0.3;
/// Cells between the planes tried first, and around the best of them afterwards.
const STRIDE: usize = 4;
/// Points of the hulls that are compared.
const HULL_POINTS: usize = 64;

/// Blocks that together hold all cells of the mesh, at most `max_blocks`.
pub(super) fn split(grid: &Grid, max_blocks: usize) -> Vec<Block> {
    let whole = grid.all();
    let enough = HOLLOW * hull_volume(grid, &whole);
    let mut blocks = vec![(hollow(grid, &whole), whole)];
    while blocks.len() < max_blocks {
        let worst =
            (0..blocks.len()).max_by(|&i, &j| blocks[i].0.total_cmp(&blocks[j].0).then(j.cmp(&i)));
        let Some(worst) = worst.filter(|&i| blocks[i].0 > enough) else { break };
        match cut(grid, &blocks[worst].1, blocks[worst].0) {
            Some([low, high]) => {
                blocks[worst] = (hollow(grid, &low), low);
                blocks.push((hollow(grid, &high), high));
            }
            None => blocks[worst].0 = 0.0,
        }
    }
    blocks.into_iter().map(|(_, block)| block).collect()
}

/// The two sides of the best plane through a block; `None` if there is no cell to cut along.
fn cut(grid: &Grid, block: &Block, hollow_before: f64) -> Option<[Block; 2]> {
    let volume = grid.volume(block);
    let mut best = (f64::INFINITY, 0, 0);
    let mut attempt = |axis: usize, at: usize| {
        let [low, high] = halves(block, axis, at);
        let (v, w) = (grid.volume(&low), grid.volume(&high));
        if v > 0.0 && w > 0.0 {
            let balance = BALANCE * hollow_before * (v - w).abs() / volume;
            let cost = hollow(grid, &low) + hollow(grid, &high) + balance;
            if cost < best.0 {
                best = (cost, axis, at);
            }
        }
        best
    };
    for axis in 0..3 {
        for at in (block.low[axis] + 1..block.high[axis]).step_by(STRIDE) {
            attempt(axis, at);
        }
    }
    // `attempt` with an empty side changes nothing and tells the best so far.
    let (_, axis, middle) = attempt(0, block.low[0]);
    for at in (middle + 1).saturating_sub(STRIDE)..middle + STRIDE {
        if at != middle && at > block.low[axis] && at < block.high[axis] {
            attempt(axis, at);
        }
    }
    let (cost, axis, at) = best;
    cost.is_finite().then(|| halves(block, axis, at))
}

fn halves(block: &Block, axis: usize, at: usize) -> [Block; 2] {
    let (mut low, mut high) = (*block, *block);
    low.high[axis] = at;
    high.low[axis] = at;
    [low, high]
}

/// Empty space (cells) in the hull of a block's contents.
fn hollow(grid: &Grid, block: &Block) -> f64 {
    (hull_volume(grid, block) - grid.volume(block)).max(0.0)
}

fn hull_volume(grid: &Grid, block: &Block) -> f64 {
    hull(&outline(grid, block), HULL_POINTS).map_or(0.0, |mesh| mass::volume(&mesh))
}

/// Points (cells) whose hull is that of a block's contents.
///
/// The surface runs through the middle of its cells, but on to the wall where the block was cut.
fn outline(grid: &Grid, block: &Block) -> Vec<Vec3> {
    // From where to where the contents of a cell reach along an axis.
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
            // Only the ends of a row can be on the hull.
            let mut row = block.low[0]..block.high[0];
            let Some(first) = row.find(|&x| grid.at([x, y, z]) != Cell::Outside) else { continue };
            let last = row.rfind(|&x| grid.at([x, y, z]) != Cell::Outside).unwrap_or(first);
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

/// Both ends of a span, or the one if it has no length.
fn distinct(ends: &[f32; 2]) -> &[f32] {
    if ends[0] == ends[1] { &ends[..1] } else { ends }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples;

    #[test]
    fn the_first_cut_of_an_l_runs_along_an_arm() {
        let grid = Grid::new(&samples::l_shape(), 64).unwrap();
        let blocks = split(&grid, 2);
        let inner_corner = (0.03 - grid.origin.x) / grid.cell;
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
    fn a_convex_body_stays_whole() {
        for mesh in [samples::cube(), hull(&samples::l_shape().vertices, 99).unwrap()] {
            let grid = Grid::new(&mesh, 64).unwrap();
            assert_eq!(split(&grid, 16), [grid.all()]);
        }
    }

    #[test]
    fn blocks_hold_every_cell_once() {
        let grid = Grid::new(&samples::l_shape(), 32).unwrap();
        let blocks = split(&grid, 7);
        let sum: f64 = blocks.iter().map(|block| grid.volume(block)).sum();
        assert_eq!(sum, grid.volume(&grid.all()));
    }
}
