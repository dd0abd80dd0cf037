//! `docs/faults.md` names only tests that there are.

use crate::support::repository;
use std::path::Path;

/// The sources that hold tests.
const SOURCES: [&str; 13] = [
    "tests/faults",
    "tests/runs",
    "bus/src",
    "bus/component/src",
    "bus/tests",
    "recorder/tests",
    "flights/tests",
    "identify/tests",
    "vehicles/tests",
    "vehicles/src",
    "runtime/src",
    "runtime/src/supervisor",
    "src",
];

fn sources() -> String {
    let files = SOURCES
        .iter()
        .flat_map(|folder| std::fs::read_dir(Path::new(&repository(folder))).unwrap().flatten());
    files.map(|file| std::fs::read_to_string(file.path()).unwrap_or_default()).collect()
}

#[test]
fn every_test_that_the_faults_name_exists() {
    let text = std::fs::read_to_string(repository("docs/faults.md")).unwrap();
    let sources = sources();
    let quoted = text.split('`').skip(1).step_by(2);
    // A test's name is a sentence.
    let is_test = |word: &&str| word.matches('_').count() >= 4 && !word.contains(['=', ' ', '/', '\n']);
    let tests: Vec<&str> = quoted.filter(is_test).collect();
    assert!(tests.len() > 25, "{tests:?}");
    for test in tests {
        let name = test.rsplit("::").next().unwrap();
        assert!(sources.contains(&format!("fn {name}(")), "docs/faults.md names {test}");
    }
}

#[test]
fn no_fault_of_a_table_stands_there_twice_with_two_rules() {
    let text = std::fs::read_to_string(repository("docs/faults.md")).unwrap();
    for table in text.split("\n\n") {
        let faults = table.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
        let faults: Vec<&str> = faults.filter(|fault| !fault.starts_with("the same")).collect();
        for (index, fault) in faults.iter().enumerate() {
            assert!(!faults[..index].contains(fault), "docs/faults.md has twice: {fault}");
        }
    }
}
