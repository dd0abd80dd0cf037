//! libFuzzer's entry into the target `model`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = hummingbus_fuzz::model(bytes);
});
