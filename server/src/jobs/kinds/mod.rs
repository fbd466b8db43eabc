//! Job kinds: one file per kind, with its parameters and everything that the server knows about it.
//!
//! A new kind needs a file here that implements [`JobKind`], an entry in the table below, and a command of
//! `ngf-worker`. Requests, the database, the OpenAPI description, the form on the page and the worker commands
//! follow from the table.

mod command_line;
mod cost;
mod dataset_adapt;
mod dataset_generate;
mod encoder_train;
mod grasps_search;
pub(crate) mod mesh_options;
mod mesh_prepare;
mod object_params;
mod param_checks;
mod policy_evaluate;
mod policy_train;
mod table;
mod training_params;

pub(crate) use command_line::{InputPaths, OUT_DIR};
pub(crate) use cost::Cost;
pub(crate) use param_checks::Invalid;

use super::record::Inputs;
use super::scheduler::OutputCollector;
use crate::store::StoreError;
use param_checks::parse;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value};
use utoipa::ToSchema;
use utoipa::openapi::Ref;
use utoipa::openapi::schema::{AnyOfBuilder, Schema};

table::job_kinds! {
    /// Generates demonstrations and point clouds.
    DatasetGenerate = "dataset.generate", "Generate dataset" => #[serde(default)] dataset_generate::DatasetParams;
    /// Generates a dataset whose demonstrations end near the final configurations of a policy.
    DatasetAdapt = "dataset.adapt", "Adapt dataset" => dataset_adapt::AdaptationParams;
    /// Trains the autoencoder on the point clouds of a dataset.
    EncoderTrain = "encoder.train", "Train encoder" => encoder_train::EncoderParams;
    /// Trains a policy on the demonstrations of a dataset, with a trained encoder.
    PolicyTrain = "policy.train", "Train policy" => policy_train::PolicyParams;
    /// Evaluates a policy: grasp attempts by the protocol.
    PolicyEvaluate = "policy.evaluate", "Evaluate policy" => policy_evaluate::EvaluationParams;
    /// Searches for grasps of an object in simulation.
    GraspsSearch = "grasps.search", "Search grasps" => grasps_search::GraspSearchParams;
    /// Inspects a mesh and decomposes it into convex parts.
    MeshPrepare = "mesh.prepare", "Inspect mesh" => mesh_prepare::MeshParams;
}

/// Parameters of a job kind, and its behaviour.
pub(crate) trait JobKind: Sized {
    /// Validates the parameters and fills in defaults.
    fn resolve(self) -> Result<Self, Invalid>;

    /// Replaces aliases of models by their ids. The id is stored, because an alias can change.
    fn resolve_aliases(&mut self, _resolve: impl Fn(&str) -> String) {}

    /// Random seed of the job; 0 for kinds without one.
    fn seed(&self) -> u64 {
        0
    }

    /// Whether unit, size or scale of the mesh are given; true for kinds without a mesh.
    fn has_mesh_size(&self) -> bool {
        true
    }

    /// Ids of the datasets, models and meshes that the job uses.
    fn inputs(&self) -> Inputs;

    /// Arguments of `ngf` for the job. The command writes its files to [`OUT_DIR`].
    fn argv(&self, inputs: &InputPaths) -> Vec<String>;

    /// Stores the files in [`OUT_DIR`] after the worker has succeeded.
    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError>;

    /// Run time and disk space by reference measurements.
    fn cost(&self) -> Cost;

    /// Whether the duration of a job predicts that of another one, scaled by their costs.
    fn is_comparable(&self, _other: &Self) -> bool {
        true
    }
}

impl Kind {
    /// Inverse of [`Kind::name`].
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// Names of all kinds, separated by commas.
    pub(crate) fn names() -> String {
        Self::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn resolve(kind: Kind, given: Value) -> Result<Params, Invalid> {
        Params::resolve(kind, given.as_object().unwrap().clone())
    }

    #[test]
    fn kind_names_match_their_json() {
        for kind in Kind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
            assert_eq!(Kind::from_name(kind.name()), Some(*kind));
        }
        assert_eq!(Kind::from_name("dataset"), None);
    }

    #[test]
    fn params_round_trip_through_json() {
        let mesh = json!({ "mesh_id": "msh_1", "mass_kg": 0.3 });
        let cases = [
            (Kind::DatasetGenerate, json!({})),
            (Kind::DatasetGenerate, mesh.clone()),
            (Kind::DatasetAdapt, json!({ "dataset_id": "ds_1", "model_id": "mdl_1" })),
            (Kind::EncoderTrain, json!({ "dataset_id": "ds_1" })),
            (Kind::PolicyTrain, json!({ "dataset_id": "ds_1", "encoder_id": "mdl_1" })),
            (Kind::PolicyEvaluate, json!({ "model_id": "mdl_1", "object": "bleach" })),
            (Kind::GraspsSearch, json!({ "object": "bleach", "effort": "quick" })),
            (Kind::MeshPrepare, json!({ "mesh_id": "msh_1" })),
        ];
        for (kind, given) in cases {
            let params = resolve(kind, given).unwrap();
            assert_eq!(params.kind(), kind);
            let text = serde_json::to_string(&params).unwrap();
            assert_eq!(serde_json::from_str::<Params>(&text).unwrap(), params, "{text}");
            let stored: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(stored["kind"], kind.name());
            assert_eq!(stored["params"], json!(ParamsView(&params)));
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
            (Kind::DatasetGenerate, json!({ "mesh_id": "m", "mass_kg": 1e-30 }), "mass_kg"),
            (Kind::DatasetGenerate, json!({ "mesh_id": "m", "mass_kg": 1e30 }), "mass_kg"),
            (Kind::DatasetGenerate, json!({ "mesh_id": "m", "mass_kg": 0.0 }), "mass_kg"),
            (
                Kind::DatasetGenerate,
                json!({ "mesh_id": "m", "density_kg_m3": 1e30 }),
                "density_kg_m3",
            ),
            (Kind::DatasetGenerate, json!({ "mesh_id": "msh_1", "object": "bleach" }), "mesh_id"),
            (Kind::MeshPrepare, json!({}), "mesh_id"),
            (Kind::MeshPrepare, json!({ "mesh_id": "msh_1", "size_m": 0.0 }), "size_m"),
            (Kind::PolicyEvaluate, json!({ "model_id": "x", "object": "bleach", "up": "y" }), "up"),
            (Kind::GraspsSearch, json!({ "object": "bleach", "effort": "huge" }), "effort"),
            (Kind::GraspsSearch, json!({}), "object"),
            (Kind::DatasetAdapt, json!({ "dataset_id": "ds_1" }), "model_id"),
            (
                Kind::DatasetAdapt,
                json!({ "dataset_id": "x", "model_id": "y", "threads": 5000 }),
                "threads",
            ),
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
