#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scansion_fuzz::settings(bytes));
