//! OpenAPI schemas of job parameters that cannot be derived: enumerated names and their descriptions.

use super::{
    DatasetParams, EncoderParams, EvaluationParams, MeshParams, PolicyParams,
    default_dataset_preset, default_policy, default_training_preset,
};
use dataset::config::PRESETS;
use policy::network::POLICY_NAMES;
use utoipa::ToSchema;
use utoipa::openapi::Ref;
use utoipa::openapi::schema::{AnyOfBuilder, ObjectBuilder, Schema, SchemaType, Type};

/// Parameters of any job kind. `anyOf` instead of `oneOf`, because mesh parameters also match the dataset
/// schema.
pub(crate) fn any_params() -> Schema {
    let kinds = [
        MeshParams::name(),
        PolicyParams::name(),
        EncoderParams::name(),
        EvaluationParams::name(),
        DatasetParams::name(),
    ];
    let any = AnyOfBuilder::new().description(Some("Parameters with defaults filled in."));
    kinds.into_iter().fold(any, |any, name| any.item(Ref::from_schema_name(name))).into()
}

/// Dataset presets, with a description of their sizes.
pub(super) fn dataset_presets() -> Schema {
    let sizes = PRESETS.map(|(name, size)| format!("`{name}`: {size}"));
    let text = format!("Preset that sets the size of the dataset. {}.", sizes.join("; "));
    string_enum(PRESETS.map(|(name, _)| name))
        .default(Some(default_dataset_preset().into()))
        .description(Some(text))
        .into()
}

/// Training presets; the names are those of the dataset presets.
pub(super) fn training_presets() -> Schema {
    let text = "Preset that supplies steps, batch size, learning rate and checkpoint interval where they are \
        not given.";
    string_enum(PRESETS.map(|(name, _)| name))
        .default(Some(default_training_preset().into()))
        .description(Some(text))
        .into()
}

/// Policy architectures.
pub(super) fn policies() -> Schema {
    let text = "Policy architecture.";
    string_enum(POLICY_NAMES).default(Some(default_policy().into())).description(Some(text)).into()
}

/// Names of built-in objects as examples; shape variants such as `bleach.3` are also accepted.
pub(super) fn objects() -> Schema {
    let names = objects::catalog::CATALOG.iter().map(|entry| entry.name);
    let string_or_null = SchemaType::from_iter([Type::String, Type::Null]);
    let object = ObjectBuilder::new().schema_type(string_or_null).examples(names);
    object.description(Some("Built-in object.")).into()
}

/// String restricted to these values.
fn string_enum(values: impl IntoIterator<Item = &'static str>) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(values))
}
