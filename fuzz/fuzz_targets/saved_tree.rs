#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| splitplane_fuzz::saved_tree(bytes));
