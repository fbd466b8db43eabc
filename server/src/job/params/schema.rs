//! How the server's own description has parameters that a derived one could not tell.

use super::{
    DatasetParams, EncoderParams, EvaluationParams, MeshParams, PolicyParams, first_policy, full,
    small,
};
use dataset::config::PRESETS;
use policy::network::POLICIES;
use utoipa::ToSchema;
use utoipa::openapi::Ref;
use utoipa::openapi::schema::{AnyOfBuilder, ObjectBuilder, Schema, SchemaType, Type};

/// Parameters of a job of whichever kind: any of these and not one of them, because a mesh alone fits a dataset, too.
pub(crate) fn any() -> Schema {
    let kinds = [
        MeshParams::name(),
        PolicyParams::name(),
        EncoderParams::name(),
        EvaluationParams::name(),
        DatasetParams::name(),
    ];
    let any = AnyOfBuilder::new().description(Some("What it was told, with everything filled in."));
    kinds.into_iter().fold(any, |any, name| any.item(Ref::from_schema_name(name))).into()
}

/// Presets with their sizes in words.
pub(super) fn presets() -> Schema {
    let words = PRESETS.map(|(name, size)| format!("`{name}`: {size}"));
    let text = format!("Name of its sizes. {}.", words.join("; "));
    one_of(PRESETS.map(|(name, _)| name))
        .default(Some(small().into()))
        .description(Some(text))
        .into()
}

/// The same names, of how long something is trained.
pub(super) fn courses() -> Schema {
    let text = "Name of its sizes, as of a dataset's: where they are not given, steps, batch, rate and checkpoint are its.";
    one_of(PRESETS.map(|(name, _)| name))
        .default(Some(full().into()))
        .description(Some(text))
        .into()
}

/// The policies that are compared.
pub(super) fn policies() -> Schema {
    let text = "Which of the policies that are compared.";
    one_of(POLICIES).default(Some(first_policy().into())).description(Some(text)).into()
}

/// An object has other proportions as `bleach.3`, so that these are not all.
pub(super) fn objects() -> Schema {
    let names = geometry::catalog::CATALOG.iter().map(|entry| entry.name);
    let kind = SchemaType::from_iter([Type::String, Type::Null]);
    let described = ObjectBuilder::new().schema_type(kind).examples(names);
    described.description(Some("Name of a built-in object.")).into()
}

/// A text of which only these are meant.
fn one_of(names: impl IntoIterator<Item = &'static str>) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(names))
}
