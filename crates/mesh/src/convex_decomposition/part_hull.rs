//! Hull of a part, as half-spaces, to test which points of the empty space it fills.

use crate::convex_hull::hull_planes;
use glamx::Vec3;

/// Distance (cells) by which a hull is grown: a point counts as filled if most of its cell is.
const MARGIN: f32 = 0.3;
/// Number of half-spaces that are compared at once.
const LANES: usize = 8;

/// Convex hull as half-spaces; empty for flat points.
pub(super) struct PartHull {
    bounds: [Vec3; 2],
    blocks: Vec<Block>,
}

/// Half-spaces: a point inside has x normal.x + y normal.y + z normal.z <= offset in each.
#[derive(Clone, Copy)]
struct Block {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    offset: [f32; LANES],
}

impl PartHull {
    pub(super) fn new(points: &[Vec3]) -> Self {
        let [low, high] = crate::bounds(points);
        let bounds = [low - MARGIN, high + MARGIN];
        let planes = hull_planes(points).unwrap_or_default();
        let block = |faces: &[(Vec3, f32)]| {
            // The rest of the last block repeats its first face.
            let lanes: [_; LANES] =
                std::array::from_fn(|lane| *faces.get(lane).unwrap_or(&faces[0]));
            Block {
                x: lanes.map(|(normal, _)| normal.x),
                y: lanes.map(|(normal, _)| normal.y),
                z: lanes.map(|(normal, _)| normal.z),
                offset: lanes.map(|(_, offset)| offset + MARGIN),
            }
        };
        Self { bounds, blocks: planes.chunks(LANES).map(block).collect() }
    }

    pub(super) fn contains(&self, p: Vec3) -> bool {
        let [low, high] = self.bounds;
        let is_near = p.cmpge(low).all() && p.cmple(high).all();
        is_near && !self.blocks.is_empty() && self.blocks.iter().all(|block| block.contains(p))
    }
}

impl Block {
    fn contains(&self, p: Vec3) -> bool {
        // Without branches, so that the compiler uses vector instructions.
        let mut is_inside = true;
        for i in 0..LANES {
            is_inside &= self.x[i] * p.x + self.y[i] * p.y + self.z[i] * p.z <= self.offset[i];
        }
        is_inside
    }
}
