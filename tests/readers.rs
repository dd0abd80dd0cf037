//! Readers that others wrote find in a recording exactly what hummingbus's own reader finds.
//!
//! Each of `tests/readers/read_*` decodes every topic and ends at the first difference. `scripts/test`
//! installs what they need and says where in `HUMMINGBUS_READERS`.

#[path = "readers/campaign.rs"]
mod campaign;
#[path = "readers/dataflash.rs"]
mod dataflash;
#[path = "readers/export.rs"]
mod export;
#[path = "readers/identify.rs"]
mod identify;
#[path = "runs/laps.rs"]
#[allow(dead_code, reason = "shared with tests/runs")]
mod laps;
#[path = "readers/launched.rs"]
mod launched;
#[path = "readers/live.rs"]
mod live;
#[path = "readers/plot.rs"]
mod plot;
#[path = "readers/profile.rs"]
mod profile;
#[path = "runs/skipped.rs"]
mod skipped;
#[path = "readers/steered.rs"]
mod steered;
#[path = "readers/throws.rs"]
mod throws;
#[path = "readers/urdf.rs"]
mod urdf;
#[path = "readers/view.rs"]
mod view;
#[path = "readers/world.rs"]
mod world;

use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Arc, Mutex, Weak};
use tempfile::TempDir;

const HUMMINGBUS: &str = env!("CARGO_BIN_EXE_hummingbus");
const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// Optional outputs of standard messages.
const STANDARD: [&str; 9] = [
    "plant.odometry",
    "plant.actuators",
    "imu.data_raw",
    "range.front",
    "range.back",
    "range.left",
    "range.right",
    "range.down",
    "range.scan",
];
const VEHICLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/vehicles/hummingbird.toml");

#[test]
fn mcap_finds_a_sound_container() {
    check("read_container.py");
}

#[test]
fn mcap_ros2_support_decodes_the_same_values() {
    check("read_mcap_ros2.py");
}

#[test]
fn rosbags_decodes_the_same_values() {
    check("read_rosbags.py");
}

/// Their frames have names of other lengths, which moves what stands behind them.
#[test]
fn others_decode_the_frames_and_standard_messages_of_ten_vehicles() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (recording, lines) = (folder.path().join("ten.mcap"), folder.path().join("ten.jsonl"));
    let manifest = Path::new(ROOT).join("manifests/ten-vehicles.toml");
    let tf = r#"set.wall-follower.process.plant.outputs.tf={ topic = "/tf", every_ticks = 10 }"#;
    let mut run = Command::new(HUMMINGBUS);
    run.arg("run").arg(&manifest).args(["--set", "run.duration_s=0.1", "--set", tf]);
    for output in STANDARD {
        let (process, port) = output.split_once('.').unwrap();
        run.args(["--set", &format!("set.wall-follower.process.{process}.outputs.{port}={{}}")]);
    }
    run.arg("--record");
    // Whether it passes does not matter: it is cut short.
    assert!(matches!(run.arg(&recording).output().unwrap().status.code(), Some(0 | 1)));
    fs::write(&lines, hummingbus(&["cat".as_ref(), recording.as_ref()]).stdout).unwrap();
    let text = fs::read_to_string(&lines).unwrap();
    let frames = ["transforms[0].child_frame_id\":\"v9/body", "\"child_frame_id\":\"v9/body"];
    let headers = ["body", "range/front", "range/back", "range/down"];
    let headers = headers.map(|frame| format!("\"header.frame_id\":\"v9/{frame}\""));
    let topics = ["\"topic\":\"/v9/plant/actuators\"", "\"topic\":\"/v9/range/scan\""];
    for part in frames.into_iter().chain(headers.iter().map(String::as_str)).chain(topics) {
        assert!(text.contains(part), "no {part}");
    }
    decode_the_same(&readers, &recording, &lines);
}

