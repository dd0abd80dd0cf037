//! The command `view`: its address, its end, and what it refuses.

use crate::recordings::require_same;
use crate::support::{Launch, Place, poll, repository};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};

/// A short recording of the hover.
fn recording(place: &Place) -> String {
    let path = place.path("hover.mcap");
    let args = ["run", &repository("manifests/hover.toml"), "--record", &path, "--set", "run.duration_s=0.5"];
    place.call(&args).with_code(1);
    path
}

fn address(launch: &Launch<'_>) -> String {
    poll("no address", || {
        launch.output().lines().find_map(|line| line.strip_prefix("http://").map(str::to_owned))
    })
}

/// The first line of the answer to a request for `path`.
fn status(host: &str, path: &str) -> String {
    answer(host, path).0.lines().next().unwrap_or_default().to_owned()
}

/// Head and body of the answer to a request for `path`.
fn answer(host: &str, path: &str) -> (String, String) {
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    answer.split_once("\r\n\r\n").map(|(head, body)| (head.to_owned(), body.to_owned())).unwrap()
}

#[test]
fn it_prints_the_address_opens_the_browser_and_ends_with_code_0_when_told() {
    let place = Place::new();
    let recording = recording(&place);
    for signal in [Signal::TERM, Signal::INT] {
        let opened = place.path(&format!("opened-{}", signal.as_raw()));
        let browser = place
            .write("browser", format!("#!/bin/sh\necho \"$1\" >{opened}.new && mv {opened}.new {opened}\n"));
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(&browser, mode).unwrap();
        let launch = place.start_with(&["view", &recording], &[("BROWSER", &browser)]);
        let address = address(&launch);
        let (host, path) = address.split_at(address.find('/').unwrap());
        assert!(host.starts_with("127.0.0.1:"), "{address}");
        assert_eq!(status(host, path), "HTTP/1.1 200 OK");
        assert_eq!(status(host, "/"), "HTTP/1.1 403 Forbidden");
        let seen = poll("no browser was opened", || std::fs::read_to_string(&opened).ok());
        // The arguments of a process are visible to every user: the address is in a private file.
        let page = seen.trim().strip_prefix("file://").unwrap();
        assert!(
            std::fs::read_to_string(page).unwrap().contains(&format!("url=http://{address}\"")),
            "{seen}"
        );
        launch.signal(signal);
        let ended = launch.end().with_code(0);
        assert_eq!(ended.output.lines().count(), 1, "{ended}");
        assert!(!std::path::Path::new(page).exists(), "{page} was left");
        ended.says(&["The browser shows it. Ctrl-C ends."]);
    }
}

/// The files that a run attaches have the values of `--set`.
#[test]
fn the_catalogue_has_the_shadow_and_the_wind_of_a_run() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let shadow = "[[shadow]]\nprocess = \"controller\"\nwith.parameters.gains.tilt_command_max_rad = 0.1\n";
    let manifest =
        place.write("shadow.toml", format!("include = [{hover:?}]\n[run]\nduration_s = 0.5\n{shadow}"));
    let recording = place.path("shadow.mcap");
    let [east, north] = ["x={ value = 3, unit = \"m/s\" }", "y={ value = -4, unit = \"m/s\" }"]
        .map(|value| format!("process.plant.vehicle.effects.wind.{value}"));
    // It is too short for its conditions.
    let args = ["run", &manifest, "--record", &recording, "--set", &east, "--set", &north];
    place.call(&args).with_code(1);
    let launch = place.start(&["view", &recording, "--no-open"]);
    let address = address(&launch);
    let (host, path) = address.split_at(address.find('/').unwrap());
    let (_, body) = answer(host, &format!("{path}api/catalogue"));
    let told: Value = serde_json::from_str(&body).unwrap();
    let vehicle = &told["recordings"][0]["vehicles"][0];
    let command = json!({ "topic": "/shadow/controller/command", "flown": "/controller/command" });
    assert_eq!(vehicle["shadows"], json!({ "command": command }));
    assert_eq!(vehicle["air"], json!({ "velocity_m_s": [3.0, -4.0, 0.0], "has_gusts": false }));
    launch.signal(Signal::TERM);
    launch.end().with_code(0);
}

