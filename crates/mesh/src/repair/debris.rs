//! Debris: small components that are no part of the object, such as specks around a scan.

use super::edges::{EdgeDefects, HalfEdge, components, half_edges};
use crate::{Mesh, bounds};
use glamx::DVec3;

/// Max size of debris (diagonal of its bounding box, fraction of that of the largest component): a thousandth
/// of the volume.
const MAX_SIZE: f64 = 0.1;
/// Max volume of one closed piece of debris (fraction of the volume of all other components).
const MAX_VOLUME: f64 = 1e-3;
/// Max volume of all closed debris (fraction of the volume of all other components).
const MAX_TOTAL_VOLUME: f64 = 0.01;
/// Max area of all open debris (fraction of the total). Above it, the surface consists of small open pieces.
const MAX_TOTAL_AREA: f64 = 0.05;
/// Max area of all distant components (fraction of the total); larger ones are part of the object.
const MAX_DISTANT_AREA: f64 = 0.05;
/// Max number of rounds in which the group around the largest component grows.
const MAX_ROUNDS: usize = 100;

/// Component of a mesh.
#[derive(Clone)]
struct Component {
    corners: Vec<glamx::Vec3>,
    area: f64,
    is_closed: bool,
}

/// Measures of a component.
struct Measures {
    low: DVec3,
    high: DVec3,
    size: f64,
    volume: f64,
    area: f64,
    is_closed: bool,
}

/// Removes the debris; returns its number of components.
pub(super) fn remove_debris(mesh: &mut Mesh) -> usize {
    let half_edges = half_edges(mesh);
    let (of_triangle, count) = components(mesh.triangles.len(), &half_edges);
    if count < 2 {
        return 0;
    }
    let measures = measure(mesh, &half_edges, &of_triangle, count);
    let is_debris = find_debris(&measures);
    let mut of_triangle = of_triangle.into_iter();
    mesh.triangles.retain(|_| of_triangle.next().is_none_or(|component| !is_debris[component]));
    is_debris.into_iter().filter(|is_debris| *is_debris).count()
}

fn find_debris(all: &[Measures]) -> Vec<bool> {
    let largest = all.iter().max_by(|a, b| a.size.total_cmp(&b.size));
    let Some(largest) = largest else { return Vec::new() };
    let small: Vec<bool> = all.iter().map(|m| m.size < MAX_SIZE * largest.size).collect();
    let large_volume: f64 =
        all.iter().zip(&small).filter(|(_, small)| !**small).map(|(m, _)| m.volume).sum();
    let total_area: f64 = all.iter().map(|m| m.area).sum();
    let sum = |is_closed: bool, value: fn(&Measures) -> f64| -> f64 {
        let chosen =
            all.iter().zip(&small).filter(|(m, small)| **small && m.is_closed == is_closed);
        chosen.map(|(m, _)| value(m)).sum()
    };
    let is_closed_debris = sum(true, |m| m.volume) <= MAX_TOTAL_VOLUME * large_volume;
    let is_open_debris = sum(false, |m| m.area) <= MAX_TOTAL_AREA * total_area;
    let is_near = near_components(all, largest);
    let distant = all.iter().zip(&is_near).filter(|(_, is_near)| !**is_near);
    let is_distant_debris =
        distant.map(|(m, _)| m.area).sum::<f64>() <= MAX_DISTANT_AREA * total_area;
    let is_debris = |((m, small), is_near): ((&Measures, &bool), &bool)| {
        let is_part_of_debris = match m.is_closed {
            true => is_closed_debris && m.volume <= MAX_VOLUME * large_volume,
            false => is_open_debris,
        };
        *small && is_part_of_debris || is_distant_debris && !is_near
    };
    all.iter().zip(&small).zip(&is_near).map(is_debris).collect()
}

/// Whether each component belongs to a group around the largest one without a gap as wide as the group.
///
/// The parts of an assembly may be small and far from the largest, but not from each other.
fn near_components(all: &[Measures], largest: &Measures) -> Vec<bool> {
    let (mut low, mut high) = (largest.low, largest.high);
    let mut is_near = vec![false; all.len()];
    // The group at least doubles in each round but the last ones.
    for _ in 0..MAX_ROUNDS {
        let size = low.distance(high);
        let (group_low, group_high) = (low, high);
        for (m, is_near) in all.iter().zip(&mut is_near).filter(|(_, is_near)| !**is_near) {
            let gap = (m.low - group_high).max(group_low - m.high).max_element();
            if gap <= size {
                *is_near = true;
                (low, high) = (low.min(m.low), high.max(m.high));
            }
        }
        if (low, high) == (group_low, group_high) {
            break;
        }
    }
    is_near
}

fn measure(
    mesh: &Mesh,
    half_edges: &[HalfEdge],
    of_triangle: &[usize],
    count: usize,
) -> Vec<Measures> {
    let empty = Component { corners: Vec::new(), area: 0.0, is_closed: true };
    let mut all = vec![empty; count];
    for (triangle, &component) in mesh.triangles.iter().zip(of_triangle) {
        let corners = triangle.map(|i| mesh.vertices[i as usize]);
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        all[component].corners.extend(corners);
        all[component].area += (b - a).cross(c - a).length() / 2.0;
    }
    for edge in super::edges::edges(half_edges) {
        let is_open = EdgeDefects::of(mesh, edge).unbalanced > 0;
        all[of_triangle[edge[0].2 / 3]].is_closed &= !is_open;
    }
    let measures = |component: Component| {
        let [low, high] = bounds(&component.corners).map(|p| p.as_dvec3());
        let center = (low + high) / 2.0;
        let det = |t: &[glamx::Vec3; 3]| {
            let [a, b, c] = t.map(|p| p.as_dvec3() - center);
            a.dot(b.cross(c))
        };
        let volume = component.corners.as_chunks::<3>().0.iter().map(det).sum::<f64>().abs() / 6.0;
        let (area, is_closed) = (component.area, component.is_closed);
        Measures { low, high, size: low.distance(high), volume, area, is_closed }
    };
    all.into_iter().map(measures).collect()
}