/// The poses of a path are the references that are sent at their times.
#[test]
fn others_decode_the_path_of_a_trajectory() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (recording, lines) = (folder.path().join("path.mcap"), folder.path().join("path.jsonl"));
    let manifest = Path::new(ROOT).join("manifests/figure-eight.toml");
    let path = "process.trajectory.outputs.path={ every_ticks = 500 }";
    let mut run = Command::new(HUMMINGBUS);
    run.arg("run").arg(&manifest).args(["--set", "run.duration_s=3.2", "--set", path]);
    run.arg("--record").arg(&recording);
    // Whether it passes does not matter: it is cut short.
    assert!(matches!(run.output().unwrap().status.code(), Some(0 | 1)));
    let text = hummingbus(&["cat".as_ref(), recording.as_ref()]).stdout;
    fs::write(&lines, &text).unwrap();
    let messages: Vec<serde_json::Value> =
        String::from_utf8(text).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |topic: &'static str| messages.iter().filter(move |message| message["topic"] == topic);
    let paths: Vec<_> = of("/trajectory/path").map(|message| &message["fields"]).collect();
    assert!(paths.len() > 5, "{} paths", paths.len());
    // 2.8 s after the first: the figure eight begins at 2 s.
    let stamp = |part: &str| &paths[0][format!("poses[28].header.stamp.{part}")];
    let is_then = |reference: &&serde_json::Value| {
        ["sec", "nanosec"]
            .into_iter()
            .all(|part| &reference["fields"][format!("stamp.{part}")] == stamp(part))
    };
    let reference = &of("/trajectory/reference").find(is_then).unwrap()["fields"];
    for axis in ["x", "y", "z"] {
        let asked = &reference[format!("position.{axis}")];
        assert_eq!(&paths[0][format!("poses[28].pose.position.{axis}")], asked, "{axis}");
    }
    assert_ne!(paths[0]["poses[28].pose.position.x"], paths[0]["poses[0].pose.position.x"]);
    decode_the_same(&readers, &recording, &lines);
}

/// Requires of every reader that it finds in a recording the `lines` of `cat`.
fn decode_the_same(readers: &Path, recording: &Path, lines: &Path) {
    for script in ["read_mcap_ros2.py", "read_rosbags.py", "read_plotjuggler.py", "read_foxglove.mjs"] {
        let output = read(readers, script, recording, lines).output().unwrap();
        assert!(output.status.success(), "{script}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn the_parser_of_plotjuggler_decodes_the_same_values() {
    check("read_plotjuggler.py");
}

#[test]
fn foxglove_decodes_the_same_values() {
    check("read_foxglove.mjs");
}

#[test]
fn rerun_converts_the_same_values() {
    check("read_rerun.py");
}

/// Runs a reader on the recording, and on falsified output of hummingbus's own reader, which it must notice.
fn check(script: &str) {
    let Some(readers) = readers() else { return };
    let flight = Flight::shared();
    let output = flight.read(&readers, script, &flight.lines);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // Not `print!`, which the test runner hides.
    std::io::stderr().write_all(&output.stdout).unwrap();

    let (topic, falsified) = if script == "read_container.py" {
        ("/plant/pose", flight.falsified(script, "/plant/pose", "tick", |tick| *tick = 1.into()))
    } else {
        ("/plant/state", flight.falsified(script, "/plant/state", "position.z", one_bit_more))
    };
    expect_failure(&flight.read(&readers, script, &falsified), topic);
    expect_failure(&flight.read(&readers, script, &flight.dir.path().join("empty.jsonl")), "");
}

fn expect_failure(output: &Output, reason: &str) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("read_") && message.contains(reason), "{message}");
}

/// Requires of a page that it is white in a light browser and dark in a dark one, with its letters and its plots.
fn require_schemes(seen: &serde_json::Value) {
    let [light, dark] = ["light", "dark"].map(|scheme| &seen["schemes"][scheme]);
    assert_eq!(
        (&light["ground"], &dark["ground"]),
        (&"rgb(255, 255, 255)".into(), &"rgb(20, 23, 27)".into())
    );
    for part in ["ink", "mark"] {
        assert!(!dark[part].is_null() && light[part] != dark[part], "{part}: {light} {dark}");
    }
}

fn one_bit_more(number: &mut serde_json::Value) {
    *number = number.as_f64().unwrap().next_up().into();
}

/// The folder of the readers; absent only where a person runs `cargo test` by itself.
fn readers() -> Option<PathBuf> {
    let readers = skipped::variable_or_skip("HUMMINGBUS_READERS", "which scripts/test sets up");
    assert!(readers.is_some() || std::env::var_os("CI").is_none(), "HUMMINGBUS_READERS is not set");
    readers.map(PathBuf::from)
}

/// A recording and what hummingbus's own reader finds in it.
struct Flight {
    dir: TempDir,
    manifest: PathBuf,
    recording: PathBuf,
    lines: PathBuf,
}

