//! Object of a job: parameters, validation and command line.

use super::command_line::option_args;
use super::mesh_options;
use super::param_checks::{Invalid, check_range, invalid};
use mesh::{MeshOptions, Unit, UpAxis};
use objects::catalog::CATALOG;
use objects::import::{DENSITY_LIMITS, MASS_LIMITS};
use objects::object::Object;
use serde::{Deserialize, Serialize};
use std::path::Path;
use utoipa::ToSchema;
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};

/// Object of a job: a built-in object, or an uploaded mesh with its mass or density.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct ObjectParams {
    /// Built-in object.
    #[serde(default)]
    #[schema(schema_with = built_in_objects)]
    pub(crate) object: Option<String>,
    /// Uploaded mesh.
    #[serde(default)]
    pub(crate) mesh_id: Option<String>,
    /// Mass of the mesh (kg).
    #[serde(default)]
    #[schema(minimum = 0.001, maximum = 100.0)]
    pub(crate) mass_kg: Option<f64>,
    /// Density of the mesh (kg/m³), as an alternative to its mass.
    #[serde(default)]
    #[schema(minimum = 1.0, maximum = 23000.0)]
    pub(crate) density_kg_m3: Option<f64>,
    /// Unit of the mesh: `m`, `cm`, `mm` or `in`; by default that of the format, or the one that suits the size.
    #[serde(default)]
    #[schema(schema_with = mesh_options::unit_schema)]
    pub(crate) unit: Option<Unit>,
    /// Length of the longest side of the mesh (m), instead of unit and scale.
    #[serde(default)]
    pub(crate) size_m: Option<f32>,
    /// Factor on the coordinates of the mesh, in addition to its unit.
    #[serde(default)]
    pub(crate) scale: Option<f32>,
    /// Axis of the mesh file that points up: `x`, `y` or `z`.
    #[serde(default)]
    #[schema(schema_with = mesh_options::up_schema)]
    pub(crate) up: Option<UpAxis>,
    /// Orientation of the mesh: `file`, or the index of a stable pose, 0 for the most stable one.
    #[serde(default)]
    pub(crate) orientation: Option<String>,
}

impl ObjectParams {
    /// Accepts a built-in object, or a mesh with its mass or density; with `required` false, also no object.
    pub(super) fn validate(&self, required: bool) -> Result<(), Invalid> {
        let masses = [
            ("mass_kg", self.mass_kg, MASS_LIMITS),
            ("density_kg_m3", self.density_kg_m3, DENSITY_LIMITS),
        ];
        for (param, value, [min, max]) in masses {
            if let Some(value) = value {
                check_range(param, value, min, max)?;
            }
            if value.is_some() && self.mesh_id.is_none() {
                return Err(invalid(
                    param,
                    "only valid with mesh_id; built-in objects have a mass",
                ));
            }
        }
        mesh_options::validate(&self.mesh_options(), self.mesh_id.is_some())?;
        mesh_options::validate_orientation(self.orientation.as_deref(), self.mesh_id.is_some())?;
        match (&self.object, &self.mesh_id) {
            (Some(_), Some(_)) => {
                Err(invalid("mesh_id", "give either mesh_id or object, not both"))
            }
            (None, None) if required => {
                Err(invalid("object", "give a built-in object, or mesh_id with mass_kg"))
            }
            (None, None) => Ok(()),
            (Some(name), None) if Object::from_catalog(name).is_none() => {
                Err(invalid("object", format!("unknown built-in object \"{name}\"")))
            }
            (Some(_), None) => Ok(()),
            (None, Some(_)) if self.mass_kg.is_some() == self.density_kg_m3.is_some() => {
                Err(invalid("mass_kg", "a mesh requires either mass_kg or density_kg_m3"))
            }
            (None, Some(_)) => Ok(()),
        }
    }

    /// Options that select the object.
    pub(super) fn argv(&self, mesh: Option<&Path>) -> Vec<String> {
        [
            option_args("object", self.object.as_ref()),
            option_args("mesh", mesh.map(Path::display)),
            option_args("mass", self.mass_kg),
            option_args("density", self.density_kg_m3),
            mesh_options::argv(&self.mesh_options()),
            option_args("orientation", self.orientation.as_ref()),
        ]
        .concat()
    }

    /// Whether unit, size or scale of the mesh are given.
    pub(super) fn has_mesh_size(&self) -> bool {
        self.mesh_options().has_size()
    }

    fn mesh_options(&self) -> MeshOptions {
        MeshOptions { unit: self.unit, size: self.size_m, scale: self.scale, up: self.up }
    }
}

/// Names of built-in objects as examples; shape variants such as `bleach.3` are also accepted.
fn built_in_objects() -> Schema {
    let names = CATALOG.iter().map(|entry| entry.name);
    let string_or_null = SchemaType::from_iter([Type::String, Type::Null]);
    let object = ObjectBuilder::new().schema_type(string_or_null).examples(names);
    object.description(Some("Built-in object.")).into()
}
