//! Search for the plane that cuts a part so that the hulls of both sides fill the least empty space.
//!
//! The planes need not follow the axes of the file. They are normal to these, to the faces and edges of the mesh's
//! principal box, or to the principal axes of the part. The hulls are those of the extreme points in a number of
//! directions, which are found for all planes of one normal at once.

use super::part::{HalfSpace, Part, Solid};
use super::part_hull::PartHull;
use super::principal_axes::principal_axes;
use glamx::{DVec3, Vec3};

/// Planes of the coarse search along each normal (fraction of the extent); floors and rims are near the ends.
const COARSE_STATIONS: [f32; 9] = [0.06, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.94];
/// Planes of the fine search on each side of the best plane (fraction of the distance to its neighbour).
const FINE_STATIONS: [f32; 6] = [-0.75, -0.5, -0.25, 0.25, 0.5, 0.75];
/// Number of normals whose best plane is refined.
const REFINED: usize = 3;
/// Number of directions in which the extreme points of a hull are searched.
const NUM_SUPPORTS: usize = 60;
/// Weight of the unsolved share relative to the space that is filled before the cut.
///
/// No single cut of a hollow body empties it. Among such cuts, one that separates a convex part, such as the floor of a
/// cup, is better than one that halves the body.
const SOLVED_WEIGHT: f64 = 1.0;
/// Min thickness of both sides of a cut (cells).
const MIN_THICKNESS: f32 = 2.0;
/// Min range of offsets that is searched (cells).
const MIN_RANGE: f32 = 0.4;
/// Max distance (cells) of the surface points that represent a plane's section.
const SECTION_THICKNESS: f32 = 1.0;

/// Search for cuts of the parts of a solid.
pub(super) struct CutSearch<'a> {
    solid: &'a Solid<'a>,
    /// Directions in which the extreme points of a hull are searched.
    supports: Vec<Vec3>,
    /// Normals of the planes.
    normals: Vec<Vec3>,
}

/// Cut that was evaluated.
#[derive(Clone, Copy)]
struct Cut {
    /// Weight of the empty space in the hulls of both sides, and a penalty for what is not solved.
    cost: f64,
    plane: HalfSpace,
    /// Distance to the next planes below and above (cells).
    gaps: [f32; 2],
}

impl<'a> CutSearch<'a> {
    pub(super) fn new(solid: &'a Solid) -> Self {
        let mut normals = vec![Vec3::X, Vec3::Y, Vec3::Z];
        normals.extend(solid.grid.file_axes());
        for sign in [-1.0, 1.0] {
            let edges =
                [Vec3::new(1.0, sign, 0.0), Vec3::new(1.0, 0.0, sign), Vec3::new(0.0, 1.0, sign)];
            normals.extend(edges.into_iter().map(Vec3::normalize));
        }
        Self { solid, supports: directions(NUM_SUPPORTS), normals }
    }

