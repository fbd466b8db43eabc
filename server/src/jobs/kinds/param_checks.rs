//! Parsing and validation of job parameters, and schemas of enumerated names.

use serde_json::Value;
use utoipa::openapi::schema::{ObjectBuilder, Type};

/// Maximum number of threads of a job.
pub(super) const MAX_THREADS: usize = 256;

/// Rejected parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Invalid {
    /// Path of the parameter inside `params`.
    pub(crate) param: String,
    /// The error, and the accepted values.
    pub(crate) detail: String,
}

/// Error of a parameter.
pub(super) fn invalid(param: &str, detail: impl Into<String>) -> Invalid {
    Invalid { param: param.into(), detail: detail.into() }
}

/// Error of an unknown preset.
pub(super) fn unknown_preset() -> Invalid {
    let names = configs::dataset::PRESETS.map(|(name, _)| name).join(", ");
    invalid("preset", format!("must be one of {names}"))
}

/// Deserializes parameters; the error names the field that is unknown, missing or of the wrong type.
pub(super) fn parse<T: serde::de::DeserializeOwned>(given: Value) -> Result<T, Invalid> {
    serde_path_to_error::deserialize(given).map_err(|error| {
        let text = error.inner().to_string();
        // Serde quotes the field in backticks; the path names its parent.
        let field = text.split('`').nth(1).unwrap_or_default();
        let path = error.path().to_string();
        let param = if path == "." { field.to_owned() } else { path };
        Invalid { param, detail: text }
    })
}

/// Returns the value if it is in `min..=max`.
pub(super) fn check_range<T: PartialOrd + Copy + std::fmt::Display>(
    param: &str,
    value: T,
    min: T,
    max: T,
) -> Result<T, Invalid> {
    if (min..=max).contains(&value) {
        return Ok(value);
    }
    Err(invalid(param, format!("must be between {min} and {max}")))
}

/// OpenAPI schema of a string restricted to these values.
pub(super) fn string_enum(values: impl IntoIterator<Item = &'static str>) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(values))
}
