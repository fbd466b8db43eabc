//! Convex hulls by quickhull in double precision, farthest point first.
//!
//! parry's hull is not used, because physics needs bit-identical hulls natively and in wasm. It calls the
//! system's `acosf` for the principal axes, recurses to the depth of the visible faces, and has assertions
//! that rounding can break. This one uses only + - * / and square roots, does not recurse, and returns
//! `None` on failure. With the farthest point first, a hull of few points is a good approximation.

use crate::{Mesh, bounds};
use glamx::DVec3;
use glamx::Vec3;
use std::collections::{BTreeMap, BinaryHeap};

/// Points closer than this to a face are on it (fraction of the longest side); f32 input is noise below this.
const COPLANAR_TOLERANCE: f64 = 1e-7;
/// A point farther outside a face than this is visible from it (fraction of the longest side).
///
/// Far above f64 rounding, and far below [`COPLANAR_TOLERANCE`] to keep the faces next to a new vertex
/// convex.
const VISIBILITY_TOLERANCE: f64 = 1e-11;
/// Min thickness of a solid with a hull (fraction of the longest side).
const MIN_THICKNESS: f64 = 1e-5;
/// Max distance of a point that the hull may omit on rounding errors (fraction of the longest side).
const MAX_MISSED_DISTANCE: f64 = 1e-3;

/// Convex hull as a closed mesh of up to `max_points` of the points, in any unit. `None` if the points are
/// coplanar.
pub fn convex_hull(points: &[Vec3], max_points: usize) -> Option<Mesh> {
    convex_hull_within(points, max_points, 0.0)
}

/// Convex hull that may omit points up to `tolerance` outside (fraction of the longest side).
pub(super) fn convex_hull_within(
    points: &[Vec3],
    max_points: usize,
    tolerance: f64,
) -> Option<Mesh> {
    Some(Hull::new(points, max_points, tolerance)?.mesh(points))
}

/// Outward unit normals and offsets of the faces: `normal.dot(p) <= offset` inside. `None` if the points are
/// coplanar.
pub(super) fn hull_planes(points: &[Vec3]) -> Option<Vec<(Vec3, f32)>> {
    let hull = Hull::new(points, usize::MAX, 0.0)?;
    let plane = |face: &Face| {
        let normal = face.normal.as_vec3();
        (normal, normal.dot(points[face.corners[0]]))
    };
    Some(hull.faces.iter().filter(|face| face.is_alive).map(plane).collect())
}

/// Triangle of the hull under construction.
struct Face {
    /// Point indices, counter-clockwise seen from outside.
    corners: [usize; 3],
    /// Index of the face across the edge from corner k to corner k + 1.
    neighbors: [usize; 3],
    normal: DVec3,
    offset: f64,
    /// Distances and indices of the points outside this face, the farthest last.
    outside: Vec<(f64, usize)>,
    is_alive: bool,
}

/// Prefers the point farthest from the centre among equally distant ones: it is a vertex, not inside a face.
fn tie_break(point: DVec3) -> f64 {
    COPLANAR_TOLERANCE * point.length_squared()
}

struct Hull {
    points: Vec<DVec3>,
    faces: Vec<Face>,
    /// Faces with outside points, by the bits of the max distance (ordered like the positive values).
    queue: BinaryHeap<(u64, usize)>,
    /// For each face, the last apex for which its visibility was determined, and the result.
    visibility: Vec<(usize, bool)>,
}

/// Edge between a visible face and one that is not.
struct HorizonEdge {
    /// Point indices, in the direction of the visible face.
    from: usize,
    to: usize,
    /// Index of the visible face.
    inner: usize,
    /// Index of the other face.
    outer: usize,
}

impl Face {
    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

impl Hull {
    fn new(points: &[Vec3], max_points: usize, tolerance: f64) -> Option<Self> {
        let [low, high] = bounds(points);
        let size = f64::from((high - low).max_element());
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        let center = (low.as_dvec3() + high.as_dvec3()) / 2.0;
        let scaled = points.iter().map(|p| (p.as_dvec3() - center) / size);
        let mut hull = Self {
            points: scaled.collect(),
            faces: Vec::new(),
            queue: BinaryHeap::new(),
            visibility: Vec::new(),
        };
        hull.build_tetrahedron()?;
        let mut num_points = 4;
        while num_points < max_points
            && let Some((distance, face)) = hull.queue.pop()
        {
            if !hull.faces[face].is_alive {
                continue;
            }
            if f64::from_bits(distance) < tolerance {
                break;
            }
            if hull.add_farthest(face).is_some() {
                num_points += 1;
            } else if f64::from_bits(distance) > MAX_MISSED_DISTANCE {
                return None;
            } else {
                hull.discard_farthest(face);
            }
        }
        Some(hull)
    }

