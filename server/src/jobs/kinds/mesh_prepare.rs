//! Job kind `mesh.prepare`: inspects a mesh and decomposes it into convex parts.

use super::command_line::{InputPaths, OUT_DIR, args, path_arg};
use super::param_checks::Invalid;
use super::{Cost, JobKind, mesh_options};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use mesh::{MeshOptions, Unit, UpAxis};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Parameters of mesh inspection and convex decomposition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshParams {
    /// Uploaded mesh.
    pub(crate) mesh_id: String,
    /// Unit of the mesh: `m`, `cm`, `mm` or `in`; by default that of the format, or the one that suits the size.
    #[serde(default)]
    #[schema(schema_with = mesh_options::unit_schema)]
    pub(crate) unit: Option<Unit>,
    /// Length of the longest side of the mesh (m), instead of unit and scale.
    #[serde(default)]
    pub(crate) size_m: Option<f32>,
    /// Factor on the coordinates of the mesh, in addition to its unit.
    #[serde(default)]
    pub(crate) scale: Option<f32>,
    /// Axis of the mesh file that points up: `x`, `y` or `z`.
    #[serde(default)]
    #[schema(schema_with = mesh_options::up_schema)]
    pub(crate) up: Option<UpAxis>,
}

impl MeshParams {
    fn mesh_options(&self) -> MeshOptions {
        MeshOptions { unit: self.unit, size: self.size_m, scale: self.scale, up: self.up }
    }
}

/// Reference run time and disk space.
const COST: Cost = Cost { seconds: 5.0, bytes: 5e6 };

impl JobKind for MeshParams {
    fn resolve(self) -> Result<Self, Invalid> {
        mesh_options::validate(&self.mesh_options(), true)?;
        Ok(self)
    }

    fn has_mesh_size(&self) -> bool {
        self.mesh_options().has_size()
    }

    fn inputs(&self) -> Inputs {
        Inputs { mesh_id: Some(self.mesh_id.clone()), ..Inputs::default() }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        let inspect = args(["mesh", "inspect", &path_arg(inputs.mesh), "--out", OUT_DIR]);
        [inspect, mesh_options::argv(&self.mesh_options())].concat()
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_files().await?;
        Ok(())
    }

    fn cost(&self) -> Cost {
        COST
    }
}
