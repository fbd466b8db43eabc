//! Job kind `grasps.search`: searches for grasps of an object in simulation.

use super::command_line::{InputPaths, OUT_DIR, args, option_args};
use super::object_params::ObjectParams;
use super::param_checks::Invalid;
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Grasp file, in [`OUT_DIR`].
const GRASP_FILE: &str = "grasps.json";

/// Parameters of a grasp search in simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GraspSearchParams {
    /// Object to grasp.
    #[serde(flatten)]
    pub(crate) object_params: ObjectParams,
    /// Number of grasps to search for.
    #[serde(default)]
    pub(crate) effort: Effort,
    /// Random seed of the search.
    #[serde(default)]
    pub(crate) seed: u64,
}

/// Number of grasps to search for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Effort {
    /// A few grasps within seconds, as on the page.
    Quick,
    /// Grasps that cover the workspace.
    #[default]
    Standard,
    /// Many grasps, without regard to coverage.
    Thorough,
}

impl Effort {
    fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Standard => "standard",
            Self::Thorough => "thorough",
        }
    }

    /// Reference run time (s) on two cores.
    fn seconds(self) -> f64 {
        match self {
            Self::Quick => 3.0,
            Self::Standard => 10.0,
            Self::Thorough => 120.0,
        }
    }
}

/// Reference disk space (bytes).
const BYTES: f64 = 40_000.0;

impl JobKind for GraspSearchParams {
    fn resolve(self) -> Result<Self, Invalid> {
        self.object_params.validate(true)?;
        Ok(self)
    }

    fn seed(&self) -> u64 {
        self.seed
    }

    fn has_mesh_size(&self) -> bool {
        self.object_params.has_mesh_size()
    }

    fn inputs(&self) -> Inputs {
        Inputs { mesh_id: self.object_params.mesh_id.clone(), ..Inputs::default() }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        [
            args(["grasps", "--effort", self.effort.name()]),
            self.object_params.argv(inputs.mesh),
            option_args("seed", Some(self.seed)),
            args(["--out", &format!("{OUT_DIR}/{GRASP_FILE}")]),
        ]
        .concat()
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_files().await?;
        Ok(())
    }

    fn cost(&self) -> Cost {
        Cost { seconds: self.effort.seconds(), bytes: BYTES }
    }

    fn is_comparable(&self, other: &Self) -> bool {
        self.effort == other.effort
    }
}
