//! Samples that a node sees and sends at a tick (docs/architecture.md, the timeline of one tick).

use crate::nodes::{manifest, sender, table};
use crate::recordings::{Row, rows, topics};
use crate::skipped::cases;
use crate::support::Place;

/// Ticks of a run here: several windows, and no multiple of any period.
const TICKS: u32 = 203;
/// The tick that a delayed input's initial value claims to be from.
const INITIAL: u32 = 777;

/// Runs `processes` with a recorder; returns the recording.
fn fly(place: &Place, processes: &[String], more: &[&str]) -> String {
    let path = place.write("contract.toml", manifest(TICKS, processes));
    place.call(&[&["run", &path], more].concat()).with_code(0);
    place.path("contract.mcap")
}

fn source(every_ticks: u32) -> String {
    sender("source", every_ticks, "")
}

/// A relay that reads the source's notes with this delay, every `period_ticks`.
fn relay(name: &str, period_ticks: u32, delay_ticks: u32) -> String {
    let initial = format!(", delay_ticks = 1, initial = {{ tick = {INITIAL} }}");
    let delay = if delay_ticks == 0 { "" } else { &initial };
    let input = format!("inputs.input = {{ topic = \"/source/note\"{delay} }}");
    sender(name, period_ticks, &format!("period_ticks = {period_ticks}\n{input}"))
}

/// Ticks computed, each with the tick of the note that was seen.
fn seen(rows: &[Row]) -> Vec<(u32, u32)> {
    rows.iter().map(|row| (row.tick, row.get("seen_tick") as u32)).collect()
}

/// The newest sample stamped at or before `tick` minus the delay.
fn newest(tick: u32, every_ticks: u32, delay_ticks: u32) -> u32 {
    tick.checked_sub(delay_ticks).map_or(INITIAL, |limit| limit / every_ticks * every_ticks)
}

#[test]
fn an_edge_without_delay_brings_the_sample_of_the_same_tick() {
    let place = Place::new();
    let recording = fly(&place, &[source(1), relay("relay", 1, 0)], &[]);
    let expected: Vec<_> = (0..TICKS).map(|tick| (tick, tick)).collect();
    assert_eq!(seen(&rows(&recording, "/relay/note")), expected);
}

#[test]
fn a_delayed_edge_brings_the_initial_value_and_then_the_sample_before() {
    let place = Place::new();
    let recording = fly(&place, &[source(1), relay("relay", 1, 1)], &[]);
    let before = (1..TICKS).map(|tick| (tick, tick - 1));
    let expected: Vec<_> = std::iter::once((0, INITIAL)).chain(before).collect();
    assert_eq!(seen(&rows(&recording, "/relay/note")), expected);
}

#[test]
fn a_slow_node_sees_the_newest_samples_at_its_ticks() {
    let place = Place::new();
    let recording = fly(&place, &[source(1), relay("relay", 4, 0)], &[]);
    let expected: Vec<_> = (0..TICKS).step_by(4).map(|tick| (tick, tick)).collect();
    assert_eq!(seen(&rows(&recording, "/relay/note")), expected);
}

#[test]
fn a_fast_node_sees_the_newest_sample_of_a_slow_topic() {
    let place = Place::new();
    let recording = fly(&place, &[source(10), relay("relay", 1, 0)], &[]);
    let expected: Vec<_> = (0..TICKS).map(|tick| (tick, tick / 10 * 10)).collect();
    assert_eq!(seen(&rows(&recording, "/relay/note")), expected);
}

#[test]
fn every_mix_of_rates_delays_and_windows_sees_the_newest_sample() {
    let place = Place::new();
    for every_ticks in [1, 3, 10] {
        let relays = [(1, 0), (1, 1), (4, 0), (4, 1), (7, 0), (7, 1)];
        let name = |(period, delay): (u32, u32)| format!("relay-{period}-{delay}");
        let nodes = relays.map(|relay_of @ (period, delay)| relay(&name(relay_of), period, delay));
        let is_quick = |window: &str| [(1, "1"), (3, "5"), (10, "64")].contains(&(every_ticks, window));
        let what = format!("windows of a source every {every_ticks} ticks");
        for window in cases(&what, ["1", "5", "64"], |window| is_quick(window)) {
            let processes = [&[source(every_ticks)], &nodes[..]].concat();
            let recording = fly(&place, &processes, &["--window", window]);
            for relay @ (period, delay) in relays {
                let ticks = (0..TICKS).step_by(period as usize);
                let expected: Vec<_> = ticks.map(|tick| (tick, newest(tick, every_ticks, delay))).collect();
                let found = seen(&rows(&recording, &format!("/{}/note", name(relay))));
                assert_eq!(found, expected, "source every {every_ticks}, {}, window {window}", name(relay));
            }
        }
    }
}

