//! libFuzzer's entry into the target `scene`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = hummingbus_fuzz::scene(bytes);
});