#[test]
fn what_is_no_recording_is_refused_in_words() {
    let place = Place::new();
    let text = place.write("text.mcap", "not a recording");
    place.call(&["view", &text]).with_code(2).says(&["text.mcap", "expected the magic bytes of MCAP"]);
    place
        .call(&["view", &place.path("none.mcap")])
        .with_code(2)
        .says(&["cannot open the recording", "none.mcap"]);
}

#[test]
fn a_recording_that_was_cut_is_shown_as_far_as_it_is_whole() {
    let place = Place::new();
    let whole = std::fs::read(recording(&place)).unwrap();
    let cut = place.write("cut.mcap", &whole[..whole.len() - 1000]);
    let launch = place.start(&["view", &cut, "--no-open"]);
    address(&launch);
    launch.await_said("cut.mcap was cut off");
    launch.signal(Signal::TERM);
    launch.end().with_code(0);
}

#[test]
fn a_port_that_is_taken_is_refused_in_words() {
    let place = Place::new();
    let recording = recording(&place);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let ended = place.call(&["view", &recording, "--port", &port, "--no-open"]).with_code(2);
    ended.says(&[&format!("cannot listen at port {port}"), "--port", "in use"]);
}

#[test]
fn a_live_run_is_shown_as_far_as_it_is_recorded() {
    let place = Place::new();
    let recording = place.path("live.mcap");
    let mut run = place.start_endless(&["run", &repository("manifests/hover.toml"), "--record", &recording]);
    run.await_ticks(10);
    let launch = place.start(&["view", "--run", &place.run_id(), "--no-open"]);
    let address = address(&launch);
    let (host, path) = address.split_at(address.find('/').unwrap());
    let duration = || -> Option<u64> {
        let (_, body) = answer(host, &format!("{path}api/growth"));
        let told: Value = serde_json::from_str(&body).unwrap();
        // Until the first second is recorded there is none.
        let growing = told.get(0)?;
        assert_eq!(growing["is_growing"], true, "{told}");
        growing["duration_ns"].as_u64()
    };
    let first = poll("there is no recording", duration);
    poll("the recording does not grow", || duration().filter(|now| *now > first));
    launch.signal(Signal::TERM);
    launch.end_among_others().with_code(0);
    run.signal(Signal::TERM);
    run.end();
}

#[test]
fn a_run_that_is_not_alive_is_refused_in_words() {
    let place = Place::new();
    place.call(&["view", "--run", "0-0"]).with_code(2).says(&["alive"]);
}

/// A page as the server sees it: a stream of events, and requests beside it. Dropping it closes it.
pub struct Page {
    pub host: String,
    pub path: String,
    events: BufReader<TcpStream>,
}

impl Page {
    /// The page of a run that was started with `--view`.
    pub fn of(launch: &Launch<'_>) -> Self {
        let address = poll("no address", || {
            let said = launch.errors();
            let line = said.lines().find_map(|line| line.strip_prefix("The run in the browser: http://"))?;
            Some(line.to_owned())
        });
        let (host, path) = address.split_at(address.find('/').unwrap());
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "GET {path}api/events HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        Self { host: host.to_owned(), path: path.to_owned(), events: BufReader::new(stream) }
    }

    /// The next event for which `is_meant`.
    pub fn await_event(&mut self, is_meant: impl Fn(&Value) -> bool) -> Value {
        poll("no such event", || {
            let mut line = String::new();
            assert!(self.events.read_line(&mut line).unwrap() > 0, "the stream has ended");
            let event = serde_json::from_str(line.strip_prefix("data: ")?).unwrap();
            is_meant(&event).then_some(event)
        })
    }