    /// Best plane; `None` if no plane has points on both sides.
    pub(super) fn best_plane(&self, part: &Part) -> Option<HalfSpace> {
        let content = &Content::new(part, self);
        let axes = principal_axes(content.points.iter().map(|p| (p.as_dvec3(), 1.0)));
        let own = (0..3).map(|i| axes.row(i).as_vec3());
        let mut best: Vec<Cut> = Vec::new();
        for normal in self.normals.iter().copied().chain(own) {
            let [low, high] = content.extent(normal);
            let offsets = COARSE_STATIONS.map(|station| low + station * (high - low));
            // Only the best are refined.
            let max_cost =
                if best.len() < REFINED { f64::INFINITY } else { best[REFINED - 1].cost };
            best.extend(self.best_of(content, normal, &offsets, [low, high], max_cost));
            best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            best.truncate(REFINED);
        }
        let refined = best.iter().map(|cut| self.refine(content, &self.refine(content, cut)));
        refined.min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|cut| cut.plane)
    }

    /// Best of the planes between a plane and its neighbours.
    fn refine(&self, content: &Content, cut: &Cut) -> Cut {
        let Cut { plane: HalfSpace { normal, offset }, gaps: [below, above], .. } = *cut;
        let at = |station: f32| offset + station * if station < 0.0 { below } else { above };
        let ends = [offset - below, offset + above];
        self.best_of(content, normal, &FINE_STATIONS.map(at), ends, cut.cost).unwrap_or(*cut)
    }

    /// Best of the planes at increasing `offsets` between two ends; `None` if no cost is below `max_cost`.
    fn best_of(
        &self,
        content: &Content,
        normal: Vec3,
        offsets: &[f32],
        ends: [f32; 2],
        max_cost: f64,
    ) -> Option<Cut> {
        let [bottom, top] = content.extent(normal);
        if ends[1] - ends[0] < MIN_RANGE {
            return None;
        }
        let slabs = self.slabs(content, normal, offsets);
        let num_supports = self.supports.len();
        // Extremes of all slabs above each plane.
        let mut above = vec![Extremes::new(num_supports); offsets.len() + 1];
        for i in (0..offsets.len()).rev() {
            above[i] = above[i + 1].clone();
            above[i].merge(&slabs[i + 1].extremes);
        }
        let total = content.points.len();
        let mut below = Extremes::new(num_supports);
        let mut num_below = 0;
        let mut best: Option<Cut> = None;
        for (i, &offset) in offsets.iter().enumerate() {
            below.merge(&slabs[i].extremes);
            num_below += slabs[i].num_points;
            let thickness = (offset - bottom).min(top - offset);
            if num_below == 0 || num_below == total || thickness < MIN_THICKNESS {
                continue;
            }
            let plane = HalfSpace { normal, offset };
            let all = content.part.hull.weight;
            let share = num_below as f64 / total as f64;
            let sides = [(&below, &slabs[..=i], share), (&above[i], &slabs[i + 1..], 1.0 - share)];
            let max_cost = best.map_or(max_cost, |least: Cut| least.cost);
            // A lower bound of the cost until both sides are known.
            let (mut filled, mut solved) = (0.0, 1.0);
            let cost = |filled: f64, solved: f64| filled + SOLVED_WEIGHT * all * (1.0 - solved);
            for (extremes, side, share) in sides {
                if cost(filled, solved) < max_cost {
                    let hull = content.hull(extremes, &slabs[i].section, &plane);
                    let of_side = self.filled(&hull, side.iter().flat_map(|slab| &slab.empty));
                    filled += of_side;
                    solved -= share * (1.0 - solved_fraction(of_side / all));
                }
            }
            let cost = cost(filled, solved);
            if cost < max_cost {
                let before = if i == 0 { ends[0] } else { offsets[i - 1] };
                let after = *offsets.get(i + 1).unwrap_or(&ends[1]);
                best = Some(Cut { cost, plane, gaps: [offset - before, after - offset] });
            }
        }
        best
    }

    /// Content between the planes at increasing offsets.
    fn slabs(&self, content: &Content, normal: Vec3, offsets: &[f32]) -> Vec<Slab> {
        let slab_of = |height: f32| offsets.iter().filter(|offset| height > **offset).count();
        let mut slabs: Vec<Slab> =
            (0..=offsets.len()).map(|_| Slab::new(self.supports.len())).collect();
        let heights = content.heights.chunks(self.supports.len());
        for ((i, point), heights) in (0..).zip(&content.points).zip(heights) {
            let height = normal.dot(*point);
            let slab = slab_of(height);
            slabs[slab].num_points += 1;
            slabs[slab].extremes.add(heights, i);
            for plane in slab.saturating_sub(1)..(slab + 1).min(offsets.len()) {
                if (height - offsets[plane]).abs() <= SECTION_THICKNESS {
                    slabs[plane].section.add(heights, i);
                }
            }
        }
        for &i in &content.part.hull.empty {
            slabs[slab_of(normal.dot(self.solid.space.points[i as usize]))].empty.push(i);
        }
        slabs
    }

    /// Weight of the samples inside a hull.
    fn filled<'b>(&self, hull: &PartHull, samples: impl Iterator<Item = &'b u32>) -> f64 {
        let space = &self.solid.space;
        let inside = samples.filter(|&&i| hull.contains(space.points[i as usize]));
        inside.map(|&i| space.weights[i as usize]).sum()
    }
}

