//! STL: triangle soup, as text or in binary records.

use super::builder::MeshBuilder;
use super::{stl_binary, stl_text};
use crate::{Location, MeshError};

pub(super) const FORMAT: &str = "STL";

/// Parser of the variant, binary or text; `None` if the bytes are not STL.
pub(super) fn detect(bytes: &[u8]) -> Option<super::Reader> {
    if stl_binary::is_binary(bytes) {
        return Some(|bytes, _| stl_binary::read(bytes));
    }
    stl_text::is_text(bytes).then_some(|bytes, _| stl_text::read(bytes))
}

/// Parser of a binary file whose length matches its header. No other format has such a length.
pub(super) fn detect_exact(bytes: &[u8]) -> Option<super::Reader> {
    stl_binary::is_complete(bytes).then_some(|bytes, _| stl_binary::read(bytes))
}

pub(super) fn add_facet(
    builder: &mut MeshBuilder,
    corners: impl Iterator<Item = [f64; 3]>,
    location: Location,
) -> Result<(), MeshError> {
    let first = builder.num_vertices() as u32;
    for corner in corners {
        builder.add_vertex(corner, location)?;
    }
    let corners: Vec<u32> = (first..builder.num_vertices() as u32).collect();
    builder.add_polygon(&corners, location)
}
