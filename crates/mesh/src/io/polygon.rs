//! Triangulation of a face with more than three corners.
//!
//! A fan from the first corner covers the opening of a concave face. Such a face is projected on its best
//! plane and cut by ear clipping (crate `earcut`, the algorithm of Mapbox).

use earcut::Earcut;
use glamx::{DVec2, DVec3};

/// Max area of a reversed fan triangle (fraction of the area of the face): rounding of collinear corners.
const REVERSED_AREA_TOLERANCE: f64 = 1e-9;
/// Max deviation of the triangles' total area from the area of the face (fraction).
const AREA_TOLERANCE: f64 = 1e-6;

/// Max number of corners of a face that is cut by ear clipping, whose time may grow with their square.
const MAX_CORNERS: usize = 50_000;

/// Triangles of a face as indices into its corners: always `corners.len() - 2`, with the winding of the face.
///
/// A convex face keeps its fan. So does a face that ear clipping cannot cover, such as one that crosses itself.
pub(crate) fn triangulate(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let fan = || (1..corners.len().saturating_sub(1)).map(|i| [0, i, i + 1]);
    let normal = doubled_area(corners);
    let area = normal.length();
    let doubled = |[a, b, c]: [usize; 3]| {
        (corners[b] - corners[a]).cross(corners[c] - corners[a]).dot(normal) / area
    };
    let is_fan_valid = fan().all(|triangle| doubled(triangle) >= -REVERSED_AREA_TOLERANCE * area);
    // A face without area has no plane.
    if area.is_nan() || area <= 0.0 || is_fan_valid || corners.len() > MAX_CORNERS {
        return fan().collect();
    }
    let triangles = clip_ears(&project(corners, normal / area));
    let covered: f64 = triangles.iter().map(|&triangle| doubled(triangle).abs()).sum();
    let is_covered = (covered - area).abs() <= AREA_TOLERANCE * area;
    if is_covered && triangles.len() + 2 == corners.len() { triangles } else { fan().collect() }
}

/// Normal of a polygon, of twice its area (Newell's method).
fn doubled_area(corners: &[DVec3]) -> DVec3 {
    let Some(&origin) = corners.first() else { return DVec3::ZERO };
    corners.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum()
}

/// Coordinates in the plane with this unit normal, counter-clockwise about it.
fn project(corners: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    // The axis that is farthest from the normal; along an axis, the projection only drops a coordinate.
    let n = normal.abs();
    let axis = match () {
        () if n.x <= n.y && n.x <= n.z => DVec3::X,
        () if n.y <= n.z => DVec3::Y,
        () => DVec3::Z,
    };
    let u = (axis - normal * axis.dot(normal)).normalize_or_zero();
    let v = normal.cross(u);
    let origin = corners[0];
    corners.iter().map(|&p| DVec2::new((p - origin).dot(u), (p - origin).dot(v))).collect()
}

/// Triangles by ear clipping, counter-clockwise, with the collinear corners that it leaves out put back.
///
/// A neighbouring face may share such a corner; without it, the surface would have a gap there.
fn clip_ears(points: &[DVec2]) -> Vec<[usize; 3]> {
    let mut indices: Vec<u32> = Vec::new();
    Earcut::new().earcut(points.iter().map(|p| p.to_array()), &[], &mut indices);
    let (triples, _) = indices.as_chunks::<3>();
    let is_clockwise =
        |&[a, b, c]: &[usize; 3]| (points[b] - points[a]).perp_dot(points[c] - points[a]) < 0.0;
    let mut triangles: Vec<[usize; 3]> =
        triples.iter().map(|triple| triple.map(|i| i as usize)).collect();
    for triangle in triangles.iter_mut().filter(|triangle| is_clockwise(triangle)) {
        triangle.swap(1, 2);
    }
    let mut is_used = vec![false; points.len()];
    triangles.iter().flatten().for_each(|&i| is_used[i] = true);
    let Some(start) = is_used.iter().position(|used| *used) else { return triangles };
    let mut from = start;
    let mut skipped = Vec::new();
    for step in 1..=points.len() {
        let corner = (start + step) % points.len();
        if !is_used[corner] {
            skipped.push(corner);
            continue;
        }
        insert_on_edge(&mut triangles, from, corner, &skipped);
        skipped.clear();
        from = corner;
    }
    triangles
}