#[test]
fn a_chain_of_nodes_passes_a_sample_on_within_its_tick() {
    let place = Place::new();
    let link = |number: u32| {
        let input = format!("inputs.input = \"/link{}/note\"", number - 1);
        sender(&format!("link{number}"), 1, &input)
    };
    let processes = [sender("link0", 1, ""), link(1), link(2), link(3)];
    let recording = fly(&place, &processes, &[]);
    for topic in ["/link1/note", "/link2/note", "/link3/note"] {
        assert!(seen(&rows(&recording, topic)).iter().all(|(tick, seen)| tick == seen), "{topic}");
    }
}

#[test]
fn two_nodes_in_a_ring_see_each_other_one_tick_apart() {
    let place = Place::new();
    let initial = format!("delay_ticks = 1, initial = {{ tick = {INITIAL} }}");
    let ping = sender("ping", 1, &format!("inputs.input = {{ topic = \"/pong/note\", {initial} }}"));
    let pong = sender("pong", 1, "inputs.input = \"/ping/note\"");
    let recording = fly(&place, &[ping, pong], &[]);
    let expected: Vec<_> = (0..TICKS).map(|tick| (tick, newest(tick, 1, 1))).collect();
    assert_eq!(seen(&rows(&recording, "/ping/note")), expected);
    assert!(seen(&rows(&recording, "/pong/note")).iter().all(|(tick, seen)| tick == seen));
}

#[test]
fn outputs_carry_the_stamp_of_their_tick() {
    let place = Place::new();
    let recording = fly(&place, &[source(1), relay("relay", 1, 0), relay("slow", 4, 1)], &[]);
    for topic in topics(&recording).keys() {
        for row in rows(&recording, topic) {
            assert_eq!(row.time_ns, u64::from(row.tick) * 1_000_000, "{topic}");
            assert_eq!(
                (row.stamp_ns(), row.get("tick")),
                (row.time_ns as f64, f64::from(row.tick)),
                "{topic}"
            );
        }
    }
    let relayed = rows(&recording, "/relay/note");
    assert!(relayed.iter().all(|row| row.get("seen_ns") == row.time_ns as f64), "the stamp that readers see");
}

#[test]
fn a_tick_is_a_whole_number_of_nanoseconds_at_other_rates() {
    let place = Place::new();
    let more = ["--set", "run.rate_hz=250", "--set", "run.duration_s=0.4"];
    let recording = fly(&place, &[source(1), relay("relay", 1, 1)], &more);
    let found = rows(&recording, "/relay/note");
    assert_eq!(found.len(), 100);
    assert!(found.iter().all(|row| row.time_ns == u64::from(row.tick) * 4_000_000));
    assert!(found.iter().all(|row| row.stamp_ns() == row.time_ns as f64));
}

#[test]
fn nobody_runs_ahead_of_the_window() {
    let place = Place::new();
    for (window, pace) in [("1", "free"), ("4", "free"), ("64", "free"), ("3", "8")] {
        let more = ["--window", window, "--pace", pace];
        let recording = fly(&place, &[source(1), relay("relay", 1, 0), relay("slow", 7, 1)], &more);
        let leads = rows(&recording, "/source/note").into_iter().map(|row| row.get("lead_ticks") as u32);
        let (most, window) = (leads.max().unwrap(), window.parse().unwrap());
        assert!(most < window, "{most} ticks ahead in a window of {window} at pace {pace}");
    }
}

#[test]
fn a_node_may_be_without_any_port() {
    let place = Place::new();
    let recording = fly(&place, &[source(1), table("idler", "")], &[]);
    assert_eq!(rows(&recording, "/source/note").len(), TICKS as usize);
}

#[test]
fn a_run_may_be_without_a_recorder() {
    let place = Place::new();
    let text = format!("[run]\nduration_s = 0.1\n{}", source(1));
    let path = place.write("bare.toml", text);
    place.call(&["run", &path]).with_code(0).prints(&["bare: 100 ticks", "passed"]);
    assert!(!std::path::Path::new(&place.path("bare.mcap")).exists());
}
