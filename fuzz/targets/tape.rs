//! Mutates what [`fuzz::tape`] reads.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::tape(bytes));