/// How far a side is solved (0 to 1), from the fraction of the empty space that it fills: (1 - filled)^10. A side counts
/// only if it fills nearly nothing.
fn solved_fraction(filled: f64) -> f64 {
    let empty = 1.0 - filled.min(1.0);
    // Not `powi`, whose rounding depends on the machine.
    let squared = empty * empty;
    let fourth = squared * squared;
    fourth * fourth * squared
}

/// Points of a part, and their heights in each of the support directions.
struct Content<'a> {
    part: &'a Part,
    points: Vec<Vec3>,
    heights: Vec<f32>,
}

impl<'a> Content<'a> {
    fn new(part: &'a Part, search: &CutSearch) -> Self {
        let surface = part.points.iter().map(|&i| search.solid.surface[i as usize]);
        let points: Vec<Vec3> = surface.chain(part.hull.vertices.iter().copied()).collect();
        let heights =
            points.iter().flat_map(|p| search.supports.iter().map(|direction| direction.dot(*p)));
        Self { part, heights: heights.collect(), points }
    }

    /// Min and max height along a direction.
    fn extent(&self, direction: Vec3) -> [f32; 2] {
        let heights = self.points.iter().map(|p| direction.dot(*p));
        heights.fold([f32::MAX, f32::MIN], |[low, high], h| [low.min(h), high.max(h)])
    }

    /// Hull of one side of a plane.
    fn hull(&self, extremes: &Extremes, section: &Extremes, plane: &HalfSpace) -> PartHull {
        let mut points: Vec<Vec3> = extremes.points(self).collect();
        // The cut itself is on the surface of both sides.
        points.extend(section.points(self).map(|p| p - plane.height(p) * plane.normal));
        points.sort_unstable_by_key(|p| p.to_array().map(f32::to_bits));
        points.dedup();
        PartHull::new(&points)
    }
}

/// Content of a part between two planes.
struct Slab {
    num_points: usize,
    extremes: Extremes,
    /// Extremes of the points near the upper plane.
    section: Extremes,
    /// Indices of the empty samples.
    empty: Vec<u32>,
}

impl Slab {
    fn new(num_supports: usize) -> Self {
        let extremes = Extremes::new(num_supports);
        Self { num_points: 0, section: extremes.clone(), extremes, empty: Vec::new() }
    }
}

/// For each support direction, the extreme point of a set: its height and its index.
#[derive(Clone)]
struct Extremes {
    heights: Vec<f32>,
    indices: Vec<u32>,
}

impl Extremes {
    fn new(num_supports: usize) -> Self {
        Self { heights: vec![f32::NEG_INFINITY; num_supports], indices: vec![0; num_supports] }
    }

    /// Adds a point with these heights.
    fn add(&mut self, heights: &[f32], index: u32) {
        let extremes = self.heights.iter_mut().zip(&mut self.indices);
        // Without branches: this is the inner loop of the search.
        for ((max, at), height) in extremes.zip(heights) {
            let is_higher = *height > *max;
            *max = if is_higher { *height } else { *max };
            *at = if is_higher { index } else { *at };
        }
    }

    fn merge(&mut self, other: &Self) {
        let extremes = self.heights.iter_mut().zip(&mut self.indices);
        for ((max, at), (height, index)) in extremes.zip(other.heights.iter().zip(&other.indices)) {
            if height > max {
                (*max, *at) = (*height, *index);
            }
        }
    }

    fn points<'a>(&'a self, content: &'a Content) -> impl Iterator<Item = Vec3> + 'a {
        let found = self.heights.iter().zip(&self.indices).filter(|(h, _)| **h > f32::NEG_INFINITY);
        found.map(|(_, index)| content.points[*index as usize])
    }
}

/// Directions evenly spread over the sphere (Fibonacci lattice).
fn directions(count: usize) -> Vec<Vec3> {
    // The golden angle as a rotation, because sine and cosine of the system differ between machines.
    let (cos, sin) = (-0.737_368_878_078_319_9_f64, 0.675_490_294_261_523_6_f64);
    let (mut x, mut y) = (1.0, 0.0);
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let radius = (1.0 - z * z).sqrt();
            (x, y) = (cos * x - sin * y, sin * x + cos * y);
            DVec3::new(radius * x, radius * y, z).as_vec3()
        })
        .collect()
}
