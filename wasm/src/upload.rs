//! Objects to grasp: built in, or from the bytes of a mesh file.

use crate::protocol::{Failure, ObjectLoaded, Report, Shape, Stands, Unit};
use crate::statistics::Tally;
use geometry::Vec3;
use geometry::catalog::{LOOK_ALIKES, of_family};
use geometry::mesh::{self, Healing, Import, Mesh};
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
/// Ways to stand that are offered.
const MOST_RESTS: usize = 6;
/// Directions from which a width is looked for.
const WIDTHS: usize = 90;
/// A little more than the softball (9.7 cm), the widest object that grasps of the search lift by going round it (m).
const SPAN: f32 = 0.10;
/// Between the hammer (3.0 cm), of which the search found nothing to lift, and the screwdriver (3.8 cm), the lowest of
/// all others (m).
const LOW: f32 = 0.035;
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

/// What somebody says of a mesh file; the rest is guessed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Told {
    pub(crate) unit: Option<Unit>,
    pub(crate) mass_kg: Option<f32>,
    pub(crate) stands: Option<Stands>,
}

/// An object from a mesh file.
pub(crate) fn read(file_name: &str, bytes: &[u8], told: Told) -> Result<Loaded, Failure> {
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
    let import = mesh::import(bytes, told.unit.map(Unit::geometry)).map_err(unusable)?;
    let Import { mesh, unit, healing, is_drawn_y_up } = import;
    let solid = mesh::solid(&mesh, healing.watertight).map_err(unusable)?;
    let mut notes = notes(&healing, solid.from_hull);
    let guessed = DENSITY * solid.volume;
    let [least, most] = MASSES;
    let mass = told.mass_kg.filter(|kg| kg.is_finite() && *kg > 0.0).unwrap_or_else(|| {
        notes.push(match guessed {
            kg if kg < least => format!("Mass assumed: {least} kg at least."),
            kg if kg > most => format!("Mass assumed: {most} kg at most, what a hand can lift."),
            _ => format!("Mass assumed from {DENSITY} kg/m³."),
        });
        guessed.clamp(least, most) as f32
    });
    let mut rests = mesh::rests(&mesh.vertices, solid.center);
    // What is round has many sides, each steadier than to stand upright.
    let stays = rests.is_empty() || rests.iter().any(mesh::Rest::is_as_it_is);
    let drawn = rests.iter().position(mesh::Rest::is_y_up).filter(|_| is_drawn_y_up);
    let far = drawn.filter(|side| *side >= MOST_RESTS).map(|side| rests.remove(side));
    rests.truncate(MOST_RESTS);
    // It is one of those that are offered.
    rests.extend(far);
    let drawn = drawn.map(|side| side.min(MOST_RESTS));
    let stands = told.stands.unwrap_or_else(|| {
        if let Some(side) = drawn {
            notes.push("Its file looks drawn with y up, and it stands so.".into());
            return Stands::On(side);
        }
        if stays {
            return Stands::AsInFile;
        }
        notes.push(
            "It would fall over as it stands in the file; it lies on its steadiest side.".into(),
        );
        Stands::On(0)
    });
    let (mesh, stands) = match stands {
        Stands::On(side) if side < rests.len() => (mesh.turned(&rests[side].rotation), stands),
        _ => (mesh, Stands::AsInFile),
    };
    let parts = mesh::convex_parts_or_hull(&mesh);
    let object = Object::new(file_name, mesh, healing.watertight, parts.hulls, mass, FRICTION)
        .map_err(unusable)?;
    let report = Report {
        unit: Some(Unit::of(unit.unit)),
        reason: Some(format!("{}.", unit.reason)),
        sides: rests.len(),
        stands: Some(stands),
        notes,
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
            hash: self.object.hash(),
            label: self.label.clone(),
            shape: Shape::of(&self.object.mesh),
            hulls: hulls.map(|hull| Shape::of(&hull)).collect(),
            report: self.report.clone(),
            tally,
        }
    }
}

fn report_of(object: &Object, watertight: bool) -> Report {
    let extent = object.size();
    Report {
        extent_cm: extent.to_array().map(|side| side * 100.0),
        mass_kg: object.mass,
        triangles: object.mesh.triangles.len(),
        watertight,
        parts: object.parts.len(),
        unit: None,
        reason: None,
        sides: 0,
        stands: None,
        fits: fits(&object.mesh),
        notes: Vec::new(),
    }
}

