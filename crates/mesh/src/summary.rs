//! Summary of an imported mesh file.

use crate::{ImportedMesh, MeshError, VolumeSource, solid_properties};
use serde::Serialize;

/// Size, unit, surface quality and volume of a mesh file; serialized as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshSummary {
    /// Extents of the bounding box along x, y and z (m).
    pub extent_m: [f32; 3],
    /// Unit of the coordinates: English name, singular.
    pub unit: &'static str,
    /// Reason for the unit, without a full stop.
    pub unit_reason: String,
    /// Triangles in the file, if the mesh was simplified.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simplified_from: Option<usize>,
    /// Triangles after simplification and repair.
    pub triangles: usize,
    /// Whether every edge joins exactly two triangles of consistent winding.
    pub watertight: bool,
    /// Connected components: sets of triangles joined by edges.
    pub components: usize,
    /// Edges with one triangle: the boundaries of holes.
    pub boundary_edges: usize,
    /// Triangles removed or flipped by the repair.
    pub repaired_triangles: usize,
    /// Components removed as debris: small ones around the object, or far from it.
    pub removed_debris: usize,
    /// Small holes that were closed.
    pub filled_holes: usize,
    /// Volume (m³).
    pub volume_m3: f64,
    /// Solid from which volume and centre of mass are computed.
    pub volume_source: VolumeSource,
    /// Centre of mass at uniform density (m), in the frame of the file, but z up for glTF and a given up axis.
    pub center_of_mass_m: [f32; 3],
    /// Whether the file appears to be y-up, although its format defines no axis.
    pub appears_y_up: bool,
}

impl MeshSummary {
    /// Summarises an imported mesh; fails if the mesh is flat.
    pub fn of(import: &ImportedMesh) -> Result<Self, MeshError> {
        let ImportedMesh { mesh, unit, repair, simplified, is_y_up } = import;
        let properties = solid_properties(mesh, repair.watertight)?;
        let num_removed = repair.degenerate_triangles + repair.duplicate_triangles;
        Ok(Self {
            extent_m: mesh.extent().to_array(),
            unit: unit.unit.name(),
            unit_reason: unit.reason.clone(),
            simplified_from: simplified.map(|simplified| simplified.triangles_before),
            triangles: mesh.triangles.len(),
            watertight: repair.watertight,
            components: repair.components,
            boundary_edges: repair.boundary_edges,
            repaired_triangles: num_removed + repair.flipped_triangles,
            removed_debris: repair.debris,
            filled_holes: repair.filled_holes,
            volume_m3: properties.volume,
            volume_source: properties.source,
            center_of_mass_m: properties.center_of_mass.to_array(),
            appears_y_up: *is_y_up,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeshOptions, import};

    #[test]
    fn summary_of_a_cube_in_millimetres_is_in_metres() {
        let corners = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| 100 * bit));
        let mut text: String = corners.map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        for face in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
            text += &format!("f {face}\n");
        }
        let summary =
            MeshSummary::of(&import(text.as_bytes(), &MeshOptions::default()).unwrap()).unwrap();
        assert_eq!((summary.unit, summary.triangles, summary.watertight), ("millimetre", 12, true));
        assert!((summary.volume_m3 - 1e-3).abs() < 1e-9, "{summary:?}");
        assert_eq!(summary.volume_source, VolumeSource::Surface);
        assert!(summary.center_of_mass_m.iter().all(|x| (x - 0.05).abs() < 1e-6), "{summary:?}");
        assert!(summary.extent_m.iter().all(|side| (side - 0.1).abs() < 1e-6));
    }
}
