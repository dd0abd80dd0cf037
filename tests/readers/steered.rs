//! A browser steers the live run that its page shows, with the mouse and with keys alone.

use crate::launched::Launched;
use crate::skipped::cases;
use crate::{HUMMINGBUS, ROOT, look, readers};
use recorder::reader::Recording;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{ChildStderr, Command, Stdio};

/// A watched run.
struct Run {
    launched: Launched,
    address: String,
    errors: BufReader<ChildStderr>,
}

impl Run {
    /// A manifest at real time, recorded to `recording`.
    fn start(manifest: &str, recording: &Path) -> Self {
        let mut command = Command::new(HUMMINGBUS);
        command
            .arg("run")
            .arg(Path::new(ROOT).join("manifests").join(manifest))
            .arg("--record")
            .arg(recording);
        command.args(["--pace", "realtime", "--set", "run.duration_s=4000", "--view", "--no-open", "--json"]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut errors = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        let address = loop {
            said.clear();
            assert!(errors.read_line(&mut said).unwrap() > 0, "the run has ended");
            if let Some(address) = said.trim().strip_prefix("The run in the browser: ") {
                break address.to_owned();
            }
        };
        Self { launched: Launched(child), address, errors }
    }

    /// The summary of the run, which ends by itself when its page was closed.
    fn end(mut self) -> Value {
        let child = &mut self.launched.0;
        let mut text = String::new();
        child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        let mut said = String::new();
        self.errors.read_to_string(&mut said).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(1), "it was stopped: {said}");
        serde_json::from_str(&text).unwrap()
    }
}

fn tick(look: &Value) -> u64 {
    look["tick"].as_u64().unwrap()
}

#[test]
fn a_browser_steers_a_run_with_mouse_and_keys_on_every_screen() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let screens = [&["1280x900"][..], &["390x844", "dark"]];
    for (number, looks) in cases("screens", screens, |looks| looks.len() > 1).iter().enumerate() {
        let recording = folder.path().join(format!("steered-{number}.mcap"));
        let run = Run::start("hover.toml", &recording);
        let arguments: Vec<&OsStr> =
            std::iter::once(run.address.as_str()).chain(looks.iter().copied()).map(OsStr::new).collect();
        let seen = look(&readers, "read_run.mjs", &arguments);
        require_controls(&seen);
        let summary = run.end();
        assert_eq!((&summary["stopped_early"], &summary["ticks"]), (&json!(true), &seen["ended"]["tick"]));
        // The page has seen the recording to its end.
        let recorded = Recording::open(&recording).unwrap();
        let states = &recorded.series(&[("/plant/state", "position.z")]).unwrap()[0];
        assert_eq!(states.time_ns.last().copied(), seen["endNs"].as_u64());
    }
}

fn require_controls(seen: &Value) {
    assert_eq!(seen["wrong"], json!([]));
    let [running, paused, stepped] = ["running", "paused", "stepped"].map(|key| &seen[key]);
    assert_eq!((&running["shown"], &running["button"]), (&json!("running"), &json!("Pause")));
    assert_eq!((&paused["shown"], &paused["button"]), (&json!("paused"), &json!("Go on")));
    assert_eq!(paused["answer"], format!("paused at tick {}", tick(paused)));
    assert!(paused["facts"].as_str().unwrap().starts_with(&format!("tick {} of 4000000 · ", tick(paused))));
    assert_eq!(stepped["answer"], format!("paused at tick {}, 7 ticks on", tick(paused) + 109));
    for (key, part) in [("refused", "only"), ("zero", "a whole number of at least 1")] {
        assert_eq!((&seen[key]["isWrong"], tick(&seen[key])), (&json!(true), tick(stepped)), "{key}");
        assert!(seen[key]["answer"].as_str().unwrap().contains(part), "{}", seen[key]);
    }
    require_schedule(&seen["schedule"]);
    assert_eq!(seen["playbackPace"], 2, "the page shows a faster run faster");
    assert!(seen["noToml"].as_str().unwrap().contains("TOML"), "{}", seen["noToml"]);
    assert!(seen["noKind"].as_str().unwrap().contains("kind"), "{}", seen["noKind"]);
    let swapped = &seen["swapped"];
    assert!(
        swapped["answer"].as_str().unwrap().contains("controller") && swapped["isWrong"] == false,
        "{swapped}"
    );
    assert_eq!(
        (&seen["marks"][0]["text"], seen["marks"].as_array().unwrap().len()),
        (&json!("controller.1 takes over"), 1)
    );
    let texts =
        |key: &str| seen[key].as_array().unwrap().iter().map(|mark| mark["text"].clone()).collect::<Vec<_>>();
    assert_eq!(texts("otherMarks"), ["controller.1 takes over", "mocap.1 takes over"]);
    require_warning(&seen["warned"]);
    assert_eq!(seen["other"]["shown"], "paused");
    assert_eq!((&seen["kept"]["shown"], &seen["ended"]["shown"]), (&json!("paused"), &json!("ended")));
    assert!(seen["ended"]["answer"].as_str().unwrap().contains("has ended at tick"), "{}", seen["ended"]);
    assert_eq!(seen["disabled"], json!(vec![true; 6]));
    for look in ["running", "paused", "refused", "ended"] {
        assert_eq!(seen[look]["overflow"], 0, "{look}");
    }
}

/// The swap is done, and its warning stands below, on a line of its own.
fn require_warning(seen: &Value) {
    let answer = seen["answer"].as_str().unwrap();
    let mut lines = answer.lines();
    assert!(
        lines.next().is_some_and(|line| line.contains("mocap") && line.contains("flies from")),
        "{answer}"
    );
    let is_warning = |line: &str| line.starts_with("warning: ") && line.contains("sent more than once");
    assert!(lines.next().is_some_and(is_warning) && seen["isWrong"] == false, "{answer}");
}

