//! Lofts: solids through a stack of superellipse sections.
//!
//! In: sections along an axis. Out: a closed mesh and convex parts. Used for objects and robot visuals.

use geometry::Vec3;
use mesh::Mesh;

/// Superellipse |x/a|^n + |y/b|^n = 1 at a height.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(from = "Row", into = "Row")]
pub struct Section {
    /// Position along the loft's axis (m).
    pub height: f32,
    /// Half-widths a, b (m).
    pub half: [f32; 2],
    /// Exponent n: 1 is a rhombus, 2 an ellipse, above 6 nearly a rectangle.
    pub exponent: f32,
    /// Offset of the centre from the axis (m).
    pub center: [f32; 2],
}

/// Section in a file: height, a, b, n, and optionally the centre x, y.
#[derive(serde::Deserialize, serde::Serialize)]
#[serde(untagged)]
enum Row {
    Centered([f32; 4]),
    Offset([f32; 6]),
}

/// Stack of sections with increasing heights, closed by flat caps at both ends.
#[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(transparent)]
pub struct Loft {
    /// Sections in order of height, at least 2.
    pub sections: Vec<Section>,
}

/// Points around each section of the mesh.
const MESH_POINTS: usize = 48;
/// Points around each section of a convex part.
const HULL_POINTS: usize = 16;

/// Max distance (m) of a section inside the line between its neighbours that still counts as convex.
const CONVEXITY_TOLERANCE: f32 = 0.0015;

impl Loft {
    /// Checks the preconditions of the meshing: 2 or more sections, positive sizes, increasing heights.
    ///
    /// The error message names the invalid section.
    pub fn check(&self) -> Result<(), String> {
        if self.sections.len() < 2 {
            return Err(format!("a loft needs at least 2 sections, found {}", self.sections.len()));
        }
        for (i, section) in self.sections.iter().enumerate() {
            let sizes = [section.half[0], section.half[1], section.exponent];
            if !sizes.iter().all(|&x| x.is_finite() && x > 0.0) || !section.height.is_finite() {
                return Err(format!(
                    "section {i}: half-widths and exponent must be positive numbers"
                ));
            }
            if i > 0 && section.height <= self.sections[i - 1].height {
                return Err(format!("section {i}: heights must increase"));
            }
        }
        Ok(())
    }

    /// Closed mesh, triangles counter-clockwise seen from outside.
    pub fn mesh(&self) -> Mesh {
        let n = MESH_POINTS as u32;
        let mut vertices: Vec<Vec3> =
            self.sections.iter().flat_map(|section| section.ring(MESH_POINTS)).collect();
        let (first, last) = (self.sections[0], self.sections[self.sections.len() - 1]);
        let (bottom, top) = (vertices.len() as u32, vertices.len() as u32 + 1);
        vertices.extend([first.center_point(), last.center_point()]);

        let mut triangles = Vec::new();
        let last_ring = n * (self.sections.len() as u32 - 1);
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.push([bottom, j, i]);
            for ring in (0..last_ring).step_by(MESH_POINTS) {
                let (a, b) = (ring + i, ring + j);
                triangles.extend([[a, b, b + n], [a, b + n, a + n]]);
            }
            triangles.push([top, last_ring + i, last_ring + j]);
        }
        Mesh { vertices, triangles }
    }

    /// Point sets whose convex hulls together form the solid. The stack is cut where its profile is concave.
    pub fn convex_parts(&self) -> Vec<Vec<Vec3>> {
        let mut parts = Vec::new();
        let mut start = 0;
        while start + 1 < self.sections.len() {
            let mut end = start + 1;
            while end + 1 < self.sections.len() && self.is_convex(start, end + 1) {
                end += 1;
            }
            let rings = self.sections[start..=end].iter();
            parts.push(rings.flat_map(|section| section.ring(HULL_POINTS)).collect());
            start = end;
        }
        parts
    }

    /// Section at a height, interpolated between its neighbours; the first or last one beyond the ends.
    pub(crate) fn section_at(&self, height: f32) -> Section {
        let above = self.sections.partition_point(|section| section.height < height);
        if above == 0 || above == self.sections.len() {
            return self.sections[above.min(self.sections.len() - 1)];
        }
        let (low, high) = (self.sections[above - 1], self.sections[above]);
        let t = (height - low.height) / (high.height - low.height);
        let mix = |a: f32, b: f32| a + (b - a) * t;
        Section {
            height,
            half: std::array::from_fn(|i| mix(low.half[i], high.half[i])),
            exponent: mix(low.exponent, high.exponent),
            center: std::array::from_fn(|i| mix(low.center[i], high.center[i])),
        }
    }

    fn is_convex(&self, start: usize, end: usize) -> bool {
        let (low, high) = (self.sections[start], self.sections[end]);
        self.sections[start + 1..end].iter().all(|section| {
            let t = (section.height - low.height) / (high.height - low.height);
            (0..2).all(|axis| {
                [-1.0, 1.0].iter().all(|side| {
                    let extent = |s: &Section| side * s.center[axis] + s.half[axis];
                    extent(section)
                        >= extent(&low) * (1.0 - t) + extent(&high) * t - CONVEXITY_TOLERANCE
                })
            })
        })
    }
}

