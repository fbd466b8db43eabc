//! Cuts a mesh into more parts than wanted, then merges those whose joint hull fills little more empty space.
//!
//! Wei et al., Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree Search (2022),
//! measure concavity by distance, because volume ignores narrow openings, and search a tree of cuts, because the best
//! single cut of a hollow body fills as much as none. Here, empty space counts relative to the width of its opening, and
//! [`CutSearch`] prefers cuts that separate a convex part.
//!
//! Without gain: cutting one part again and merging two others at the end; separating the connected components of a
//! side; the best of three searches with other directions. Each took 25 % more time or a multiple.

use super::cut_search::CutSearch;
use super::empty_space::EmptySpace;
use super::filled_hull::FilledHull;
use super::part::{Part, Solid};
use glamx::DVec3;

/// Limits of a decomposition.
pub(super) struct Limits {
    pub(super) max_parts: usize,
    /// Weight of the empty space that a part may fill, and that a merge may add (cells²).
    pub(super) tolerance: f64,
}

/// Number of parts before they are merged, per final part.
const CUTS_PER_PART: usize = 2;

/// Decomposes a solid with the given surface.
pub(super) fn decompose(
    solid: &Solid,
    triangles: Vec<Vec<DVec3>>,
    limits: &Limits,
) -> Vec<FilledHull> {
    let whole = Part::whole(solid, triangles);
    let parts = cut(solid, whole, CUTS_PER_PART * limits.max_parts, limits.tolerance);
    let hulls = parts.into_iter().map(|part| part.hull).collect();
    merge(&solid.space, hulls, limits.max_parts, limits.tolerance)
}

/// Cuts the part that fills the most, until each fills at most `tolerance`.
fn cut(solid: &Solid, whole: Part, max_parts: usize, tolerance: f64) -> Vec<Part> {
    let search = CutSearch::new(solid);
    let (mut parts, mut finished) = (vec![whole], Vec::new());
    while parts.len() + finished.len() < max_parts {
        let filled = |i: usize| parts[i].hull.weight;
        let worst =
            (0..parts.len()).max_by(|&i, &j| filled(i).total_cmp(&filled(j)).then(j.cmp(&i)));
        let Some(worst) = worst.filter(|&i| filled(i) > tolerance) else { break };
        let part = parts.swap_remove(worst);
        match search.best_plane(&part).and_then(|plane| part.cut(solid, &plane)) {
            Some(sides) => parts.extend(sides),
            None => finished.push(part),
        }
    }
    parts.extend(finished);
    parts
}

/// Pair of hulls, and the weight of the empty space that their joint hull fills in addition.
struct Pair {
    cost: f64,
    hulls: [usize; 2],
}

/// Merges the pair that adds the least, while that is little or there are too many hulls.
fn merge(
    space: &EmptySpace,
    hulls: Vec<FilledHull>,
    max_hulls: usize,
    tolerance: f64,
) -> Vec<FilledHull> {
    // Merged hulls leave an empty slot, so that the indices in `pairs` stay valid.
    let mut slots: Vec<Option<FilledHull>> = Vec::new();
    let mut pairs: Vec<Pair> = Vec::new();
    let mut num_hulls = hulls.len();
    let add = |slots: &mut Vec<Option<FilledHull>>, pairs: &mut Vec<Pair>, hull: FilledHull| {
        let others = slots.iter().enumerate().filter_map(|(i, other)| Some((i, other.as_ref()?)));
        let touching = others.filter(|(_, other)| hull.touches(other));
        let index = slots.len();
        pairs.extend(
            touching
                .map(|(i, other)| Pair { cost: hull.merge_cost(other, space), hulls: [i, index] }),
        );
        slots.push(Some(hull));
    };
    hulls.into_iter().for_each(|hull| add(&mut slots, &mut pairs, hull));
    while let Some(pair) = pairs.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) {
        if pair.cost > tolerance && num_hulls <= max_hulls {
            break;
        }
        let merged = pair.hulls;
        pairs.retain(|pair| !pair.hulls.iter().any(|i| merged.contains(i)));
        if let [Some(a), Some(b)] = merged.map(|i| slots[i].take()) {
            add(&mut slots, &mut pairs, a.merged(&b, space));
            num_hulls -= 1;
        }
    }
    slots.into_iter().flatten().collect()
}
