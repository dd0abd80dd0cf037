//! pandas, polars and DuckDB read the tables of an exported recording.

use crate::{ROOT, hummingbus, readers};
use std::path::Path;
use std::process::{Command, Output};

#[test]
fn pandas_polars_and_duckdb_find_every_value_of_a_recording() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let manifest = Path::new(ROOT).join("manifests/hover.toml");
    let recording = folder.path().join("a.mcap");
    fly(&manifest, &recording, "run.duration_s=0.2");
    let export = |recording: &Path, more: &[&str]| {
        let mut arguments = vec!["export".as_ref(), recording.as_os_str()];
        arguments.extend(more.iter().map(AsRef::<std::ffi::OsStr>::as_ref));
        hummingbus(&arguments);
    };
    export(&recording, &[]);
    export(&recording, &["--csv"]);
    let output = read(&readers, &recording, &folder.path().join("a"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let compared: usize = String::from_utf8_lossy(&output.stdout).trim().parse().unwrap();
    assert!(compared > 20_000, "only {compared} values");

    // The same comparison must notice the tables of another flight.
    let other = folder.path().join("b.mcap");
    fly(&manifest, &other, "run.seed=2");
    let output = read(&readers, &other, &folder.path().join("a"));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && message.starts_with("read_export.py: pandas"), "{message}");
}

fn fly(manifest: &Path, recording: &Path, setting: &str) {
    let mut command = Command::new(crate::HUMMINGBUS);
    command.arg("run").arg(manifest).arg("--record").arg(recording).args(["--in-process", "--set", setting]);
    command.args(["--set", "run.duration_s=0.2"]);
    // Its conditions lie behind its end.
    assert_eq!(command.output().unwrap().status.code(), Some(1));
}

fn read(readers: &Path, recording: &Path, folder: &Path) -> Output {
    let mut command = Command::new(readers.join("venv/bin/python"));
    command.env("PYTHONDONTWRITEBYTECODE", "1").arg(Path::new(ROOT).join("tests/readers/read_export.py"));
    command.args([recording, folder]).output().unwrap()
}
