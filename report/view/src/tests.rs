//! Answers of the server compared with the messages that were written into a recording.

mod live;
mod seeks;
mod vehicles;

use crate::catalogue::{Lasting, catalogue};
use crate::curves::{CurvesRequest, curves};
use crate::fields::{Asked, Listed};
use crate::frames::{FramesRequest, frames};
use crate::overview::Overview;
use crate::{Server, Shown};
use bus::Message;
use bus::announcement::Announcement;
use bus::messages::{PlantState, SetPoint};
use recorder::reader::Recording;
use recorder::writer::RecordingWriter;
use serde_json::json;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;

const MS: u64 = 1_000_000;
const TICKS: u32 = 5000;
/// The tick with a peak that one sample has.
const PEAK: u32 = 3217;

fn cdr<T: Message>(message: &T) -> Vec<u8> {
    [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat()
}

/// The height at a tick: a climb with one peak.
fn height_m(tick: u32) -> f64 {
    if tick == PEAK { 40.0 } else { f64::from(tick) * 1e-3 }
}

/// Writes five seconds of a state every millisecond, and two set points, at ticks 500 and 1500. A chunk holds `chunk`
/// ticks; one that is not finished has no summary.
fn write(path: &Path, chunk: u32, is_finished: bool) {
    let mut writer = RecordingWriter::create(path).unwrap();
    let state = writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA)).unwrap();
    let asked = writer.add_channel("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA)).unwrap();
    for tick in 0..TICKS {
        let time_ns = u64::from(tick) * MS;
        let position = [f64::from(tick), 0.0, height_m(tick)].into();
        writer.write(state, tick, time_ns, &cdr(&PlantState { position, ..PlantState::default() })).unwrap();
        if tick == 500 || tick == 1500 {
            let set_point = SetPoint { altitude: f64::from(tick), ..SetPoint::default() };
            writer.write(asked, tick, time_ns, &cdr(&set_point)).unwrap();
        }
        if tick % chunk == chunk - 1 {
            writer.flush().unwrap();
        }
    }
    if is_finished {
        writer.finish().unwrap();
    } else {
        // A writer that is dropped finishes its file; one that is killed does not.
        std::mem::forget(writer);
    }
}

struct Flight {
    _folder: TempDir,
    path: PathBuf,
}

impl Flight {
    fn of(chunk: u32, is_finished: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("climb.mcap");
        write(&path, chunk, is_finished);
        Self { _folder: folder, path }
    }

    fn shown(&self) -> Shown {
        Shown::new(Recording::salvage(&self.path).unwrap()).unwrap()
    }
}

fn asked(names: &[(&str, &str)]) -> Vec<Asked> {
    let asked =
        |(topic, field): &(&str, &str)| Asked { topic: (*topic).to_owned(), field: (*field).to_owned() };
    names.iter().map(asked).collect()
}

fn frames_at(shown: &Shown, from_ns: u64, step_ns: u64, count: usize) -> Vec<f64> {
    let fields = asked(&[("/pilot/set_point", "altitude"), ("/plant/state", "position.x")]);
    frames(shown, &FramesRequest { recording: 0, from_ns, step_ns, count, fields }).unwrap()
}

#[test]
fn a_frame_has_the_newest_samples_whatever_block_they_are_in() {
    for is_finished in [true, false] {
        let flight = Flight::of(1000, is_finished);
        let shown = flight.shown();
        assert_eq!((shown.block_count(), shown.duration_ns()), (5, 4999 * MS));
        // Between two ticks the earlier counts; the set point of tick 1500 is three chunks back.
        assert_eq!(frames_at(&shown, 4200 * MS + 999_999, 0, 1), [1500.0, 4200.0], "finished: {is_finished}");
        assert_eq!(frames_at(&shown, 1499 * MS, MS, 3), [500.0, 1499.0, 1500.0, 1500.0, 1500.0, 1501.0]);
        let early = frames_at(&shown, 499 * MS, 0, 1);
        assert!(early[0].is_nan() && early[1] == 499.0, "nothing was asked for yet: {early:?}");
        // Behind the end the last ones stay.
        assert_eq!(frames_at(&shown, 9000 * MS, 0, 1), [1500.0, 4999.0]);
    }
}

