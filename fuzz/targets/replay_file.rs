//! libFuzzer entry point of [`fuzz::replay_file`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::replay_file(bytes));
