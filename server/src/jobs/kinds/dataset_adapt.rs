//! Job kind `dataset.adapt`: generates a dataset whose demonstrations end near the final configurations of a policy.

use super::command_line::{InputPaths, OUT_DIR, args, option_args, path_arg};
use super::object_params::ObjectParams;
use super::param_checks::{Invalid, MAX_THREADS, check_range};
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Parameters of the adaptation of a dataset to a policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct AdaptationParams {
    /// Dataset whose grasps are adapted.
    pub(crate) dataset_id: String,
    /// Model whose policy ends near the adapted grasps.
    pub(crate) model_id: String,
    /// The object of a dataset of one object.
    #[serde(flatten)]
    pub(crate) object_params: ObjectParams,
    /// Threads; 0 = all cores.
    #[serde(default)]
    pub(crate) threads: usize,
}

/// Reference run time (s) and disk space (bytes) of a dataset of 1000 object poses with 2 demonstrations each. The size
/// of the dataset is not part of the parameters.
const REFERENCE_COST: Cost = Cost { seconds: 360.0, bytes: 0.3e9 };

impl JobKind for AdaptationParams {
    fn resolve(self) -> Result<Self, Invalid> {
        self.object_params.validate(false)?;
        check_range("threads", self.threads, 0, MAX_THREADS)?;
        Ok(self)
    }

    fn resolve_aliases(&mut self, resolve: impl Fn(&str) -> String) {
        self.model_id = resolve(&self.model_id);
    }

    fn has_mesh_size(&self) -> bool {
        self.object_params.has_mesh_size()
    }

    fn inputs(&self) -> Inputs {
        Inputs {
            mesh_id: self.object_params.mesh_id.clone(),
            dataset_id: Some(self.dataset_id.clone()),
            model_id: Some(self.model_id.clone()),
            ..Inputs::default()
        }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        let (dataset, model) = (path_arg(inputs.dataset), path_arg(inputs.model));
        [
            args(["dataset", "adapt", "--dataset", &dataset, "--model", &model]),
            args(["--out", OUT_DIR, "--resume"]),
            option_args("threads", Some(self.threads)),
            self.object_params.argv(inputs.mesh),
        ]
        .concat()
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_dataset().await
    }

    fn cost(&self) -> Cost {
        REFERENCE_COST
    }

    fn is_comparable(&self, other: &Self) -> bool {
        self.dataset_id == other.dataset_id
    }
}
