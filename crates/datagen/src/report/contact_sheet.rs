//! Contact sheet: all objects of a collection at one scale, by family.

use crate::report::projection::{Projection, facets};
use crate::report::{INK, MUTED};
use files::svg::Canvas;
use objects::catalog::{CATALOG, YCB_FAMILY};
use objects::generated::{self, FAMILIES};
use objects::object::Object;

/// Cell size (pixels), and scale (pixels per metre).
const CELL: [f32; 2] = [118.0, 206.0];
const SCALE: f32 = 430.0;
/// Cells per row, to the right of the family name.
const COLUMNS: usize = 8;
const MARGIN: f32 = 110.0;

/// Objects that a sheet shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Collection {
    /// The catalogue.
    BuiltIn,
    /// The generated objects.
    Generated,
}

/// Objects of one family, and their use.
struct FamilyObjects {
    name: &'static str,
    usage: &'static str,
    objects: Vec<Object>,
}

/// Renders the sheet as SVG; the error names the object that cannot be drawn.
pub fn contact_sheet(collection: Collection) -> Result<String, String> {
    let families = match collection {
        Collection::BuiltIn => built_in_families()?,
        Collection::Generated => generated_families(),
    };
    let num_rows = |family: &FamilyObjects| family.objects.len().div_ceil(COLUMNS);
    let rows: usize = families.iter().map(num_rows).sum();
    let size = [MARGIN + CELL[0] * COLUMNS as f32, CELL[1] * rows as f32 + 10.0];
    let mut canvas = Canvas::new(size[0], size[1]);
    canvas.rectangle([0.0, 0.0], size, "#ffffff");
    let mut top = 0.0;
    for family in &families {
        canvas.text([10.0, top + 90.0], 15.0, INK, family.name);
        canvas.text([10.0, top + 108.0], 11.0, MUTED, family.usage);
        for row in family.objects.chunks(COLUMNS) {
            for (column, object) in row.iter().enumerate() {
                canvas.embed([MARGIN + CELL[0] * column as f32, top], &cell(object));
            }
            top += CELL[1];
        }
    }
    Ok(canvas.svg("All objects at one scale"))
}

fn built_in_families() -> Result<Vec<FamilyObjects>, String> {
    let mut names: Vec<&str> = CATALOG.iter().map(|entry| entry.family).collect();
    names.dedup();
    let family = |name| {
        let members = CATALOG.iter().filter(|entry| entry.family == name);
        let is_train = members.clone().any(|entry| entry.is_for_training());
        let usage = match (name == YCB_FAMILY, is_train) {
            (true, _) => "modeled on YCB",
            (_, true) => "train",
            _ => "held out",
        };
        let build = |entry: &objects::catalog::CatalogEntry| {
            let object = entry.object_file()?.build();
            object.map_err(|error| format!("{}: {error}", entry.name))
        };
        Ok(FamilyObjects { name, usage, objects: members.map(build).collect::<Result<_, _>>()? })
    };
    names.into_iter().map(family).collect()
}

fn generated_families() -> Vec<FamilyObjects> {
    let family = |family: &generated::Family| {
        let objects = family.names().filter_map(|name| generated::generate(&name)).collect();
        FamilyObjects { name: family.name, usage: family.usage(), objects }
    };
    FAMILIES.iter().map(family).collect()
}

fn cell(object: &Object) -> Canvas {
    let mut canvas = Canvas::new(CELL[0], CELL[1]);
    let facets: Vec<_> = facets(&object.mesh, [0.72, 0.82, 0.93]).collect();
    Projection::new(35.0, 20.0).draw(&mut canvas, &facets, SCALE, [0.5 * CELL[0], 138.0]);
    let [min, max] = object.bounds;
    let size = (max - min) * 1000.0;
    canvas.text([6.0, 168.0], 10.0, INK, &object.name);
    let figures = format!("{:.0} x {:.0} x {:.0} mm", size.x, size.y, size.z);
    canvas.text([6.0, 180.0], 9.0, MUTED, &figures);
    canvas.text([6.0, 191.0], 9.0, MUTED, &format!("{} g", (1000.0 * object.mass).round()));
    canvas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_sheet_contains_every_object() {
        let sheet = contact_sheet(Collection::BuiltIn).unwrap();
        for entry in CATALOG {
            assert!(
                sheet.contains(&entry.object_file().unwrap().name),
                "{} is missing",
                entry.name
            );
        }
        assert!(sheet.matches("<polygon").count() > 50 * CATALOG.len());
    }
}
