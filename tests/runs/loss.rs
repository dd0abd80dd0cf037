//! Every sample is recorded: complete, in order, at its topic's rate.

use crate::recordings::topics;
use crate::skipped::{cases, first, quick_or};
use crate::support::{Load, Place, repository};

const TICK_NS: u64 = 1_000_000;
/// The topics of hover.toml with the ticks between their samples.
const RATES: [(&str, u32); 8] = [
    ("/controller/command", 1),
    ("/ekf/estimate", 1),
    ("/imu/imu", 1),
    ("/mocap/mocap", 10),
    ("/pilot/set_point", 1),
    ("/plant/pose", 10),
    ("/plant/state", 1),
    ("/tf", 10),
];

/// Flies hover.toml for `ticks` milliseconds and requires every sample of every topic.
fn require_complete(ticks: u32, more: &[&str]) {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    let duration = format!("run.duration_s={}", f64::from(ticks) * 1e-3);
    let args = ["run", &manifest, "--record", &recording, "--set", &duration];
    place.call(&[&args, more].concat()).flown();
    let topics = topics(&recording);
    assert_eq!(topics.keys().collect::<Vec<_>>(), RATES.map(|(topic, _)| topic));
    for (topic, every_ticks) in RATES {
        let expected = (0..ticks).step_by(every_ticks as usize);
        let expected: Vec<_> = expected.map(|tick| (tick, u64::from(tick) * TICK_NS)).collect();
        let found: Vec<_> = topics[topic].iter().map(|message| (message.tick, message.time_ns)).collect();
        let differing = expected.iter().zip(&found).find(|(expected, found)| expected != found);
        assert!(differing.is_none(), "{topic}: {differing:?} in a recording with {more:?}");
        assert_eq!(expected.len(), found.len(), "messages on {topic} with {more:?}");
    }
}

#[test]
fn a_long_run_is_recorded_whole() {
    require_complete(quick_or(10_000, 60_000, "flights of a minute"), &[]);
}

#[test]
fn nothing_is_lost_on_a_loaded_machine() {
    let _load = Load::of_threads(4);
    for (ticks, window) in first(1, "windows", [(1_009, "1"), (5_003, "4096")]) {
        require_complete(ticks, &["--window", window]);
    }
}

#[test]
fn the_last_ticks_are_recorded_whatever_the_length_of_the_run() {
    let lengths = [1, 2, 9, 10, 11, 63, 64, 65, 129];
    for ticks in cases("lengths", lengths, |ticks| [1, 10, 64, 129].contains(ticks)) {
        require_complete(ticks, &[]);
    }
}