#[test]
fn what_asks_for_too_much_or_for_nothing_is_refused_in_words() {
    let shown = Flight::of(1000, true).shown();
    let request = |count, fields| FramesRequest { recording: 0, from_ns: 0, step_ns: MS, count, fields };
    let refused = |count, fields| frames(&shown, &request(count, fields)).unwrap_err().to_string();
    let height = || asked(&[("/plant/state", "position.z")]);
    assert!(refused(0, height()).contains("expected 1 to 8192 frames"));
    assert!(refused(1 << 40, height()).contains("expected 1 to 8192 frames"));
    assert!(refused(1, asked(&[("/no/topic", "x")])).contains("it has /pilot/set_point, /plant/state"));
    assert!(refused(1, vec![height()[0].clone(); 1025]).contains("at most 1024"));
    // A field that is not there is not known.
    let unknown = frames(&shown, &request(1, asked(&[("/plant/state", "position.q")]))).unwrap();
    assert!(unknown[0].is_nan());
}

fn curve_of(shown: &Shown, overview: &Overview, from_ns: u64, to_ns: u64, bins: usize) -> (Vec<f64>, f64) {
    let fields = asked(&[("/plant/state", "position.z")]);
    let found =
        curves(shown, overview, &CurvesRequest { recording: 0, from_ns, to_ns, bins, fields }).unwrap();
    (found.values, found.read)
}

#[test]
fn a_curve_keeps_the_peak_that_one_sample_has() {
    let flight = Flight::of(1000, true);
    let shown = flight.shown();
    let overview = Overview::new(Listed::of(&shown).unwrap().fields());
    let (values, read) = curve_of(&shown, &overview, 0, 5000 * MS, 10);
    assert_eq!((values.len(), read), (20, 1.0));
    // Half a second each: climbing, the lowest comes first; in the one with the peak, too.
    assert_eq!(values[..4], [0.0, 0.499, 0.5, 0.999]);
    assert_eq!(values[12..14], [3.0, 40.0]);
    let (narrow, _) = curve_of(&shown, &overview, 100 * MS, 110 * MS, 20);
    let numbers: Vec<f64> = narrow.iter().copied().filter(|value| !value.is_nan()).collect();
    assert_eq!(numbers.len(), 20, "ten samples in twenty intervals: {narrow:?}");
}

/// With a block for every ten ticks there are more of them than one window reads.
#[test]
fn a_long_window_is_answered_by_the_overview_with_the_same_extremes() {
    let flight = Flight::of(10, true);
    let shown = flight.shown();
    let overview = Overview::new(Listed::of(&shown).unwrap().fields());
    assert_eq!(curve_of(&shown, &overview, 0, 5000 * MS, 10).1, 0.0, "nothing was read yet");
    overview.fill(&shown, &AtomicBool::new(false)).unwrap();
    let (values, read) = curve_of(&shown, &overview, 0, 5000 * MS, 10);
    assert_eq!(read, 1.0);
    let near = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 0.01, "{found} {expected}: {values:?}")
    };
    near(values[0], 0.0);
    near(values[19], 4.999);
    assert_eq!(values[13], 40.0, "{values:?}");
}

#[test]
fn an_overview_of_few_bins_keeps_the_extremes_of_all_samples() {
    let shown = Flight::of(1000, true).shown();
    // The least number of bins: 1024 for 5000 samples.
    let overview = Overview::with_budget(Listed::of(&shown).unwrap().fields(), 0);
    overview.fill(&shown, &AtomicBool::new(false)).unwrap();
    let (mut low_m, mut high_m, mut bins) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    overview
        .visit(&asked(&[("/plant/state", "position.z")])[0], &mut |_, low, high| {
            (low_m, high_m, bins) = (low_m.min(low), high_m.max(high), bins + 1);
        })
        .unwrap();
    assert_eq!((low_m, high_m), (0.0, 40.0));
    assert!((512..=1024).contains(&bins), "{bins}");
}

