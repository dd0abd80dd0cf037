//! A browser draws the page of a recording: curves over time, and the paths in space with the scene.

use crate::skipped::is_left;
use crate::{Flight, ROOT, hummingbus, laps, look, reader_of_a_page, readers, require_schemes};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// Titles of the hover's plots, with what their vertical axes show and their lines: flown, estimated, asked.
const AXES: [(&str, &str, [usize; 3]); 6] = [
    ("Attitude", "angle [deg]", [3, 3, 3]),
    ("Body rates", "angular velocity in the body [deg/s]", [3, 3, 0]),
    ("Velocity", "velocity in the world [m/s]", [3, 3, 0]),
    ("Position", "position in the world [m]", [3, 3, 1]),
    ("Motor command", "command [count]", [4, 0, 0]),
    ("Rotor speed", "rotor speed [rpm]", [4, 0, 0]),
];

#[test]
fn a_browser_draws_every_curve_of_a_flight() {
    let Some(readers) = readers() else { return };
    let flight = Flight::shared();
    // Pictures in space, which others look at, would take a third of the time.
    let args = [page_of(&flight.recording).into_os_string(), "no-webgl".into()];
    let seen = look(&readers, "read_plot.mjs", &args.each_ref().map(|word| word.as_os_str()));
    assert_eq!(seen["wrong"], json!([]));
    assert_eq!(seen["overflow"], 0, "the page is wider than the window");
    assert_eq!(seen["axes"].as_array().unwrap().len(), AXES.len());
    for (axes, (title, label, lines)) in seen["axes"].as_array().unwrap().iter().zip(AXES) {
        require_axes(axes, title, label, lines);
    }
    require_zoom(&seen);
    require_schemes(&seen);
    assert_eq!(seen["range"], seen["zoomed"][0], "a change of the scheme zooms out");
    assert_eq!(seen["corners"], json!([]), "labels of both axes lie over each other");
}

