//! Objects to grasp: built in, or from the bytes of a mesh file.

use crate::protocol::{Failure, ObjectLoaded, Report, Shape, Unit};
use crate::statistics::Tally;
use geometry::catalog::{LOOK_ALIKES, of_family};
use geometry::mesh::{self, Healing, Import};
use geometry::object::Object;

/// An object, and what is told about it.
pub(crate) struct Loaded {
    pub(crate) object: Object,
    /// Name of a built-in object; `None` for an upload.
    pub(crate) name: Option<String>,
    /// Name for people.
    pub(crate) label: String,
    report: Report,
}

/// Density (kg/m³) of an upload, which says nothing of its mass: that of a packed box of food.
const DENSITY: f64 = 600.0;
/// Mass (kg) of an upload, at least and at most: what a hand can be asked to lift.
const MASSES: [f64; 2] = [0.02, 1.5];
/// Friction coefficient of an upload, the same as that of the built-in objects.
const FRICTION: f32 = 0.8;
/// Corners of a hull that is drawn; its part may have fewer.
const HULL_POINTS: usize = 256;

/// Names of the built-in objects that the page offers, in their order.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    of_family(LOOK_ALIKES).map(|entry| entry.name)
}

/// "Sugar box" for `sugar_box`.
pub(crate) fn label(name: &str) -> String {
    let spaced = name.replace('_', " ");
    let mut letters = spaced.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A built-in object.
pub(crate) fn built_in(name: &str) -> Result<Loaded, Failure> {
    let object = Object::built_in(name).ok_or_else(|| Failure {
        code: "object_unknown",
        cause: format!("There is no built-in object \"{name}\"."),
        cure: "Choose one from the list.".into(),
    })?;
    let report = report_of(&object, true);
    Ok(Loaded { object, name: Some(name.to_owned()), label: label(name), report })
}

/// An object from a mesh file; its unit is guessed unless given.
pub(crate) fn read(file_name: &str, bytes: &[u8], unit: Option<Unit>) -> Result<Loaded, Failure> {
    let unusable = |error: mesh::MeshError| {
        let message = error.to_string();
        // The message ends with the cure, as a sentence of its own.
        let (cause, cure) = message.rsplit_once(". ").unwrap_or((&message, "Try another file"));
        Failure {
            code: "mesh_unusable",
            cause: format!("{file_name}: {cause}."),
            cure: format!("{cure}."),
        }
    };
    let import = mesh::import(bytes, unit.map(Unit::geometry)).map_err(unusable)?;
    let Import { mesh, unit, healing } = import;
    let solid = mesh::solid(&mesh, healing.watertight).map_err(unusable)?;
    let parts = mesh::convex_parts_or_hull(&mesh);
    let mass = (DENSITY * solid.volume).clamp(MASSES[0], MASSES[1]) as f32;
    let object = Object::new(file_name, mesh, healing.watertight, parts.hulls, mass, FRICTION)
        .map_err(unusable)?;
    let report = Report {
        unit: Some(Unit::of(unit.unit)),
        reason: Some(format!("{}.", unit.reason)),
        notes: notes(&healing, solid.from_hull),
        ..report_of(&object, healing.watertight)
    };
    Ok(Loaded { object, name: None, label: file_name.to_owned(), report })
}

impl Loaded {
    /// What the page is told.
    pub(crate) fn message(&self, tally: Tally) -> ObjectLoaded {
        let hulls = self.object.parts.iter().filter_map(|part| mesh::hull(part, HULL_POINTS));
        ObjectLoaded {
            name: self.name.clone(),
            label: self.label.clone(),
            shape: Shape::of(&self.object.mesh),
            hulls: hulls.map(|hull| Shape::of(&hull)).collect(),
            report: self.report.clone(),
            tally,
        }
    }
}

fn report_of(object: &Object, watertight: bool) -> Report {
    let extent = object.bounds[1] - object.bounds[0];
    Report {
        extent_cm: extent.to_array().map(|side| side * 100.0),
        mass_kg: object.mass,
        triangles: object.mesh.triangles.len(),
        watertight,
        parts: object.parts.len(),
        unit: None,
        reason: None,
        notes: Vec::new(),
    }
}

/// What was repaired or assumed, as far as it changes what one sees or grasps.
fn notes(healing: &Healing, is_weighed_by_hull: bool) -> Vec<String> {
    let mut notes = Vec::new();
    let mut note = |count: usize, what: &str| {
        if count > 0 {
            notes.push(format!("{count} {what}"));
        }
    };
    note(healing.degenerate_triangles, "triangles without area were left out.");
    note(healing.duplicate_triangles, "triangles that lay on others were left out.");
    note(healing.flipped_triangles, "triangles were turned to face outward.");
    note(healing.open_edges, "edges are open: the surface has holes.");
    if is_weighed_by_hull {
        notes.push("Weighed by its convex hull.".into());
    }
    notes.push(format!("Mass assumed from {DENSITY} kg/m³."));
    notes
}

impl Unit {
    fn geometry(self) -> mesh::Unit {
        match self {
            Self::Metre => mesh::Unit::Metre,
            Self::Centimetre => mesh::Unit::Centimetre,
            Self::Millimetre => mesh::Unit::Millimetre,
            Self::Inch => mesh::Unit::Inch,
        }
    }

    fn of(unit: mesh::Unit) -> Self {
        match unit {
            mesh::Unit::Metre => Self::Metre,
            mesh::Unit::Centimetre => Self::Centimetre,
            mesh::Unit::Millimetre => Self::Millimetre,
            mesh::Unit::Inch => Self::Inch,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    /// A box of 40 x 60 x 120 as an OBJ file.
    const BOX: &str = "v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    #[test]
    fn a_mesh_in_millimetres_becomes_an_object_with_mass_and_parts() {
        let loaded = read("box.obj", BOX.as_bytes(), None).unwrap();
        let report = &loaded.report;
        assert_eq!(report.unit, Some(Unit::Millimetre));
        assert!(report.watertight && report.parts == 1);
        let volume = 0.04 * 0.06 * 0.12;
        assert!((f64::from(report.mass_kg) - DENSITY * volume).abs() < 1e-4, "{}", report.mass_kg);
        assert!((report.extent_cm[2] - 12.0).abs() < 1e-3);
    }

    #[test]
    fn the_unit_can_be_set_right() {
        let loaded = read("box.obj", BOX.as_bytes(), Some(Unit::Centimetre)).unwrap();
        assert!((loaded.report.extent_cm[2] - 120.0).abs() < 1e-3);
    }

    #[test]
    fn a_bad_file_says_what_is_wrong_and_what_to_do() {
        let failure = read("notes.txt", b"", None).err().unwrap();
        assert_eq!(failure.code, "mesh_unusable");
        assert!(failure.cause.starts_with("notes.txt: the file is empty"), "{}", failure.cause);
        assert_eq!(failure.cure, "Export it again.");
    }

    #[test]
    fn labels_are_words() {
        assert_eq!(label("sugar_box"), "Sugar box");
    }
}
