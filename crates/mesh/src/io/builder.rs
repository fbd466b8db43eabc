//! Mesh under construction: the checks that apply to every format.
//!
//! Coordinates stay in double precision until the centre of a distant mesh is subtracted: single precision
//! has steps of 0.5 m at the coordinates of a map projection.

use super::parse::check_limit;
use super::polygon::triangulate;
use super::{MAX_TRIANGLES, MAX_VERTICES};
use crate::{Location, Mesh, MeshError};
use glamx::DVec3;

/// Max magnitude of a coordinate in the file (units of the file).
const MAX_COORDINATE: f64 = 1e12;
/// Max magnitude of a coordinate after the centre is subtracted; its cube fits single precision.
const MAX_CENTERED_COORDINATE: f64 = 1e9;
/// Distance from the origin (fraction of the longest side) above which the centre is subtracted.
///
/// Single precision resolves 1e-6 of the size of a nearer mesh, which the repair takes for equal.
const MAX_CENTER_DISTANCE: f64 = 10.0;
/// Max spacing of single-precision numbers at the mesh (fraction of its longest side).
const MAX_SINGLE_PRECISION_STEP: f64 = 1e-3;
/// Max number of invalid vertices whose location is stored; later ones are named by their index.
const MAX_STORED_LOCATIONS: usize = 1000;

/// Mesh under construction; applies the same checks to every format.
pub(super) struct MeshBuilder {
    format: &'static str,
    /// Index of the first vertex in the format: 0, or 1 for OBJ.
    first_index: i64,
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// First triangle and number of corners of each face with more than three corners.
    polygons: Vec<(u32, u32)>,
    /// Max vertex index used so far, with its location: OBJ and PLY may use a vertex before its definition.
    max_index: Option<(u32, Location)>,
    /// Locations of the first invalid vertices; they are errors only if a face uses them.
    invalid: Vec<(u32, Location)>,
    has_invalid: bool,
    is_single_precision: bool,
    /// Max spacing (units of the file) of the stored coordinates before their transform.
    max_step: f64,
}

impl MeshBuilder {
    pub(super) fn new(format: &'static str, first_index: i64) -> Self {
        Self {
            format,
            first_index,
            vertices: Vec::new(),
            triangles: Vec::new(),
            polygons: Vec::new(),
            max_index: None,
            invalid: Vec::new(),
            has_invalid: false,
            is_single_precision: false,
            max_step: 0.0,
        }
    }

    /// Declares that the file stores coordinates in single precision, so that distant ones are inaccurate.
    pub(super) fn set_single_precision(&mut self) {
        self.is_single_precision = true;
    }

    /// Declares that coordinates of this magnitude (units of the file) were in single precision before a transform.
    pub(super) fn add_single_precision(&mut self, magnitude: f64) {
        self.max_step = self.max_step.max(magnitude * f64::from(f32::EPSILON));
    }

    pub(super) fn num_vertices(&self) -> usize {
        self.vertices.len()
    }

    pub(super) fn num_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Adds a vertex, after a check of the count.
    pub(super) fn add_vertex(
        &mut self,
        position: [f64; 3],
        location: Location,
    ) -> Result<(), MeshError> {
        check_limit("vertices", self.num_vertices() as u64 + 1, MAX_VERTICES)?;
        if position.iter().any(|x| is_invalid(*x)) {
            self.has_invalid = true;
            if self.invalid.len() < MAX_STORED_LOCATIONS {
                self.invalid.push((self.num_vertices() as u32, location));
            }
        }
        self.vertices.push(DVec3::from_array(position));
        Ok(())
    }

    /// Adds a face; `corners` are vertex indices from 0.
    pub(super) fn add_polygon(
        &mut self,
        corners: &[u32],
        location: Location,
    ) -> Result<(), MeshError> {
        let [first, rest @ ..] = corners else { return Err(self.too_few_corners(0, location)) };
        if rest.len() < 2 {
            return Err(self.too_few_corners(corners.len(), location));
        }
        let found = (self.num_triangles() + rest.len() - 1) as u64;
        check_limit("triangles", found, MAX_TRIANGLES)?;
        let max_index = corners.iter().fold(*first, |a, &b| a.max(b));
        if self.max_index.is_none_or(|(index, _)| max_index > index) {
            self.max_index = Some((max_index, location));
        }
        if corners.len() > 3 {
            // Vertices may follow, so a concave face is triangulated at the end.
            self.polygons.push((self.num_triangles() as u32, corners.len() as u32));
        }
        self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        Ok(())
    }

    /// Adds the triangles of a strip, with alternating winding. A strip of fewer than 3 corners has none.
    pub(super) fn add_strip(
        &mut self,
        corners: &[u32],
        location: Location,
    ) -> Result<(), MeshError> {
        for (i, window) in corners.windows(3).enumerate() {
            let [a, b, c] = [window[0], window[1], window[2]];
            self.add_polygon(&if i % 2 == 0 { [a, b, c] } else { [b, a, c] }, location)?;
        }
        Ok(())
    }