    /// Head and body of the answer to `request`.
    pub fn post(&self, name: &str, request: &Value) -> (String, String) {
        let Self { host, path, .. } = self;
        let (body, mut stream) = (request.to_string(), TcpStream::connect(host).unwrap());
        write!(
            stream,
            "POST {path}api/{name} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n{body}",
            body.len()
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer.split_once("\r\n\r\n").map(|(head, body)| (head.to_owned(), body.to_owned())).unwrap()
    }

    fn ask(&self, request: &Value) -> Value {
        let (head, body) = self.post("ctl", request);
        assert!(head.starts_with("HTTP/1.1 200"), "{head} {body}");
        serde_json::from_str(&body).unwrap()
    }

    /// Asks for what the run does, and returns the tick after it.
    pub fn done(&self, request: &Value) -> u64 {
        let answer = self.ask(request);
        assert_eq!(answer["answer"], "done", "{request}: {answer}");
        answer["tick"].as_u64().unwrap()
    }
}

/// Arguments of a run of the hover at real time that is watched, and whose page no browser opens.
fn watched<'a>(manifest: &'a str, recording: &'a str, duration: &'a str) -> Vec<&'a str> {
    watched_at("realtime", manifest, recording, duration)
}

/// The same at another pace.
fn watched_at<'a>(pace: &'a str, manifest: &'a str, recording: &'a str, duration: &'a str) -> Vec<&'a str> {
    let args = ["run", manifest, "--record", recording, "--pace", pace, "--set", duration];
    [&args[..], &["--view", "--no-open"]].concat()
}

#[test]
fn a_run_that_is_watched_and_steered_writes_the_same_bytes_and_ends_with_its_page() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let (recording, alone) = (place.path("watched.mcap"), place.path("alone.mcap"));
    // At this pace it lasts for 340 s, longer than the watchdog of a launch waits.
    let run = place.start(&watched_at("0.05", &manifest, &recording, "run.duration_s=17"));
    let mut page = Page::of(&run);
    let event = page.await_event(|event| event["run"]["tick"].as_u64() > Some(20));
    assert_eq!((&event["run"]["pace"], &event["run"]["end_tick"]), (&json!("0.05"), &json!(17_000)));
    let held = page.done(&json!({ "request": "pause" }));
    assert_eq!(page.done(&json!({ "request": "step", "ticks": 7 })), held + 7);
    // An event before may tell of the pause.
    page.await_event(|event| event["run"]["state"] == "paused" && event["run"]["tick"] == held + 7);
    let refused = page.ask(&json!({ "request": "step", "ticks": 100_000 }));
    assert!(refused["reason"].as_str().unwrap().contains("only"), "{refused}");
    let refused = page.ask(&json!({ "request": "checkpoint", "path": place.path("no.ckpt") }));
    assert!(refused["reason"].as_str().unwrap().contains("hummingbus ctl checkpoint"), "{refused}");
    page.done(&json!({ "request": "pace", "pace": "free" }));
    page.done(&json!({ "request": "resume" }));
    // The run has ended, and its page is still there.
    run.await_said("The page stays until it is closed");
    page.await_event(|event| event["run"]["state"] == "ended" && event["recordings"] == 1);
    assert_eq!(status(&page.host, &page.path), "HTTP/1.1 200 OK");
    drop(page);
    let ended = run.end().with_code(0);
    assert!(ended.output.contains("view"), "the summary is printed: {ended}");
    place.call(&["run", &manifest, "--record", &alone, "--set", "run.duration_s=17"]).with_code(0);
    require_same(&std::fs::read(alone).unwrap(), &recording);
}

