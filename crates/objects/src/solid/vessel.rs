//! Vessels: lofts with a cavity that is open at the top, and tubes that are open at both ends.

use super::{Solid, band};
use crate::loft::{Loft, Section};
use geometry::Vec3;
use mesh::Mesh;

/// Body of a cup, a bowl or a ring.
#[derive(Clone, Debug)]
pub struct Vessel {
    /// Outer surface, from bottom to top.
    pub outer: Loft,
    /// Thickness of the wall (m); smaller than every half-width.
    pub wall: f32,
    /// Thickness of the floor (m); `None` for a tube that is open at both ends.
    pub floor: Option<f32>,
}

/// Points around each ring of the mesh.
const MESH_POINTS: usize = 48;
/// Sectors into which the wall is cut for the convex parts.
const NUM_SECTORS: usize = 12;
/// Points around the convex floor.
const FLOOR_POINTS: usize = 24;
/// Sections less than this (m) above the floor are left out of the cavity.
const MIN_SECTION_HEIGHT: f32 = 1e-3;

impl Vessel {
    /// Closed mesh and convex parts of the vessel.
    pub fn solid(&self) -> Solid {
        let cavity = self.cavity();
        Solid { mesh: self.mesh(&cavity), parts: self.parts(&cavity) }
    }

    /// Sections of the outer surface along the cavity, from its bottom to the top.
    fn cavity(&self) -> Vec<Section> {
        let Some(floor) = self.floor else { return self.outer.sections.clone() };
        let above = self.outer.sections.iter().filter(|s| s.height > floor + MIN_SECTION_HEIGHT);
        std::iter::once(self.outer.section_at(floor)).chain(above.copied()).collect()
    }

    /// Section of the inner surface where the outer surface has `outer`.
    fn inner(&self, outer: &Section) -> Section {
        Section { half: outer.half.map(|half| half - self.wall), ..*outer }
    }

    fn mesh(&self, cavity: &[Section]) -> Mesh {
        let n = MESH_POINTS as u32;
        let outer = self.outer.sections.iter();
        let inner = cavity.iter().map(|section| self.inner(section));
        let rings: Vec<Section> = outer.copied().chain(inner.rev()).collect();
        let mut vertices: Vec<Vec3> = rings.iter().flat_map(|s| s.ring(MESH_POINTS)).collect();
        // Up the outer surface, over the rim, down the inner surface.
        let last = n * (rings.len() as u32 - 1);
        let mut triangles: Vec<[u32; 3]> =
            (0..last).step_by(MESH_POINTS).flat_map(|from| band(from, from + n, n)).collect();
        if self.floor.is_none() {
            triangles.extend(band(last, 0, n));
            return Mesh { vertices, triangles };
        }
        let centers = vertices.len() as u32;
        vertices.extend([rings[0], rings[rings.len() - 1]].map(|s| s.center_point()));
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.push([centers, j, i]);
            triangles.push([centers + 1, last + i, last + j]);
        }
        Mesh { vertices, triangles }
    }

    fn parts(&self, cavity: &[Section]) -> Vec<Vec<Vec3>> {
        let mut parts = Vec::new();
        if let Some(floor) = self.floor {
            let below = self.outer.sections.iter().filter(|section| section.height < floor);
            let rings = below.copied().chain([self.outer.section_at(floor)]);
            parts.push(rings.flat_map(|s| s.ring(FLOOR_POINTS).collect::<Vec<_>>()).collect());
        }
        let step = std::f32::consts::TAU / NUM_SECTORS as f32;
        for pair in cavity.windows(2) {
            for sector in 0..NUM_SECTORS {
                let angle = |k: f32| (sector as f32 + k) * step;
                let corners = |section: &Section| {
                    let inner = self.inner(section);
                    let outer = [0.0, 0.5, 1.0].map(|k| section.point(angle(k)));
                    [outer.as_slice(), &[0.0, 1.0].map(|k| inner.point(angle(k)))].concat()
                };
                parts.push(pair.iter().flat_map(corners).collect());
            }
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::tests::{is_closed, mesh_volume, parts_volume};

    fn cylinder(floor: Option<f32>) -> Vessel {
        let rows = "[[0, 0.04, 0.04, 2], [0.1, 0.04, 0.04, 2]]";
        let outer = Loft { sections: serde_json::from_str(rows).unwrap() };
        Vessel { outer, wall: 0.005, floor }
    }

    #[test]
    fn cup_and_tube_have_the_volume_of_their_walls() {
        let tau = std::f64::consts::TAU;
        let wall = 0.5 * tau * (0.04f64.powi(2) - 0.035f64.powi(2));
        let floor = 0.5 * tau * 0.035f64.powi(2) * 0.006;
        for (vessel, wanted) in
            [(cylinder(Some(0.006)), 0.1 * wall + floor), (cylinder(None), 0.1 * wall)]
        {
            let solid = vessel.solid();
            assert!(is_closed(&solid.mesh));
            let ratio = mesh_volume(&solid.mesh) / wanted;
            assert!((ratio - 1.0).abs() < 0.01, "mesh: {ratio}");
            // The flat sides of the parts are inside the round cavity.
            let ratio = parts_volume(&solid.parts) / wanted;
            assert!((0.95..1.3).contains(&ratio), "parts: {ratio}");
        }
    }

    #[test]
    fn parts_leave_the_cavity_empty() {
        let solid = cylinder(Some(0.006)).solid();
        let hulls: Vec<Mesh> =
            solid.parts.iter().map(|part| mesh::convex_hull(part, 256).unwrap()).collect();
        let is_inside = |hull: &Mesh, point: Vec3| {
            hull.triangles.iter().all(|t| {
                let [a, b, c] = t.map(|i| hull.vertices[i as usize]);
                (b - a).cross(c - a).dot(point - a) <= 0.0
            })
        };
        for (point, wanted) in [
            (Vec3::new(0.0, 0.0, 0.05), false),
            (Vec3::new(0.03, 0.01, 0.09), false),
            (Vec3::new(0.0375, 0.0, 0.05), true),
            (Vec3::new(0.01, 0.01, 0.003), true),
        ] {
            assert_eq!(hulls.iter().any(|hull| is_inside(hull, point)), wanted, "{point}");
        }
    }
}
