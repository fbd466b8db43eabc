//! What may be asked of jobs, and its bounds.

use crate::Problem;
use crate::job::{DatasetParams, EncoderParams, EvaluationParams, Kind, MeshParams, PolicyParams};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// What is asked for.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Request {
    pub(super) kind: Kind,
    #[serde(default)]
    pub(super) params: Map<String, Value>,
    #[serde(default)]
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) metadata: Map<String, Value>,
    #[serde(default)]
    pub(super) priority: i64,
}

/// What is asked for, as it is described: the parameters go with the kind.
#[derive(ToSchema)]
#[serde(tag = "kind")]
#[expect(dead_code, reason = "only described")]
pub(super) enum JobTask {
    #[serde(rename = "dataset.generate")]
    Dataset {
        #[serde(default)]
        params: DatasetParams,
    },
    #[serde(rename = "encoder.train")]
    Encoder { params: EncoderParams },
    #[serde(rename = "policy.train")]
    Policy { params: PolicyParams },
    #[serde(rename = "policy.evaluate")]
    Evaluation { params: EvaluationParams },
    #[serde(rename = "mesh.prepare")]
    Mesh { params: MeshParams },
}

/// A request for a job, as it is described.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct JobRequest {
    #[serde(flatten)]
    task: JobTask,
    /// A name for people.
    #[schema(max_length = 200)]
    name: Option<String>,
    /// At most 16 texts.
    #[schema(value_type = Option<std::collections::HashMap<String, String>>)]
    metadata: Option<Map<String, Value>>,
    /// Higher ones begin first.
    priority: Option<i64>,
}

/// What can be asked of a job.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[expect(dead_code, reason = "only described")]
pub(super) enum Verb {
    Cancel,
    Pause,
    Resume,
    Retry,
    Clone,
}

/// What can be changed of a job.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct JobPatch {
    /// Null takes it away.
    #[serde(default, deserialize_with = "said")]
    #[schema(value_type = Option<String>)]
    pub(super) name: Option<Option<String>>,
    /// All of it anew; null takes it away.
    #[serde(default, deserialize_with = "said")]
    #[schema(value_type = Option<std::collections::HashMap<String, String>>)]
    pub(super) metadata: Option<Option<Map<String, Value>>>,
    #[serde(default)]
    pub(super) priority: Option<i64>,
}

/// What is there, even if it is null: that is another wish than to leave it out (RFC 7396).
fn said<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// Bounds of what may be said of a job.
const MOST_NAME: usize = 200;
pub(super) const MOST_METADATA: usize = 16;
const MOST_KEY: usize = 64;
const MOST_VALUE: usize = 512;

pub(super) fn checked_name(name: Option<&str>) -> Result<(), Problem> {
    if name.is_some_and(|name| name.len() > MOST_NAME) {
        return Err(Problem::invalid("name", format!("it may have {MOST_NAME} bytes at most")));
    }
    Ok(())
}

pub(super) fn checked_metadata(metadata: &Map<String, Value>) -> Result<(), Problem> {
    let is_good = |(key, value): (&String, &Value)| {
        key.len() <= MOST_KEY && value.as_str().is_some_and(|value| value.len() <= MOST_VALUE)
    };
    if metadata.len() > MOST_METADATA || !metadata.iter().all(is_good) {
        return Err(Problem::invalid(
            "metadata",
            format!(
                "{MOST_METADATA} entries at most: keys of {MOST_KEY} bytes, texts of {MOST_VALUE}"
            ),
        ));
    }
    Ok(())
}

/// The one thing that may be asked for behind the path, true or false.
pub(super) fn flag(query: &BTreeMap<String, String>, name: &str) -> Result<bool, Problem> {
    if let Some(other) = query.keys().find(|key| *key != name) {
        return Err(Problem::invalid(other, "there is no such parameter"));
    }
    match query.get(name).map(String::as_str) {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(_) => Err(Problem::invalid(name, "it is true or false")),
    }
}

/// Reads JSON; says where it is wrong.
pub(super) fn read_json<T: serde::de::DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let value: Value =
        serde_json::from_slice(body).map_err(|error| Problem::malformed(&error.to_string()))?;
    // Serde would read a list of the fields' values, too.
    if !value.is_object() {
        return Err(Problem::malformed("it is a value of another kind"));
    }
    serde_path_to_error::deserialize(value).map_err(|error| {
        let text = error.inner().to_string();
        let path = error.path().to_string();
        let field = text.split('`').nth(1).unwrap_or_default();
        Problem::invalid(if path == "." { field } else { &path }, text.clone())
    })
}
