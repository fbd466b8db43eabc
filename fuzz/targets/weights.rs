//! libFuzzer entry point of [`fuzz::weights`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::weights(bytes));
