//! SVG figures of datasets and objects, standalone or in one self-contained HTML page.

mod charts;
mod contact_sheet;
mod grasp_figure;
mod page;
mod projection;

pub use contact_sheet::{Collection, contact_sheet};
pub use page::render_page;

/// Colors of text, of secondary text, and of lines.
const INK: &str = "#1f2933";
const MUTED: &str = "#5b6773";
const LINE: &str = "#c8d0d8";
