//! Loading of objects: built-in ones, and mesh files.

use crate::protocol::{Failure, ObjectInfo, ObjectLoaded, Shape};
use crate::statistics::Tally;
use geometry::Vec3;
use mesh::{ImportedMesh, Mesh, SimplifyReport, VolumeSource};
use objects::catalog::{YCB_FAMILY, entries_of_family};
use objects::import::{
    self, DEFAULT_DENSITY, ImportContext, ImportedObject, MASS_RANGE, MassSource, Orientation,
    stage,
};
use objects::object::Object;
use robot::HandModel;
use rollout::RolloutContext;

/// Object with its texts for the page.
pub(crate) struct LoadedObject {
    pub(crate) object: Object,
    /// Catalogue name of a built-in object; `None` for an upload.
    pub(crate) name: Option<String>,
    /// Display name.
    pub(crate) label: String,
    info: ObjectInfo,
}

/// Number of directions in which the width is measured.
const NUM_WIDTH_DIRECTIONS: usize = 90;
/// Max vertices of a displayed hull; the collision shape may have fewer.
const MAX_HULL_POINTS: usize = 256;

/// Names of the built-in objects on the page, in order.
pub(crate) fn built_in_names() -> impl Iterator<Item = &'static str> {
    entries_of_family(YCB_FAMILY).map(|entry| entry.name)
}

/// Display name: "Sugar box" for `sugar_box`.
pub(crate) fn display_name(name: &str) -> String {
    let mut spaced = name.replace('_', " ");
    if let Some(first) = spaced.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    spaced
}

/// Loads a built-in object.
pub(crate) fn load_built_in(name: &str) -> Result<LoadedObject, Failure> {
    let object = Object::from_catalog(name).ok_or_else(|| Failure {
        code: "unknown_object",
        message: format!("Unknown built-in object \"{name}\"."),
        hint: "Choose one from the list.".into(),
    })?;
    let report = object_info(&object, true);
    Ok(LoadedObject {
        object,
        name: Some(name.to_owned()),
        label: display_name(name),
        info: report,
    })
}

/// Text of a stage of an import.
fn stage_text(stage: &str, file_name: &str) -> String {
    match stage {
        stage::STABLE_POSES => format!("Computing stable poses of {file_name}"),
        _ => format!("Decomposing {file_name} into convex parts"),
    }
}

/// Makes an object from a mesh that module `mesh-reader` has read from a file, and reports progress texts.
pub(crate) fn import_mesh(
    file_name: &str,
    mesh: &[u8],
    mass: Option<f32>,
    orientation: Option<Orientation>,
    context: &RolloutContext,
    report: &dyn Fn(String),
) -> Result<LoadedObject, Failure> {
    let mesh = ImportedMesh::from_bytes(mesh).map_err(|error| Failure {
        code: "invalid_message",
        message: format!("The mesh that was read from {file_name} is invalid: {error}."),
        hint: "Reload the page; its files may be of different versions.".into(),
    })?;
    let progress = |stage: &str, _: usize, _: usize| report(stage_text(stage, file_name));
    let import_context = ImportContext {
        choose_orientation: &|poses| context.most_familiar(poses),
        rests: &|object| scene::rests_on_table(&context.robot.config, object),
        progress: &progress,
        ..ImportContext::NONE
    };
    let imported = import::object_from_mesh(file_name, mesh, mass, orientation, &import_context);
    let imported = imported.map_err(|error| {
        let (cause, hint) = error.cause_and_hint();
        Failure {
            code: error.code(),
            message: format!("{file_name}: {cause}."),
            hint: format!("{hint}."),
        }
    })?;
    let report = ObjectInfo {
        unit: Some(imported.unit.unit),
        unit_reason: Some(format!("{}.", imported.unit.reason)),
        stable_poses: imported.num_stable_poses,
        orientation: Some(imported.orientation.0),
        orientation_reason: Some(imported.orientation.1),
        notes: import_notes(&imported),
        ..object_info(&imported.object, imported.repair.watertight)
    };
    Ok(LoadedObject {
        object: imported.object,
        name: None,
        label: file_name.to_owned(),
        info: report,
    })
}