/// Whether the hand gets round it, by its narrowest width seen from above, and hold of it, by its height.
fn fits(mesh: &Mesh) -> String {
    let width = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / WIDTHS as f64;
        let across = Vec3::new(libm::cos(angle) as f32, libm::sin(angle) as f32, 0.0);
        let along = mesh.vertices.iter().map(|v| v.dot(across));
        let (low, high) =
            along.fold((f32::MAX, f32::MIN), |(low, high), s| (low.min(s), high.max(s)));
        high - low
    };
    let narrowest = (0..WIDTHS).map(width).fold(f32::MAX, f32::min);
    let words = match narrowest > SPAN {
        true => "wider than the hand opens, only a rim or an edge could be held",
        false => "the hand gets round it",
    };
    let height = mesh.vertices.iter().map(|v| v.z).fold(0.0, f32::max);
    let mut said = format!("{:.1} cm across at its narrowest: {words}", 100.0 * narrowest);
    if height < LOW {
        said += &format!("; {:.1} cm high: too low for the fingers to get hold of", 100.0 * height);
    }
    said
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
        let loaded = read("box.obj", BOX.as_bytes(), Told::default()).unwrap();
        let report = &loaded.report;
        assert_eq!(report.unit, Some(Unit::Millimetre));
        assert!(report.watertight && report.parts == 1);
        let volume = 0.04 * 0.06 * 0.12;
        assert!((f64::from(report.mass_kg) - DENSITY * volume).abs() < 1e-4, "{}", report.mass_kg);
        assert!((report.extent_cm[2] - 12.0).abs() < 1e-3);
    }

    /// A bottle of eight sides, on each of which it stands more steadily than on its foot.
    fn bottle(is_y_up: bool) -> Report {
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
        read("bottle.obj", text.as_bytes(), Told::default()).unwrap().report
    }

    #[test]
    fn a_slender_bottle_stays_upright_however_many_sides_it_has() {
        let report = bottle(false);
        assert_eq!((report.stands, report.sides), (Some(Stands::AsInFile), MOST_RESTS));
        assert!((report.extent_cm[2] - 20.0).abs() < 1e-3 && report.watertight);
    }

    #[test]
    fn what_was_drawn_with_y_up_stands_up() {
        let report = bottle(true);
        assert_eq!((report.stands, report.sides), (Some(Stands::On(MOST_RESTS)), MOST_RESTS + 1));
        assert!((report.extent_cm[2] - 20.0).abs() < 1e-3 && report.watertight);
        assert!(report.notes.iter().any(|note| note.contains("y up")), "{:?}", report.notes);
    }

    #[test]
    fn the_unit_can_be_set_right() {
        let told = Told { unit: Some(Unit::Centimetre), ..Told::default() };
        let loaded = read("box.obj", BOX.as_bytes(), told).unwrap();
        assert!((loaded.report.extent_cm[2] - 120.0).abs() < 1e-3);
    }

    #[test]
    fn it_stands_and_weighs_as_is_said() {
        let loaded = read("box.obj", BOX.as_bytes(), Told::default()).unwrap();
        assert_eq!((loaded.report.stands, loaded.report.sides), (Some(Stands::AsInFile), 6));
        let told = Told { mass_kg: Some(0.25), stands: Some(Stands::On(0)), ..Told::default() };
        let loaded = read("box.obj", BOX.as_bytes(), told).unwrap();
        assert!((loaded.report.extent_cm[2] - 4.0).abs() < 1e-3, "{:?}", loaded.report.extent_cm);
        assert_eq!(loaded.object.mass, 0.25);
        assert_eq!(loaded.report.fits, "6.0 cm across at its narrowest: the hand gets round it");
        // On its edge it does not stand.
        let tilted = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
        let loaded = read("wedge.obj", tilted.as_bytes(), Told::default()).unwrap();
        assert_eq!(loaded.report.stands, Some(Stands::On(0)));
        assert!(loaded.report.notes.iter().any(|note| note.contains("fall over")));
    }

    #[test]
    fn what_is_too_wide_or_too_low_is_told() {
        let fits = |height: &str, unit| {
            let told = Told { unit: Some(unit), stands: Some(Stands::AsInFile), ..Told::default() };
            read("box.obj", BOX.replace("120", height).as_bytes(), told).unwrap().report.fits
        };
        assert!(
            fits("30", Unit::Millimetre)
                .ends_with("3.0 cm high: too low for the fingers to get hold of")
        );
        assert!(fits("38", Unit::Millimetre).ends_with("gets round it"));
        let wide = fits("12", Unit::Centimetre);
        assert!(wide.contains("only a rim or an edge") && !wide.contains("too low"), "{wide}");
    }

    #[test]
    fn a_bad_file_says_what_is_wrong_and_what_to_do() {
        let failure = read("notes.txt", b"", Told::default()).err().unwrap();
        assert_eq!(failure.code, "mesh_unusable");
        assert!(failure.cause.starts_with("notes.txt: the file is empty"), "{}", failure.cause);
        assert_eq!(failure.cure, "Export it again.");
    }

    #[test]
    fn labels_are_words() {
        assert_eq!(label("sugar_box"), "Sugar box");
    }
}
