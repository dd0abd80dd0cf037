//! A recording that grows is followed.

use super::{MS, Running, await_some, cdr, overwrite};
use crate::{Server, Shown};
use bus::Message as _;
use bus::announcement::Announcement;
use bus::messages::PlantState;
use recorder::reader::Recording;
use recorder::writer::{ChannelId, RecordingWriter};
use serde_json::{Value, json};
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::PathBuf;
use tempfile::TempDir;

/// Attached in front of the messages: one swap, one fault.
const MANIFEST: &str = "[process.plant]\nkind = \"plant\"\n[process.mocap]\nparameters.dropout = 0.1\n\
                        [[swap]]\nprocess = \"plant\"\nat_tick = 50\n";

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
        (vec!["/plant/state".to_owned()], 2)
    );
    let fault = &before["recordings"][0]["marks"][1];
    assert_eq!((&fault["kind"], &fault["from_s"]), (&json!("fault"), &json!(0.0)));
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

/// The page of a run is there before the run has recorded anything.
#[test]
fn a_server_without_a_recording_says_so_and_shows_the_one_that_comes() {
    let live = Live::new();
    let server = Server::awaiting(0).unwrap();
    let handle = server.handle();
    let server = Running::serving(server);
    assert_eq!(server.get("api/catalogue"), json!({ "recordings": [], "refusal": null, "is_live": true }));
    assert_eq!((server.get("api/growth"), server.get("api/run")), (json!([]), Value::Null));
    let request = json!({ "recording": 0, "from_ns": 0, "step_ns": MS, "count": 1, "fields": [] });
    assert_eq!(server.post("api/frames", &request), (400, b"no tick is recorded yet\n".to_vec()));
    handle.refuse("it ended too early".to_owned());
    assert_eq!(server.get("api/catalogue")["refusal"], "it ended too early");
    handle.show(vec![live.shown()]).unwrap();
    assert_eq!(server.get("api/catalogue")["recordings"].as_array().unwrap().len(), 1);
    server.await_growth("duration_ns", &json!(99 * MS));
}

#[test]
fn a_page_is_counted_while_its_stream_is_open() {
    let live = Live::new();
    let server = Server::new(vec![live.shown()], 0).unwrap();
    let handle = server.handle();
    let server = Running::serving(server);
    assert_eq!(handle.pages(), [0, 0]);
    let (host, page) = server.parts();
    let open = || {
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "GET {page}api/events HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        let mut lines = BufReader::new(stream).lines();
        let event = await_some(|| lines.next()?.ok()?.strip_prefix("data: ").map(str::to_owned));
        assert_eq!(event, r#"{"run":null,"take_overs":[],"recordings":1,"starts":0}"#);
        lines
    };
    let first = open();
    let second = open();
    assert_eq!(handle.pages(), [2, 2]);
    drop(first);
    await_some(|| (handle.pages() == [1, 2]).then_some(()));
    drop(second);
    await_some(|| (handle.pages() == [0, 2]).then_some(()));
}

#[test]
fn a_page_without_a_run_steers_nothing_and_nonsense_is_refused() {
    let server = Running::of(Live::new().shown());
    // Such a page opens no stream: nothing of it is live.
    assert_eq!(server.get("api/catalogue")["is_live"], false);
    let asked = |request: &Value| {
        let (status, body) = server.post("api/ctl", request);
        (status, String::from_utf8(body).unwrap())
    };
    let (status, answer) = asked(&json!({ "request": "pause" }));
    assert!(status == 200 && answer.contains("this page shows no live run"), "{answer}");
    for nonsense in [json!({ "request": "fly" }), json!({ "request": "step" }), json!([])] {
        assert_eq!(asked(&nonsense).0, 422, "{nonsense}");
    }
}
