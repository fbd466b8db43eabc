//! Parameters of each job kind, with their defaults.

pub(super) mod schema;
mod validate;

use super::Kind;
use policy::network::POLICY_NAMES;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// Parameters of a job; all defaults are filled in by [`Params::resolve`]. The variants are untagged:
/// deserialization identifies them by their required fields, so `Dataset`, which has none, is last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Params {
    /// See [`MeshParams`].
    Mesh(MeshParams),
    /// See [`PolicyParams`].
    Policy(PolicyParams),
    /// See [`EncoderParams`].
    Encoder(EncoderParams),
    /// See [`EvaluationParams`].
    Evaluation(EvaluationParams),
    /// See [`DatasetParams`].
    Dataset(DatasetParams),
}

/// Parameters of dataset generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DatasetParams {
    /// Preset that sets the size of the dataset.
    #[serde(default = "default_dataset_preset")]
    #[schema(schema_with = schema::dataset_presets)]
    pub(crate) preset: String,
    /// A single object instead of the objects of the preset.
    #[serde(flatten)]
    pub(crate) object_params: ObjectParams,
    /// Random seed.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Threads; 0 = all cores.
    #[serde(default)]
    pub(crate) threads: usize,
}

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
    #[schema(schema_with = schema::policies)]
    pub(crate) policy: String,
    /// Rollout length (steps); 1 = behaviour cloning.
    #[serde(default)]
    pub(crate) horizon: Option<usize>,
    /// Duration, batch size and learning rate.
    #[serde(flatten)]
    pub(crate) training: TrainingParams,
}

/// Parameters common to all training jobs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct TrainingParams {
    /// Preset that supplies steps, batch size, learning rate and checkpoint interval where they are not
    /// given.
    #[serde(default = "default_training_preset")]
    #[schema(schema_with = schema::training_presets)]
    pub(crate) preset: String,
    /// Number of optimiser steps.
    #[serde(default)]
    pub(crate) steps: Option<u64>,
    /// Batch size.
    #[serde(default)]
    pub(crate) batch: Option<usize>,
    /// Peak learning rate.
    #[serde(default)]
    pub(crate) learning_rate: Option<f64>,
    /// Checkpoint interval (steps).
    #[serde(default)]
    pub(crate) checkpoint_every: Option<u64>,
    /// Threads; 0 = the default number.
    #[serde(default)]
    pub(crate) threads: usize,
    /// Random seed of initial weights and batches.
    #[serde(default)]
    pub(crate) seed: u64,
}

/// Parameters of an evaluation: grasp attempts by the protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EvaluationParams {
    /// Model id, or `planner`.
    pub(crate) model_id: String,
    /// Object to grasp.
    #[serde(flatten)]
    pub(crate) object_params: ObjectParams,
    /// Number of attempts.
    #[serde(default = "default_attempts")]
    pub(crate) attempts: u64,
    /// Random seed of the first attempt; later attempts count up from it.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Also evaluate the control conditions.
    #[serde(default)]
    pub(crate) controls: bool,
}

/// Parameters of mesh inspection and convex decomposition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshParams {
    /// Uploaded mesh.
    pub(crate) mesh_id: String,
}

/// Object of a job: a built-in object, or an uploaded mesh with its mass or density.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct ObjectParams {
    /// Built-in object.
    #[serde(default)]
    #[schema(schema_with = schema::objects)]
    pub(crate) object: Option<String>,
    /// Uploaded mesh.
    #[serde(default)]
    pub(crate) mesh_id: Option<String>,
    /// Mass of the mesh (kg).
    #[serde(default)]
    pub(crate) mass_kg: Option<f64>,
    /// Density of the mesh (kg/m³), as an alternative to its mass.
    #[serde(default)]
    pub(crate) density_kg_m3: Option<f64>,
}

fn default_dataset_preset() -> String {
    "small".into()
}

fn default_training_preset() -> String {
    "paper".into()
}

fn default_policy() -> String {
    POLICY_NAMES[0].into()
}

fn default_attempts() -> u64 {
    100
}

/// Rejected parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Invalid {
    /// Path of the parameter inside `params`.
    pub(crate) param: String,
    /// The error, and the accepted values.
    pub(crate) detail: String,
}

impl Params {
    /// Parses and validates the parameters of a job kind, and fills in defaults.
    pub(crate) fn resolve(kind: Kind, given: Map<String, Value>) -> Result<Self, Invalid> {
        let given = Value::Object(given);
        Ok(match kind {
            Kind::DatasetGenerate => {
                Self::Dataset(validate::parse::<DatasetParams>(given)?.resolve()?)
            }
            Kind::EncoderTrain => {
                Self::Encoder(validate::parse::<EncoderParams>(given)?.resolve()?)
            }
            Kind::PolicyTrain => Self::Policy(validate::parse::<PolicyParams>(given)?.resolve()?),
            Kind::PolicyEvaluate => {
                Self::Evaluation(validate::parse::<EvaluationParams>(given)?.resolve()?)
            }
            Kind::MeshPrepare => Self::Mesh(validate::parse(given)?),
        })
    }

