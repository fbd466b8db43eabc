//! Convex hulls by quickhull, the farthest point first, in double precision.
//!
//! Our own because a hull reaches physics: parry's asks the system's `acosf` for principal axes, which differs
//! between native and wasm, recurses as deep as faces are seen, and asserts what rounding may break. Here are
//! only + - * / and square roots, no recursion, and a failure is a `None`. Taking the farthest point first also
//! gives a good hull of few points on the way.

use super::{Mesh, bounds};
use crate::Vec3;
use glamx::DVec3;
use std::collections::{BTreeMap, BinaryHeap};

/// Points nearer than this to a face lie on it (fraction of the longest side); below it f32 input is noise.
const THICKNESS: f64 = 1e-7;
/// A face sees a point farther outside than this: far above rounding in f64, far below `THICKNESS`, so that the
/// faces left beside a new corner stay convex with the new ones.
const ROUNDING: f64 = 1e-11;
/// Thinner things have no hull (fraction of the longest side).
const FLAT: f64 = 1e-5;
/// A hull that had to leave out a point this far outside (fraction of the longest side) has failed.
const MISSED: f64 = 1e-3;

/// The convex hull as a closed mesh of at most `max_points` of the points; `None` if they lie in a plane.
pub fn hull(points: &[Vec3], max_points: usize) -> Option<Mesh> {
    hull_within(points, max_points, 0.0)
}

/// The same, leaving out points that lie outside by less than `slack` (fraction of the longest side).
pub(super) fn hull_within(points: &[Vec3], max_points: usize, slack: f64) -> Option<Mesh> {
    let [low, high] = bounds(points);
    let size = f64::from((high - low).max_element());
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let center = (low.as_dvec3() + high.as_dvec3()) / 2.0;
    let scaled = points.iter().map(|p| (p.as_dvec3() - center) / size);
    let mut hull = Hull { points: scaled.collect(), faces: Vec::new(), queue: BinaryHeap::new() };
    hull.start()?;
    let mut num_points = 4;
    while num_points < max_points
        && let Some((distance, face)) = hull.queue.pop()
    {
        if !hull.faces[face].is_alive {
            continue;
        }
        if f64::from_bits(distance) < slack {
            break;
        }
        if hull.add_farthest(face).is_some() {
            num_points += 1;
        } else if f64::from_bits(distance) > MISSED {
            return None;
        } else {
            hull.drop_farthest(face);
        }
    }
    Some(hull.mesh(points))
}

/// A triangle of the hull under construction.
struct Face {
    /// Counter-clockwise seen from outside.
    corners: [usize; 3],
    /// The face across the edge from corner k to corner k + 1.
    neighbors: [usize; 3],
    normal: DVec3,
    offset: f64,
    /// Points outside this face and its distance, the farthest last.
    outside: Vec<(f64, usize)>,
    is_alive: bool,
}

/// Of points equally far outside, prefers the one farthest from the middle: it is a corner, not within a side.
fn tie_break(point: DVec3) -> f64 {
    THICKNESS * point.length_squared()
}

struct Hull {
    points: Vec<DVec3>,
    faces: Vec<Face>,
    /// Faces with points outside, by the bits of the farthest one's distance: for positive numbers they sort alike.
    queue: BinaryHeap<(u64, usize)>,
}

impl Face {
    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

impl Hull {
    /// The tetrahedron of the most distant points; `None` if all lie in a plane.
    fn start(&mut self) -> Option<()> {
        let farthest = |measure: &dyn Fn(DVec3) -> f64| {
            let mut best = (0, f64::NEG_INFINITY);
            for (i, &p) in self.points.iter().enumerate() {
                let value = measure(p) + tie_break(p);
                if value > best.1 {
                    best = (i, value);
                }
            }
            (best.0, best.1, self.points[best.0])
        };
        let (a, _, pa) = farthest(&|p| -p.x);
        let (b, _, pb) = farthest(&|p| p.distance_squared(pa));
        let along = (pb - pa).normalize_or_zero();
        let (c, width, pc) = farthest(&|p| (p - pa).cross(along).length_squared());
        let normal = along.cross(pc - pa).normalize_or_zero();
        let (d, height, pd) = farthest(&|p| (p - pa).dot(normal).abs());
        if !(width > FLAT * FLAT && height > FLAT) {
            return None;
        }
        let [a, b, c] = if (pd - pa).dot(normal) > 0.0 { [a, c, b] } else { [a, b, c] };
        let corners = [[a, b, c], [b, a, d], [c, b, d], [a, c, d]];
        let neighbors = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        for (corners, neighbors) in corners.into_iter().zip(neighbors) {
            let face = self.face(corners, neighbors)?;
            self.faces.push(face);
        }
        let all = (0..self.points.len()).collect();
        self.share_out(all, 0);
        Some(())
    }