/// Splits the triangle with the edge `from` to `to` at the corners `between` them.
fn insert_on_edge(triangles: &mut Vec<[usize; 3]>, from: usize, to: usize, between: &[usize]) {
    let sides = |t: &[usize; 3]| [0, 1, 2].map(|k| (t[k], t[(k + 1) % 3], t[(k + 2) % 3]));
    let found = triangles.iter().enumerate().find_map(|(i, triangle)| {
        let side = sides(triangle).into_iter().find(|&(a, b, _)| (a, b) == (from, to));
        side.map(|(.., opposite)| (i, opposite))
    });
    let (Some((index, opposite)), false) = (found, between.is_empty()) else { return };
    let mut last = from;
    for &corner in between {
        triangles.push([last, corner, opposite]);
        last = corner;
    }
    triangles[index] = [last, to, opposite];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// C of 80 x 80, opening to the right from x = 15, y = 15 to 65; starts at any corner.
    fn bracket(start: usize) -> Vec<DVec3> {
        let outline = [[80, 0], [80, 15], [15, 15], [15, 65], [80, 65], [80, 80], [0, 80], [0, 0]];
        let corner = |i: usize| outline[(start + i) % 8].map(f64::from);
        // Tilted out of the coordinate planes.
        (0..8).map(corner).map(|[x, y]| DVec3::new(x, 0.6 * y, 0.8 * y)).collect()
    }

    fn area(corners: &[DVec3], [a, b, c]: [usize; 3]) -> f64 {
        (corners[b] - corners[a]).cross(corners[c] - corners[a]).length() / 2.0
    }

    #[test]
    fn opening_of_a_concave_face_stays_open() {
        let opening = DVec3::new(50.0, 0.6 * 40.0, 0.8 * 40.0);
        for start in 0..8 {
            let corners = bracket(start);
            let triangles = triangulate(&corners);
            assert_eq!(triangles.len(), 6);
            let sum: f64 = triangles.iter().map(|&t| area(&corners, t)).sum();
            assert!((sum - (6400.0 - 3250.0)).abs() < 1e-6, "start {start}: {sum} mm²");
            for t in triangles {
                let [a, b, c] = t.map(|i| corners[i] - opening);
                let around = a.cross(b).length() + b.cross(c).length() + c.cross(a).length();
                assert!(around / 2.0 > area(&corners, t) + 1.0, "{t:?} covers the opening");
                let normal = (b - a).cross(c - a);
                assert!(normal.dot(DVec3::new(0.0, -0.8, 0.6)) > 0.0, "{t:?} is reversed");
            }
        }
    }

    #[test]
    fn collinear_corners_of_a_concave_face_are_kept() {
        let corners: Vec<DVec3> = bracket(0)
            .iter()
            .zip(bracket(1))
            .flat_map(|(&a, b)| [a, a.lerp(b, 0.25), a.lerp(b, 0.5)])
            .collect();
        let triangles = triangulate(&corners);
        assert_eq!(triangles.len(), 22);
        let mut edges: Vec<[usize; 2]> =
            triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        edges.sort_unstable();
        for i in 0..24 {
            assert!(edges.contains(&[i, (i + 1) % 24]), "side {i} is not a side of a triangle");
        }
    }

    #[test]
    fn convex_face_keeps_its_fan_and_a_face_without_area_does_not_panic() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        assert_eq!(triangulate(&square), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangulate(&[DVec3::ONE; 5]).len(), 3);
        let bow = [DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0), DVec3::Y * 2.0, DVec3::X];
        assert_eq!(triangulate(&bow).len(), 2);
    }
}