    fn too_few_corners(&self, found: usize, location: Location) -> MeshError {
        let expected = "a face with at least 3 corners";
        MeshError::Malformed { format: self.format, location, expected, found: found.to_string() }
    }

    /// Error for a face with the undefined vertex `index`, counted as in the file.
    pub(super) fn bad_index(&self, index: i64, location: Location) -> MeshError {
        let last = self.first_index + self.num_vertices() as i64 - 1;
        let limits = if self.num_vertices() == 0 {
            "there are no vertices".to_owned()
        } else {
            format!("there are vertices {} to {last}", self.first_index)
        };
        MeshError::BadIndex { location, index, limits }
    }

    /// Returns the mesh, after a check of the vertex indices and of the coordinates in use.
    pub(super) fn finish(mut self) -> Result<Mesh, MeshError> {
        match self.max_index {
            None => return Err(MeshError::NoFaces { vertices: self.num_vertices() }),
            Some((index, location)) if index as usize >= self.num_vertices() => {
                return Err(self.bad_index(self.first_index + i64::from(index), location));
            }
            Some(_) => {}
        }
        if self.has_invalid {
            self.replace_invalid_vertices()?;
        }
        self.triangulate_polygons();
        let center = self.distant_center()?;
        // Unused vertices may be anywhere; the repair removes them.
        let limit = DVec3::splat(MAX_CENTERED_COORDINATE);
        let centered = |v: DVec3| (v - center).clamp(-limit, limit).as_vec3();
        let vertices = self.vertices.into_iter().map(centered).collect();
        Ok(Mesh { vertices, triangles: self.triangles })
    }

    /// Replaces the invalid vertices that no face uses by a used one; the repair removes them.
    fn replace_invalid_vertices(&mut self) -> Result<(), MeshError> {
        for &corner in self.triangles.iter().flatten() {
            let position = self.vertices[corner as usize].to_array();
            if let Some(&found) = position.iter().find(|x| is_invalid(**x)) {
                let stored = self.invalid.iter().find(|(index, _)| *index == corner);
                let location =
                    stored.map_or(Location::Entry("vertex", corner as usize), |(_, at)| *at);
                return Err(MeshError::NotFinite { location, found, limit: MAX_COORDINATE });
            }
        }
        let used = self.triangles.first().map_or(DVec3::ZERO, |t| self.vertices[t[0] as usize]);
        let is_bad = |v: &&mut DVec3| v.to_array().iter().any(|x| is_invalid(*x));
        self.vertices.iter_mut().filter(is_bad).for_each(|v| *v = used);
        Ok(())
    }

    /// Replaces the fan of each face that is not convex.
    fn triangulate_polygons(&mut self) {
        let mut corners = Vec::new();
        for &(first, num_corners) in &self.polygons {
            let fan = &mut self.triangles[first as usize..][..num_corners as usize - 2];
            corners.clear();
            corners.extend([fan[0][0], fan[0][1]]);
            corners.extend(fan.iter().map(|triangle| triangle[2]));
            let points: Vec<DVec3> = corners.iter().map(|&i| self.vertices[i as usize]).collect();
            for (triangle, new) in fan.iter_mut().zip(triangulate(&points)) {
                *triangle = new.map(|k| corners[k]);
            }
        }
    }

    /// Centre of the used vertices along each axis on which it is far from the origin, else zero.
    fn distant_center(&self) -> Result<DVec3, MeshError> {
        let used = || self.triangles.iter().flatten().map(|&i| self.vertices[i as usize]);
        let (low, high) =
            used().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let longest = (high - low).max_element();
        let center = (low + high) / 2.0;
        let is_far = center.abs().cmpgt(DVec3::splat(MAX_CENTER_DISTANCE * longest));
        let stored = if self.is_single_precision { center.abs().max_element() } else { 0.0 };
        let step = self.max_step.max(stored * f64::from(f32::EPSILON));
        if step > MAX_SINGLE_PRECISION_STEP * longest && longest > 0.0 {
            return Err(MeshError::Imprecise { distance: step / f64::from(f32::EPSILON), step });
        }
        let center = DVec3::select(is_far, center, DVec3::ZERO);
        let limit = MAX_CENTERED_COORDINATE;
        let distance = |v: DVec3| (v - center).abs().max_element();
        let mut corners = self.triangles.iter().flatten();
        match corners.find(|&&corner| distance(self.vertices[corner as usize]) > limit) {
            Some(&corner) => {
                let location = Location::Entry("vertex", corner as usize);
                let found = distance(self.vertices[corner as usize]);
                Err(MeshError::NotFinite { location, found, limit })
            }
            None => Ok(center),
        }
    }
}

fn is_invalid(x: f64) -> bool {
    x.is_nan() || x.abs() > MAX_COORDINATE
}
