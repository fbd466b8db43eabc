//! Job kind `mesh.prepare`: inspects a mesh and decomposes it into convex parts.

use super::command_line::{InputPaths, OUT_DIR, args, path_arg};
use super::param_checks::Invalid;
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Parameters of mesh inspection and convex decomposition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshParams {
    /// Uploaded mesh.
    pub(crate) mesh_id: String,
}

/// Reference run time and disk space.
const COST: Cost = Cost { seconds: 5.0, bytes: 5e6 };

impl JobKind for MeshParams {
    fn resolve(self) -> Result<Self, Invalid> {
        Ok(self)
    }

    fn inputs(&self) -> Inputs {
        Inputs { mesh_id: Some(self.mesh_id.clone()), ..Inputs::default() }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        args(["mesh", "inspect", &path_arg(inputs.mesh), "--out", OUT_DIR])
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_files().await?;
        Ok(())
    }

    fn cost(&self) -> Cost {
        COST
    }
}
