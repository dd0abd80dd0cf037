//! The command `view`: its address, its end, and what it refuses.

use crate::support::{Launch, Place, poll, repository};
use rustix::process::Signal;
use std::io::{Read as _, Write as _};
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
    let duration = || {
        let (_, body) = answer(host, &format!("{path}api/growth"));
        let told: serde_json::Value = serde_json::from_str(&body).unwrap();
        assert_eq!(told[0]["is_growing"], true, "{told}");
        told[0]["duration_ns"].as_u64().unwrap()
    };
    let first = duration();
    poll("the recording does not grow", || (duration() > first).then_some(()));
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
