//! Mutates what [`fuzz::weights`] reads.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::weights(bytes));
