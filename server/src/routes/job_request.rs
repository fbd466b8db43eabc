//! Request bodies and query parameters of job endpoints, and their limits.

use super::unique_json::UniqueJson;
use crate::Problem;
use crate::extract::Parameters;
use crate::jobs::kinds::Kind;
use serde::Deserialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// Body of a creation request.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CreateJobRequest {
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

/// Action on a job.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) enum JobAction {
    Cancel,
    Pause,
    Resume,
    Retry,
    Clone,
}

/// Changes of a job (JSON merge patch).
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct JobPatch {
    /// Display name; null removes it.
    #[serde(default, deserialize_with = "double_option")]
    #[schema(value_type = Option<String>)]
    pub(super) name: Option<Option<String>>,
    /// Replaces all metadata; null removes them.
    #[serde(default, deserialize_with = "double_option")]
    #[schema(value_type = Option<std::collections::HashMap<String, String>>)]
    pub(super) metadata: Option<Option<Map<String, Value>>>,
    #[serde(default)]
    pub(super) priority: Option<i64>,
}

/// Deserializes a present member to `Some`, also if it is null: null and absence differ in a merge patch (RFC
/// 7396).
fn double_option<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// Maximum length of a job name (bytes).
const MAX_NAME: usize = 200;
/// Maximum number of metadata entries.
pub(super) const MAX_METADATA: usize = 16;
/// Maximum length of a metadata key (bytes).
const MAX_KEY: usize = 64;
/// Maximum length of a metadata value (bytes).
const MAX_VALUE: usize = 512;

/// Rejects a name that is too long.
pub(super) fn check_name(name: Option<&str>) -> Result<(), Problem> {
    if name.is_some_and(|name| name.len() > MAX_NAME) {
        return Err(Problem::invalid_parameter(
            "name",
            format!("must have up to {MAX_NAME} bytes"),
        ));
    }
    Ok(())
}

/// Rejects metadata with too many or too long entries, or with values that are not texts.
pub(super) fn check_metadata(metadata: &Map<String, Value>) -> Result<(), Problem> {
    let is_valid = |(key, value): (&String, &Value)| {
        key.len() <= MAX_KEY && value.as_str().is_some_and(|value| value.len() <= MAX_VALUE)
    };
    if metadata.len() > MAX_METADATA || !metadata.iter().all(is_valid) {
        return Err(Problem::invalid_parameter(
            "metadata",
            format!(
                "must have up to {MAX_METADATA} entries: keys of up to {MAX_KEY} bytes, \
                 texts of up to {MAX_VALUE} bytes"
            ),
        ));
    }
    Ok(())
}

/// Parses the only supported query parameter, a boolean; false by default.
pub(super) fn query_bool(parameters: Parameters, name: &str) -> Result<bool, Problem> {
    match parameters.only(&[name])?.get(name).map(String::as_str) {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(_) => Err(Problem::invalid_parameter(name, "must be true or false")),
    }
}

/// Parses a JSON object; errors name the invalid member.
pub(super) fn parse_json<T: serde::de::DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let UniqueJson(value) = serde_json::from_slice(body).map_err(|error| {
        let text = error.to_string();
        match text.split('`').nth(1) {
            // Well-formed, but ambiguous.
            Some(name) if error.is_data() => Problem::invalid_parameter(name, text.clone()),
            _ => Problem::malformed_json(&text),
        }
    })?;
    // Serde would also accept an array of the field values.
    if !value.is_object() {
        return Err(Problem::malformed_json("it is another JSON type"));
    }
    serde_path_to_error::deserialize(value).map_err(|error| {
        let text = error.inner().to_string();
        let path = error.path().to_string();
        let field = text.split('`').nth(1).unwrap_or_default();
        Problem::invalid_parameter(if path == "." { field } else { &path }, text.clone())
    })
}