    /// Random seed of the job; 0 for kinds without one.
    pub(crate) fn seed(&self) -> u64 {
        match self {
            Self::Dataset(params) => params.seed,
            Self::Encoder(EncoderParams { training, .. }) => training.seed,
            Self::Policy(PolicyParams { training, .. }) => training.seed,
            Self::Evaluation(params) => params.seed,
            Self::Mesh(_) => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dataset::config::PRESETS;
    use serde_json::json;

    fn resolve(kind: Kind, given: Value) -> Result<Params, Invalid> {
        Params::resolve(kind, given.as_object().unwrap().clone())
    }

    #[test]
    fn unspecified_params_get_defaults() {
        let Ok(Params::Dataset(dataset)) = resolve(Kind::DatasetGenerate, json!({})) else {
            panic!("rejected")
        };
        assert_eq!((dataset.preset.as_str(), dataset.seed), ("small", 0));
        let given = json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1", "steps": 10 });
        let Ok(Params::Policy(policy)) = resolve(Kind::PolicyTrain, given) else {
            panic!("rejected")
        };
        let training = policy.training;
        assert_eq!((training.steps, training.batch, training.threads), (Some(10), Some(128), 2));
        assert_eq!((policy.policy.as_str(), policy.horizon), ("ngf-pcd", Some(90)));
        for (preset, _) in PRESETS {
            let given = json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1", "preset": preset });
            for kind in [Kind::EncoderTrain, Kind::PolicyTrain] {
                let mut given = given.clone();
                if kind == Kind::EncoderTrain {
                    given.as_object_mut().unwrap().remove("encoder_id");
                }
                let training = match resolve(kind, given) {
                    Ok(Params::Encoder(EncoderParams { training, .. })) => training,
                    Ok(Params::Policy(PolicyParams { training, .. })) => training,
                    other => panic!("{preset}: {other:?}"),
                };
                assert!(training.steps.unwrap() < 1000 || preset != "smoke", "{training:?}");
            }
        }
    }

    #[test]
    fn params_round_trip_through_json() {
        let mesh = json!({ "mesh_id": "msh_1", "mass_kg": 0.3 });
        let cases = [
            (Kind::DatasetGenerate, json!({})),
            (Kind::DatasetGenerate, mesh.clone()),
            (Kind::EncoderTrain, json!({ "dataset_id": "ds_1" })),
            (Kind::PolicyTrain, json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1" })),
            (Kind::PolicyEvaluate, json!({ "model_id": "mdl_1", "object": "bleach" })),
            (Kind::MeshPrepare, json!({ "mesh_id": "msh_1" })),
        ];
        for (kind, given) in cases {
            let params = resolve(kind, given).unwrap();
            let text = serde_json::to_string(&params).unwrap();
            assert_eq!(serde_json::from_str::<Params>(&text).unwrap(), params, "{text}");
        }
    }

    #[test]
    fn invalid_params_are_reported_by_name() {
        let cases = [
            (Kind::DatasetGenerate, json!({ "preset": "huge" }), "preset"),
            (Kind::DatasetGenerate, json!({ "presets": "small" }), "presets"),
            (Kind::DatasetGenerate, json!({ "seed": -1 }), "seed"),
            (Kind::DatasetGenerate, json!({ "object": "../etc" }), "object"),
            (Kind::DatasetGenerate, json!({ "mesh_id": "msh_1" }), "mass_kg"),
            (Kind::DatasetGenerate, json!({ "mass_kg": 1.0 }), "mass_kg"),
            (Kind::DatasetGenerate, json!({ "mesh_id": "msh_1", "object": "bleach" }), "mesh_id"),
            (Kind::MeshPrepare, json!({}), "mesh_id"),
            (Kind::EncoderTrain, json!({}), "dataset_id"),
            (Kind::EncoderTrain, json!({ "dataset_id": "x", "steps": 0 }), "steps"),
            (
                Kind::PolicyTrain,
                json!({ "dataset_id": "x", "encoder_id": "y", "preset": "huge" }),
                "preset",
            ),
            (
                Kind::EncoderTrain,
                json!({ "dataset_id": "x", "learning_rate": 2.0 }),
                "learning_rate",
            ),
            (Kind::EncoderTrain, json!({ "dataset_id": "x", "rates": 2.0 }), "rates"),
            (Kind::PolicyEvaluate, json!({ "model_id": "x" }), "object"),
            (
                Kind::PolicyEvaluate,
                json!({ "model_id": "x", "object": "bleach", "attempts": 0 }),
                "attempts",
            ),
        ];
        for (kind, given, param) in cases {
            let invalid = resolve(kind, given.clone()).expect_err("accepted");
            assert_eq!(invalid.param, param, "{given}: {}", invalid.detail);
        }
    }
}
