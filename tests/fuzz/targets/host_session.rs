#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| vergence_fuzz::host_session(data));
