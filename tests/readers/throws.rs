//! MuJoCo, closed forms and the laws of mechanics judge drawn stacks and throws that the program flew.

use crate::skipped::quick_or;
use crate::{HUMMINGBUS, ROOT, readers};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// `THROWS=1-12` draws from these seeds instead of the first two, of which quick tests take one.
#[test]
fn drawn_stacks_and_throws_are_what_mujoco_and_mechanics_say() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let seeds = std::env::var("THROWS").unwrap_or_else(|_| quick_or("1", "1-2", "seeds").to_owned());
    let output = judge(&readers, folder.path(), &["--fly", HUMMINGBUS, "--seeds", &seeds]);
    let table = String::from_utf8_lossy(&output.stdout);
    println!("{table}");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(table.lines().count() > 20 && table.contains("MuJoCo"), "{table}");
}

#[test]
fn a_slide_that_ends_a_millimetre_aside_is_noticed() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let only = ["--seeds", "1", "--only", "slide-1"];
    let flown = judge(&readers, folder.path(), &[&["--fly", HUMMINGBUS][..], &only].concat());
    assert!(flown.status.success(), "{}", String::from_utf8_lossy(&flown.stderr));

    let motion = folder.path().join("slide-1.csv");
    let text = fs::read_to_string(&motion).unwrap();
    let column = text.lines().next().unwrap().split(',').position(|name| name == "position[0].x").unwrap();
    let (before, last) = text.trim_end().rsplit_once('\n').unwrap();
    let mut cells: Vec<_> = last.split(',').map(str::to_owned).collect();
    cells[column] = (cells[column].parse::<f64>().unwrap() + 1e-3).to_string();
    fs::write(&motion, format!("{before}\n{}\n", cells.join(","))).unwrap();
    let output = judge(&readers, folder.path(), &only);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("compare_throws.py: slide-1: slide: way"), "{message}");
}

/// Judges the cases in `folder`, with these arguments.
fn judge(readers: &Path, folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(readers.join("venv/bin/python"));
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    command.arg(Path::new(ROOT).join("tests/readers/compare_throws.py")).arg(folder);
    command.args(arguments).output().unwrap()
}