fn require_axes(axes: &Value, title: &str, label: &str, [flown, estimated, asked]: [usize; 3]) {
    assert_eq!(
        (&axes["title"], &axes["y"], &axes["x"]),
        (&json!(title), &json!(label), &json!("simulated time [s]"))
    );
    let lines = axes["lines"].as_array().unwrap();
    assert_eq!(lines.len(), flown + estimated + asked, "{title}: {axes}");
    assert!(
        lines.iter().all(|line| (1000..=4000).contains(&line["points"].as_u64().unwrap())),
        "{title}: {axes}"
    );
    // What the page says, and what the browser made of it.
    let dashed = lines.iter().filter(|line| line["dash"] == "dash");
    assert!(dashed.clone().all(|line| line["name"].as_str().unwrap().ends_with(" set point")), "{axes}");
    assert_eq!(dashed.count(), asked, "{title}");
    assert_eq!(
        (axes["drawn"].as_u64(), axes["dashed"].as_u64()),
        (Some(lines.len() as u64), Some(asked as u64)),
        "{title}"
    );
    // Lines of a kind that all have the colours of flown ones share a row.
    let names = lines.iter().map(|line| line["name"].as_str().unwrap());
    let is_shared = |name: &str| {
        (estimated > 1 && name.ends_with(" estimate")) || (asked > 1 && name.ends_with(" set point"))
    };
    let shared = [("estimate", estimated), ("set point", asked)].into_iter().filter(|(_, count)| *count > 1);
    let rows: Vec<&str> = names.filter(|name| !is_shared(name)).chain(shared.map(|(name, _)| name)).collect();
    assert_eq!(axes["legend"], json!(rows), "{title}: the legend");
    // None that sends the data to a server.
    let buttons = json!(["Download plot as a PNG", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"]);
    assert_eq!(axes["buttons"], buttons);
}

fn require_space(seen: &Value) {
    let traces: Vec<&str> =
        seen["space"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    for expected in [
        "mesh3d ground",
        "mesh3d wall +x",
        "mesh3d wall -y",
        "scatter3d h1",
        "scatter3d h2 set point",
        "scatter3d AscTec Hummingbird",
    ] {
        assert!(traces.contains(&expected), "{expected} is missing: {traces:?}");
    }
    let colours: Vec<[u64; 3]> = serde_json::from_value(seen["colours"].clone()).unwrap();
    let is_there = |is: fn([u64; 3]) -> bool| colours.iter().any(|colour| is(*colour));
    // Blue is the path; grey-green is the ground.
    assert!(is_there(|[r, g, b]| b > 130 && r < 60 && g < 160), "no path is seen: {colours:?}");
    assert!(is_there(|[r, g, b]| g > r && g > b && g < 250), "no ground is seen: {colours:?}");
    require_views(seen);
}

fn require_views(seen: &Value) {
    let views = seen["views"].as_array().unwrap();
    let labels: Vec<_> = views.iter().map(|view| (&view["x"], &view["y"])).collect();
    assert_eq!(labels, [(&json!("x [m]"), &json!("y [m]")), (&json!("x [m]"), &json!("z [m]"))]);
    for view in views {
        // Four walls, and two vehicles with what was asked of them: a path and its start each, and their airframes.
        assert_eq!(view["lines"].as_array().unwrap().len(), 4 + 2 * 4 + 2, "{view}");
        assert!(view["drawn"].as_u64().unwrap() >= 14 && view["dashed"] == 2, "{view}");
        // A metre is as long on both axes.
        let metre: [f64; 2] = serde_json::from_value(view["metre"].clone()).unwrap();
        assert!((metre[0] / metre[1] - 1.0).abs() < 1e-3, "{metre:?}");
    }
}

/// A part of the first plot was marked with the mouse: all others show the same time.
fn require_zoom(seen: &Value) {
    let zoomed: Vec<[f64; 2]> = serde_json::from_value(seen["zoomed"].clone()).unwrap();
    let whole: [f64; 2] = serde_json::from_value(seen["axes"][0]["range"].clone()).unwrap();
    let part = |time: f64| (time - whole[0]) / (whole[1] - whole[0]);
    assert!(
        (part(zoomed[0][0]) - 0.25).abs() < 0.02 && (part(zoomed[0][1]) - 0.5).abs() < 0.02,
        "{zoomed:?}"
    );
    assert!(zoomed.iter().all(|range| range == &zoomed[0]), "{zoomed:?}");
}

#[test]
fn a_browser_draws_the_room_and_the_paths_in_it_and_the_vehicle_that_is_chosen() {
    let Some(readers) = readers() else { return };
    let flight = Laps::of(&["h1", "h2"]);
    let seen = look(&readers, "read_plot.mjs", &[flight.page.as_os_str(), "needs-webgl".as_ref()]);
    assert_eq!((&seen["wrong"], &seen["vehicles"]), (&json!([]), &json!(["h1", "h2"])));
    require_space(&seen);
    // The second starts a quarter of a lap ahead.
    let x = |seen: &Value| seen["axes"][3]["lines"][0]["y"][0].as_f64().unwrap().round();
    assert_eq!((x(&seen), x(&seen["second"])), (2.0, 0.0));
}

#[test]
fn a_browser_that_lacks_what_a_reader_needs_is_named_with_it() {
    let Some(readers) = readers() else { return };
    let flight = Laps::of(&["h1"]);
    let args = [flight.page.as_os_str(), "needs-webgl".as_ref(), "no-webgl".as_ref()];
    let output = reader_of_a_page(&readers, "read_plot.mjs", &args);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{message}");
    for word in ["needs WebGL 2", "Chrome", "started as /", "chrome://gpu"] {
        assert!(message.contains(word), "`{word}` is missing: {message}");
    }
}

#[test]
fn a_browser_without_webgl_says_so_and_draws_the_paths_from_above_and_from_the_side() {
    let Some(readers) = readers() else { return };
    let flight = Laps::of(&["h1", "h2"]);
    let seen = look(&readers, "read_plot.mjs", &[flight.page.as_os_str(), "no-webgl".as_ref()]);
    assert_eq!((&seen["wrong"], &seen["space"]), (&json!([]), &Value::Null));
    assert!(seen["note"].as_str().unwrap().contains("no WebGL"), "{}", seen["note"]);
    require_views(&seen);
}

#[test]
fn the_view_for_rerun_holds_the_scene_the_path_and_the_vehicle() {
    if is_left("`the_view_for_rerun_holds_the_meshes_of_the_scene` has a view") {
        return;
    }
    let Some(readers) = readers() else { return };
    let flight = Laps::of(&["h1", "h2"]);
    let view = flight.page.with_extension("rrd");
    let script = Path::new(ROOT).join("scripts/rerun_view.py");
    let recording = flight.page.with_extension("mcap");
    python(&readers, &[script.as_os_str(), recording.as_os_str(), view.as_os_str(), "h1".as_ref()]);
    let rerun = ["-m", "rerun", "rrd"].map(OsStr::new);
    python(&readers, &[&rerun[..], &["verify".as_ref(), view.as_os_str()]].concat());
    let stats = python(&readers, &[&rerun[..], &["stats".as_ref(), view.as_os_str()]].concat());
    let part = |vehicle: &str, part: &str| format!("/airframe/{vehicle}/AscTec\\ Hummingbird/{part}: ");
    let airframes =
        ["h1", "h2"].map(|vehicle| part(vehicle, &format!("visual_geometries/{vehicle}\\/body/hub")));
    let plain = ["/scene: ", "/path/h1: ", "/path/h2: ", "/body/h1: ", "/motion/h2: ", "/flown/attitude: "];
    let settings = ["overrides/h1/plant/state/visualizers: "];
    for entity in plain.iter().chain(&settings).copied().chain(airframes.iter().map(String::as_str)) {
        assert!(stats.contains(entity), "{entity} is missing:\n{stats}");
    }
}

#[test]
fn the_view_for_rerun_holds_the_meshes_of_the_scene() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (recording, view) = (folder.path().join("office.mcap"), folder.path().join("office.rrd"));
    let mut run = Command::new(crate::HUMMINGBUS);
    run.args(["run", &format!("{ROOT}/manifests/office.toml"), "--set", "run.duration_s=0.2", "--record"]);
    // Whether it passes does not matter: it is cut short.
    assert!(matches!(run.arg(&recording).output().unwrap().status.code(), Some(0 | 1)));
    let script = Path::new(ROOT).join("scripts/rerun_view.py");
    python(&readers, &[script.as_os_str(), recording.as_os_str(), view.as_os_str()]);
    let stats = ["-m", "rerun", "rrd", "stats"].map(OsStr::new);
    let stats = python(&readers, &[&stats[..], &[view.as_os_str()]].concat());
    for entity in [
        "/scene/desk: ",
        "/scene/lamp: ",
        "/scene/shelf\\ in\\ the\\ room: ",
        "/visual_geometries/hb_body/nose: ",
    ] {
        assert!(stats.contains(entity), "{entity} is missing:\n{stats}");
    }
}

/// Runs Python with the packages of the readers; what it prints.
fn python(readers: &Path, args: &[&OsStr]) -> String {
    let mut command = Command::new(readers.join("venv/bin/python"));
    // Rerun sends usage data, except where CI is set; strictly, what it cannot log is an error.
    command.args(args).env("CI", "true").env("RERUN_STRICT", "1").env("PYTHONDONTWRITEBYTECODE", "1");
    command.env("HUMMINGBUS", crate::HUMMINGBUS);
    let Output { status, stdout, stderr } = command.output().unwrap();
    assert!(status.success(), "{args:?}: {}", String::from_utf8_lossy(&stderr));
    String::from_utf8_lossy(&stdout).into_owned()
}

#[test]
fn every_path_and_panel_of_the_layout_for_foxglove_is_there() {
    let text = fs::read_to_string(Path::new(ROOT).join("docs/foxglove-layout.json")).unwrap();
    let layout: Value = serde_json::from_str(&text).unwrap();
    let flight = Flight::shared();
    let lines = fs::read_to_string(&flight.lines).unwrap();
    let messages: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let first = |topic: &str| messages.iter().find(|message| message["topic"] == topic);
    let panels = layout["configById"].as_object().unwrap();
    let paths = panels.values().flat_map(|panel| panel["paths"].as_array().into_iter().flatten());
    for path in paths.clone().map(|path| path["value"].as_str().unwrap()) {
        let (topic, field) = path.split_once('.').unwrap();
        let field = field.split(".@").next().unwrap();
        let message = first(topic).unwrap_or_else(|| panic!("{path}: there is no such topic"));
        // The function `rpy` makes angles of a quaternion.
        let is_quaternion = path.contains(".@rpy.") && message["fields"][format!("{field}.w")].is_number();
        assert!(is_quaternion || message["fields"][field].is_number(), "{path}: there is no such field");
    }
    assert!(paths.count() > 10 && first("/plant/pose").is_some() && first("/tf").is_some());
    assert_eq!(leaves(&layout["layout"]), panels.keys().map(String::as_str).collect::<BTreeSet<_>>());
}

/// The panels that a layout places.
fn leaves(place: &Value) -> BTreeSet<&str> {
    match place.as_str() {
        Some(panel) => BTreeSet::from([panel]),
        None => ["first", "second"].into_iter().flat_map(|side| leaves(&place[side])).collect(),
    }
}

/// The page of a recording in which vehicles fly laps in a room.
struct Laps {
    page: PathBuf,
    _folder: TempDir,
}

impl Laps {
    fn of(vehicles: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("laps.mcap");
        let room = fs::read_to_string(Path::new(ROOT).join("scenes/room.toml")).unwrap();
        laps::record(&recording, vehicles, Some(&room));
        Self { page: page_of(&recording), _folder: folder }
    }
}

/// Plots a recording; the page lies beside it.
fn page_of(recording: &Path) -> PathBuf {
    hummingbus(&["plot".as_ref(), recording.as_os_str()]);
    recording.with_extension("html")
}