impl LoadedObject {
    /// Event for the page.
    pub(crate) fn to_event(&self, tally: Tally) -> ObjectLoaded {
        let hulls =
            self.object.parts.iter().filter_map(|part| mesh::convex_hull(part, MAX_HULL_POINTS));
        ObjectLoaded {
            name: self.name.clone(),
            hash: self.object.hash(),
            label: self.label.clone(),
            shape: Shape::from_mesh(&self.object.mesh),
            hulls: hulls.map(|hull| Shape::from_mesh(&hull)).collect(),
            info: self.info.clone(),
            tally,
        }
    }
}

fn object_info(object: &Object, watertight: bool) -> ObjectInfo {
    let extent = object.size();
    ObjectInfo {
        extent_cm: extent.to_array().map(|side| side * 100.0),
        mass_kg: object.mass,
        triangles: object.mesh.triangles.len(),
        watertight,
        convex_parts: object.parts.len(),
        unit: None,
        unit_reason: None,
        stable_poses: 0,
        orientation: None,
        orientation_reason: None,
        graspability: graspability_text(&object.mesh),
        notes: Vec::new(),
    }
}

/// Text about graspability by the hand, from the min width in the top view and the height.
fn graspability_text(mesh: &Mesh) -> String {
    let graspable = &HandModel::standard().graspable;
    let width = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / NUM_WIDTH_DIRECTIONS as f64;
        let across = Vec3::new(libm::cos(angle) as f32, libm::sin(angle) as f32, 0.0);
        let along = mesh.vertices.iter().map(|v| v.dot(across));
        let (low, high) =
            along.fold((f32::MAX, f32::MIN), |(low, high), s| (low.min(s), high.max(s)));
        high - low
    };
    let narrowest = (0..NUM_WIDTH_DIRECTIONS).map(width).fold(f32::MAX, f32::min);
    let fit = match narrowest > graspable.max_width {
        true => "wider than the hand opens; only a rim or an edge can be grasped",
        false => "fits the hand",
    };
    let height = mesh.vertices.iter().map(|v| v.z).fold(0.0, f32::max);
    let mut text = format!("{:.1} cm at its narrowest: {fit}", 100.0 * narrowest);
    if height < graspable.min_height {
        text += &format!("; {:.1} cm high: too low to grasp", 100.0 * height);
    }
    text
}

/// Fraction of the empty space in the hull of the mesh that the convex parts may fill without a note.
const MAX_FILLED_FRACTION: f64 = 0.05;

/// Notes on repairs and assumptions that affect appearance or grasping.
fn import_notes(imported: &ImportedObject) -> Vec<String> {
    let mut notes = Vec::new();
    notes.extend(imported.simplified.map(
        |SimplifyReport { triangles_before: from, max_displacement: moved }| {
            let deviation = 1000.0 * moved;
            format!("Simplified from {from} triangles (max. deviation {deviation:.1} mm).")
        },
    ));
    let mut note = |count: usize, text: &str| {
        if count > 0 {
            notes.push(format!("{count} {text}"));
        }
    };
    let repair = &imported.repair;
    note(repair.degenerate_triangles, "degenerate triangles removed.");
    note(repair.duplicate_triangles, "duplicate triangles removed.");
    note(repair.flipped_triangles, "triangles flipped to face outward.");
    note(repair.debris, "loose pieces removed: small ones around the object, or far from it.");
    note(repair.filled_holes, "small holes closed.");
    note(repair.boundary_edges, "boundary edges: the surface has holes.");
    notes.extend(volume_note(imported.volume_source).map(str::to_owned));
    notes.extend(match imported.mass_source {
        MassSource::Given => None,
        MassSource::DefaultDensity => {
            Some(format!("Mass estimated with a density of {DEFAULT_DENSITY} kg/m³."))
        }
        MassSource::Clamped(kg) if kg == MASS_RANGE[0] => {
            Some(format!("Mass clamped to the minimum of {kg} kg."))
        }
        MassSource::Clamped(kg) => {
            Some(format!("Mass clamped to the maximum of {kg} kg, the payload of the hand."))
        }
    });
    if imported.filled_fraction > MAX_FILLED_FRACTION {
        notes.push(format!(
            "The convex parts fill {:.0} % of the hollows, where the fingers cannot enter.",
            100.0 * imported.filled_fraction
        ));
    }
    notes.extend(imported.orientation.1.message().map(str::to_owned));
    notes
}

