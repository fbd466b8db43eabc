//! Tests across crates: see `tests/tests` (Rust), `tests/browser` (page) and `tests/python`.