#[test]
fn a_watched_run_ends_when_told_whether_it_flies_or_not() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("told.mcap"));
    let mut run = place.start(&watched(&manifest, &recording, "run.duration_s=4000"));
    run.await_ticks(10);
    let _page = Page::of(&run);
    run.signal(Signal::INT);
    let ended = run.end().with_code(1);
    assert!(!ended.error.contains("The page stays"), "{ended}");
    // Over before anybody looks: the page waits for somebody.
    let args = [
        "run",
        &manifest,
        "--record",
        &recording,
        "--set",
        "run.duration_s=0.1",
        "--view",
        "--no-open",
        "--json",
    ];
    for host in [&[][..], &["--in-process"]] {
        let run = place.start(&[&args[..], host].concat());
        run.await_said("The page stays until it is closed");
        let mut page = Page::of(&run);
        page.await_event(|event| event["recordings"] == 1);
        run.signal(Signal::TERM);
        let summary = run.end().with_code(1).json();
        assert_eq!(summary["ticks"], 100, "{summary}");
    }
}

#[test]
fn a_run_without_a_recording_cannot_be_watched() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let ended = place.call(&["run", &manifest, "--record", "none", "--view", "--no-open"]).with_code(2);
    ended.says(&["--view", "records nothing"]);
}

/// A run that goes back starts again: its page shows it from the checkpoint on.
#[test]
fn the_page_of_a_run_that_goes_back_shows_it_from_the_checkpoint_on() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("back.mcap"));
    let mut args = watched(&manifest, &recording, "run.duration_s=4000");
    args.extend(["--checkpoint-every", "100ms"]);
    let run = place.start(&args);
    let mut page = Page::of(&run);
    page.await_event(|event| event["run"]["tick"].as_u64() > Some(1200) && event["recordings"] == 1);
    let held = page.done(&json!({ "request": "pause" }));
    let to = page.done(&json!({ "request": "rewind" }));
    assert!(to < held && to.is_multiple_of(100), "from tick {held} to tick {to}");
    let event = page.await_event(|event| event["starts"] == 2 && event["run"]["state"] == "paused");
    assert_eq!((&event["run"]["tick"], &event["recordings"]), (&json!(to), &json!(0)));
    page.done(&json!({ "request": "pace", "pace": "free" }));
    page.done(&json!({ "request": "resume" }));
    page.await_event(|event| event["recordings"] == 1);
    let (_, body) = answer(&page.host, &format!("{}api/catalogue", page.path));
    let catalogue: Value = serde_json::from_str(&body).unwrap();
    let start_s = catalogue["recordings"][0]["start_s"].as_f64().unwrap();
    assert!(
        (start_s - to as f64 * 1e-3).abs() < 1e-9,
        "it begins at {start_s} s, and the checkpoint is of tick {to}"
    );
    page.done(&json!({ "request": "stop" }));
    page.await_event(|event| event["run"]["state"] == "ended");
    drop(page);
    run.end().with_code(1);
}

