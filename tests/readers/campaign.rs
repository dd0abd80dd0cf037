//! pandas, polars and DuckDB read the flights of a campaign, and a browser draws its page.

use crate::{ROOT, hummingbus, look, readers, require_schemes};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Flights that pass, that fail, and one that is refused.
const CAMPAIGN: &str = r#"
sampling = "grid"
set = ["run.duration_s=2.1"]

[[vary]]
name = "mass in kg, \"as flown\""
key = "process.plant.vehicle.body.mass"
values = [0.48, 0.9, -1.0]

[[vary]]
key = "run.seed"
integers = [1, 2]
"#;

#[test]
fn pandas_polars_and_duckdb_find_the_rows_of_a_campaign() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let campaign = folder.path().join("c.toml");
    let manifest = Path::new(ROOT).join("manifests/hover.toml");
    fs::write(&campaign, format!("manifest = {:?}\n{CAMPAIGN}", manifest.to_str().unwrap())).unwrap();
    let out = folder.path().join("out");
    hummingbus(&["campaign".as_ref(), campaign.as_os_str(), "--out".as_ref(), out.as_os_str()]);

    let output = read(&readers, &out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), "6");

    // The same comparison must notice a value that differs by one bit.
    let rows = fs::read_to_string(out.join("rows.jsonl")).unwrap();
    let falsified =
        rows.replacen("\"flight\":1,\"drawn\":[0.48,", "\"flight\":1,\"drawn\":[0.48000000000000004,", 1);
    assert_ne!(rows, falsified);
    fs::write(out.join("rows.jsonl"), falsified).unwrap();
    let output = read(&readers, &out);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(1) && message.starts_with("read_campaign.py: pandas has"),
        "{message}"
    );
}

#[test]
fn a_browser_draws_the_page_with_units_and_counts_within_its_window() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    // The commands of the worst flights are as long as the path.
    let inner = folder.path().join("a-folder-with-a-name-that-takes-a-line-by-itself/".repeat(3));
    fs::create_dir_all(&inner).unwrap();
    let (campaign, out) = (inner.join("c.toml"), inner.join("out"));
    let manifest = Path::new(ROOT).join("manifests/hover.toml");
    fs::write(&campaign, format!("manifest = {:?}\n{CAMPAIGN}", manifest.to_str().unwrap())).unwrap();
    hummingbus(&["campaign".as_ref(), campaign.as_os_str(), "--out".as_ref(), out.as_os_str()]);

    let seen = look(&readers, "read_campaign.mjs", &[out.join("report.html").as_os_str()]);
    assert_eq!((&seen["wrong"], &seen["overflow"]), (&json!([]), &json!(0)), "{seen}");
    require_schemes(&seen);
    let cell = |table: &str, row: usize, column: usize| {
        seen["tables"][table][row][column]
            .as_str()
            .unwrap_or_else(|| panic!("{table} {row} {column}: {seen}"))
    };
    assert_eq!((cell("figures", 0, 7), cell("figures", 1, 7)), ("unit", "m"));
    let failures = seen["tables"]["failures"].as_array().unwrap();
    let total = failures.iter().position(|row| row[1] == "without figures, for these reasons:").unwrap();
    assert_eq!((cell("failures", total, 0), cell("failures", total + 1, 0)), ("2", "2"));
    assert!(cell("failures", total + 1, 1).starts_with("such as flight "), "{seen}");
    for axis in ["histogram", "scatter"] {
        assert!(seen["axes"][axis].as_str().unwrap().ends_with(" in m"), "{seen}");
    }
    // The whole name of the figure, in lines that fit.
    let title = seen["axes"]["scatter"].as_str().unwrap();
    assert!(!title.contains('…') && seen["tooHigh"] == json!(0), "{seen}");
}

/// Two kinds of the controller.
const KINDS: &str = r#"
sampling = "grid"
set = ["run.duration_s=3"]

[[vary]]
name = "controller"
key = "process.controller.kind"
values = ["lqr", "geometric"]

[[vary]]
key = "run.seed"
integers = [1, 2]
"#;

/// Requires that a number of the page is `expected`, to the page's four digits.
fn require_shown(shown: &str, expected: f64) {
    let number: f64 = shown.replace('−', "-").parse().unwrap_or_else(|_| panic!("{shown} is not a number"));
    assert!((number - expected).abs() <= 1e-3 * expected.abs(), "{shown} is not {expected}");
}

#[test]
fn a_browser_draws_the_whole_page_of_a_campaign_with_choices() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (campaign, out) = (folder.path().join("c.toml"), folder.path().join("out"));
    let manifest = Path::new(ROOT).join("manifests/figure-eight.toml");
    fs::write(&campaign, format!("manifest = {:?}\n{KINDS}", manifest.to_str().unwrap())).unwrap();
    hummingbus(&["campaign".as_ref(), campaign.as_os_str(), "--out".as_ref(), out.as_os_str()]);

    let seen = look(&readers, "read_campaign.mjs", &[out.join("report.html").as_os_str()]);
    assert_eq!(seen["wrong"], json!([]), "{seen}");
    let report: Value = serde_json::from_str(&fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    let choices = report["choices"].as_array().unwrap();
    assert_eq!(choices.len(), 2, "{report}");
    let (summary, version) = (seen["summary"].as_str().unwrap(), report["version"].as_str().unwrap());
    assert!(summary.contains(&format!("Flown by hummingbus {version}.")), "{summary}");
    let rates = seen["tables"]["rates"].as_array().unwrap();
    assert_eq!((rates.len(), &rates[1][0], &rates[1][2]), (3, &json!("seed"), &json!("1.000")), "{seen}");
    for (row, choice) in (1_usize..).zip(choices) {
        let cells = seen["tables"]["choices"][row].as_array().unwrap();
        assert_eq!(cells[1], choice["choice"], "{seen}");
        let medians = choice["medians"].as_array().unwrap();
        // The first seven columns have the flights and the pass rate.
        assert_eq!(cells.len(), 7 + medians.len(), "{seen}");
        for (cell, median) in cells[7..].iter().zip(medians) {
            require_shown(cell.as_str().unwrap(), median.as_f64().unwrap());
        }
    }
}

fn read(readers: &Path, folder: &Path) -> Output {
    let mut command = Command::new(readers.join("venv/bin/python"));
    command.env("PYTHONDONTWRITEBYTECODE", "1").arg(Path::new(ROOT).join("tests/readers/read_campaign.py"));
    command.arg(folder).output().unwrap()
}
