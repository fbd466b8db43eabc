//! What each kind of job may be told, with its defaults and bounds.

use super::Kind;
use dataset::config::{DatasetConfig, PRESETS};
use imitation::autoencoder::AutoencoderConfig;
use imitation::dagger::DaggerConfig;
use policy::PolicyConfig;
use policy::network::POLICIES;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};

/// The parameters of a job; once resolved, nothing is left open. They are read back by what they must have: those of a
/// dataset, which need nothing, come last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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
    #[schema(schema_with = presets)]
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
    #[schema(schema_with = policies)]
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
    #[schema(schema_with = courses)]
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
    #[schema(schema_with = objects)]
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

/// Presets with their sizes in words.
fn presets() -> Schema {
    let words = PRESETS.map(|(name, size)| format!("`{name}`: {size}"));
    let text = format!("Name of its sizes. {}.", words.join("; "));
    one_of(PRESETS.map(|(name, _)| name))
        .default(Some(small().into()))
        .description(Some(text))
        .into()
}

fn courses() -> Schema {
    let text = "Name of its sizes, as of a dataset's: where they are not given, steps, batch, rate and checkpoint are its.";
    one_of(PRESETS.map(|(name, _)| name))
        .default(Some(full().into()))
        .description(Some(text))
        .into()
}

/// Refuses a preset that there is not.
fn no_preset() -> Invalid {
    let names = PRESETS.map(|(name, _)| name).join(", ");
    invalid("preset", format!("it must be one of {names}"))
}

fn policies() -> Schema {
    let text = "Which of the policies that are compared.";
    one_of(POLICIES).default(Some(first_policy().into())).description(Some(text)).into()
}

/// An object has other proportions as `bleach.3`, so that these are not all.
fn objects() -> Schema {
    let names = geometry::catalog::CATALOG.iter().map(|entry| entry.name);
    let kind = SchemaType::from_iter([Type::String, Type::Null]);
    let described = ObjectBuilder::new().schema_type(kind).examples(names);
    described.description(Some("Name of a built-in object.")).into()
}

/// A text of which only these are meant.
fn one_of(names: impl IntoIterator<Item = &'static str>) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(names))
}

/// Why parameters are refused.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Invalid {
    /// Which one, as a path in `params`.
    pub(crate) param: String,
    /// What is wrong with it, and what it may be.
    pub(crate) detail: String,
}

fn invalid(param: &str, detail: impl Into<String>) -> Invalid {
    Invalid { param: param.into(), detail: detail.into() }
}

/// Optimiser steps, attempts and threads that a job may ask for at most.
const MOST_STEPS: u64 = 10_000_000;
const MOST_ATTEMPTS: u64 = 100_000;
const MOST_THREADS: usize = 256;
const MOST_BATCH: usize = 4096;

