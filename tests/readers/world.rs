//! MuJoCo and closed forms move a vehicle as the plant does: in free flight, in contacts, in the rigs.

use crate::{ROOT, readers};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

#[path = "../../examples/world_cases.rs"]
#[allow(dead_code, reason = "its main is not run here")]
mod world_cases;

#[test]
fn mujoco_and_closed_forms_agree_and_a_wrong_motion_is_noticed() {
    let Some(readers) = readers() else { return };
    let mut told = world_cases::told();
    let output = compare(&readers, &told, &[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.lines().count() > 20 && table.contains("| MuJoCo |"), "{table}");

    // A centimetre more of a slide of 92 cm.
    let slide = told["cases"]["slide"].as_array_mut().unwrap();
    let end = &mut slide.last_mut().unwrap()[1];
    *end = (end.as_f64().unwrap() + 0.01).into();
    let output = compare(&readers, &told, &["--only", "slide"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("compare_world.py: slide at 3 m/s"), "{message}");
}

fn compare(readers: &Path, told: &Value, more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let cases = folder.path().join("cases.json");
    fs::write(&cases, told.to_string()).unwrap();
    let mut command = Command::new(readers.join("venv/bin/python"));
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    command.arg(Path::new(ROOT).join("tests/readers/compare_world.py")).arg(&cases);
    command.args(more).output().unwrap()
}
