//! Result of an import, and its bytes for another module of the page.

use crate::{Mesh, RepairReport, ResolvedUnit, SimplifyReport};
use glamx::Vec3;

/// Repaired and scaled mesh, with the assumptions and repairs of the import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedMesh {
    /// Repaired mesh (m), with the origin and axes of the file: not centred, not rotated, not on the ground.
    /// glTF is converted to z up.
    pub mesh: Mesh,
    /// Unit of the file's coordinates, with the reason.
    pub unit: ResolvedUnit,
    /// Counts of the repairs and of the remaining defects.
    pub repair: RepairReport,
    /// Result of the simplification (m), if the file had more than [`crate::SIMPLIFY_ABOVE_TRIANGLES`] triangles.
    pub simplified: Option<SimplifyReport>,
    /// Whether the mesh appears to be y-up, in a format that does not define the up axis. The mesh is not
    /// rotated; see [`crate::StablePose::is_y_up`].
    pub is_y_up: bool,
}

impl ImportedMesh {
    /// The mesh and its report as bytes, for programs of one version that share no memory: in the browser, one
    /// module reads the file and another one simulates the object.
    ///
    /// ```
    /// use mesh::{ImportedMesh, MeshOptions};
    /// let obj = b"v 0 0 0\nv 60 0 0\nv 0 40 0\nv 0 0 120\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    /// let imported = mesh::import(obj, &MeshOptions::default())?;
    /// assert_eq!(ImportedMesh::from_bytes(&imported.to_bytes()), Ok(imported));
    /// # Ok::<(), mesh::MeshError>(())
    /// ```
    pub fn to_bytes(&self) -> Vec<u8> {
        let vertices: Vec<[f32; 3]> = self.mesh.vertices.iter().map(|v| v.to_array()).collect();
        let mesh = (vertices, &self.mesh.triangles);
        let report = (&self.unit, &self.repair, &self.simplified, self.is_y_up);
        // Only sequences of unknown length fail.
        postcard::to_allocvec(&(mesh, report)).unwrap_or_default()
    }

    /// Inverse of [`ImportedMesh::to_bytes`].
    ///
    /// # Errors
    /// The bytes are not an imported mesh of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        type Report = (ResolvedUnit, RepairReport, Option<SimplifyReport>, bool);
        let ((vertices, triangles), (unit, repair, simplified, is_y_up)) =
            postcard::from_bytes::<((Vec<[f32; 3]>, Vec<[u32; 3]>), Report)>(bytes)?;
        let vertices = vertices.into_iter().map(Vec3::from_array).collect();
        Ok(Self { mesh: Mesh { vertices, triangles }, unit, repair, simplified, is_y_up })
    }
}
