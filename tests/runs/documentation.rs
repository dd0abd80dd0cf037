//! The documentation names only what is there.

use crate::support::repository;
use std::collections::BTreeSet;

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

/// The names of the workspace's libraries that the crate in `folder` depends on.
fn known_to(folder: &str) -> BTreeSet<String> {
    let text = std::fs::read_to_string(repository(&format!("{folder}Cargo.toml"))).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let root: toml::Table = std::fs::read_to_string(repository("Cargo.toml")).unwrap().parse().unwrap();
    let is_ours = |name: &String| root["workspace"]["dependencies"][name].get("path").is_some();
    let known = manifest.get("dependencies").and_then(toml::Value::as_table).cloned().unwrap_or_default();
    known.keys().filter(|name| is_ours(name)).cloned().collect()
}

#[test]
fn the_architecture_tells_every_crate_and_whom_it_knows() {
    let text = std::fs::read_to_string(repository("docs/architecture.md")).unwrap();
    let rows =
        text.lines().filter_map(|line| line.strip_prefix("| `")?.strip_suffix(" |")?.split_once("/` |"));
    let mut told = BTreeSet::new();
    for (folder, rest) in rows {
        let known = rest.rsplit(" | ").next().unwrap();
        let known: BTreeSet<String> =
            known.split(", ").filter(|name| *name != "–").map(str::to_owned).collect();
        let crate_folder = if folder == "src" { String::new() } else { format!("{folder}/") };
        assert_eq!(known, known_to(&crate_folder), "docs/architecture.md, {folder}");
        told.insert(folder.to_owned());
    }
    let root: toml::Table = std::fs::read_to_string(repository("Cargo.toml")).unwrap().parse().unwrap();
    let members = root["workspace"]["members"].as_array().unwrap().iter();
    let members = members.map(|member| member.as_str().unwrap().to_owned());
    assert_eq!(told, members.chain(["src".to_owned()]).collect());
}

#[test]
fn every_manifest_is_named_in_the_readme() {
    let readme = std::fs::read_to_string(repository("README.md")).unwrap();
    for entry in std::fs::read_dir(repository("manifests")).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        assert!(!name.ends_with(".toml") || readme.contains(&name), "README.md does not name {name}");
    }
}
