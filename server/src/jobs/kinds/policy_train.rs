//! Job kind `policy.train`: trains a policy on the demonstrations of a dataset, with a trained encoder.

use super::command_line::{InputPaths, OUT_DIR, args, option_args, path_arg};
use super::param_checks::{Invalid, check_range, invalid, string_enum, unknown_preset};
use super::training_params::{MODEL_BYTES, TrainingParams};
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use configs::DaggerConfig;
use policy::PolicyConfig;
use policy::networks::POLICY_NAMES;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::schema::Schema;

/// Parameters of policy training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolicyParams {
    /// Dataset that provides the demonstrations.
    pub(crate) dataset_id: String,
    /// Encoder, or a policy whose encoder is reused.
    pub(crate) encoder_id: String,
    /// Policy architecture.
    #[serde(default = "default_policy")]
    #[schema(schema_with = policies)]
    pub(crate) policy: String,
    /// Rollout length (steps); 1 = behaviour cloning.
    #[serde(default)]
    pub(crate) horizon: Option<usize>,
    /// Duration, batch size and learning rate.
    #[serde(flatten)]
    pub(crate) training: TrainingParams,
}

fn default_policy() -> String {
    POLICY_NAMES[0].into()
}

/// Policy architectures.
fn policies() -> Schema {
    let text = "Policy architecture.";
    string_enum(POLICY_NAMES).default(Some(default_policy().into())).description(Some(text)).into()
}

/// Reference run times per training example (s). 160,000 steps at batch size 128, including validation
/// attempts: 23 (NGF), 50 (large MLP) and 4 (MLP) minutes.
mod seconds {
    pub(super) const NGF_EXAMPLE: f64 = 0.00007;
    pub(super) const LARGE_MLP_EXAMPLE: f64 = 0.00015;
    pub(super) const MLP_EXAMPLE: f64 = 0.000014;
}

/// Reference disk space (bytes) of one stored checkpoint; every checkpoint is kept.
mod bytes {
    pub(super) const CHECKPOINT: f64 = 12.6e6;
    pub(super) const SMALL_CHECKPOINT: f64 = 1.7e6;
}

impl JobKind for PolicyParams {
    fn resolve(self) -> Result<Self, Invalid> {
        let Some(policy) = PolicyConfig::by_name(&self.policy) else {
            return Err(invalid("policy", format!("must be one of {}", POLICY_NAMES.join(", "))));
        };
        let default =
            DaggerConfig::preset(&self.training.preset, policy).ok_or_else(unknown_preset)?;
        let horizon = check_range("horizon", self.horizon.unwrap_or(default.horizon), 1, 1000)?;
        let DaggerConfig { steps, batch, learning_rate, checkpoint_every, threads, .. } = default;
        let training =
            self.training.resolve(steps, batch, learning_rate, checkpoint_every, threads)?;
        Ok(Self { training, horizon: Some(horizon), ..self })
    }

    fn resolve_aliases(&mut self, resolve: impl Fn(&str) -> String) {
        self.encoder_id = resolve(&self.encoder_id);
    }

    fn seed(&self) -> u64 {
        self.training.seed
    }

    fn inputs(&self) -> Inputs {
        Inputs {
            dataset_id: Some(self.dataset_id.clone()),
            encoder_id: Some(self.encoder_id.clone()),
            ..Inputs::default()
        }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        let (dataset, encoder) = (path_arg(inputs.dataset), path_arg(inputs.model));
        [
            args(["train", "policy", "--dataset", &dataset, "--out", OUT_DIR]),
            args(["--encoder", &encoder, "--policy", &self.policy]),
            option_args("horizon", self.horizon),
            self.training.argv(),
        ]
        .concat()
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_model("policy").await
    }

    fn cost(&self) -> Cost {
        let (seconds_per_example, bytes_per_checkpoint) = match self.policy.as_str() {
            "mlp-large-pcd" => (seconds::LARGE_MLP_EXAMPLE, bytes::CHECKPOINT),
            small if small.starts_with("mlp") => (seconds::MLP_EXAMPLE, bytes::SMALL_CHECKPOINT),
            _ => (seconds::NGF_EXAMPLE, bytes::CHECKPOINT),
        };
        let training = &self.training;
        let checkpoint_every = training.checkpoint_every.unwrap_or(u64::MAX).max(1);
        let checkpoints = training.steps.unwrap_or_default() / checkpoint_every;
        Cost {
            seconds: seconds_per_example * training.num_examples(),
            bytes: MODEL_BYTES + bytes_per_checkpoint * checkpoints as f64,
        }
    }

    fn is_comparable(&self, other: &Self) -> bool {
        self.policy == other.policy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::kinds::encoder_train::EncoderParams;
    use crate::jobs::kinds::param_checks::parse;
    use configs::dataset::PRESETS;
    use serde_json::{Value, json};

    fn resolve(given: Value) -> PolicyParams {
        parse::<PolicyParams>(given).unwrap().resolve().unwrap()
    }

    #[test]
    fn unspecified_params_get_defaults() {
        let ids = json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1", "steps": 10 });
        let policy = resolve(ids);
        let training = policy.training;
        assert_eq!((training.steps, training.batch, training.threads), (Some(10), Some(128), 2));
        assert_eq!((policy.policy.as_str(), policy.horizon), ("ngf-pcd", Some(90)));
    }

    #[test]
    fn every_dataset_preset_is_a_training_preset() {
        for (preset, _) in PRESETS {
            let given = json!({ "dataset_id": "ds_1", "preset": preset });
            let encoder = parse::<EncoderParams>(given).unwrap().resolve().unwrap();
            let given = json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1", "preset": preset });
            for training in [encoder.training, resolve(given).training] {
                assert!(training.steps.unwrap() < 1000 || preset != "smoke", "{training:?}");
            }
        }
    }

    #[test]
    fn estimate_grows_with_the_network_size() {
        let of = |policy: &str| {
            let given = json!({
                "dataset_id": "dst_1", "encoder_id": "mdl_1", "steps": 160_000, "policy": policy
            });
            resolve(given).cost().seconds / 60.0
        };
        // Measured: 4, 23 and 50 minutes.
        for (policy, minutes) in [("mlp-pos", 4.0), ("ngf-pcd", 23.0), ("mlp-large-pcd", 50.0)] {
            assert!((0.7..1.5).contains(&(of(policy) / minutes)), "{policy}: {}", of(policy));
        }
    }

    #[test]
    fn disk_estimate_includes_every_checkpoint() {
        let of = |checkpoint_every: u64| {
            let given = json!({
                "dataset_id": "dst_1", "encoder_id": "mdl_1", "steps": 160_000,
                "checkpoint_every": checkpoint_every,
            });
            resolve(given).cost().bytes
        };
        assert!((of(80_000) - of(160_000) - bytes::CHECKPOINT).abs() < 1.0);
        assert!(of(100) > 20e9, "{}", of(100));
    }
}
