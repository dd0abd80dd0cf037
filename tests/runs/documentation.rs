//! The documentation names only what is there.

use crate::support::repository;

/// The words of a Markdown file that stand in backticks.
fn quoted(file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(repository(file)).unwrap();
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn every_path_that_the_architecture_names_exists() {
    let is_path = |word: &String| word.contains('/') && word.contains('.') && !word.contains([' ', '*']);
    let paths: Vec<String> = quoted("docs/architecture.md").into_iter().filter(is_path).collect();
    assert!(paths.len() > 30, "found only {paths:?}");
    for path in paths {
        assert!(std::path::Path::new(&repository(&path)).exists(), "docs/architecture.md names {path}");
    }
}

#[test]
fn every_manifest_is_named_in_the_readme() {
    let readme = std::fs::read_to_string(repository("README.md")).unwrap();
    for entry in std::fs::read_dir(repository("manifests")).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        assert!(!name.ends_with(".toml") || readme.contains(&name), "README.md does not name {name}");
    }
}
