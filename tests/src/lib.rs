//! Tests across crates; they lie in `tests/tests`, and what drives the page in `tests/browser`.