/// The processes of the hover stand in the order in which they compute, and each bar begins where those end that it waits for.
fn require_schedule(seen: &Value) {
    let rows: Vec<Vec<&str>> = seen["rows"].as_array().unwrap().iter().map(|row| texts(row)).collect();
    let row = |name: &str| rows.iter().position(|row| row[0] == name).unwrap();
    let chain = ["plant", "imu", "ekf", "controller", "recorder"];
    assert!(chain.is_sorted_by_key(|name| row(name)), "{rows:?}");
    let orders = chain.map(|name| rows[row(name)][1].parse::<u32>().unwrap());
    assert!(orders.windows(2).all(|pair| pair[0] < pair[1]), "{orders:?}");
    let left = |name: &str| seen["left"][name].as_f64().unwrap();
    assert!(left("plant") < left("ekf") && left("ekf") < left("controller"), "{}", seen["left"]);
    let controller = &rows[row("controller")];
    assert_eq!((controller[2], controller[4], controller[5]), ("own process", "1", "–"), "{controller:?}");
    let [median, most] = [7, 8].map(|cell| controller[cell].parse::<f64>().unwrap());
    assert!(0.0 < median && median <= most, "{controller:?}");
    assert!(seen["facts"].as_str().unwrap().contains("1000.0 µs of host time"), "{}", seen["facts"]);
    assert_eq!(seen["overflow"], 0);
}

fn texts(row: &Value) -> Vec<&str> {
    row.as_array().unwrap().iter().map(|cell| cell.as_str().unwrap()).collect()
}

/// The recorder finds the page at the first step, whatever its tick is.
#[test]
fn the_page_of_a_run_that_was_paused_before_shows_its_newest_tick_after_one_step() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let run = Run::start("hover.toml", &folder.path().join("held.mcap"));
    let seen = look(&readers, "read_held.mjs", &[run.address.as_ref()]);
    assert_eq!(seen["wrong"], json!([]));
    let held = tick(&seen);
    assert_eq!((tick(&seen["held"]), tick(&seen["stepped"])), (held, held + 1));
    assert!(seen["held"]["timeNs"].as_u64().unwrap() < held * 1_000_000, "{seen}");
    assert_eq!(seen["stepped"]["timeNs"], held * 1_000_000, "{seen}");
    assert_eq!(seen["wentBack"], 0, "time does not go back");
    assert_eq!(seen["isAtRest"], true, "a page at rest shows the newest samples, and draws them once");
    run.end();
}

#[test]
fn a_browser_flies_a_run_by_sliders_keys_and_a_gamepad() {
    if !crate::skipped::is_steady() {
        return;
    }
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    for size in ["1280x900", "390x844"] {
        let recording = folder.path().join(format!("flown-{size}.mcap"));
        let run = Run::start("by-hand.toml", &recording);
        let seen = look(&readers, "read_hand.mjs", &[run.address.as_ref(), size.as_ref()]);
        require_hand(&seen);
        assert_eq!(run.end()["stopped_early"], true);
        require_flown(&Recording::open(&recording).unwrap());
    }
}

fn require_hand(seen: &Value) {
    assert_eq!(seen["wrong"], json!([]));
    let look = |key: &str| &seen[key];
    let number = |key: &str, channel: &str| seen[key][channel].as_f64().unwrap();
    let before = look("before");
    assert_eq!(
        (&before["isOn"], &before["sent"], &before["altitude"]),
        (&json!(false), &json!(0), &json!(1.5))
    );
    assert_eq!(before["tilt"], "15", "the limits are those of the manifest");
    assert_eq!((number("slider", "altitude"), number("held", "roll")), (4.0, -15.0));
    assert_eq!(number("released", "roll"), 0.0, "a key that is let go asks for nothing");
    assert_eq!((number("gamepad", "roll"), number("gamepad", "pitch")), (0.0, 7.5), "forwards is nose down");
    assert!(look("gamepad")["pad"].as_str().unwrap().contains("Test pad"), "{}", look("gamepad"));
    assert!(number("left", "yaw") > 20.0 && number("left", "altitude") < 3.9, "{}", look("left"));
    let said = look("gone")["said"].as_str().unwrap();
    assert!(
        look("gone")["isOn"] == false && said.contains("gamepad has gone") && said.contains("level"),
        "{said}"
    );
    assert!(number("later", "sent") - number("gone", "sent") <= 1.0, "nothing is sent any more");
    for key in ["before", "gamepad", "gone"] {
        assert_eq!(look(key)["overflow"], 0, "{key}");
    }
}

/// The run has taken what the page asked for, and answered its silence.
fn require_flown(recording: &Recording) {
    let fields = ["altitude", "roll", "pitch", "yaw"].map(|field| ("/pilot/set_point", field));
    let series = recording.series(&fields).unwrap();
    let [altitude, roll, pitch, yaw] = [0, 1, 2, 3].map(|index| &series[index].value);
    assert!(altitude[0] == 1.5 && altitude.contains(&4.0), "{altitude:?}");
    let has = |values: &[f64], asked_deg: f64| {
        values.iter().any(|value| (value.to_degrees() - asked_deg).abs() < 1e-9)
    };
    assert!(has(roll, -15.0) && has(pitch, 7.5));
    assert_eq!((roll.last(), pitch.last()), (Some(&0.0), Some(&0.0)), "the fallback is level");
    assert!(*yaw.last().unwrap() > 20_f64.to_radians(), "and holds the yaw");
}
