//! Live runs in Foxglove: what a client sees, and that no client changes or holds up a run.

use crate::recordings::require_same;
use crate::skipped::first;
use crate::support::{Launch, Place, poll, repository};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};

/// Topics of the hover.
const TOPICS: usize = 8;

/// A client of the protocol `foxglove.sdk.v1`.
struct Client(BufReader<TcpStream>);

/// A message of the server.
enum Said {
    Text(Value),
    /// Time in ns, and the bytes behind it.
    Sample(u64, Vec<u8>),
    Other,
}

impl Client {
    /// A client of the server that `launch` has announced.
    fn of(launch: &Launch<'_>) -> Self {
        let host = poll("no address", || {
            let said = launch.errors();
            said.lines()
                .find_map(|line| line.split_once("ws://")?.1.split_whitespace().next().map(str::to_owned))
        });
        let mut stream = TcpStream::connect(&host).unwrap();
        let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1";
        write!(stream, "GET / HTTP/1.1\r\nHost: {host}\r\n{upgrade}\r\n\r\n").unwrap();
        let mut client = Self(BufReader::new(stream));
        let mut line = String::new();
        client.0.read_line(&mut line).unwrap();
        assert!(line.starts_with("HTTP/1.1 101"), "{line}");
        while line != "\r\n" {
            line.clear();
            client.0.read_line(&mut line).unwrap();
        }
        client
    }

    fn send(&mut self, text: &str) {
        let length = u16::try_from(text.len()).unwrap().to_be_bytes();
        // The last frame of a text, masked with zeros.
        let frame = [&[0x81, 0xfe], &length[..], &[0; 4], text.as_bytes()].concat();
        self.0.get_mut().write_all(&frame).unwrap();
    }

    fn next(&mut self) -> Said {
        self.try_next().unwrap()
    }

    /// The next message; an error once the server has gone.
    fn try_next(&mut self) -> std::io::Result<Said> {
        let mut head = [0; 2];
        self.0.read_exact(&mut head)?;
        let mut long = vec![
            0;
            match head[1] {
                126 => 2,
                127 => 8,
                _ => 0,
            }
        ];
        self.0.read_exact(&mut long)?;
        let length = if long.is_empty() {
            usize::from(head[1])
        } else {
            long.iter().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
        };
        let mut content = vec![0; length];
        self.0.read_exact(&mut content)?;
        Ok(match (head[0] & 15, content.first()) {
            (1, _) => Said::Text(serde_json::from_slice(&content).unwrap()),
            (2, Some(1)) => {
                let time_ns = u64::from_le_bytes(content[5..13].try_into().unwrap());
                Said::Sample(time_ns, content.split_off(13))
            }
            _ => Said::Other,
        })
    }

    /// Subscribes to all topics of the hover.
    fn subscribe(&mut self) {
        let mut count = 0;
        while count < TOPICS {
            if let Said::Text(text) = self.next()
                && text["op"] == "advertise"
            {
                let channels = text["channels"].as_array().unwrap();
                count += channels.len();
                let ids =
                    channels.iter().map(|channel| json!({ "id": channel["id"], "channelId": channel["id"] }));
                let subscriptions: Vec<Value> = ids.collect();
                self.send(&json!({ "op": "subscribe", "subscriptions": subscriptions }).to_string());
            }
        }
        assert_eq!(count, TOPICS);
    }

    fn sample(&mut self) -> (u64, Vec<u8>) {
        loop {
            if let Said::Sample(time_ns, content) = self.next() {
                return (time_ns, content);
            }
        }
    }
}

#[test]
fn a_run_that_is_watched_writes_the_same_bytes_though_a_client_does_not_read() {
    let manifest = repository("manifests/hover.toml");
    // So slow at first that clients are there before the end, however busy the machine is: who shows a run steps back for
    // it. A run on one thread takes no requests and keeps its pace.
    let hosts =
        [(&[][..], "0.1", "4"), (&["--in-process"], "0.25", "2.5"), (&["--compose", "all"], "0.1", "4")];
    for (host, pace, seconds) in first(1, "hosts", hosts) {
        let place = Place::new();
        let (recording, alone) = (place.path("watched.mcap"), place.path("alone.mcap"));
        let duration = format!("run.duration_s={seconds}");
        let args = ["run", &manifest, "--set", &duration, "--record"];
        let run = place.start(&[&args[..], &[&recording, "--foxglove=0", "--pace", pace], host].concat());
        // A client that takes all, and one that takes nothing any more.
        let mut quick = Client::of(&run);
        quick.subscribe();
        let mut stuck = Client::of(&run);
        stuck.subscribe();
        let first_ns = quick.sample().0;
        while quick.sample().0 < first_ns + 100_000_000 {}
        if host != ["--in-process"] {
            place.start(&["ctl", "pace", "4", "--run", &place.run_id()]).end_among_others().with_code(0);
        }
        while let Ok(said) = quick.try_next() {
            if let Said::Sample(time_ns, content) = said {
                assert!(
                    time_ns.is_multiple_of(1_000_000) && content.starts_with(&[0, 1, 0, 0]),
                    "{time_ns} {content:?}"
                );
            }
        }
        drop(quick);
        // It ends before all its conditions can hold.
        run.end().with_code(1);
        place.call(&[&args[..], &[&alone]].concat()).with_code(1);
        require_same(&std::fs::read(alone).unwrap(), &recording);
    }
}

