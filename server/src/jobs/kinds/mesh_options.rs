//! Options of a mesh in a job or an upload: size, up axis and orientation.

use super::command_line::option_args;
use super::param_checks::{Invalid, invalid, string_enum};
use mesh::{MeshError, MeshOptions, Unit, UpAxis};
use objects::import::Orientation;
use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};

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

/// Option of the worker command for an orientation.
pub(super) fn orientation_argv(orientation: Option<Orientation>) -> Vec<String> {
    let text = orientation.map(|orientation| match orientation {
        Orientation::AsInFile => "file".to_owned(),
        Orientation::StablePose(index) => index.to_string(),
    });
    option_args("orientation", text)
}

/// Detail of a missing size.
pub(crate) fn size_required_hint() -> String {
    format!("give {SIZE_PARAMS}")
}

/// Schema of a unit.
pub(crate) fn unit_schema() -> Schema {
    nullable(string_enum(Unit::ALL.map(Unit::symbol)))
}

/// Schema of an up axis.
pub(crate) fn up_schema() -> Schema {
    nullable(string_enum(UpAxis::ALL.map(UpAxis::name)))
}

/// Schema of an orientation: as in the file, or a stable pose by its index.
pub(super) fn orientation_schema() -> Schema {
    let index = ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(0));
    let pose = ObjectBuilder::new().property("stablePose", index).required("stablePose");
    let null = ObjectBuilder::new().schema_type(Type::Null);
    OneOfBuilder::new().item(string_enum(["asInFile"])).item(pose).item(null).into()
}

fn nullable(object: ObjectBuilder) -> Schema {
    let null = ObjectBuilder::new().schema_type(Type::Null);
    OneOfBuilder::new().item(object).item(null).into()
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
        assert_eq!(orientation_argv(Some(Orientation::AsInFile)), ["--orientation", "file"]);
        assert_eq!(orientation_argv(Some(Orientation::StablePose(2))), ["--orientation", "2"]);
        assert_eq!(argv(&MeshOptions::default()), Vec::<String>::new());
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
