//! What a mesh file turned out to be, for whoever gave it.

use super::{Import, MeshError, solid};
use serde::Serialize;

/// What was found out about a mesh file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Sides of the bounding box (m).
    pub extent_m: [f32; 3],
    /// The unit that was taken.
    pub unit: &'static str,
    /// Why.
    pub reason: String,
    /// Triangles in the file, if they were too many to keep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simplified_from: Option<usize>,
    /// Triangles that are left.
    pub triangles: usize,
    /// Whether the surface is closed.
    pub watertight: bool,
    /// Pieces that share no edge.
    pub components: usize,
    /// Edges at holes.
    pub open_edges: usize,
    /// Triangles that were left out or turned round.
    pub mended_triangles: usize,
    /// Volume (m³).
    pub volume_m3: f64,
    /// Whether the volume is that of the convex hull, because the surface bounds none.
    pub weighed_by_hull: bool,
}

impl Report {
    /// What is to be said of a mesh that was read.
    pub fn of(import: &Import) -> Result<Self, MeshError> {
        let Import { mesh, unit, healing, simplified, .. } = import;
        let solid = solid(mesh, healing.watertight)?;
        let left_out = healing.degenerate_triangles + healing.duplicate_triangles;
        Ok(Self {
            extent_m: mesh.extent().to_array(),
            unit: unit.unit.name(),
            reason: unit.reason.clone(),
            simplified_from: simplified.map(|simplified| simplified.from),
            triangles: mesh.triangles.len(),
            watertight: healing.watertight,
            components: healing.components,
            open_edges: healing.open_edges,
            mended_triangles: left_out + healing.flipped_triangles,
            volume_m3: solid.volume,
            weighed_by_hull: solid.from_hull,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::import;

    #[test]
    fn a_cube_in_millimetres_is_told_in_metres() {
        let corners = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| 100 * bit));
        let mut text: String = corners.map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        for face in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
            text += &format!("f {face}\n");
        }
        let report = Report::of(&import(text.as_bytes(), None).unwrap()).unwrap();
        assert_eq!((report.unit, report.triangles, report.watertight), ("millimetre", 12, true));
        assert!((report.volume_m3 - 1e-3).abs() < 1e-9 && !report.weighed_by_hull, "{report:?}");
        assert!(report.extent_m.iter().all(|side| (side - 0.1).abs() < 1e-6));
    }
}
