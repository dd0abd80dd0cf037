//! pymavlink finds in a dataflash log what the crate `flights` reads of it.

use crate::{ROOT, readers};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

#[path = "../../flights/tests/support/dataflash.rs"]
mod made;

#[test]
fn pymavlink_finds_the_same_samples_and_a_wrong_one_is_noticed() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    for has_units in [true, false] {
        let log = folder.path().join("log.BIN");
        fs::write(&log, made::log(400, has_units)).unwrap();
        let output = compare(&readers, &printer(folder.path(), ""), &log);
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
        assert!(printed.contains("1200 samples of 1 logs, 0 logs with differences"), "{printed}");
    }
    // Ours, with one attitude less its sign of the first number.
    let log = folder.path().join("log.BIN");
    let output = compare(
        &readers,
        &printer(folder.path(), " | sed 's/\"values\":\\[\\[0\\./\"values\":[[0.1/'"),
        &log,
    );
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.code() == Some(1) && printed.contains("pymavlink has"), "{printed}");
}

/// A program that prints the channels of a flights file, by the example, with `more` behind it.
fn printer(folder: &Path, more: &str) -> PathBuf {
    let example = Path::new(env!("CARGO_BIN_EXE_hummingbus")).with_file_name("examples").join("log_channels");
    let script = folder.join("printer.sh");
    fs::write(&script, format!("#!/bin/sh\n'{}' \"$@\"{more}\n", example.display())).unwrap();
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o700);
    fs::set_permissions(&script, executable).unwrap();
    script
}

fn compare(readers: &Path, printer: &Path, log: &Path) -> Output {
    let mut command = Command::new(readers.join("venv/bin/python"));
    command
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .arg(Path::new(ROOT).join("tests/readers/compare_dataflash.py"));
    command.arg(printer).arg(Path::new(ROOT).join("vehicles/hummingbird.toml")).arg(log);
    command.output().unwrap()
}
