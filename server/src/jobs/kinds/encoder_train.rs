//! Job kind `encoder.train`: trains the autoencoder on the point clouds of a dataset.

use super::command_line::{InputPaths, OUT_DIR, args, path_arg};
use super::param_checks::{Invalid, unknown_preset};
use super::training_params::{MODEL_BYTES, TrainingParams};
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use configs::AutoencoderConfig;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Parameters of autoencoder training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EncoderParams {
    /// Dataset that provides the point clouds.
    pub(crate) dataset_id: String,
    /// Duration, batch size and learning rate.
    #[serde(flatten)]
    pub(crate) training: TrainingParams,
}

/// Reference run time per training example (s).
const SECONDS_PER_EXAMPLE: f64 = 0.0005;

impl JobKind for EncoderParams {
    fn resolve(self) -> Result<Self, Invalid> {
        let default =
            AutoencoderConfig::preset(&self.training.preset).ok_or_else(unknown_preset)?;
        let AutoencoderConfig { steps, batch, learning_rate, checkpoint_every, threads, .. } =
            default;
        let training =
            self.training.resolve(steps, batch, learning_rate, checkpoint_every, threads)?;
        Ok(Self { training, ..self })
    }

    fn seed(&self) -> u64 {
        self.training.seed
    }

    fn inputs(&self) -> Inputs {
        Inputs { dataset_id: Some(self.dataset_id.clone()), ..Inputs::default() }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        let dataset = path_arg(inputs.dataset);
        [args(["train", "encoder", "--dataset", &dataset, "--out", OUT_DIR]), self.training.argv()]
            .concat()
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_model("encoder").await
    }

    fn cost(&self) -> Cost {
        let seconds = SECONDS_PER_EXAMPLE * self.training.num_examples();
        Cost { seconds, bytes: MODEL_BYTES }
    }
}
