//! Files that the tools write: atomic replacement, named tensors, SVG drawings.

pub mod atomic_file;
pub mod svg;
pub mod tensors;
