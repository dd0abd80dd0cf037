//! libFuzzer's entry into the target `manifest`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = hummingbus_fuzz::manifest(bytes);
});
