//! Strikes at a group: its process dies with all members, and others go on in their places. What is recorded is what
//! would have been recorded without the strike.

use crate::campaign;
use crate::flight::{Reference, Watched, messages, write_manifest};
use crate::kill_points::{EDGES, GUARD_TICKS, Moment};
use crate::support::Place;
use rand_core::Rng;
use rustix::process::{Signal, kill_process};
use std::collections::BTreeSet;

const KILL_POINTS: u64 = 12;
/// Strikes come before this tick.
const LAST_TICK: usize = 3000;
/// Compositions with one group, and its members.
const GROUPS: [(&str, &[&str]); 3] = [
    ("all", &["controller", "ekf", "imu", "mocap", "pilot", "plant"]),
    ("ekf+controller+pilot", &["controller", "ekf", "pilot"]),
    ("plant+imu+mocap", &["imu", "mocap", "plant"]),
];

/// One strike.
#[derive(Clone, Copy, Debug)]
struct Case {
    on_exit: &'static str,
    compose: &'static str,
    members: &'static [&'static str],
    moment: Moment,
}

impl Case {
    fn draw(seed: u64, index: u64) -> Self {
        let mut random = bus::random::stream(seed, &format!("strike {index} at a group"));
        let mut below = |bound: usize| random.next_u32() as usize % bound;
        let number = usize::try_from(index).unwrap();
        let (compose, members) = GROUPS[number / 2 % GROUPS.len()];
        let tick =
            if below(4) == 0 { EDGES[below(EDGES.len())] } else { u32::try_from(below(LAST_TICK)).unwrap() };
        let moment = match below(2) {
            0 => Moment::Boundary { tick, is_lifted: below(2) == 0 },
            _ => Moment::Flight(tick.max(1)),
        };
        Self { on_exit: ["restart", "standby"][number % 2], compose, members, moment }
    }
}

fn tables(on_exit: &str) -> String {
    let (_, all) = GROUPS[0];
    all.iter().map(|member| format!("[process.{member}]\non_exit = \"{on_exit}\"\n")).collect()
}

#[test]
fn a_run_goes_on_after_a_strike_at_a_group_as_if_nothing_had_been() {
    let references = ["restart", "standby"].map(|on_exit| Reference::fly_with(&tables(on_exit)));
    let paths = references.each_ref().map(Reference::path);
    campaign::run("groups", KILL_POINTS, Case::draw, |case| {
        strike(case, &paths[usize::from(case.on_exit == "standby")]);
    });
}

fn strike(case: &Case, reference: &str) {
    let place = Place::new();
    let (manifest, recording) = (write_manifest(&place, &tables(case.on_exit)), place.path("flight.mcap"));
    let args = ["run", &manifest, "--record", &recording, "--json", "--compose", case.compose];
    let launch = place.start(&args);
    let watched = Watched::attach(&place);
    match case.moment {
        Moment::Boundary { tick, .. } => assert_eq!(watched.hold_at(tick), tick),
        Moment::Flight(tick) => watched.control.set_hold_tick(tick + GUARD_TICKS),
        Moment::Start(_) => unreachable!("no case strikes while the run starts"),
    }
    let nodes = || case.members.iter().map(|member| watched.node(member).unwrap());
    if case.on_exit == "standby" {
        for node in nodes() {
            watched.await_shadow(&place, node);
        }
    }
    let group = place.group();
    if let Moment::Flight(tick) = case.moment {
        watched.await_ticks(nodes().next(), tick);
    }
    let epoch = watched.control.epoch();
    kill_process(group, Signal::KILL).unwrap();
    if let Moment::Boundary { is_lifted: false, .. } = case.moment {
        watched.await_epoch(epoch + 1);
    }
    watched.control.set_hold_tick(u32::MAX);

    let ended = launch.end().with_code(0);
    ended.says(&["was killed by signal 9 (SIGKILL)", "of group `"]);
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap().iter();
    let flew: BTreeSet<&str> = successions
        .filter(|succession| !succession["take_over_tick"].is_null())
        .filter_map(|succession| succession["process"].as_str())
        .collect();
    assert_eq!(flew, case.members.iter().copied().collect(), "{ended}");
    if case.on_exit == "restart" {
        assert!(std::fs::read(&recording).unwrap() == std::fs::read(reference).unwrap(), "other bytes");
    } else {
        assert!(messages(&recording) == messages(reference), "other messages");
    }
}
