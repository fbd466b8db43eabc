//! Pictures of a dataset and of the objects: SVG, alone or in one self-contained page.

pub mod canvas;
mod charts;
mod held;
mod page;
mod sheet;
mod view;

pub use page::report;
pub use sheet::contact_sheet;

/// Colours of text, of what is less important, and of lines.
const INK: &str = "#1f2933";
const QUIET: &str = "#5b6773";
const LINE: &str = "#c8d0d8";