impl Params {
    /// Reads and checks the parameters of a kind, with everything filled in that was left open.
    pub(crate) fn resolve(kind: Kind, given: Map<String, Value>) -> Result<Self, Invalid> {
        let given = Value::Object(given);
        Ok(match kind {
            Kind::DatasetGenerate => Self::Dataset(read::<DatasetParams>(given)?.resolved()?),
            Kind::EncoderTrain => Self::Encoder(read::<EncoderParams>(given)?.resolved()?),
            Kind::PolicyTrain => Self::Policy(read::<PolicyParams>(given)?.resolved()?),
            Kind::PolicyEvaluate => Self::Evaluation(read::<EvaluationParams>(given)?.resolved()?),
            Kind::MeshPrepare => Self::Mesh(read(given)?),
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

/// Reads parameters; a field that is unknown, missing or of the wrong type is named.
fn read<T: serde::de::DeserializeOwned>(given: Value) -> Result<T, Invalid> {
    serde_path_to_error::deserialize(given).map_err(|error| {
        let text = error.inner().to_string();
        // Serde names the field in back quotes; the path leads to what has it.
        let field = text.split('`').nth(1).unwrap_or_default();
        let path = error.path().to_string();
        let param = if path == "." { field.to_owned() } else { path };
        Invalid { param, detail: text }
    })
}

fn at_most<T: PartialOrd + Copy + std::fmt::Display>(
    param: &str,
    value: T,
    least: T,
    most: T,
) -> Result<T, Invalid> {
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(invalid(param, format!("it must be from {least} to {most}")))
}

impl Subject {
    /// Refuses what names no object, or more than one, or a mesh without its mass.
    fn checked(&self, must_be: bool) -> Result<(), Invalid> {
        let weights = [("mass_kg", self.mass_kg), ("density_kg_m3", self.density_kg_m3)];
        for (param, weight) in weights {
            if weight.is_some_and(|weight| !(weight.is_finite() && weight > 0.0)) {
                return Err(invalid(param, "it must be a positive number"));
            }
            if weight.is_some() && self.mesh_id.is_none() {
                return Err(invalid(param, "it goes with mesh_id; a built-in object has its own"));
            }
        }
        match (&self.object, &self.mesh_id) {
            (Some(_), Some(_)) => Err(invalid("mesh_id", "give it or object, not both")),
            (None, None) if must_be => {
                Err(invalid("object", "name a built-in object, or give mesh_id with its mass_kg"))
            }
            (None, None) => Ok(()),
            (Some(name), None) if geometry::object::Object::built_in(name).is_none() => {
                Err(invalid("object", format!("there is no built-in object \"{name}\"")))
            }
            (Some(_), None) => Ok(()),
            (None, Some(_)) if self.mass_kg.is_some() == self.density_kg_m3.is_some() => {
                Err(invalid("mass_kg", "a mesh needs mass_kg or density_kg_m3, one of them"))
            }
            (None, Some(_)) => Ok(()),
        }
    }
}

impl DatasetParams {
    fn resolved(self) -> Result<Self, Invalid> {
        if DatasetConfig::preset(&self.preset, self.seed).is_none() {
            return Err(no_preset());
        }
        self.subject.checked(false)?;
        at_most("threads", self.threads, 0, MOST_THREADS)?;
        Ok(self)
    }
}

/// The double that is written as this number is: 0.001 and not 0.0010000000474974513.
fn written(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

impl EncoderParams {
    fn resolved(self) -> Result<Self, Invalid> {
        let preset = self.course.preset.clone();
        let standard = AutoencoderConfig::preset(&preset).ok_or_else(no_preset)?;
        let standard = Course {
            preset,
            steps: Some(standard.steps),
            batch: Some(standard.batch),
            rate: Some(written(standard.rate)),
            checkpoint: Some(standard.span),
            threads: standard.shards,
            seed: 0,
        };
        Ok(Self { course: self.course.resolved(&standard)?, ..self })
    }
}

impl PolicyParams {
    fn resolved(self) -> Result<Self, Invalid> {
        let Some(policy) = PolicyConfig::named(&self.policy) else {
            return Err(invalid("policy", format!("it must be one of {}", POLICIES.join(", "))));
        };
        let preset = self.course.preset.clone();
        let standard = DaggerConfig::preset(&preset, policy).ok_or_else(no_preset)?;
        let horizon = at_most("horizon", self.horizon.unwrap_or(standard.horizon), 1, 1000)?;
        let standard = Course {
            preset,
            steps: Some(standard.steps),
            batch: Some(standard.batch),
            rate: Some(written(standard.rate)),
            checkpoint: Some(standard.span),
            threads: standard.shards,
            seed: 0,
        };
        let course = self.course.resolved(&standard)?;
        Ok(Self { course, horizon: Some(horizon), ..self })
    }
}

impl Course {
    fn resolved(self, standard: &Self) -> Result<Self, Invalid> {
        let steps = self.steps.or(standard.steps).unwrap_or_default();
        let batch = self.batch.or(standard.batch).unwrap_or_default();
        let rate = self.rate.or(standard.rate).unwrap_or_default();
        let checkpoint = self.checkpoint.or(standard.checkpoint).unwrap_or_default();
        let threads = if self.threads == 0 { standard.threads } else { self.threads };
        if !(rate.is_finite() && rate > 0.0 && rate < 1.0) {
            return Err(invalid("rate", "it must be a positive number below 1"));
        }
        Ok(Self {
            preset: self.preset,
            steps: Some(at_most("steps", steps, 1, MOST_STEPS)?),
            batch: Some(at_most("batch", batch, 1, MOST_BATCH)?),
            rate: Some(rate),
            checkpoint: Some(at_most("checkpoint", checkpoint, 1, MOST_STEPS)?),
            threads: at_most("threads", threads, 1, MOST_THREADS)?,
            seed: self.seed,
        })
    }
}

impl EvaluationParams {
    fn resolved(self) -> Result<Self, Invalid> {
        self.subject.checked(true)?;
        at_most("attempts", self.attempts, 1, MOST_ATTEMPTS)?;
        at_most("seed", self.seed, 0, u64::MAX - self.attempts)?;
        Ok(self)
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
