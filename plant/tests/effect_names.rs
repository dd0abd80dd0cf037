//! The facts about an effect stand in its own file: nowhere else is its name a text of the program.

use plant::effects::CATALOGUE;
use std::fs;
use std::path::{Path, PathBuf};

/// Collects the Rust files of the library and the crates around it, without tests, examples and benchmarks.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir()
            && !["target", "tests", "examples", "benches", "fuzz"].contains(&name)
            && !name.starts_with('.')
        {
            sources(&path, found);
        } else if path.extension().is_some_and(|end| end == "rs") {
            found.push(path);
        }
    }
}

/// The program in a file: the lines before its tests, without comments.
fn program(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let before = text.split("#[cfg(test)]\nmod tests").next().unwrap().to_owned();
    before.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

#[test]
fn an_effects_name_is_a_text_in_its_own_file_only() {
    let mut files = Vec::new();
    sources(Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap(), &mut files);
    assert!(files.len() > 200, "{}", files.len());
    for kind in CATALOGUE {
        let name = format!("\"{}\"", kind.name);
        let room = format!("plant/src/effects/catalogue/{}.rs", kind.name.replace('-', "_"));
        let holders: Vec<_> = files.iter().filter(|path| program(path).contains(&name)).collect();
        assert!(holders.len() == 1 && holders[0].ends_with(&room), "{name} stands in {holders:?}");
    }
}