    /// A face through three points; `None` if they lie on a line.
    fn face(&self, corners: [usize; 3], neighbors: [usize; 3]) -> Option<Face> {
        let [a, b, c] = corners.map(|i| self.points[i]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        let offset = normal.dot((a + b + c) / 3.0);
        Some(Face { corners, neighbors, normal, offset, outside: Vec::new(), is_alive: true })
    }

    /// Gives each point to the face from `first` on that it is farthest outside of; inner points are forgotten.
    fn share_out(&mut self, points: Vec<usize>, first: usize) {
        for point in points {
            let mut best = (THICKNESS, usize::MAX);
            for (i, face) in self.faces.iter().enumerate().skip(first) {
                let distance = face.distance(self.points[point]);
                if distance > best.0 {
                    best = (distance, i);
                }
            }
            if let Some(face) = self.faces.get_mut(best.1) {
                face.outside.push((best.0, point));
            }
        }
        for face in first..self.faces.len() {
            self.enqueue(face);
        }
    }

    /// Moves the farthest point of a face to the end of its list, and the face to its place in the queue.
    fn enqueue(&mut self, index: usize) {
        let outside = &mut self.faces[index].outside;
        let key = |i: usize| outside[i].0 + tie_break(self.points[outside[i].1]);
        // The lower index wins a tie, so that the result depends on nothing but the input.
        let farthest =
            (0..outside.len()).max_by(|&i, &j| key(i).total_cmp(&key(j)).then(j.cmp(&i)));
        if let Some(farthest) = farthest {
            let last = outside.len() - 1;
            outside.swap(farthest, last);
            self.queue.push((outside[last].0.to_bits(), index));
        }
    }

    fn drop_farthest(&mut self, face: usize) {
        self.faces[face].outside.pop();
        self.enqueue(face);
    }

    /// Replaces all faces that see the farthest point of `face` by a cone from it to their rim.
    ///
    /// `None`, with nothing changed, if rounding has torn the rim.
    fn add_farthest(&mut self, face: usize) -> Option<()> {
        let &(_, apex) = self.faces[face].outside.last()?;
        let mut seen = vec![face];
        let mut is_seen = BTreeMap::from([(face, true)]);
        let mut rim = BTreeMap::new();
        let mut num_edges = 0;
        let mut next = 0;
        while let Some(&current) = seen.get(next) {
            next += 1;
            for edge in 0..3 {
                let neighbor = self.faces[current].neighbors[edge];
                let sees = *is_seen.entry(neighbor).or_insert_with(|| {
                    let sees = self.faces[neighbor].distance(self.points[apex]) > ROUNDING;
                    if sees {
                        seen.push(neighbor);
                    }
                    sees
                });
                if !sees {
                    let corners = self.faces[current].corners;
                    rim.insert(corners[edge], (corners[(edge + 1) % 3], current, neighbor));
                    num_edges += 1;
                }
            }
        }
        let cone = self.cone(apex, &rim, num_edges)?;
        let first = self.faces.len();
        for (i, face) in cone.iter().enumerate() {
            let (_, inner, outer) = rim[&face.corners[0]];
            // Two faces may share two edges, so the edge is known by its corner as well.
            let corners = self.faces[outer].corners;
            let edge = (0..3).find(|&k| {
                self.faces[outer].neighbors[k] == inner && corners[k] == face.corners[1]
            })?;
            self.faces[outer].neighbors[edge] = first + i;
        }
        self.faces.extend(cone);
        let mut orphans = Vec::new();
        for face in seen {
            let face = &mut self.faces[face];
            face.is_alive = false;
            orphans.extend(std::mem::take(&mut face.outside).into_iter().map(|(_, point)| point));
        }
        orphans.retain(|&point| point != apex);
        self.share_out(orphans, first);
        Some(())
    }

    /// The new faces in order around the rim; `None` unless it is one closed loop.
    fn cone(
        &self,
        apex: usize,
        rim: &BTreeMap<usize, (usize, usize, usize)>,
        num_edges: usize,
    ) -> Option<Vec<Face>> {
        let (first, count) = (self.faces.len(), rim.len());
        let mut faces = Vec::with_capacity(count);
        let (&start, _) = rim.first_key_value()?;
        let mut corner = start;
        for i in 0..count {
            let &(next, _, outer) = rim.get(&corner)?;
            let neighbors = [outer, first + (i + 1) % count, first + (i + count - 1) % count];
            faces.push(self.face([corner, next, apex], neighbors)?);
            corner = next;
            if corner == start && i + 1 < count {
                return None;
            }
        }
        (corner == start && num_edges == count).then_some(faces)
    }

    /// The faces that are left, with the points they use.
    fn mesh(&self, points: &[Vec3]) -> Mesh {
        let mut renamed = BTreeMap::new();
        let mut mesh = Mesh::default();
        for face in self.faces.iter().filter(|face| face.is_alive) {
            mesh.triangles.push(face.corners.map(|corner| {
                *renamed.entry(corner).or_insert_with(|| {
                    mesh.vertices.push(points[corner]);
                    mesh.vertices.len() as u32 - 1
                })
            }));
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{heal, samples};
    use rand::{Rng, RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn point(rng: &mut impl Rng) -> Vec3 {
        Vec3::from_array([(); 3].map(|()| rng.random_range(-1.0..1.0)))
    }

    /// Closed, oriented outward, and no point outside by more than `slack`.
    fn check(points: &[Vec3], hull: &Mesh, slack: f64) {
        let (healed, healing) = heal(hull.clone()).unwrap();
        assert!(healing.watertight && healing.flipped_triangles == 0, "{healing:?}");
        assert_eq!(healed.triangles.len(), hull.triangles.len());
        for corners in
            hull.triangles.iter().map(|t| t.map(|i| hull.vertices[i as usize].as_dvec3()))
        {
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let worst =
                points.iter().map(|p| normal.dot(p.as_dvec3() - corners[0])).fold(0.0, f64::max);
            // The plane of a sliver says nothing.
            if normal.length() > 1e-4 {
                let worst = worst / normal.length();
                assert!(worst <= slack, "a point is {worst} outside");
            }
        }
    }

    #[test]
    fn random_points_lie_within_their_hull() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for count in [5, 20, 300, 3000] {
            let points: Vec<_> = (0..count).map(|_| point(&mut rng)).collect();
            check(&points, &hull(&points, usize::MAX).unwrap(), 1e-5);
        }
    }

    #[test]
    fn grids_and_spheres_do_not_tear_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let grid: Vec<_> = (0..729)
            .map(|i| Vec3::new((i % 9) as f32, (i / 9 % 9) as f32, (i / 81) as f32) * 0.1)
            .collect();
        let box_hull = hull(&grid, usize::MAX).unwrap();
        check(&grid, &box_hull, 1e-6);
        assert_eq!(box_hull.vertices.len(), 8, "a grid has the corners of its box");
        let sphere: Vec<_> = (0..2000).map(|_| point(&mut rng).normalize()).collect();
        check(&sphere, &hull(&sphere, usize::MAX).unwrap(), 1e-5);
        // Nearly coplanar and nearly collinear points, twice each, as scans of boxes have them.
        for scale in [1e-3, 1e-5, 1e-6, 1e-7] {
            let jitter = |p: &Vec3, rng: &mut ChaCha8Rng| *p + point(rng) * scale;
            let mut rough: Vec<_> = grid.iter().map(|p| jitter(p, &mut rng)).collect();
            rough.extend_from_within(..);
            check(&rough, &hull(&rough, usize::MAX).unwrap(), 1e-5);
        }
    }

    #[test]
    fn few_points_make_nearly_the_same_hull() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let sphere: Vec<_> = (0..5000).map(|_| point(&mut rng).normalize()).collect();
        let small = hull(&sphere, 64).unwrap();
        assert_eq!(small.vertices.len(), 64);
        check(&[], &small, 0.0);
        let ratio = samples::volume(&small) / samples::volume(&hull(&sphere, usize::MAX).unwrap());
        assert!(ratio > 0.85, "got {ratio}");
    }

    #[test]
    fn what_is_flat_has_no_hull() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 0.4]];
        let tilted = square.map(|[x, y]| Vec3::new(x, y, 0.3 * x + 0.2 * y));
        assert_eq!(hull(&tilted, usize::MAX), None);
        assert_eq!(hull(&[Vec3::ONE; 9], usize::MAX), None);
        assert_eq!(hull(&[Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::X * 3.0], usize::MAX), None);
        assert_eq!(hull(&[], usize::MAX), None);
        assert_eq!(hull(&[Vec3::NAN; 5], usize::MAX), None);
    }
}