/// Numbers of the answer to `request`.
fn numbers(page: &Page, name: &str, request: &Value) -> Vec<f64> {
    let Page { host, path, .. } = page;
    let (body, mut stream) = (request.to_string(), TcpStream::connect(host).unwrap());
    write!(
        stream,
        "POST {path}api/{name} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
    .unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let head = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").unwrap();
    if answer.starts_with(b"HTTP/1.1 204") {
        return Vec::new();
    }
    assert!(answer.starts_with(b"HTTP/1.1 200"), "{}", String::from_utf8_lossy(&answer));
    answer[head + 4..].as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
}

/// The newest values of a live run are ahead of its recording, and those that the recording then holds.
#[test]
fn the_page_of_a_live_run_gets_its_newest_samples_ahead_of_the_recording() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("newest.mcap"));
    let run = place.start(&watched(&manifest, &recording, "run.duration_s=4000"));
    let mut page = Page::of(&run);
    page.await_event(|event| event["recordings"] == 1);
    let fields = json!([
        { "topic": "/plant/state", "field": "position.z" },
        { "topic": "/plant/state", "field": "rotor_speed[0]" },
    ]);
    let newest = json!({ "fields": fields });
    // The recorder finds the ring at the first ticks after the first request.
    poll("nothing is newer", || numbers(&page, "newest", &newest).first().copied());
    let held = page.done(&json!({ "request": "pause" }));
    let found = poll("the newest sample is not that of the pause", || {
        let found = numbers(&page, "newest", &newest);
        (found[0] == (held - 1) as f64 * 1e6).then_some(found)
    });
    let refused = json!({ "fields": [{ "topic": "/nobody", "field": "x" }] });
    let (head, body) = page.post("newest", &refused);
    assert!(head.starts_with("HTTP/1.1 400") && body.contains("/nobody"), "{head} {body}");
    page.done(&json!({ "request": "stop" }));
    page.await_event(|event| event["run"]["state"] == "ended");
    let at =
        json!({ "recording": 0, "from_ns": found[0] as u64, "step_ns": 0, "count": 1, "fields": fields });
    poll("the recording has other values", || (numbers(&page, "frames", &at) == found[1..]).then_some(()));
    assert!(numbers(&page, "newest", &newest).is_empty(), "the recording is whole by now");
    drop(page);
    run.end().with_code(1);
}

/// The tick of a step need not be one of many.
#[test]
fn the_page_of_a_run_that_was_paused_before_gets_its_newest_samples_from_the_first_step_on() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("held.mcap"));
    let run = place.start(&watched(&manifest, &recording, "run.duration_s=4000"));
    let mut page = Page::of(&run);
    page.await_event(|event| event["recordings"] == 1);
    page.done(&json!({ "request": "pause" }));
    let newest = json!({ "fields": [{ "topic": "/plant/state", "field": "position.z" }] });
    assert!(numbers(&page, "newest", &newest).is_empty(), "the recorder has found no page");
    // The recorder looks again a millisecond after its last look.
    std::thread::sleep(std::time::Duration::from_millis(20));
    for _ in 0..2 {
        let held = page.done(&json!({ "request": "step", "ticks": 1 }));
        poll("the newest sample is not that of the step", || {
            let found = numbers(&page, "newest", &newest);
            (found.first() == Some(&((held - 1) as f64 * 1e6))).then_some(())
        });
    }
    page.done(&json!({ "request": "stop" }));
    page.await_event(|event| event["run"]["state"] == "ended");
    drop(page);
    run.end().with_code(1);
}

/// Layouts of plots outlive the command, and every page has them.
#[test]
fn layouts_are_kept_in_the_folder_of_the_user_s_state() {
    let place = Place::new();
    let (recording, state) = (recording(&place), place.path("state"));
    let plots = json!([[[0, "/plant/state", "position.z"]]]);
    for round in 0..2 {
        let launch = place.start_with(&["view", &recording, "--no-open"], &[("XDG_STATE_HOME", &state)]);
        let address = address(&launch);
        let (host, path) = address.split_at(address.find('/').unwrap());
        if round == 0 {
            let body = json!({ "name": "height", "plots": plots }).to_string();
            let mut stream = TcpStream::connect(host).unwrap();
            write!(
                stream,
                "POST {path}api/layouts HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\
                 Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
                body.len()
            )
            .unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap();
            assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        }
        let (_, body) = answer(host, &format!("{path}api/layouts"));
        assert_eq!(
            serde_json::from_str::<Value>(&body).unwrap(),
            json!({ "height": plots }),
            "round {round}"
        );
        launch.signal(Signal::TERM);
        launch.end().with_code(0);
    }
}

#[test]
fn a_browser_that_fails_is_not_said_to_show_the_page() {
    let place = Place::new();
    let recording = recording(&place);
    let launch = place.start_with(&["view", &recording], &[("BROWSER", "/bin/false")]);
    launch.await_said("Open this address in a browser");
    launch.signal(Signal::TERM);
    launch.end().with_code(0);
}
