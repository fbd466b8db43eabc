//! A contact sheet: every object of the project at one scale, family by family.

use crate::report::canvas::Canvas;
use crate::report::view::{View, facets};
use crate::report::{INK, QUIET};
use geometry::catalog::{CATALOG, Entry, LOOK_ALIKES};

/// Size of a cell (pixels), and pixels a metre.
const CELL: [f32; 2] = [118.0, 206.0];
const SCALE: f32 = 430.0;
/// Cells in a row beside the family's name.
const COLUMNS: usize = 8;
const MARGIN: f32 = 110.0;

/// The sheet as SVG; the message says which object cannot be drawn.
pub fn contact_sheet() -> Result<String, String> {
    let mut families: Vec<&str> = CATALOG.iter().map(|entry| entry.family).collect();
    families.dedup();
    let width = MARGIN + CELL[0] * COLUMNS as f32;
    let mut canvas = Canvas::new(width, CELL[1] * families.len() as f32 + 10.0);
    canvas.rectangle([0.0, 0.0], [width, CELL[1] * families.len() as f32 + 10.0], "#ffffff");
    for (row, family) in families.iter().enumerate() {
        let top = CELL[1] * row as f32;
        let members: Vec<&Entry> = CATALOG.iter().filter(|e| e.family == *family).collect();
        canvas.text([10.0, top + 90.0], 15.0, INK, family);
        let is_taught = members.iter().any(|entry| entry.is_for_training());
        let use_ = match (*family == LOOK_ALIKES, is_taught) {
            (true, _) => "look-alikes of YCB",
            (_, true) => "to learn from",
            _ => "held out",
        };
        canvas.text([10.0, top + 108.0], 11.0, QUIET, use_);
        for (column, entry) in members.iter().enumerate() {
            let left = MARGIN + CELL[0] * column as f32;
            canvas.place([left, top], &cell(entry)?);
        }
    }
    Ok(canvas.svg("All objects of the project at one scale"))
}

fn cell(entry: &Entry) -> Result<Canvas, String> {
    let object = entry.file()?.object().map_err(|error| format!("{}: {error}", entry.name))?;
    let mut canvas = Canvas::new(CELL[0], CELL[1]);
    let facets: Vec<_> = facets(&object.mesh, [0.72, 0.82, 0.93]).collect();
    View::new(35.0, 20.0).draw(&mut canvas, &facets, SCALE, [0.5 * CELL[0], 138.0]);
    let [min, max] = object.bounds;
    let size = (max - min) * 1000.0;
    canvas.text([6.0, 168.0], 10.0, INK, &object.name);
    let figures = format!("{:.0} x {:.0} x {:.0} mm", size.x, size.y, size.z);
    canvas.text([6.0, 180.0], 9.0, QUIET, &figures);
    canvas.text([6.0, 191.0], 9.0, QUIET, &format!("{} g", (1000.0 * object.mass).round()));
    Ok(canvas)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_object_is_on_the_sheet() {
        let sheet = contact_sheet().unwrap();
        for entry in CATALOG {
            assert!(sheet.contains(&entry.file().unwrap().name), "{} is missing", entry.name);
        }
        assert!(sheet.matches("<polygon").count() > 50 * CATALOG.len());
    }
}
