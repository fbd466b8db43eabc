//! libFuzzer entry point of [`fuzz::mesh`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::mesh(bytes));
