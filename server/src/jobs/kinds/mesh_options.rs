//! Options of a mesh in a job or an upload: size, up axis and orientation.

use super::command_line::option_args;
use super::param_checks::{Invalid, invalid};
use mesh::{MeshError, MeshOptions, Unit, UpAxis};
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};

/// Parameters that give the size of a mesh.
const SIZE_PARAMS: &str = "size_m, unit or scale";

/// Fails if the options are invalid, or given without a mesh.
pub(super) fn validate(options: &MeshOptions, has_mesh: bool) -> Result<(), Invalid> {
    let given = [
        ("unit", options.unit.is_some()),
        ("size_m", options.size.is_some()),
        ("scale", options.scale.is_some()),
        ("up", options.up.is_some()),
    ];
    if let Some((param, _)) = given.into_iter().find(|(_, is_given)| *is_given && !has_mesh) {
        return Err(invalid(param, "only valid with mesh_id"));
    }
    options.check().map_err(|error| match error {
        MeshError::InvalidOption { option, expected } => {
            let param = if option == "size" { "size_m" } else { option };
            invalid(param, format!("expected {expected}"))
        }
        error => invalid("mesh_id", error.to_string()),
    })
}

/// Options of the worker command.
pub(super) fn argv(options: &MeshOptions) -> Vec<String> {
    [
        option_args("unit", options.unit.map(Unit::symbol)),
        option_args("size", options.size),
        option_args("scale", options.scale),
        option_args("up", options.up.map(UpAxis::name)),
    ]
    .concat()
}

/// Fails unless an orientation is `file` or the index of a stable pose.
pub(super) fn validate_orientation(text: Option<&str>, has_mesh: bool) -> Result<(), Invalid> {
    let is_valid = text.is_none_or(|text| text == "file" || text.parse::<usize>().is_ok());
    match is_valid {
        true if has_mesh || text.is_none() => Ok(()),
        true => Err(invalid("orientation", "only valid with mesh_id")),
        false => Err(invalid("orientation", "must be \"file\" or the index of a stable pose")),
    }
}

/// Hint of an error about a mesh without a size.
pub(crate) fn size_required_hint() -> String {
    format!("give {SIZE_PARAMS}")
}

/// Schema of a unit.
pub(crate) fn unit_schema() -> Schema {
    let text = "Unit of the mesh; by default that of the format, or the one that suits the size.";
    optional_name(&Unit::ALL.map(Unit::symbol), text)
}

/// Schema of an up axis.
pub(crate) fn up_schema() -> Schema {
    optional_name(&UpAxis::ALL.map(UpAxis::name), "Axis of the mesh file that points up.")
}

fn optional_name(names: &[&str], description: &str) -> Schema {
    let string_or_null = SchemaType::from_iter([Type::String, Type::Null]);
    let object = ObjectBuilder::new().schema_type(string_or_null).examples(names.iter().copied());
    object.description(Some(format!("{description} One of: {}.", names.join(", ")))).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_become_options_of_the_worker() {
        let options = MeshOptions {
            unit: Some(Unit::Inch),
            scale: Some(2.5),
            up: Some(UpAxis::Y),
            ..MeshOptions::default()
        };
        assert_eq!(argv(&options), ["--unit", "in", "--scale", "2.5", "--up", "y"]);
        assert_eq!(argv(&MeshOptions::default()), Vec::<String>::new());
    }

    #[test]
    fn orientation_is_that_of_the_file_or_an_index() {
        for (text, has_mesh, is_valid) in [
            (Some("file"), true, true),
            (Some("2"), true, true),
            (None, false, true),
            (Some("2"), false, false),
            (Some("-1"), true, false),
            (Some("head"), true, false),
        ] {
            assert_eq!(validate_orientation(text, has_mesh).is_ok(), is_valid, "{text:?}");
        }
    }

    #[test]
    fn invalid_options_are_named() {
        let none = MeshOptions::default();
        for (options, has_mesh, param) in [
            (MeshOptions { size: Some(0.1), ..none }, false, "size_m"),
            (MeshOptions { up: Some(UpAxis::X), ..none }, false, "up"),
            (MeshOptions { size: Some(-0.1), ..none }, true, "size_m"),
            (MeshOptions { scale: Some(0.0), ..none }, true, "scale"),
            (MeshOptions { size: Some(0.1), unit: Some(Unit::Metre), ..none }, true, "size_m"),
        ] {
            assert_eq!(validate(&options, has_mesh).unwrap_err().param, param);
        }
    }
}