impl Flight {
    /// The one flight of all tests that run at the same time; its files go with the last of them.
    fn shared() -> Arc<Self> {
        // Not a `OnceLock<Flight>`: statics are never dropped, and the files would stay.
        static FLIGHT: Mutex<Weak<Flight>> = Mutex::new(Weak::new());
        let mut shared = FLIGHT.lock().expect("another test could not fly");
        shared.upgrade().unwrap_or_else(|| {
            let flight = Arc::new(Self::fly());
            *shared = Arc::downgrade(&flight);
            flight
        })
    }

    fn fly() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str| dir.path().join(name);
        let (manifest, recording, lines) = (file("hover.toml"), file("hover.mcap"), file("hover.jsonl"));
        fs::write(&manifest, manifest_text()).unwrap();
        fs::write(file("empty.jsonl"), "").unwrap();
        hummingbus(&["run".as_ref(), manifest.as_ref(), "--record".as_ref(), recording.as_ref()]);
        let output = hummingbus(&["cat".as_ref(), recording.as_ref()]);
        fs::write(&lines, output.stdout).unwrap();
        Self { dir, manifest, recording, lines }
    }

    fn read(&self, readers: &Path, script: &str, lines: &Path) -> Output {
        let mut command = read(readers, script, &self.recording, lines);
        if script == "read_container.py" {
            command.arg(&self.manifest).arg(VEHICLE);
        }
        command.output().unwrap_or_else(|error| panic!("{script}: {error}"))
    }

    /// A copy of the lines in which `change` was applied to one message of `topic`.
    fn falsified(
        &self,
        script: &str,
        topic: &str,
        key: &str,
        change: impl Fn(&mut serde_json::Value),
    ) -> PathBuf {
        let text = fs::read_to_string(&self.lines).unwrap();
        let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
        let start = format!("{{\"topic\":\"{topic}\"");
        let line = lines.iter_mut().rfind(|line| line.starts_with(&start)).unwrap();
        let mut message: serde_json::Value = serde_json::from_str(line).unwrap();
        let object = if key == "tick" { &mut message } else { &mut message["fields"] };
        change(&mut object[key]);
        *line = message.to_string();
        // A file for each script: those of other tests are read at the same time.
        let path = self.dir.path().join(format!("{script}-{key}.jsonl"));
        fs::write(&path, lines.join("\n")).unwrap();
        path
    }
}

/// A reader of `recording` that compares with `lines`.
fn read(readers: &Path, script: &str, recording: &Path, lines: &Path) -> Command {
    let program = if script.ends_with(".py") { readers.join("venv/bin/python") } else { "node".into() };
    let mut command = Command::new(program);
    command.env("HUMMINGBUS_READERS", readers).env("PYTHONDONTWRITEBYTECODE", "1");
    command.arg(Path::new(ROOT).join("tests/readers").join(script)).arg(recording).arg(lines);
    command
}

/// The hover manifest, shortened, without conditions, and with absolute paths.
fn manifest_text() -> String {
    let text = fs::read_to_string(Path::new(ROOT).join("manifests/hover.toml")).unwrap();
    let mut manifest: toml_edit::DocumentMut = text.parse().unwrap();
    manifest["run"]["duration_s"] = toml_edit::value(2.0);
    manifest.remove("pass");
    for (_, process) in manifest["process"].as_table_mut().unwrap().iter_mut() {
        if let Some(vehicle) = process.as_table_mut().unwrap().get_mut("vehicle") {
            *vehicle = toml_edit::value(VEHICLE);
        }
    }
    manifest.to_string()
}

fn hummingbus(arguments: &[&OsStr]) -> Output {
    let output = Command::new(HUMMINGBUS).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Runs a script that looks at a page with a browser; the JSON that it prints.
fn look(readers: &Path, script: &str, arguments: &[&OsStr]) -> serde_json::Value {
    let Output { status, stdout, stderr } = reader_of_a_page(readers, script, arguments);
    assert!(status.success(), "{script}: {}", String::from_utf8_lossy(&stderr));
    serde_json::from_slice(&stdout).unwrap()
}

fn reader_of_a_page(readers: &Path, script: &str, arguments: &[&OsStr]) -> Output {
    let mut command = Command::new("node");
    command.arg(Path::new(ROOT).join("tests/readers").join(script)).args(arguments);
    command.env("HUMMINGBUS_READERS", readers).output().unwrap_or_else(|error| panic!("node: {error}"))
}
