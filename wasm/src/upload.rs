//! Objects to grasp: built in, or from the bytes of a mesh file.

use crate::protocol::{Failure, ObjectLoaded, Report, Shape};
use crate::statistics::Tally;
use geometry::Vec3;
use geometry::brought::{self, Brought, DENSITY, Guide, MASSES, MassFrom, Stage, Told};
use geometry::catalog::{LOOK_ALIKES, of_family};
use geometry::mesh::{self, Mesh, Simplified};
use geometry::object::Object;
use rollout::Workcell;

/// An object, and what is told about it.
pub(crate) struct Loaded {
    pub(crate) object: Object,
    /// Name of a built-in object; `None` for an upload.
    pub(crate) name: Option<String>,
    /// Name for people.
    pub(crate) label: String,
    report: Report,
}

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

/// Says in words what reading a file is at, and asks the model how it lies.
struct Reading<'a> {
    file_name: &'a str,
    workcell: &'a Workcell,
    say: &'a dyn Fn(String),
}

impl Guide for Reading<'_> {
    fn at(&mut self, stage: Stage) {
        let file_name = self.file_name;
        (self.say)(match stage {
            Stage::Triangles => format!("Reading {file_name}"),
            Stage::Sides => format!("Looking how {file_name} can stand"),
            Stage::Parts => format!("Cutting {file_name} into convex parts"),
        });
    }

    fn lay(&mut self, sides: impl Iterator<Item = Mesh>) -> Option<usize> {
        self.workcell.most_familiar(sides)
    }
}

/// An object from a mesh file; says in words what it is at.
pub(crate) fn read(
    file_name: &str,
    bytes: &[u8],
    told: Told,
    workcell: &Workcell,
    say: &dyn Fn(String),
) -> Result<Loaded, Failure> {
    let mut guide = Reading { file_name, workcell, say };
    let found = brought::read(file_name, bytes, told, &mut guide).map_err(|error| {
        let message = error.to_string();
        // The message ends with the cure, as a sentence of its own.
        let (cause, cure) = message.rsplit_once(". ").unwrap_or((&message, "Try another file"));
        Failure {
            code: "mesh_unusable",
            cause: format!("{file_name}: {cause}."),
            cure: format!("{cure}."),
        }
    })?;
    let report = Report {
        unit: Some(found.unit.unit),
        reason: Some(format!("{}.", found.unit.reason)),
        sides: found.sides,
        stands: Some(found.stands.0),
        because: Some(found.stands.1),
        notes: notes(&found),
        ..report_of(&found.object, found.healing.watertight)
    };
    Ok(Loaded { object: found.object, name: None, label: file_name.to_owned(), report })
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
        because: None,
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
fn notes(found: &Brought) -> Vec<String> {
    let mut notes = Vec::new();
    notes.extend(found.simplified.map(|Simplified { from, moved }| {
        let most = 1000.0 * moved;
        format!("Its {from} triangles were made fewer, which moved none by more than {most:.1} mm.")
    }));
    let mut note = |count: usize, what: &str| {
        if count > 0 {
            notes.push(format!("{count} {what}"));
        }
    };
    let healing = &found.healing;
    note(healing.degenerate_triangles, "triangles without area were left out.");
    note(healing.duplicate_triangles, "triangles that lay on others were left out.");
    note(healing.flipped_triangles, "triangles were turned to face outward.");
    note(healing.open_edges, "edges are open: the surface has holes.");
    if found.is_weighed_by_hull {
        notes.push("Weighed by its convex hull.".into());
    }
    notes.extend(match found.mass {
        MassFrom::Told => None,
        MassFrom::Density => Some(format!("Mass assumed from {DENSITY} kg/m³.")),
        MassFrom::Bound(kg) if kg == MASSES[0] => Some(format!("Mass assumed: {kg} kg at least.")),
        MassFrom::Bound(kg) => {
            Some(format!("Mass assumed: {kg} kg at most, what a hand can lift."))
        }
    });
    notes.extend(found.stands.1.sentence().map(str::to_owned));
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::brought::{MOST_RESTS, Stands};
    use geometry::mesh::Unit;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    /// A box of 40 x 60 x 120 as an OBJ file.
    const BOX: &str = "v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    /// Read where no model is there.
    fn read(name: &str, text: &str, told: Told) -> Result<Loaded, Failure> {
        super::read(name, text.as_bytes(), told, &Workcell::new().unwrap(), &|_| ())
    }

    #[test]
    fn a_mesh_in_millimetres_becomes_an_object_with_mass_and_parts() {
        let loaded = read("box.obj", BOX, Told::default()).unwrap();
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
        read("bottle.obj", &text, Told::default()).unwrap().report
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
        let loaded = read("box.obj", BOX, told).unwrap();
        assert!((loaded.report.extent_cm[2] - 120.0).abs() < 1e-3);
    }

    #[test]
    fn it_stands_and_weighs_as_is_said() {
        let loaded = read("box.obj", BOX, Told::default()).unwrap();
        assert_eq!((loaded.report.stands, loaded.report.sides), (Some(Stands::AsInFile), 6));
        let told = Told { mass: Some(0.25), stands: Some(Stands::On(0)), ..Told::default() };
        let loaded = read("box.obj", BOX, told).unwrap();
        assert!((loaded.report.extent_cm[2] - 4.0).abs() < 1e-3, "{:?}", loaded.report.extent_cm);
        assert_eq!(loaded.object.mass, 0.25);
        assert_eq!(loaded.report.fits, "6.0 cm across at its narrowest: the hand gets round it");
        // On its edge it does not stand.
        let tilted = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
        let loaded = read("wedge.obj", &tilted, Told::default()).unwrap();
        assert_eq!(loaded.report.stands, Some(Stands::On(0)));
        assert!(loaded.report.notes.iter().any(|note| note.contains("fall over")));
    }

    #[test]
    fn what_is_too_wide_or_too_low_is_told() {
        let fits = |height: &str, unit| {
            let told = Told { unit: Some(unit), stands: Some(Stands::AsInFile), ..Told::default() };
            read("box.obj", &BOX.replace("120", height), told).unwrap().report.fits
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
        let failure = read("notes.txt", "", Told::default()).err().unwrap();
        assert_eq!(failure.code, "mesh_unusable");
        assert!(failure.cause.starts_with("notes.txt: the file is empty"), "{}", failure.cause);
        assert_eq!(failure.cure, "Export it again.");
    }

    #[test]
    fn labels_are_words() {
        assert_eq!(label("sugar_box"), "Sugar box");
    }
}
