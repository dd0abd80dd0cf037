//! Tests that cannot run here, and cases that heavy tests leave to `scripts/dev thorough`: both are reported and counted.
//! Tests of all crates include this file.

use std::fs::OpenOptions;
use std::io::Write as _;

/// The file that gets a line for each skipped test and for cases that are left out. `scripts/test` sets it and counts.
const VARIABLE: &str = "HUMMINGBUS_SKIPPED";
/// If it is set, heavy tests take all of their cases. `scripts/dev thorough` sets it.
const THOROUGH: &str = "HUMMINGBUS_THOROUGH";

/// Tells that the running test, or a part of it, is skipped, and why.
pub fn skip(reason: &str) {
    report(&format!("skipped: {}: {reason}\n", test_name()));
}

/// Name of the running test.
fn test_name() -> String {
    std::thread::current().name().unwrap_or("a test").to_owned()
}

/// Writes a line to standard error and to the report.
fn report(line: &str) {
    // Not `eprintln!`, which the test runner hides.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(path) = std::env::var_os(VARIABLE) {
        let mut file = OpenOptions::new().create(true).append(true).open(&path).expect(VARIABLE);
        file.write_all(line.as_bytes()).expect(VARIABLE);
    }
}

/// True if heavy tests take all of their cases.
#[allow(dead_code, reason = "few crates have heavy tests")]
pub fn is_thorough() -> bool {
    std::env::var_os(THOROUGH).is_some_and(|value| !value.is_empty())
}

/// Reports that the running test leaves `count` of its cases to `scripts/dev thorough`; `what` names them in the plural.
#[allow(dead_code, reason = "few crates have heavy tests")]
pub fn leave(count: usize, what: &str) {
    if count > 0 {
        // `scripts/test` sums the third words.
        report(&format!("left out: {count} {what} of {}\n", test_name()));
    }
}

/// The cases that the running test takes: all if it is thorough, and elsewhere those that `is_quick`. Reports the others.
#[allow(dead_code, reason = "few crates have heavy tests")]
#[track_caller]
pub fn cases<T>(what: &str, all: impl IntoIterator<Item = T>, is_quick: impl Fn(&T) -> bool) -> Vec<T> {
    let is_thorough = is_thorough();
    let (taken, left): (Vec<T>, Vec<T>) = all.into_iter().partition(|case| is_thorough || is_quick(case));
    assert!(!taken.is_empty(), "the quick tests take none of the {what}");
    leave(left.len(), what);
    taken
}

/// The first `count` cases, or all as in [`cases`].
#[allow(dead_code, reason = "few crates have heavy tests")]
#[track_caller]
pub fn first<T>(count: usize, what: &str, all: impl IntoIterator<Item = T>) -> Vec<T> {
    let numbered = all.into_iter().enumerate();
    cases(what, numbered, |(number, _)| *number < count).into_iter().map(|(_, case)| case).collect()
}

/// `whole` if the running test is thorough. Elsewhere `quick`, which reports one case that is left out.
#[allow(dead_code, reason = "few crates have heavy tests")]
pub fn quick_or<T>(quick: T, whole: T, what: &str) -> T {
    if is_thorough() {
        return whole;
    }
    leave(1, what);
    quick
}

/// True if the running test leaves the case that follows to `scripts/dev thorough`, which is reported. `why` names the quick
/// test that flies one of its kind, or says why there is none.
#[allow(dead_code, reason = "few crates have heavy tests")]
#[must_use]
pub fn is_left(why: &str) -> bool {
    if is_thorough() {
        return false;
    }
    // As in `leave`, the third word is the number of cases.
    report(&format!("left out: 1 heavy case of {}: {why}\n", test_name()));
    true
}

/// The number of random cases that the running test draws: `quick`, or `all` if it is thorough. Reports the others.
#[allow(dead_code, reason = "few crates draw cases")]
pub fn drawn(quick: u32, all: u32) -> u32 {
    if is_thorough() {
        return all;
    }
    leave((all - quick) as usize, "drawn cases");
    quick
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
