//! Perfetto and a browser find in a profile's files what was written into them.

use crate::{hummingbus, look, manifest_text, readers, require_schemes};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// The nodes of the hover.
const NODES: usize = 7;

#[test]
fn perfetto_finds_every_slice_and_every_hop() {
    let Some(readers) = readers() else { return };
    let flight = Profiled::fly();
    let found = look(&readers, "read_trace.mjs", &[flight.trace.as_os_str()]);
    let written = fs::read_to_string(&flight.trace).unwrap();
    require_trace(&written, &found).unwrap_or_else(|difference| panic!("{difference}"));

    // The same check must notice a slice that is missing, and a hop that leads nowhere.
    for (mark, what) in [("\"name\":\"compute\"", "slices"), ("\"ph\":\"f\"", "hops")] {
        let mut lines: Vec<_> = written.lines().collect();
        let first = lines.iter().position(|line| line.contains(mark)).unwrap();
        lines.remove(first);
        let difference = require_trace(&lines.join("\n"), &found).unwrap_err();
        assert!(difference.contains(what), "{difference}");
    }
}

/// Compares what Perfetto found with the text of the trace.
fn require_trace(written: &str, found: &Value) -> Result<(), String> {
    if found["errors"] != json!([]) || found["wrong"] != json!([]) {
        return Err(format!("Perfetto complains: {} {}", found["errors"], found["wrong"]));
    }
    let trace: Value = serde_json::from_str(written).map_err(|error| error.to_string())?;
    let events = trace["traceEvents"].as_array().ok_or("no events")?;
    let (expected, slices) = (written_slices(events), found_slices(found));
    if expected.len() != 4 * NODES || expected != slices {
        return Err(format!("slices: {expected:?} were written, {slices:?} found"));
    }
    let ends = events.iter().filter(|event| event["ph"] == "f").count();
    // From within a sender's slice `publish` to the start of the reader's tick, whose first part is `compute`.
    let hops = json!([{ "from_slice": "publish", "to_slice": "compute", "count": ends }]);
    if found["flows"] == hops {
        Ok(())
    } else {
        Err(format!("hops: {hops} were written, {} found", found["flows"]))
    }
}

/// Number and total length in ns of the slices by process and name.
type Slices = BTreeMap<(String, String), (u64, u64)>;

fn written_slices(events: &[Value]) -> Slices {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let named = events.iter().filter(|event| event["name"] == "process_name");
    let names: BTreeMap<_, _> =
        named.map(|event| (event["pid"].as_u64(), text(&event["args"]["name"]))).collect();
    let mut slices = Slices::new();
    for event in events.iter().filter(|event| event["ph"] == "X") {
        let name = text(&event["name"]);
        if ["wait", "wake-up", "compute", "publish"].contains(&name.as_str()) {
            let (count, ns) = slices.entry((names[&event["pid"].as_u64()].clone(), name)).or_default();
            *count += 1;
            *ns += (event["dur"].as_f64().unwrap_or(0.0) * 1e3).round() as u64;
        }
    }
    slices
}

fn found_slices(found: &Value) -> Slices {
    let rows = found["slices"].as_array().into_iter().flatten();
    let slice = |row: &Value| {
        let key = (row["process"].as_str()?.to_owned(), row["name"].as_str()?.to_owned());
        Some((key, (row["count"].as_u64()?, row["ns"].as_u64()?)))
    };
    rows.filter_map(slice).collect()
}

#[test]
fn a_browser_draws_the_page_without_a_network() {
    let Some(readers) = readers() else { return };
    let flight = Profiled::fly();
    let seen = look(&readers, "read_page.mjs", &[flight.page.as_os_str()]);
    assert_eq!(seen["wrong"], json!([]));
    require_schemes(&seen);
    let (first, last) = (&seen["first"], &seen["last"]);
    // The slowest ticks, the course of the run, each node's histogram, and the jitter.
    let marks: Vec<_> =
        first["plots"].as_array().unwrap().iter().map(|marks| marks.as_u64().unwrap()).collect();
    assert_eq!(marks.len(), NODES + 3);
    assert!(marks.iter().all(|&marks| marks > 0), "a plot is empty: {marks:?}");
    let rows = |table: &str| first["tables"][table].as_u64().unwrap();
    assert_eq!((rows("nodes"), rows("age"), rows("jitter-table")), (1 + 4 * NODES as u64, 1 + 2 * 5, 2));
    assert!(rows("path") > 5 && rows("transport") > 4 && rows("stretches") > 2, "{first}");
    assert_ne!(first["timeline"], last["timeline"], "another tick was chosen");
    // None that sends the data to a server.
    let buttons = json!(["Download plot as a PNG", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"]);
    assert_eq!(first["buttons"], buttons);
    assert_eq!(first["overflow"], 0, "the page is wider than the window");
    assert_eq!(seen["narrow"], json!({ "cut": [], "overflow": 0 }), "on a phone");

    // The same check must notice a page that needs the network.
    let text = fs::read_to_string(&flight.page).unwrap();
    let falsified = flight.folder.path().join("falsified.html");
    fs::write(&falsified, text.replace("<h1", "<img src=\"http://plots.invalid/a.png\"><h1")).unwrap();
    let seen = look(&readers, "read_page.mjs", &[falsified.as_os_str()]);
    assert!(seen["wrong"][0].as_str().unwrap().contains("plots.invalid"), "{seen}");
}

/// The files of a profiled, paced hover.
struct Profiled {
    folder: TempDir,
    trace: PathBuf,
    page: PathBuf,
}

impl Profiled {
    fn fly() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let (manifest, trace, page) = (file("hover.toml"), file("trace.json"), file("page.html"));
        fs::write(&manifest, manifest_text()).unwrap();
        let args = ["profile".as_ref(), manifest.as_os_str(), "--pace".as_ref(), "4".as_ref()];
        let files = ["--trace".as_ref(), trace.as_os_str(), "--html".as_ref(), page.as_os_str()];
        hummingbus(&[args, files].concat());
        Self { folder, trace, page }
    }
}
