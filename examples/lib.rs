//! The examples of this folder; see README.md.