#[test]
fn a_run_that_flies_already_is_shown_too() {
    let place = Place::new();
    let recording = place.path("live.mcap");
    let mut run = place.start_endless(&["run", &repository("manifests/hover.toml"), "--record", &recording]);
    run.await_ticks(10);
    for _ in 0..2 {
        let shown = place.start(&["view", "--run", &place.run_id(), "--foxglove=0"]);
        let mut client = Client::of(&shown);
        client.subscribe();
        let (first_ns, _) = client.sample();
        while client.sample().0 < first_ns + 100_000_000 {}
        shown.signal(Signal::TERM);
        shown.end_among_others().with_code(0);
    }
    let shown = place.start(&["ctl", "foxglove", "0", "--run", &place.run_id()]);
    let mut client = Client::of(&shown);
    client.subscribe();
    client.sample();
    shown.await_said("ends with the run");
    run.signal(Signal::TERM);
    run.end_among_others();
    shown.end().with_code(0);
}

#[test]
fn a_client_follows_a_run_that_goes_back() {
    let place = Place::new();
    let args = ["run", &repository("manifests/hover.toml"), "--record", &place.path("back.mcap")];
    let run = place.start_endless(&[&args[..], &["--checkpoint-every", "100ms", "--foxglove=0"]].concat());
    let mut client = Client::of(&run);
    client.subscribe();
    while client.sample().0 < 250_000_000 {}
    let id = place.run_id();
    let ctl = |verb: &[&str]| {
        place.start(&[&["ctl"], verb, &["--run", &id]].concat()).end_among_others().with_code(0);
    };
    ctl(&["pause"]);
    ctl(&["rewind", "100"]);
    // The client is told to forget what it knows, and the samples go on behind the checkpoint.
    loop {
        if let Said::Text(text) = client.next()
            && text["op"] == "serverInfo"
        {
            break;
        }
    }
    ctl(&["resume"]);
    // Samples that have waited for the client come first; they are later than these.
    let first_ns = loop {
        let time_ns = client.sample().0;
        if time_ns < 200_000_000 {
            break time_ns;
        }
    };
    assert!(first_ns >= 100_000_000, "{first_ns}");
    while client.sample().0 < first_ns + 300_000_000 {}
    run.signal(Signal::TERM);
    run.end().with_code(1);
}

#[test]
fn an_address_that_is_taken_wrong_or_without_a_recording_is_refused_in_words() {
    let place = Place::new();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let run = |args: &[&str]| {
        let manifest = repository("manifests/hover.toml");
        let recording = place.path("refused.mcap");
        place.call(&[&["run", &manifest, "--record", &recording][..], args].concat()).with_code(2)
    };
    run(&[&format!("--foxglove={port}")]).says(&[
        &format!("cannot listen at 127.0.0.1:{port} for Foxglove"),
        &format!("--foxglove=127.0.0.1:{}", port + 1),
        "in use",
    ]);
    run(&["--foxglove=nowhere"]).says(&["nowhere", "expected a port, an IP address or both"]);
    run(&["--foxglove=192.0.2.1:0"]).says(&["cannot listen at 192.0.2.1:0", "assign requested address"]);
    let unrecorded = ["run", &repository("manifests/hover.toml"), "--record", "none", "--foxglove"];
    place
        .call(&unrecorded)
        .with_code(2)
        .says(&["--foxglove shows a run by its recording", "records nothing"]);
    place.call(&["view", "--foxglove", "--run", "0-0"]).with_code(2).says(&["alive"]);
    place.call(&["ctl", "foxglove", "--run", "0-0"]).with_code(2).says(&["alive"]);
    place
        .call(&["ctl", "foxglove", "nowhere"])
        .with_code(2)
        .says(&["expected a port, an IP address or both"]);
    place.call(&["ctl", "foxglove", "--json"]).with_code(2).says(&["leave out --json"]);
    place.call(&["view", "a.mcap", "--foxglove"]).with_code(2).says(&["cannot be used with"]);
    let open = place.start_endless(&[
        "run",
        &repository("manifests/hover.toml"),
        "--record",
        &place.path("open.mcap"),
        "--foxglove=0.0.0.0:0",
    ]);
    open.await_said("warning: everybody who reaches port");
    open.signal(Signal::TERM);
    open.end();
}
