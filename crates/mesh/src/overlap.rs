//! Common volume of solids that overlap, from the winding number along vertical lines.
//!
//! A closed surface has the winding number 1 inside and 0 outside. Where solids overlap, their numbers add
//! up. The volume by the divergence theorem therefore counts a point as often as its winding number.

use crate::Mesh;
use crate::mass_properties::{VolumeIntegrals, outer_product};
use glamx::{DMat3, DVec2, DVec3};

/// Lines along the longer horizontal side.
const RESOLUTION: f64 = 256.0;
/// Position of the lines in their cells; faces at simple fractions of the size are not on a line.
const LINE_OFFSET: DVec2 = DVec2::new(0.4637, 0.5291);
/// Max number of crossings of lines and triangles: about 400 MB.
const MAX_CROSSINGS: usize = 25_000_000;

/// Crossing of a line and a triangle: number of the line, height (m), and +1 where the line enters the solid.
type Crossing = (u32, f64, i32);

/// Integrals of the winding number above 1, relative to `origin`; `None` if there are too many crossings.
pub(super) fn overlap(mesh: &Mesh, origin: DVec3) -> Option<VolumeIntegrals> {
    let [low, high] = mesh.bounds().map(|corner| corner.as_dvec3());
    let cell = (high - low).truncate().max_element() / RESOLUTION;
    let mut sum = VolumeIntegrals { origin, volume: 0.0, first: DVec3::ZERO, second: DMat3::ZERO };
    if cell.is_nan() || cell <= 0.0 {
        return Some(sum);
    }
    let low = low.truncate();
    let num_columns = ((high.x - low.x) / cell).ceil() as u32 + 1;
    let line = |x: u32, y: u32| low + (DVec2::new(x.into(), y.into()) + LINE_OFFSET) * cell;
    let crossings = find_crossings(mesh, low, cell, num_columns, &line)?;
    for of_line in crossings.chunk_by(|a, b| a.0 == b.0) {
        // A line through an edge may miss or repeat a crossing.
        if of_line.iter().map(|(.., step)| step).sum::<i32>() != 0 {
            continue;
        }
        let at = line(of_line[0].0 % num_columns, of_line[0].0 / num_columns) - origin.truncate();
        let mut winding = 0;
        for pair in of_line.windows(2) {
            winding += pair[0].2;
            if winding > 1 {
                let weight = f64::from(winding - 1) * cell * cell;
                add_segment(&mut sum, at, [pair[0].1 - origin.z, pair[1].1 - origin.z], weight);
            }
        }
    }
    Some(sum)
}

/// Crossings, sorted by line and height.
fn find_crossings(
    mesh: &Mesh,
    low: DVec2,
    cell: f64,
    num_columns: u32,
    line: &dyn Fn(u32, u32) -> DVec2,
) -> Option<Vec<Crossing>> {
    let mut crossings: Vec<Crossing> = Vec::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.vertices[i as usize].as_dvec3());
        let [a, b, c] = corners.map(|p| p.truncate());
        let doubled = (b - a).perp_dot(c - a);
        if doubled == 0.0 {
            continue;
        }
        // Lines from the first above the lower bound to the last below the upper bound.
        let first = ((a.min(b).min(c) - low) / cell - LINE_OFFSET).ceil().max(DVec2::ZERO);
        let last = ((a.max(b).max(c) - low) / cell - LINE_OFFSET).floor();
        let (mut y, end_y) = (first.y, last.y);
        while y <= end_y {
            let mut x = first.x;
            while x <= last.x {
                let p = line(x as u32, y as u32);
                let weights =
                    [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)];
                if weights.iter().all(|w| w * doubled.signum() > 0.0) {
                    let height: f64 =
                        weights.iter().zip(corners).map(|(w, corner)| w * corner.z).sum();
                    // A face that looks down is entered by a line that runs up.
                    let step = if doubled < 0.0 { 1 } else { -1 };
                    crossings.push((x as u32 + num_columns * y as u32, height / doubled, step));
                    if crossings.len() > MAX_CROSSINGS {
                        return None;
                    }
                }
                x += 1.0;
            }
            y += 1.0;
        }
    }
    crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(b.2.cmp(&a.2)));
    Some(crossings)
}

/// Adds the integrals over a vertical segment at `at` between two heights.
fn add_segment(sum: &mut VolumeIntegrals, at: DVec2, [bottom, top]: [f64; 2], weight: f64) {
    let length = top - bottom;
    let mean = at.extend((bottom + top) / 2.0);
    let volume = weight * length;
    sum.volume += volume;
    sum.first += mean * volume;
    sum.second += outer_product(mean) * volume;
    sum.second.z_axis.z += volume * length * length / 12.0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_meshes;
    use glamx::Vec3;

    #[test]
    fn common_box_of_two_boxes_is_measured() {
        let other = test_meshes::cube().translated(Vec3::new(0.5, 0.25, 0.75));
        let mesh = test_meshes::union(&[test_meshes::cube(), other]);
        let found = overlap(&mesh, DVec3::ZERO).unwrap();
        let volume = 0.5 * 0.75 * 0.25;
        assert!((found.volume / volume - 1.0).abs() < 0.02, "{} m³", found.volume);
        let center = found.first / found.volume;
        let wanted = DVec3::new(0.75, 0.625, 0.875);
        assert!(center.distance(wanted) < 0.005, "wanted {wanted}, got {center}");
    }

    #[test]
    fn cavity_and_separate_solids_do_not_overlap() {
        let inner = test_meshes::cuboid(Vec3::splat(0.25), Vec3::splat(0.75));
        let inward = Mesh {
            triangles: inner.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
            ..inner
        };
        let far = test_meshes::cube().translated(Vec3::X * 2.0);
        let mesh = test_meshes::union(&[test_meshes::cube(), inward, far]);
        assert_eq!(overlap(&mesh, DVec3::ZERO).unwrap().volume, 0.0);
    }
}
