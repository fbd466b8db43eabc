//! Mutates what [`fuzz::mesh`] reads.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::mesh(bytes));
