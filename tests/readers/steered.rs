//! A browser steers the live run that its page shows, with the mouse and with keys alone.

use crate::{HUMMINGBUS, ROOT, look, readers};
use recorder::reader::Recording;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};

/// A watched run; dropping it ends it.
struct Run {
    child: Child,
    address: String,
    errors: BufReader<ChildStderr>,
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Run {
    /// The hover at real time, recorded to `recording`.
    fn start(recording: &Path) -> Self {
        let mut command = Command::new(HUMMINGBUS);
        command.arg("run").arg(Path::new(ROOT).join("manifests/hover.toml")).arg("--record").arg(recording);
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
        Self { child, address, errors }
    }

    /// The summary of the run, which ends by itself when its page was closed.
    fn end(mut self) -> Value {
        let mut text = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        let mut said = String::new();
        self.errors.read_to_string(&mut said).unwrap();
        assert_eq!(self.child.wait().unwrap().code(), Some(1), "it was stopped: {said}");
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
    for (number, looks) in [&["1280x900"][..], &["390x844", "dark"]].iter().enumerate() {
        let recording = folder.path().join(format!("steered-{number}.mcap"));
        let run = Run::start(&recording);
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
    assert_eq!(seen["playbackPace"], 2, "the page shows a faster run faster");
    assert!(seen["noToml"].as_str().unwrap().contains("TOML"), "{}", seen["noToml"]);
    assert!(seen["noKind"].as_str().unwrap().contains("kind"), "{}", seen["noKind"]);
    let swapped = &seen["swapped"];
    assert!(
        swapped["answer"].as_str().unwrap().contains("controller") && swapped["isWrong"] == false,
        "{swapped}"
    );
    assert_eq!(seen["other"]["shown"], "paused");
    assert_eq!((&seen["kept"]["shown"], &seen["ended"]["shown"]), (&json!("paused"), &json!("ended")));
    assert!(seen["ended"]["answer"].as_str().unwrap().contains("has ended at tick"), "{}", seen["ended"]);
    assert_eq!(seen["disabled"], json!(vec![true; 6]));
    for look in ["running", "paused", "refused", "ended"] {
        assert_eq!(seen[look]["overflow"], 0, "{look}");
    }
}
