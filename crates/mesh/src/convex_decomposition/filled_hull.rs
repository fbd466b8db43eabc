//! Convex hull of a part, and the samples of the empty space that it fills.

use super::empty_space::EmptySpace;
use super::hull_vertices;
use super::part_hull::PartHull;
use glamx::Vec3;

/// Distance (cells) up to which the bounding boxes of two parts touch.
const CONTACT_DISTANCE: f32 = 1.0;

/// Hull and the samples in it.
pub(super) struct FilledHull {
    /// Vertices (cells).
    pub(super) vertices: Vec<Vec3>,
    bounds: [Vec3; 2],
    /// Indices of the samples inside, sorted.
    pub(super) empty: Vec<u32>,
    /// Weight of these samples.
    pub(super) weight: f64,
}

impl FilledHull {
    /// Hull of points (cells).
    pub(super) fn new(points: &[Vec3], space: &EmptySpace) -> Self {
        let vertices = hull_vertices(points);
        let hull = PartHull::new(&vertices);
        let samples = (0..).zip(&space.points);
        let empty = samples.filter(|(_, p)| hull.contains(**p)).map(|(i, _)| i);
        let empty: Vec<u32> = empty.collect();
        let weight = empty.iter().fold(0.0, |sum, &i| sum + space.weights[i as usize]);
        Self { bounds: crate::bounds(&vertices), vertices, empty, weight }
    }

    pub(super) fn merged(&self, other: &Self, space: &EmptySpace) -> Self {
        Self::new(&[&self.vertices[..], &other.vertices].concat(), space)
    }

    pub(super) fn touches(&self, other: &Self) -> bool {
        let [low, high] =
            [self.bounds[0].max(other.bounds[0]), self.bounds[1].min(other.bounds[1])];
        (low - high).max_element() <= CONTACT_DISTANCE
    }

    /// Weight of the samples that the joint hull fills in addition.
    pub(super) fn merge_cost(&self, other: &Self, space: &EmptySpace) -> f64 {
        let is_filled =
            |i: &u32| self.empty.binary_search(i).is_ok() || other.empty.binary_search(i).is_ok();
        let added = self.merged(other, space).empty.into_iter().filter(|i| !is_filled(i));
        added.fold(0.0, |sum, i| sum + space.weights[i as usize])
    }
}