/// Topics of late vehicles share the budget with those that were there before.
#[test]
fn an_overview_has_fewer_bins_when_more_fields_come() {
    let shown = Flight::of(1000, true).shown();
    let mut fields = Listed::of(&shown).unwrap().fields().clone();
    let count: usize = fields.values().map(Vec::len).sum();
    let budget = 4096 * count * size_of::<[f64; 2]>();
    let overview = Overview::with_budget(&fields, budget);
    overview.fill(&shown, &AtomicBool::new(false)).unwrap();
    let found = || {
        let (mut high_m, mut bins) = (f64::NEG_INFINITY, 0);
        let mut see = |_, _, high| (high_m, bins) = (f64::max(high_m, high), bins + 1);
        overview.visit(&asked(&[("/plant/state", "position.z")])[0], &mut see).unwrap();
        (high_m, bins)
    };
    assert_eq!(found(), (40.0, 2500));
    let late = fields["/plant/state"].clone();
    fields.extend((0..8).map(|number| (format!("/late{number}/state"), late.clone())));
    overview.add_fields(&fields);
    let (high_m, bins) = found();
    assert!(high_m == 40.0 && bins <= 1024, "{high_m} {bins}");
}

/// A server at work, and its end.
struct Running {
    address: String,
    is_over: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Running {
    fn start(flight: &Flight) -> Self {
        Self::of(flight.shown())
    }

    fn of(shown: Shown) -> Self {
        Self::serving(Server::new(vec![shown], 0).unwrap())
    }

    fn serving(server: Server) -> Self {
        let (address, is_over) = (server.address(), Arc::new(AtomicBool::new(false)));
        let seen = is_over.clone();
        let serve = move || server.serve(&|| seen.load(Ordering::Relaxed)).unwrap();
        Self { address, is_over, thread: Some(std::thread::spawn(serve)) }
    }

    /// `127.0.0.1:PORT`, and the path of the page.
    fn parts(&self) -> (&str, &str) {
        let rest = self.address.strip_prefix("http://").unwrap();
        rest.split_at(rest.find('/').unwrap())
    }

    /// Status, head and body of the answer to a request.
    fn ask(&self, method: &str, host: &str, path: &str, body: &str) -> (u16, String, Vec<u8>) {
        let mut stream = TcpStream::connect(self.parts().0).unwrap();
        let length = body.len();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n\
             Connection: close\r\n\r\n{body}"
        )
        .unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), head, bytes[end + 4..].to_vec())
    }

    /// An answer in JSON.
    fn get(&self, path: &str) -> serde_json::Value {
        let (host, page) = self.parts();
        let (status, _, body) = self.ask("GET", host, &format!("{page}{path}"), "");
        assert_eq!(status, 200);
        serde_json::from_slice(&body).unwrap()
    }

    fn post(&self, path: &str, body: &serde_json::Value) -> (u16, Vec<u8>) {
        let (host, page) = self.parts();
        let (status, _, body) = self.ask("POST", host, &format!("{page}{path}"), &body.to_string());
        (status, body)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

#[test]
fn only_requests_with_the_token_and_the_server_s_name_are_answered() {
    let server = Running::start(&Flight::of(1000, true));
    let (host, page) = server.parts();
    let (status, head, body) = server.ask("GET", host, page, "");
    assert!(status == 200 && String::from_utf8(body).unwrap().contains("<canvas"), "{head}");
    for part in ["content-security-policy: default-src 'none'", "referrer-policy: no-referrer", "nosniff"] {
        assert!(head.contains(part), "{part} is missing: {head}");
    }
    assert!(!head.contains("access-control"), "no other page may read it: {head}");
    let wrong = page.replace("token=", "token=0");
    for (host, path) in [(host, "/"), (host, &wrong), ("evil.example", page), (host, "/api/catalogue")] {
        let (status, head, body) = server.ask("GET", host, path, "");
        let text = String::from_utf8(body).unwrap();
        assert!(status == 403 && text.contains("that the command printed"), "{host} {path}: {head} {text}");
    }
}

#[test]
fn every_file_of_the_page_is_served_and_no_other() {
    let server = Running::start(&Flight::of(1000, true));
    let (host, page) = server.parts();
    for asset in crate::assets::ASSETS {
        let (status, head, body) = server.ask("GET", host, &format!("{page}assets/{}", asset.name), "");
        assert!(status == 200 && body == asset.content.as_bytes(), "{}: {head}", asset.name);
        assert!(head.contains(asset.media), "{head}");
    }
    for path in ["assets/../server.rs", "assets/none.js", "api/none"] {
        assert_eq!(server.ask("GET", host, &format!("{page}{path}"), "").0, 404, "{path}");
    }
}

#[test]
fn numbers_are_answered_as_bytes_and_refusals_as_text() {
    let server = Running::start(&Flight::of(1000, true));
    let height = json!([{ "topic": "/plant/state", "field": "position.z" }]);
    let request =
        json!({ "recording": 0, "from_ns": 2000 * MS, "step_ns": MS, "count": 2, "fields": height });
    let (status, body) = server.post("api/frames", &request);
    assert_eq!((status, body), (200, [2.0_f64.to_le_bytes(), 2.001_f64.to_le_bytes()].concat()));
    let mut other = request.clone();
    other["recording"] = json!(1);
    let (status, body) = server.post("api/frames", &other);
    assert_eq!(
        (status, &*String::from_utf8(body).unwrap()),
        (400, "there is no recording 1, expected 0 to 0\n")
    );
    let (status, _) = server.post("api/curves", &json!({ "recording": "x" }));
    assert_eq!(status, 422);
}

#[test]
fn the_catalogue_lists_fields_units_and_what_is_missing() {
    let flight = Flight::of(1000, false);
    let shown = flight.shown();
    let listed = catalogue(&shown, Listed::of(&shown).unwrap().fields(), &Lasting::of(&shown).unwrap());
    assert_eq!((&listed["duration_ns"], &listed["tick_ns"]), (&json!(4999 * MS), &json!(MS)));
    assert_eq!(listed["vehicles"][0]["state"], "/plant/state");
    assert_eq!(listed["vehicles"][0]["topics"]["set_point"], "/pilot/set_point");
    let state = &listed["topics"][1];
    let has = |path: &str, unit: &str| {
        state["fields"].as_array().unwrap().contains(&json!({ "path": path, "unit": unit }))
    };
    assert!(has("position.z", "m") && has("attitude.yaw", "rad"), "{state}");
    assert!(listed["cut"].as_str().unwrap().contains("the last whole tick was 4999"), "{listed}");
}

#[test]
fn a_taken_port_is_refused_with_what_to_do() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let error = Server::new(vec![Flight::of(1000, true).shown()], port).unwrap_err();
    let text = format!("{error:#}");
    assert!(text.contains(&format!("port {port} of 127.0.0.1")) && text.contains("--port"), "{text}");
}