    /// Builds the initial tetrahedron from the most distant points; `None` if all points are coplanar.
    fn build_tetrahedron(&mut self) -> Option<()> {
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
        if !(width > MIN_THICKNESS * MIN_THICKNESS && height > MIN_THICKNESS) {
            return None;
        }
        let [a, b, c] = if (pd - pa).dot(normal) > 0.0 { [a, c, b] } else { [a, b, c] };
        let corners = [[a, b, c], [b, a, d], [c, b, d], [a, c, d]];
        let neighbors = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        for (corners, neighbors) in corners.into_iter().zip(neighbors) {
            let face = self.make_face(corners, neighbors)?;
            self.faces.push(face);
        }
        let all = (0..self.points.len()).collect();
        self.assign_outside_points(all, 0);
        Some(())
    }

    /// Face through three points; `None` if they are collinear.
    fn make_face(&self, corners: [usize; 3], neighbors: [usize; 3]) -> Option<Face> {
        let [a, b, c] = corners.map(|i| self.points[i]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        let offset = normal.dot((a + b + c) / 3.0);
        Some(Face { corners, neighbors, normal, offset, outside: Vec::new(), is_alive: true })
    }

    /// Assigns each point to the face (index >= `first`) that it is farthest outside of; drops inside points.
    fn assign_outside_points(&mut self, points: Vec<usize>, first: usize) {
        for point in points {
            let mut best = (COPLANAR_TOLERANCE, usize::MAX);
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

    /// Moves the farthest point of a face to the end of its list, and queues the face.
    fn enqueue(&mut self, index: usize) {
        let outside = &mut self.faces[index].outside;
        let key = |i: usize| outside[i].0 + tie_break(self.points[outside[i].1]);
        // The lower index wins a tie, so that the result depends only on the input.
        let farthest =
            (0..outside.len()).max_by(|&i, &j| key(i).total_cmp(&key(j)).then(j.cmp(&i)));
        if let Some(farthest) = farthest {
            let last = outside.len() - 1;
            outside.swap(farthest, last);
            self.queue.push((outside[last].0.to_bits(), index));
        }
    }

    fn discard_farthest(&mut self, face: usize) {
        self.faces[face].outside.pop();
        self.enqueue(face);
    }

    /// Replaces the faces visible from the farthest point of `face` by a cone from that point to the horizon.
    ///
    /// Returns `None`, without changes, if rounding has broken the horizon.
    fn add_farthest(&mut self, face: usize) -> Option<()> {
        let &(_, apex) = self.faces[face].outside.last()?;
        self.visibility.resize(self.faces.len(), (usize::MAX, false));
        self.visibility[face] = (apex, true);
        let mut visible = vec![face];
        let mut horizon = Vec::new();
        let mut next = 0;
        while let Some(&inner) = visible.get(next) {
            next += 1;
            for edge in 0..3 {
                let outer = self.faces[inner].neighbors[edge];
                if self.visibility[outer].0 != apex {
                    let distance = self.faces[outer].distance(self.points[apex]);
                    let sees_apex = distance > VISIBILITY_TOLERANCE;
                    self.visibility[outer] = (apex, sees_apex);
                    if sees_apex {
                        visible.push(outer);
                    }
                }
                if !self.visibility[outer].1 {
                    let corners = self.faces[inner].corners;
                    let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
                    horizon.push(HorizonEdge { from, to, inner, outer });
                }
            }
        }
        horizon.sort_unstable_by_key(|edge| edge.from);
        let cone = self.cone_to_horizon(apex, &horizon)?;
        let first = self.faces.len();
        for (i, face) in cone.iter().enumerate() {
            let HorizonEdge { inner, outer, .. } = horizon[edge_from(&horizon, face.corners[0])?];
            // Two faces may share two edges: compare the corner as well.
            let corners = self.faces[outer].corners;
            let edge = (0..3).find(|&k| {
                self.faces[outer].neighbors[k] == inner && corners[k] == face.corners[1]
            })?;
            self.faces[outer].neighbors[edge] = first + i;
        }
        self.faces.extend(cone);
        let mut orphans = Vec::new();
        for face in visible {
            let face = &mut self.faces[face];
            face.is_alive = false;
            orphans.extend(std::mem::take(&mut face.outside).into_iter().map(|(_, point)| point));
        }
        orphans.retain(|&point| point != apex);
        self.assign_outside_points(orphans, first);
        Some(())
    }

    /// New faces in order around the horizon, sorted by `from`; `None` unless it is a single closed loop.
    fn cone_to_horizon(&self, apex: usize, horizon: &[HorizonEdge]) -> Option<Vec<Face>> {
        let (first, count) = (self.faces.len(), horizon.len());
        let mut faces = Vec::with_capacity(count);
        let start = horizon.first()?.from;
        let mut corner = start;
        for i in 0..count {
            let &HorizonEdge { to, outer, .. } = &horizon[edge_from(horizon, corner)?];
            let neighbors = [outer, first + (i + 1) % count, first + (i + count - 1) % count];
            faces.push(self.make_face([corner, to, apex], neighbors)?);
            corner = to;
            if corner == start && i + 1 < count {
                return None;
            }
        }
        (corner == start).then_some(faces)
    }

    /// Mesh of the remaining faces and the points they use.
    fn mesh(&self, points: &[Vec3]) -> Mesh {
        let mut new_index = BTreeMap::new();
        let mut mesh = Mesh::default();
        for face in self.faces.iter().filter(|face| face.is_alive) {
            mesh.triangles.push(face.corners.map(|corner| {
                *new_index.entry(corner).or_insert_with(|| {
                    mesh.vertices.push(points[corner]);
                    mesh.vertices.len() as u32 - 1
                })
            }));
        }
        mesh
    }
}

/// Index of the horizon's edge that starts at a point.
fn edge_from(horizon: &[HorizonEdge], point: usize) -> Option<usize> {
    horizon.binary_search_by_key(&point, |edge| edge.from).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::repair;
    use crate::test_meshes;
    use rand::{Rng, RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn point(rng: &mut impl Rng) -> Vec3 {
        Vec3::from_array([(); 3].map(|()| rng.random_range(-1.0..1.0)))
    }

    /// Asserts a closed hull that faces outward and misses no point by more than `tolerance`.
    fn check(points: &[Vec3], hull: &Mesh, tolerance: f64) {
        let (repaired, repair) = repair(hull.clone()).unwrap();
        assert!(repair.watertight && repair.flipped_triangles == 0, "{repair:?}");
        assert_eq!(repaired.triangles.len(), hull.triangles.len());
        for corners in
            hull.triangles.iter().map(|t| t.map(|i| hull.vertices[i as usize].as_dvec3()))
        {
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let worst =
                points.iter().map(|p| normal.dot(p.as_dvec3() - corners[0])).fold(0.0, f64::max);
            // Skip slivers: their normals are inaccurate.
            if normal.length() > 1e-4 {
                let worst = worst / normal.length();
                assert!(worst <= tolerance, "a point is {worst} outside");
            }
        }
    }

    #[test]
    fn hull_contains_random_points() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for count in [5, 20, 300, 3000] {
            let points: Vec<_> = (0..count).map(|_| point(&mut rng)).collect();
            check(&points, &convex_hull(&points, usize::MAX).unwrap(), 1e-5);
        }
    }

    #[test]
    fn grids_and_spheres_give_closed_hulls() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let grid: Vec<_> = (0..729)
            .map(|i| Vec3::new((i % 9) as f32, (i / 9 % 9) as f32, (i / 81) as f32) * 0.1)
            .collect();
        let box_hull = convex_hull(&grid, usize::MAX).unwrap();
        check(&grid, &box_hull, 1e-6);
        assert_eq!(box_hull.vertices.len(), 8, "the hull of a grid has 8 vertices");
        let sphere: Vec<_> = (0..2000).map(|_| point(&mut rng).normalize()).collect();
        check(&sphere, &convex_hull(&sphere, usize::MAX).unwrap(), 1e-5);
        // Nearly coplanar and nearly collinear points, duplicated, as in scans of boxes.
        for scale in [1e-3, 1e-5, 1e-6, 1e-7] {
            let jitter = |p: &Vec3, rng: &mut ChaCha8Rng| *p + point(rng) * scale;
            let mut rough: Vec<_> = grid.iter().map(|p| jitter(p, &mut rng)).collect();
            rough.extend_from_within(..);
            check(&rough, &convex_hull(&rough, usize::MAX).unwrap(), 1e-5);
        }
    }

    #[test]
    fn limited_hull_approximates_the_full_hull() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let sphere: Vec<_> = (0..5000).map(|_| point(&mut rng).normalize()).collect();
        let small = convex_hull(&sphere, 64).unwrap();
        assert_eq!(small.vertices.len(), 64);
        check(&[], &small, 0.0);
        let ratio = test_meshes::volume(&small)
            / test_meshes::volume(&convex_hull(&sphere, usize::MAX).unwrap());
        assert!(ratio > 0.85, "got {ratio}");
    }

    #[test]
    fn flat_points_have_no_hull() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 0.4]];
        let tilted = square.map(|[x, y]| Vec3::new(x, y, 0.3 * x + 0.2 * y));
        assert_eq!(convex_hull(&tilted, usize::MAX), None);
        assert_eq!(convex_hull(&[Vec3::ONE; 9], usize::MAX), None);
        assert_eq!(
            convex_hull(&[Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::X * 3.0], usize::MAX),
            None
        );
        assert_eq!(convex_hull(&[], usize::MAX), None);
        assert_eq!(convex_hull(&[Vec3::NAN; 5], usize::MAX), None);
    }
}
