//! A browser draws the page of an identification.

use crate::{ROOT, VEHICLE, hummingbus, look, readers, require_schemes};
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use tempfile::TempDir;

#[test]
fn a_browser_draws_residuals_and_errors_without_a_network() {
    let Some(readers) = readers() else { return };
    let found = Identified::fly();
    let seen = look(&readers, "read_identify.mjs", &[found.page.as_os_str()]);
    assert_eq!(seen["wrong"], json!([]));
    require_schemes(&seen);
    let (first, last) = (&seen["first"], &seen["last"]);
    assert!(first["verdict"].as_str().unwrap().contains("mass-error"), "{}", first["verdict"]);
    require_brief(first);
    require_tables(&first["tables"]);

    // Four channels at three horizons, each with a bar before and one after for the one flight.
    let errors = first["errors"].as_array().unwrap();
    assert_eq!(errors.len(), 4 * 3);
    assert!(
        errors.iter().all(|plot| marks(plot) == 2 && !plot["y"].as_str().unwrap().is_empty()),
        "{errors:?}"
    );
    for state in [first, last] {
        require_residuals(state);
    }
    assert_eq!(
        first["chosen"]["flight"], "late (test)",
        "a flight that nothing was fitted on is shown first"
    );
    assert_ne!(first["plots"]["residual"]["title"], last["plots"]["residual"]["title"], "another was chosen");
    assert_ne!(first["plots"]["against"]["x"], last["plots"]["against"]["x"]);
    // None that sends the data to a server.
    let buttons = json!(["Download plot as a PNG", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"]);
    assert_eq!(first["buttons"], buttons);
    assert_eq!((&first["overflow"], &last["overflow"]), (&json!(0), &json!(0)), "wider than the window");
    assert_eq!(seen["attribution"], json!(0), "the table of effects is wider than its place");

    // The same check must notice a page whose script fails.
    let text = fs::read_to_string(&found.page).unwrap();
    let falsified = found.folder.path().join("falsified.html");
    fs::write(&falsified, text.replace("zoomTogether([", "nobody([")).unwrap();
    let seen = look(&readers, "read_identify.mjs", &[falsified.as_os_str()]);
    assert!(seen["wrong"][0].as_str().unwrap().contains("nobody"), "{}", seen["wrong"]);
}

fn marks(plot: &Value) -> u64 {
    plot["marks"].as_u64().unwrap()
}

/// The page begins with what a pilot reads.
fn require_brief(seen: &Value) {
    assert!(
        seen["answer"].as_str().unwrap().starts_with("The declared vehicle file lacks "),
        "{}",
        seen["answer"]
    );
    let sentences = |part: &str| -> Vec<&str> {
        seen["brief"][part].as_array().unwrap().iter().map(|sentence| sentence.as_str().unwrap()).collect()
    };
    assert!(
        sentences("missing").iter().any(|line| line.starts_with("mass-error: ") && line.contains("error ")),
        "{seen}"
    );
    assert!(
        sentences("certainty")
            .iter()
            .any(|line| line.starts_with("mass-error: ") && line.contains("the chance that it makes")),
        "{seen}"
    );
    let changes = sentences("changes");
    assert!(
        changes.len() == 4
            && changes[0].starts_with("attitude: ")
            && changes[0].contains(" deg with the new file, ")
            && changes[3].starts_with("Validated in flights with "),
        "{changes:?}"
    );
    assert!(sentences("next").iter().any(|line| line.contains("hummingbus validate")), "{seen}");
}

fn require_tables(tables: &Value) {
    let rows = |table: &str| tables[table].as_u64().unwrap();
    // A row of headings, then two flights; channels and horizons; two models of three equations.
    assert_eq!((rows("flights"), rows("held-out"), rows("fitted")), (1 + 2, 1 + 4 * 3, 1 + 4 * 3));
    assert_eq!(rows("whiteness"), 1 + 2 * 3);
    assert!(rows("effects") > 5 && rows("noise") > 3, "{tables}");
}

/// Two models everywhere, the measured beside them, and units on the axes.
fn require_residuals(state: &Value) {
    let plot = |id: &str| &state["plots"][id];
    for (id, least) in
        [("residual", 2), ("sides", 3), ("against", 100), ("agreement", 100), ("auto", 20), ("cross", 40)]
    {
        assert!(marks(plot(id)) >= least, "{id}: {}", plot(id));
        assert!(!plot(id)["x"].as_str().unwrap().is_empty() && !plot(id)["y"].as_str().unwrap().is_empty());
    }
    assert_eq!(plot("residual")["x"], "time in s");
    assert!(plot("agreement")["y"].as_str().unwrap().starts_with("measured in "), "{}", plot("agreement"));
}

/// The page of a flight of the Hummingbird, held against one that is declared a tenth heavier.
struct Identified {
    folder: TempDir,
    page: PathBuf,
}

impl Identified {
    fn fly() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let manifest = format!("{ROOT}/manifests/identify/excite.toml");
        let mut run = Command::new(crate::HUMMINGBUS);
        run.args(["run", &manifest, "--set", "run.duration_s=18.0", "--record"]).arg(file("flown.mcap"));
        // Whether it passes does not matter: it is cut short.
        assert!(matches!(run.output().unwrap().status.code(), Some(0 | 1)));
        fs::write(file("heavy.toml"), heavy()).unwrap();
        fs::write(file("flights.toml"), FLIGHTS).unwrap();
        let (flights, out) = (file("flights.toml"), file("out"));
        let args = ["identify".as_ref(), flights.as_os_str(), "--out".as_ref(), out.as_os_str()];
        hummingbus(&[&args[..], &["--no-bus".as_ref(), "--json".as_ref()]].concat());
        Self { page: out.join("report.html"), folder }
    }
}

fn heavy() -> String {
    format!(
        "base = {VEHICLE:?}\nname = \"heavy\"\n[[effects]]\nname = \"mass-error\"\n\
         error = {{ value = 0.1, unit = \"1\", source = \"a test\", uncertainty = \"exact\" }}\n"
    )
}

const FLIGHTS: &str = r#"
vehicle = "heavy.toml"
[channels]
command = { topic = "/controller/command" }
position = { topic = "/mocap/mocap" }
attitude = { topic = "/mocap/mocap" }
angular_velocity = { topic = "/imu/imu" }
[[flight]]
name = "early"
file = "flown.mcap"
role = "fit"
from_s = 1.0
to_s = 10.0
[[flight]]
name = "late"
file = "flown.mcap"
role = "test"
from_s = 10.0
"#;