/// The page would ask for the rest of the overview for ever.
#[test]
fn damage_within_a_recording_is_the_answer_to_a_long_window() {
    let flight = Flight::of(10, true);
    // So densely that a chunk is hit, and not only the indexes between two.
    (100..120).for_each(|part| overwrite(&flight.path, part, 200));
    let server = Running::start(&flight);
    let height = json!([{ "topic": "/plant/state", "field": "position.z" }]);
    let request = json!({ "recording": 0, "from_ns": 0, "to_ns": 5000 * MS, "bins": 10, "fields": height });
    let text = await_some(|| {
        let (status, body) = server.post("api/curves", &request);
        (status != 200).then(|| (status, String::from_utf8(body).unwrap()))
    });
    assert!(text.0 == 400 && text.1.contains("climb.mcap") && text.1.contains("byte "), "{text:?}");
    assert_eq!(server.get("api/growth")[0]["damage"], text.1.trim());
    // Short windows in front of it are still answered.
    let (status, _) = server.post(
        "api/frames",
        &json!({
            "recording": 0, "from_ns": 0, "step_ns": MS, "count": 2, "fields": height
        }),
    );
    assert_eq!(status, 200);
}

/// Overwrites a few bytes at this part of a file.
fn overwrite(path: &Path, part: u64, of: u64) {
    let file = std::fs::OpenOptions::new().write(true).open(path).unwrap();
    let at = file.metadata().unwrap().len() * part / of;
    file.write_all_at(&[0xa5; 64], at).unwrap();
}

/// The first value of `look`; panics if none comes for long.
fn await_some<T>(mut look: impl FnMut() -> Option<T>) -> T {
    for _ in 0..3000 {
        if let Some(found) = look() {
            return found;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("it did not come for a minute");
}
