//! What each kind of job may be told, with its defaults.

mod checks;
pub(super) mod schema;

use super::Kind;
use policy::network::POLICIES;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// The parameters of a job; once resolved, nothing is left open. They are read back by what they must have: those of a
/// dataset, which need nothing, come last.
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

/// Demonstrations and clouds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DatasetParams {
    /// Name of its sizes.
    #[serde(default = "small")]
    #[schema(schema_with = schema::presets)]
    pub(crate) preset: String,
    /// One object instead of the preset's.
    #[serde(flatten)]
    pub(crate) subject: Subject,
    /// Seed of everything.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Threads; 0 takes all.
    #[serde(default)]
    pub(crate) threads: usize,
}

/// Training an autoencoder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EncoderParams {
    /// The dataset whose clouds it learns from.
    pub(crate) dataset_id: String,
    /// How long and how fast.
    #[serde(flatten)]
    pub(crate) course: Course,
}

/// Training a policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolicyParams {
    /// The dataset whose demonstrations it learns from.
    pub(crate) dataset_id: String,
    /// The encoder, or a policy whose encoder is used.
    pub(crate) encoder_id: String,
    /// Which of the policies that are compared.
    #[serde(default = "first_policy")]
    #[schema(schema_with = schema::policies)]
    pub(crate) policy: String,
    /// Steps of a roll-out; 1 is behaviour cloning.
    #[serde(default)]
    pub(crate) horizon: Option<usize>,
    /// How long and how fast.
    #[serde(flatten)]
    pub(crate) course: Course,
}

/// How long and how fast something is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Course {
    /// Name of its sizes, as of a dataset's: where they are not given, steps, batch, rate and checkpoint are its.
    #[serde(default = "full")]
    #[schema(schema_with = schema::courses)]
    pub(crate) preset: String,
    /// Optimiser steps.
    #[serde(default)]
    pub(crate) steps: Option<u64>,
    /// Examples a step.
    #[serde(default)]
    pub(crate) batch: Option<usize>,
    /// Peak learning rate.
    #[serde(default)]
    pub(crate) rate: Option<f64>,
    /// Steps from checkpoint to checkpoint.
    #[serde(default)]
    pub(crate) checkpoint: Option<u64>,
    /// Threads; 0 takes the standard number.
    #[serde(default)]
    pub(crate) threads: usize,
    /// Seed of weights and batches.
    #[serde(default)]
    pub(crate) seed: u64,
}

/// Attempts by the protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EvaluationParams {
    /// The policy, or `planner`.
    pub(crate) model_id: String,
    /// The object.
    #[serde(flatten)]
    pub(crate) subject: Subject,
    /// Attempts.
    #[serde(default = "hundred")]
    pub(crate) attempts: u64,
    /// Seed of the first one.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Whether the controls are evaluated, too.
    #[serde(default)]
    pub(crate) controls: bool,
}

/// What a mesh is, and its convex parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshParams {
    /// A mesh that was uploaded.
    pub(crate) mesh_id: String,
}

/// A built-in object, or a mesh that was uploaded, with its mass.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Subject {
    /// Name of a built-in object.
    #[serde(default)]
    #[schema(schema_with = schema::objects)]
    pub(crate) object: Option<String>,
    /// A mesh that was uploaded.
    #[serde(default)]
    pub(crate) mesh_id: Option<String>,
    /// Mass of the mesh (kg).
    #[serde(default)]
    pub(crate) mass_kg: Option<f64>,
    /// Density of the mesh (kg/m³) instead.
    #[serde(default)]
    pub(crate) density_kg_m3: Option<f64>,
}
fn small() -> String {
    "small".into()
}

fn full() -> String {
    "paper".into()
}

fn first_policy() -> String {
    POLICIES[0].into()
}

fn hundred() -> u64 {
    100
}
/// Why parameters are refused.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Invalid {
    /// Which one, as a path in `params`.
    pub(crate) param: String,
    /// What is wrong with it, and what it may be.
    pub(crate) detail: String,
}

impl Params {
    /// Reads and checks the parameters of a kind, with everything filled in that was left open.
    pub(crate) fn resolve(kind: Kind, given: Map<String, Value>) -> Result<Self, Invalid> {
        let given = Value::Object(given);
        Ok(match kind {
            Kind::DatasetGenerate => {
                Self::Dataset(checks::read::<DatasetParams>(given)?.resolved()?)
            }
            Kind::EncoderTrain => Self::Encoder(checks::read::<EncoderParams>(given)?.resolved()?),
            Kind::PolicyTrain => Self::Policy(checks::read::<PolicyParams>(given)?.resolved()?),
            Kind::PolicyEvaluate => {
                Self::Evaluation(checks::read::<EvaluationParams>(given)?.resolved()?)
            }
            Kind::MeshPrepare => Self::Mesh(checks::read(given)?),
        })
    }

    /// Seed of the job.
    pub(crate) fn seed(&self) -> u64 {
        match self {
            Self::Dataset(params) => params.seed,
            Self::Encoder(EncoderParams { course, .. }) => course.seed,
            Self::Policy(PolicyParams { course, .. }) => course.seed,
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
    fn what_is_left_open_is_filled_in() {
        let Ok(Params::Dataset(dataset)) = resolve(Kind::DatasetGenerate, json!({})) else {
            panic!("refused")
        };
        assert_eq!((dataset.preset.as_str(), dataset.seed), ("small", 0));
        let given = json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1", "steps": 10 });
        let Ok(Params::Policy(policy)) = resolve(Kind::PolicyTrain, given) else {
            panic!("refused")
        };
        let course = policy.course;
        assert_eq!((course.steps, course.batch, course.threads), (Some(10), Some(128), 2));
        assert_eq!((policy.policy.as_str(), policy.horizon), ("ngf-pcd", Some(90)));
        for (preset, _) in PRESETS {
            let given = json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1", "preset": preset });
            for kind in [Kind::EncoderTrain, Kind::PolicyTrain] {
                let mut given = given.clone();
                if kind == Kind::EncoderTrain {
                    given.as_object_mut().unwrap().remove("encoder_id");
                }
                let course = match resolve(kind, given) {
                    Ok(Params::Encoder(EncoderParams { course, .. })) => course,
                    Ok(Params::Policy(PolicyParams { course, .. })) => course,
                    other => panic!("{preset}: {other:?}"),
                };
                assert!(course.steps.unwrap() < 1000 || preset != "smoke", "{course:?}");
            }
        }
    }

    #[test]
    fn what_is_written_down_is_read_back() {
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
    fn what_is_refused_is_named() {
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
            (Kind::EncoderTrain, json!({ "dataset_id": "x", "rate": 2.0 }), "rate"),
            (Kind::EncoderTrain, json!({ "dataset_id": "x", "rates": 2.0 }), "rates"),
            (Kind::PolicyEvaluate, json!({ "model_id": "x" }), "object"),
            (
                Kind::PolicyEvaluate,
                json!({ "model_id": "x", "object": "bleach", "attempts": 0 }),
                "attempts",
            ),
        ];
        for (kind, given, param) in cases {
            let refusal = resolve(kind, given.clone()).expect_err("taken");
            assert_eq!(refusal.param, param, "{given}: {}", refusal.detail);
        }
    }
}
