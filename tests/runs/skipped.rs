//! Tests that cannot run here say so and are counted. Tests of all crates include this file.

use std::fs::OpenOptions;
use std::io::Write as _;

/// The file that gets a line for each skipped test; `scripts/test` sets it and counts the lines.
const VARIABLE: &str = "HUMMINGBUS_SKIPPED";

/// Tells that the running test, or a part of it, is skipped, and why.
pub fn skip(reason: &str) {
    let thread = std::thread::current();
    let line = format!("skipped: {}: {reason}\n", thread.name().unwrap_or("a test"));
    // Not `eprintln!`, which the test runner hides.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(path) = std::env::var_os(VARIABLE) {
        let mut file = OpenOptions::new().create(true).append(true).open(&path).expect(VARIABLE);
        file.write_all(line.as_bytes()).expect(VARIABLE);
    }
}

/// True where `HUMMINGBUS_STEADY` says that nothing else runs on this machine; a skipped test elsewhere. For tests of what
/// host time decides, such as the silence of a person who flies by hand.
#[allow(dead_code, reason = "few crates' tests need it")]
pub fn is_steady() -> bool {
    variable_or_skip("HUMMINGBUS_STEADY", "which says that nothing else runs on this machine").is_some()
}

/// The value of an environment variable, or `None` and a skipped test where it is not set.
#[allow(dead_code, reason = "not every crate's tests need a variable")]
pub fn variable_or_skip(name: &str, meaning: &str) -> Option<String> {
    let value = std::env::var(name).ok();
    if value.is_none() {
        skip(&format!("{name}, {meaning}, is not set"));
    }
    value
}
