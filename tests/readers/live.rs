//! A client of Foxglove's protocol that others wrote watches a live run and steers it.

use crate::launched::Launched;
use crate::{HUMMINGBUS, ROOT, readers};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// A run that Foxglove can watch.
struct Run {
    launched: Launched,
    address: String,
}

impl Run {
    /// The hover at real time, with all that a 3-D panel draws.
    fn start(recording: &Path) -> Self {
        let mut command = Command::new(HUMMINGBUS);
        command.arg("run").arg(Path::new(ROOT).join("manifests/hover.toml")).arg("--record").arg(recording);
        command.args(["--pace", "realtime", "--set", "run.duration_s=4000", "--foxglove=0", "--json"]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut errors = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        let address = loop {
            said.clear();
            assert!(errors.read_line(&mut said).unwrap() > 0, "the run has ended");
            if let Some((_, address)) = said.trim().split_once("ws://") {
                break format!("ws://{address}");
            }
        };
        Self { launched: Launched(child), address }
    }

    /// The summary of the run, which is stopped.
    fn end(mut self) -> Value {
        self.launched.interrupt();
        let child = &mut self.launched.0;
        let mut text = String::new();
        child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(1), "it was stopped");
        serde_json::from_str(&text).unwrap()
    }
}

fn client(readers: &Path, arguments: [&str; 3]) -> Output {
    let mut command = Command::new(readers.join("venv/bin/python"));
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    command.arg(Path::new(ROOT).join("tests/readers/read_live.py")).args(arguments).output().unwrap()
}

fn require(output: &Output) {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_client_of_foxglove_sees_the_recording_live_and_pauses_steps_and_paces_the_run() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [recording, seen] = ["live.mcap", "seen.json"].map(|name| folder.path().join(name));
    let (recording_text, seen_text) = (recording.to_str().unwrap(), seen.to_str().unwrap());
    let run = Run::start(&recording);
    require(&client(&readers, ["watch", &run.address, seen_text]));
    let summary = run.end();
    assert_eq!(summary["stopped_early"], true, "{summary}");
    let output = client(&readers, ["compare", seen_text, recording_text]);
    require(&output);
    eprint!("{}", String::from_utf8_lossy(&output.stdout));

    let mut found: Value = serde_json::from_str(&fs::read_to_string(&seen).unwrap()).unwrap();
    let info = &found["info"];
    assert_eq!(
        (&info["name"], &info["capabilities"]),
        (&json!("hover"), &json!(["time", "playbackControl"]))
    );
    assert_eq!(info["dataEndTime"], json!({ "sec": 4000, "nsec": 0 }));
    let types: Vec<&str> = found["channels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|topic| topic["schemaName"].as_str().unwrap())
        .collect();
    for drawn in ["tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseStamped"] {
        assert!(types.contains(&drawn), "no 3-D panel draws {types:?}");
    }
    require_falsified(&readers, &mut found, recording_text, &folder.path().join("false.json"));
}

/// The comparison notices one byte, one schema and one time that are another.
fn require_falsified(readers: &Path, found: &mut Value, recording: &str, path: &Path) {
    let refused = |found: &Value, reason: &str| {
        fs::write(path, found.to_string()).unwrap();
        let output = client(readers, ["compare", path.to_str().unwrap(), recording]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(reason), "{said}");
    };
    let state = found["messages"]["/plant/state"][3].take();
    found["messages"]["/plant/state"][3] = json!([state[0], "AAEAAA=="]);
    refused(found, "/plant/state at");
    found["messages"]["/plant/state"][3] = json!([state[0].as_u64().unwrap() + 1, state[1]]);
    refused(found, "/plant/state at");
    found["messages"]["/plant/state"][3] = state;
    found["channels"][0]["schema"] = json!("float64 other");
    refused(found, "the server declares");
}