/// Note on the solid from which mass and centre of mass are computed; `None` for a closed surface.
fn volume_note(source: VolumeSource) -> Option<&'static str> {
    Some(match source {
        VolumeSource::Surface => return None,
        VolumeSource::ClosedSurfaces => "Mass computed without the open surfaces.",
        VolumeSource::Union => "Solids overlap: mass computed from their union.",
        VolumeSource::ConvexParts => "The surface is open: mass computed from the convex parts.",
        VolumeSource::Hull => "Mass computed from the convex hull.",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mesh::Unit;
    use objects::import::{ImportOptions, MAX_STABLE_POSES};
    use wasm_bindgen_test::wasm_bindgen_test as test;

    /// Box of 40 x 60 x 120 units as an OBJ file.
    const BOX: &str = "v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    /// Imports without a model.
    fn import(name: &str, text: &str, options: ImportOptions) -> Result<LoadedObject, Failure> {
        let mesh = mesh::import(text.as_bytes(), &options.mesh()).map_err(|error| Failure {
            code: error.code(),
            message: error.to_string(),
            hint: String::new(),
        })?;
        let (bytes, context) = (mesh.to_bytes(), RolloutContext::new().unwrap());
        let ImportOptions { mass, orientation, .. } = options;
        super::import_mesh(name, &bytes, mass, orientation, &context, &|_| ())
    }

    #[test]
    fn mesh_in_millimetres_gets_mass_and_convex_parts() {
        let loaded = import("box.obj", BOX, ImportOptions::default()).unwrap();
        let report = &loaded.info;
        assert_eq!(report.unit, Some(Unit::Millimetre));
        assert!(report.watertight && report.convex_parts == 1);
        let volume = 0.04 * 0.06 * 0.12;
        assert!(
            (f64::from(report.mass_kg) - DEFAULT_DENSITY * volume).abs() < 1e-4,
            "{}",
            report.mass_kg
        );
        assert!((report.extent_cm[2] - 12.0).abs() < 1e-3);
    }

    /// Octagonal bottle; each of its eight sides is a more stable face than its base.
    fn bottle(is_y_up: bool) -> ObjectInfo {
        let ring = |z: f32| {
            (0..8).map(move |k| {
                let (sin, cos) = libm::sincosf(std::f32::consts::TAU * k as f32 / 8.0);
                let (x, y) = (30.0 * cos, 30.0 * sin);
                if is_y_up { format!("v {x} {z} {}\n", -y) } else { format!("v {x} {y} {z}\n") }
            })
        };
        let caps = ["f 8 7 6 5 4 3 2 1\n", "f 9 10 11 12 13 14 15 16\n"].map(str::to_owned);
        let side =
            |k: usize| format!("f {} {} {} {}\n", k + 1, (k + 1) % 8 + 1, (k + 1) % 8 + 9, k + 9);
        let text: String =
            ring(0.0).chain(ring(200.0)).chain(caps).chain((0..8).map(side)).collect();
        import("bottle.obj", &text, ImportOptions::default()).unwrap().info
    }

    #[test]
    fn slender_bottle_keeps_file_orientation() {
        let report = bottle(false);
        assert_eq!(
            (report.orientation, report.stable_poses),
            (Some(Orientation::AsInFile), MAX_STABLE_POSES)
        );
        assert!((report.extent_cm[2] - 20.0).abs() < 1e-3 && report.watertight);
    }

    #[test]
    fn y_up_file_is_rotated_to_z_up() {
        let report = bottle(true);
        assert_eq!(
            (report.orientation, report.stable_poses),
            (Some(Orientation::StablePose(MAX_STABLE_POSES)), MAX_STABLE_POSES + 1)
        );
        assert!((report.extent_cm[2] - 20.0).abs() < 1e-3 && report.watertight);
        assert!(report.notes.iter().any(|note| note.contains("y-up")), "{:?}", report.notes);
    }

    #[test]
    fn given_unit_overrides_guess() {
        let options = ImportOptions { unit: Some(Unit::Centimetre), ..ImportOptions::default() };
        let loaded = import("box.obj", BOX, options).unwrap();
        assert!((loaded.info.extent_cm[2] - 120.0).abs() < 1e-3);
    }

    #[test]
    fn mesh_of_unit_size_asks_for_its_size() {
        let text = BOX.replace("120", "1").replace("60", "0.5").replace("40", "0.3");
        let failure = import("box.obj", &text, ImportOptions::default()).err().unwrap();
        assert_eq!(failure.code, "size_required", "{}", failure.message);
        let options = ImportOptions { size: Some(0.12), ..ImportOptions::default() };
        let loaded = import("box.obj", &text, options).unwrap();
        assert!((loaded.info.extent_cm[2] - 12.0).abs() < 1e-3, "{:?}", loaded.info.extent_cm);
    }

    #[test]
    fn given_orientation_and_mass_are_used() {
        let loaded = import("box.obj", BOX, ImportOptions::default()).unwrap();
        assert_eq!(
            (loaded.info.orientation, loaded.info.stable_poses),
            (Some(Orientation::AsInFile), 6)
        );
        let options = ImportOptions {
            mass: Some(0.25),
            orientation: Some(Orientation::StablePose(0)),
            ..ImportOptions::default()
        };
        let loaded = import("box.obj", BOX, options).unwrap();
        assert!((loaded.info.extent_cm[2] - 4.0).abs() < 1e-3, "{:?}", loaded.info.extent_cm);
        assert_eq!(loaded.object.mass, 0.25);
        assert_eq!(loaded.info.graspability, "6.0 cm at its narrowest: fits the hand");
        // The box is placed on an edge, which is unstable.
        let tilted = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
        let loaded = import("wedge.obj", &tilted, ImportOptions::default()).unwrap();
        assert_eq!(loaded.info.orientation, Some(Orientation::StablePose(0)));
        assert!(loaded.info.notes.iter().any(|note| note.contains("unstable")));
    }

    #[test]
    fn graspability_reports_excess_width_and_low_height() {
        let fits = |height: &str, unit| {
            let options = ImportOptions {
                unit: Some(unit),
                orientation: Some(Orientation::AsInFile),
                ..ImportOptions::default()
            };
            import("box.obj", &BOX.replace("120", height), options).unwrap().info.graspability
        };
        assert!(fits("8", Unit::Millimetre).ends_with("0.8 cm high: too low to grasp"));
        assert!(fits("12", Unit::Millimetre).ends_with("fits the hand"));
        let wide = fits("12", Unit::Centimetre);
        assert!(wide.contains("only a rim or an edge") && !wide.contains("too low"), "{wide}");
    }

    #[test]
    fn mesh_of_another_version_is_reported() {
        let context = RolloutContext::new().unwrap();
        let failure = import_mesh("box.obj", BOX.as_bytes(), None, None, &context, &|_| ());
        let failure = failure.err().unwrap();
        assert_eq!(failure.code, "invalid_message");
        assert!(failure.message.contains("box.obj"), "{}", failure.message);
    }

    #[test]
    fn display_name_is_capitalised_words() {
        assert_eq!(display_name("sugar_box"), "Sugar box");
    }
}
