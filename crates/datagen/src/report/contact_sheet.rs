//! Contact sheet: all built-in objects at one scale, by family.

use crate::report::projection::{Projection, facets};
use crate::report::{INK, MUTED};
use files::svg::Canvas;
use objects::catalog::{CATALOG, CatalogEntry, YCB_FAMILY};

/// Cell size (pixels), and scale (pixels per metre).
const CELL: [f32; 2] = [118.0, 206.0];
const SCALE: f32 = 430.0;
/// Cells per row, to the right of the family name.
const COLUMNS: usize = 8;
const MARGIN: f32 = 110.0;

/// Renders the sheet as SVG; the error names the object that cannot be drawn.
pub fn contact_sheet() -> Result<String, String> {
    let mut families: Vec<&str> = CATALOG.iter().map(|entry| entry.family).collect();
    families.dedup();
    let width = MARGIN + CELL[0] * COLUMNS as f32;
    let mut canvas = Canvas::new(width, CELL[1] * families.len() as f32 + 10.0);
    canvas.rectangle([0.0, 0.0], [width, CELL[1] * families.len() as f32 + 10.0], "#ffffff");
    for (row, family) in families.iter().enumerate() {
        let top = CELL[1] * row as f32;
        let members: Vec<&CatalogEntry> = CATALOG.iter().filter(|e| e.family == *family).collect();
        canvas.text([10.0, top + 90.0], 15.0, INK, family);
        let is_train = members.iter().any(|entry| entry.is_for_training());
        let use_ = match (*family == YCB_FAMILY, is_train) {
            (true, _) => "modeled on YCB",
            (_, true) => "train",
            _ => "held out",
        };
        canvas.text([10.0, top + 108.0], 11.0, MUTED, use_);
        for (column, entry) in members.iter().enumerate() {
            let left = MARGIN + CELL[0] * column as f32;
            canvas.embed([left, top], &cell(entry)?);
        }
    }
    Ok(canvas.svg("All built-in objects at one scale"))
}

fn cell(entry: &CatalogEntry) -> Result<Canvas, String> {
    let object =
        entry.object_file()?.build().map_err(|error| format!("{}: {error}", entry.name))?;
    let mut canvas = Canvas::new(CELL[0], CELL[1]);
    let facets: Vec<_> = facets(&object.mesh, [0.72, 0.82, 0.93]).collect();
    Projection::new(35.0, 20.0).draw(&mut canvas, &facets, SCALE, [0.5 * CELL[0], 138.0]);
    let [min, max] = object.bounds;
    let size = (max - min) * 1000.0;
    canvas.text([6.0, 168.0], 10.0, INK, &object.name);
    let figures = format!("{:.0} x {:.0} x {:.0} mm", size.x, size.y, size.z);
    canvas.text([6.0, 180.0], 9.0, MUTED, &figures);
    canvas.text([6.0, 191.0], 9.0, MUTED, &format!("{} g", (1000.0 * object.mass).round()));
    Ok(canvas)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_sheet_contains_every_object() {
        let sheet = contact_sheet().unwrap();
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