impl Section {
    /// `count` points on the superellipse, counter-clockwise seen from above.
    pub(crate) fn ring(&self, count: usize) -> impl Iterator<Item = Vec3> + '_ {
        // Half a step from the axes, so that boxes get flat faces.
        let step = std::f32::consts::TAU / count as f32;
        (0..count).map(move |i| self.point((i as f32 + 0.5) * step))
    }

    /// Point on the superellipse for a parameter of 0 to 2 π; for an ellipse its eccentric anomaly.
    pub(crate) fn point(&self, angle: f32) -> Vec3 {
        let power = 2.0 / self.exponent;
        let (sin, cos) = libm::sincosf(angle);
        let signed_power = |x: f32| libm::powf(x.abs(), power).copysign(x);
        Vec3::new(
            self.center[0] + self.half[0] * signed_power(cos),
            self.center[1] + self.half[1] * signed_power(sin),
            self.height,
        )
    }

    pub(crate) fn center_point(&self) -> Vec3 {
        Vec3::new(self.center[0], self.center[1], self.height)
    }
}

impl From<Row> for Section {
    fn from(row: Row) -> Self {
        let (row, center) = match row {
            Row::Centered([h, a, b, n]) => ([h, a, b, n], [0.0; 2]),
            Row::Offset([h, a, b, n, x, y]) => ([h, a, b, n], [x, y]),
        };
        let [height, a, b, exponent] = row;
        Self { height, half: [a, b], exponent, center }
    }
}

impl From<Section> for Row {
    fn from(s: Section) -> Self {
        Self::Offset([s.height, s.half[0], s.half[1], s.exponent, s.center[0], s.center[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loft(rows: &[[f32; 4]]) -> Loft {
        Loft { sections: rows.iter().map(|&row| Row::Centered(row).into()).collect() }
    }

    fn volume(mesh: &Mesh) -> f32 {
        let corner = |i: u32| mesh.vertices[i as usize];
        mesh.triangles
            .iter()
            .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0)
            .sum()
    }

    #[test]
    fn cylinder_has_the_volume_of_its_polygonal_prism() {
        let mesh = loft(&[[0.0, 0.03, 0.03, 2.0], [0.1, 0.03, 0.03, 2.0]]).mesh();
        let n = MESH_POINTS as f32;
        let wanted = 0.5 * n * (std::f32::consts::TAU / n).sin() * 0.03 * 0.03 * 0.1;
        assert!((volume(&mesh) / wanted - 1.0).abs() < 1e-4, "{} against {wanted}", volume(&mesh));
    }

    #[test]
    fn mesh_edges_join_two_triangles_in_opposite_directions() {
        let mesh =
            loft(&[[0.0, 0.03, 0.02, 4.0], [0.05, 0.04, 0.02, 3.0], [0.1, 0.01, 0.01, 2.0]]).mesh();
        let mut edges = std::collections::BTreeMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(edges.iter().all(|(&(a, b), &count)| count == 1 && edges.contains_key(&(b, a))));
    }

    #[test]
    fn bottle_is_cut_at_its_shoulder_and_box_stays_whole() {
        let bottle = loft(&[
            [0.0, 0.04, 0.04, 2.0],
            [0.12, 0.04, 0.04, 2.0],
            [0.15, 0.015, 0.015, 2.0],
            [0.2, 0.015, 0.015, 2.0],
        ]);
        assert_eq!(bottle.convex_parts().len(), 2);
        assert_eq!(loft(&[[0.0, 0.02, 0.05, 9.0], [0.2, 0.02, 0.05, 9.0]]).convex_parts().len(), 1);
    }

    #[test]
    fn loft_error_names_the_invalid_section() {
        assert!(loft(&[[0.0, 0.1, 0.1, 2.0]]).check().unwrap_err().contains("2 sections"));
        let flat = loft(&[[0.0, 0.1, 0.1, 2.0], [0.0, 0.1, 0.1, 2.0]]);
        assert!(flat.check().unwrap_err().contains("section 1"));
        let thin = loft(&[[0.0, 0.0, 0.1, 2.0], [0.1, 0.1, 0.1, 2.0]]);
        assert!(thin.check().unwrap_err().contains("section 0"));
    }
}
