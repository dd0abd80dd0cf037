//! A recording that grows is followed.

use super::{MS, Running, await_some, cdr, overwrite};
use crate::Shown;
use bus::Message as _;
use bus::announcement::Announcement;
use bus::messages::PlantState;
use recorder::reader::Recording;
use recorder::writer::{ChannelId, RecordingWriter};
use serde_json::{Value, json};
use std::path::PathBuf;
use tempfile::TempDir;

/// Attached in front of the messages: one swap.
const MANIFEST: &str = "[process.plant]\nkind = \"plant\"\n[[swap]]\nprocess = \"plant\"\nat_tick = 50\n";

/// A recording at work, with states at `/plant/state` every millisecond.
struct Live {
    writer: RecordingWriter,
    state: ChannelId,
    path: PathBuf,
    _folder: TempDir,
}

impl Live {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mcap");
        let mut writer = RecordingWriter::create(&path).unwrap();
        writer.attach("swap.toml", MANIFEST.as_bytes()).unwrap();
        let state = writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA)).unwrap();
        let mut live = Self { writer, state, path, _folder: folder };
        live.write(live.state, 0..100);
        live
    }

    /// States at these ticks: `position.x` is the tick.
    fn write(&mut self, channel: ChannelId, ticks: std::ops::Range<u32>) {
        for tick in ticks {
            let position = [f64::from(tick), 0.0, 0.0].into();
            let message = PlantState { position, ..PlantState::default() };
            self.writer.write(channel, tick, u64::from(tick) * MS, &cdr(&message)).unwrap();
        }
        self.writer.flush().unwrap();
    }

    fn shown(&self) -> Shown {
        Shown::new(Recording::salvage(&self.path).unwrap()).unwrap()
    }
}

impl Running {
    fn growth(&self, key: &str) -> Value {
        self.get("api/growth")[0][key].clone()
    }

    fn await_growth(&self, key: &str, expected: &Value) {
        await_some(|| (self.growth(key) == *expected).then_some(()));
    }
}

/// Messages of a live run are shown as they come, and stay when the run has ended.
#[test]
fn a_recording_that_grows_is_followed_to_its_end() {
    let mut live = Live::new();
    let shown = live.shown();
    assert!(shown.is_growing() && shown.grown().unwrap().is_none());
    let server = Running::of(shown);
    assert_eq!((server.growth("duration_ns"), server.growth("is_growing")), (json!(99 * MS), json!(true)));
    live.write(live.state, 100..200);
    server.await_growth("duration_ns", &json!(199 * MS));
    let position = json!([{ "topic": "/plant/state", "field": "position.x" }]);
    let request =
        json!({ "recording": 0, "from_ns": 150 * MS, "step_ns": 0, "count": 1, "fields": position });
    assert_eq!(server.post("api/frames", &request), (200, 150.0_f64.to_le_bytes().to_vec()));
    assert_eq!(server.growth("is_growing"), json!(true));
    live.writer.finish().unwrap();
    server.await_growth("is_growing", &json!(false));
    assert_eq!((server.growth("duration_ns"), server.growth("damage")), (json!(199 * MS), Value::Null));
}

/// Growth costs the new blocks alone: neither the first one nor the attachments in front of it are read again.
#[test]
fn a_late_vehicle_is_found_in_the_new_blocks_alone() {
    let mut live = Live::new();
    let server = Running::of(live.shown());
    let names = |catalogue: &Value, key: &str| {
        let listed = catalogue["recordings"][0][key].as_array().unwrap();
        listed.iter().map(|one| one["state"].as_str().unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    await_some(|| (server.growth("blocks") == json!(1)).then_some(()));
    let before = server.get("api/catalogue");
    assert_eq!(
        (names(&before, "vehicles"), names(&before, "marks").len()),
        (vec!["/plant/state".to_owned()], 1)
    );
    // Attachment and first block.
    for part in 0..20 {
        overwrite(&live.path, part * 9 + 10, 200);
    }
    let late = live.writer.add_channel("/late/plant/state", &Announcement::of(PlantState::SCHEMA)).unwrap();
    live.write(late, 100..200);
    server.await_growth("topics", &json!(2));
    let after = server.get("api/catalogue");
    assert_eq!(names(&after, "vehicles"), ["/plant/state", "/late/plant/state"]);
    assert_eq!(after["recordings"][0]["marks"], before["recordings"][0]["marks"]);
    assert_eq!(server.growth("damage"), Value::Null);
}
