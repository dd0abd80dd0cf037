//! A flight whose host times are known: the figures of it must be these numbers.
//!
//! A plant, an IMU at half the rate and a controller in a loop, four ticks. The pictures in the tests' numbers:
//! each node has its inputs, has computed, has sent, and has ended.

use super::age::{Age, Measured, ages};
use super::latency::latencies;
use super::pacing::Pacing;
use super::path::{CriticalPath, Path, Place, Stretch};
use super::times::Times;
use bus::plan::{GroupPlan, InputPlan, MemberPlan, NodePlan, OutputPlan, Pace, Plan, TopicPlan, Wait};
use bus::profile::{GrantWriter, TickWriter};
use bus::sample_ticks::SampleTicks;
use runtime::flight::{Cause, Flight};
use runtime::launcher::{Purpose, Report};
use serde_json::Value;

const PLANT: usize = 0;
const IMU: usize = 1;
const CONTROLLER: usize = 2;
const STATE: usize = 0;
const READING: usize = 1;
const COMMAND: usize = 2;

fn node(name: &str, period_ticks: u32, inputs: &[(usize, u32)], output: usize) -> NodePlan {
    let input = |&(topic, delay_ticks): &(usize, u32)| InputPlan {
        port: format!("in{topic}"),
        topic,
        delay_ticks,
        initial: None,
    };
    NodePlan {
        name: name.to_owned(),
        period_ticks,
        wait: Wait::Block,
        cpu: None,
        inputs: inputs.iter().map(input).collect(),
        outputs: vec![OutputPlan { port: "out".to_owned(), topic: output }],
        parameters: Value::Null,
        files: Vec::new(),
        restarts: false,
        computing_time: None,
        is_recorder: false,
        is_built_in: false,
    }
}

fn plan() -> Plan {
    let topic = |(name, period_ticks): (&str, u32)| TopicPlan {
        name: name.to_owned(),
        type_name: "test_msgs/msg/Number".to_owned(),
        ticks: SampleTicks::every(period_ticks),
    };
    Plan {
        run_id: "synthetic".to_owned(),
        seed: 0,
        tick_ns: 1000,
        duration_ticks: 4,
        first_tick: 0,
        checkpoint_ticks: Vec::new(),
        checkpoint_period: None,
        window_ticks: 64,
        pace: Pace::Free,
        clock_cpu: None,
        profile: true,
        lock_memory: false,
        groups: Vec::new(),
        topics: [("/plant/state", 1), ("/imu/imu", 2), ("/controller/command", 1)].map(topic).into(),
        nodes: vec![
            node("plant", 1, &[(COMMAND, 1)], STATE),
            node("imu", 2, &[(STATE, 0)], READING),
            node("controller", 1, &[(READING, 0), (STATE, 0)], COMMAND),
        ],
    }
}

/// Tick, received, done (and sent), ended.
type Ticks<'a> = &'a [[u32; 4]];

const TICKS: [Ticks<'_>; 3] = [
    &[[0, 1100, 1200, 1250], [1, 1550, 1650, 1700], [2, 1910, 2000, 2010], [3, 2155, 2160, 2165]],
    &[[0, 1300, 1310, 1330], [2, 2050, 2060, 2070]],
    &[[0, 1400, 1450, 1500], [1, 1800, 1900, 1950], [2, 2100, 2150, 2200], [3, 2205, 2255, 2260]],
];

/// A flight of these ticks and grants (tick after the last, deadline, granted).
fn flight(nodes: &[Ticks<'_>], grants: &[(u32, Option<u64>, u64)]) -> Flight {
    let (folder, plan) = (tempfile::tempdir().unwrap(), plan());
    for (index, ticks) in nodes.iter().enumerate() {
        let mut writer = TickWriter::create(folder.path(), &plan, index, 0, 0).unwrap();
        for &[tick, received, done, ended] in *ticks {
            writer.sent(0, done.into());
            writer.end(tick, received.into(), done.into(), ended.into());
        }
    }
    let mut writer = GrantWriter::create(folder.path(), &plan).unwrap();
    grants.iter().for_each(|&(end_tick, deadline, granted)| writer.grant_at(end_tick, deadline, granted));
    Flight::open(&plan, folder.path(), plan.duration_ticks, &[]).unwrap()
}

fn free_flight() -> Flight {
    flight(&TICKS, &[(4, None, 1000)])
}

fn sorted(mut values: Vec<u64>) -> Vec<u64> {
    values.sort_unstable();
    values
}

#[track_caller]
fn require(times: &Times, expected: &[u64]) {
    assert_eq!(times.values(), sorted(expected.to_vec()));
}

#[test]
fn a_tick_splits_into_wait_wake_up_compute_and_publish() {
    let (nodes, _) = latencies(&free_flight());
    let [plant, imu, controller] = &nodes[..] else { panic!("{nodes:?}") };
    // The time at which a node began to wait for its first tick is not known.
    require(&plant.wait, &[1450 - 1250, 1900 - 1700, 2150 - 2010]);
    require(&plant.wake_up, &[1550 - 1450, 1910 - 1900, 2155 - 2150]);
    require(&plant.compute, &[100, 100, 90, 5]);
    require(&plant.publish, &[50, 50, 10, 5]);
    require(&imu.wait, &[2000 - 1330]);
    require(&imu.wake_up, &[50]);
    // At tick 3 its inputs are there before it has ended tick 2: it waits for nothing.
    require(&controller.wait, &[1650 - 1500, 2060 - 1950, 0]);
    require(&controller.wake_up, &[1800 - 1650, 2100 - 2060]);
}

#[test]
fn transport_counts_the_sample_that_was_waited_for() {
    let (_, transport) = latencies(&free_flight());
    let found: Vec<_> = transport
        .iter()
        .map(|hop| (hop.topic.as_str(), hop.reader.as_str(), hop.transport.values()))
        .collect();
    let expected = [
        ("/plant/state", "imu", vec![50]),
        ("/plant/state", "controller", vec![150]),
        ("/imu/imu", "controller", vec![40]),
        ("/controller/command", "plant", vec![5, 10, 100]),
    ];
    assert_eq!(found, expected);
}

#[test]
fn a_command_is_as_old_as_the_oldest_sample_that_went_into_it() {
    let ages = ages(&free_flight(), &Measured::default());
    let age = |topic: &str| -> &Age { ages.iter().find(|age| age.source == topic).unwrap() };
    assert!(ages.iter().all(|age| age.command == "/controller/command"));
    assert_eq!(ages.len(), 2);
    // The IMU runs at every other tick, so at odd ticks the state of the tick before is in the command.
    require(&age("/plant/state").simulated, &[0, 1000, 0, 1000]);
    require(&age("/plant/state").host, &[1450 - 1200, 1900 - 1200, 2150 - 2000, 2255 - 2000]);
    require(&age("/imu/imu").simulated, &[0, 1000, 0, 1000]);
    require(&age("/imu/imu").host, &[1450 - 1310, 1900 - 1310, 2150 - 2060, 2255 - 2060]);
}

#[test]
fn a_sample_that_states_its_measurement_is_as_old_as_that() {
    // Both readings arrive a tick of 1 µs late.
    let measured = Measured::of(READING, &[(0, 0), (2, 1000)]);
    let ages = ages(&free_flight(), &measured);
    let reading = ages.iter().find(|age| age.source == "/imu/imu").unwrap();
    require(&reading.simulated, &[0, 1000, 1000, 2000]);
    let state = ages.iter().find(|age| age.source == "/plant/state").unwrap();
    require(&state.simulated, &[0, 1000, 0, 1000]);
}

fn stretch(place: Place, start_ns: u64, end_ns: u64) -> Stretch {
    Stretch { place, start_ns, end_ns }
}

#[test]
fn the_critical_path_goes_back_over_what_was_waited_for_last() {
    let flight = free_flight();
    let path = |tick| Path::of(&flight, &flight.closing_topics(), tick).unwrap().0;
    assert_eq!(flight.closing_topics(), [COMMAND]);
    let hop = |topic, reader| Place::Hop { topic, reader };
    let first = [
        stretch(Place::Grant(PLANT), 1000, 1100),
        stretch(Place::Node(PLANT), 1100, 1200),
        stretch(hop(STATE, IMU), 1200, 1300),
        stretch(Place::Node(IMU), 1300, 1310),
        stretch(hop(READING, CONTROLLER), 1310, 1400),
        stretch(Place::Node(CONTROLLER), 1400, 1450),
    ];
    assert_eq!(path(0), first);
    // Without the IMU, which is not due, and from the command of the tick before.
    let second = [
        stretch(hop(COMMAND, PLANT), 1450, 1550),
        stretch(Place::Node(PLANT), 1550, 1650),
        stretch(hop(STATE, CONTROLLER), 1650, 1800),
        stretch(Place::Node(CONTROLLER), 1800, 1900),
    ];
    assert_eq!(path(1), second);
    // The controller was still busy with tick 2 when all it needs was there.
    let last = [stretch(Place::Itself(CONTROLLER), 2200, 2205), stretch(Place::Node(CONTROLLER), 2205, 2255)];
    assert_eq!(path(3), last);
}

#[test]
fn the_shares_of_the_critical_path_are_those_of_its_time() {
    let path = CriticalPath::of(&free_flight());
    require(&path.tick_time, &[450, 450, 250, 55]);
    assert_eq!(path.slowest(3), [0, 1, 2]);
    let place = |name: &str| path.places.iter().find(|place| place.place == name).unwrap();
    let total = 450.0 + 450.0 + 250.0 + 55.0;
    for (name, ticks, ns) in [
        ("controller", 4, 50.0 + 100.0 + 50.0 + 50.0),
        ("plant", 3, 100.0 + 100.0 + 90.0),
        ("/plant/state → controller", 1, 150.0),
        ("/controller/command → plant", 2, 100.0 + 10.0),
        ("grant → plant", 1, 100.0),
        ("controller still busy", 1, 5.0),
    ] {
        assert_eq!((place(name).ticks, place(name).share), (ticks, ns / total), "{name}");
    }
    assert_eq!(path.places[0].place, "plant", "the largest share comes first");
    assert!((path.places.iter().map(|place| place.share).sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn jitter_late_grants_and_overruns_are_counted_against_the_deadlines() {
    assert!(Pacing::of(&free_flight(), 0).is_none(), "a free run has no deadlines");
    // Tick 1 is granted after the deadline of tick 2.
    let grants = [(1, Some(1000), 1010), (2, Some(1500), 2005), (3, Some(2000), 2006), (4, Some(2500), 2500)];
    let pacing = Pacing::of(&flight(&TICKS, &grants), 7).unwrap();
    require(&pacing.jitter, &[10, 505, 6, 0]);
    assert_eq!((pacing.late_grants, pacing.missed_deadlines), (1, 7));
    let overruns: Vec<_> = pacing.overruns.iter().map(|node| (node.name.as_str(), node.ticks)).collect();
    // Every node ends tick 0 by 1500, the deadline of tick 1, and tick 1 by 2000.
    assert_eq!(overruns, [("plant", 0), ("imu", 0), ("controller", 0)]);
    let late: Ticks<'_> = &[[0, 1400, 1450, 1501], [1, 1800, 1900, 2000], [2, 2100, 2150, 2600]];
    let pacing = Pacing::of(&flight(&[TICKS[0], TICKS[1], late], &grants), 0).unwrap();
    assert_eq!(pacing.overruns[CONTROLLER].ticks, 2);
}

#[test]
fn ticks_that_one_process_did_not_note_are_left_out_of_what_needs_them() {
    // The plant noted tick 0 only.
    let flight = flight(&[&TICKS[0][..1], TICKS[1], TICKS[2]], &[(4, None, 1000)]);
    let times = flight.at(CONTROLLER, 1).unwrap();
    assert_eq!(flight.waited(CONTROLLER, &times), None);
    assert_eq!(CriticalPath::of(&flight).tick_time.values(), [450]);
    let (nodes, _) = latencies(&flight);
    require(&nodes[CONTROLLER].compute, &[50, 100, 50, 50]);
    require(&nodes[CONTROLLER].wait, &[]);
}

#[test]
fn a_sample_that_was_there_before_the_grant_is_not_waited_for() {
    let flight = flight(&TICKS, &[(1, None, 1000), (4, None, 1500)]);
    let times = flight.at(PLANT, 1).unwrap();
    let waited = flight.waited(PLANT, &times).unwrap();
    assert_eq!((waited.cause, waited.ready_ns), (Cause::Grant, 1500));
}

/// A replacement of the controller that took over at `take_over_tick`, if it did.
fn replacement(generation: u32, take_over_tick: Option<u32>, inputs: &[InputPlan]) -> Report {
    Report {
        process: "controller".to_owned(),
        generation,
        purpose: Purpose::Swap,
        is_planned: true,
        request: None,
        join_tick: Some(0),
        take_over_tick,
        hand_over: None,
        start_ms: 0.0,
        hold_ms: 0.0,
        refused: None,
        inputs: inputs.to_vec(),
    }
}

#[test]
fn ticks_of_shadows_do_not_count_and_a_backup_waits_for_its_own_inputs() {
    let (folder, plan) = (tempfile::tempdir().unwrap(), plan());
    let write = |node: usize, generation: u32, ticks: Ticks<'_>| {
        let mut writer = TickWriter::create(folder.path(), &plan, node, generation, 0).unwrap();
        for &[tick, received, done, ended] in ticks {
            writer.sent(0, done.into());
            writer.end(tick, received.into(), done.into(), ended.into());
        }
    };
    write(PLANT, 0, TICKS[PLANT]);
    write(IMU, 0, TICKS[IMU]);
    // The first died after tick 1, the second was refused, the third took over at tick 2; all of them sent.
    write(CONTROLLER, 0, &TICKS[CONTROLLER][..2]);
    write(CONTROLLER, 1, &[[0, 1, 2, 3], [1, 4, 5, 6], [2, 7, 8, 9], [3, 10, 11, 12]]);
    write(CONTROLLER, 2, &[[1, 1801, 1901, 1951], TICKS[CONTROLLER][2], TICKS[CONTROLLER][3]]);
    let mut writer = GrantWriter::create(folder.path(), &plan).unwrap();
    writer.grant_at(4, None, 1000);
    // It reads the state alone.
    let inputs = &plan.nodes[CONTROLLER].inputs[1..];
    let replacements = [replacement(1, None, &[]), replacement(2, Some(2), inputs)];
    let flight = Flight::open(&plan, folder.path(), plan.duration_ticks, &replacements).unwrap();
    let received = (0..4).map(|tick| flight.at(CONTROLLER, tick).unwrap().received_ns);
    assert_eq!(received.collect::<Vec<_>>(), [1400, 1800, 2100, 2205]);
    assert_eq!(flight.noted(), 4 + 2 + 4);
    let cause = |tick| flight.waited(CONTROLLER, &flight.at(CONTROLLER, tick).unwrap()).unwrap().cause;
    assert_eq!(cause(0), Cause::Sample { topic: READING, tick: 0 });
    assert_eq!(cause(2), Cause::Sample { topic: STATE, tick: 2 });
    assert_eq!(flight.in_order(), [PLANT, IMU, CONTROLLER]);
}

#[test]
fn a_tick_that_was_sent_before_its_process_died_is_that_one_s() {
    let (folder, plan) = (tempfile::tempdir().unwrap(), plan());
    let inputs = &plan.nodes[CONTROLLER].inputs;
    let mut dead = TickWriter::create(folder.path(), &plan, CONTROLLER, 0, 0).unwrap();
    dead.sent(0, 1450);
    dead.end(0, 1400, 1450, 1500);
    let mut next = TickWriter::create(folder.path(), &plan, CONTROLLER, 1, 0).unwrap();
    next.end(0, 1700, 1750, 1800);
    let replacements = [replacement(1, Some(0), inputs)];
    let flight = Flight::open(&plan, folder.path(), plan.duration_ticks, &replacements).unwrap();
    assert_eq!(flight.sent_ns(COMMAND, 0), Some(1450));
}

#[test]
fn members_of_a_group_have_its_name_in_all_outputs() {
    let mut flight = free_flight();
    let members = [PLANT, IMU].map(|node| MemberPlan { node, kind: "test".to_owned() });
    flight.plan.groups = vec![GroupPlan { name: "body".to_owned(), members: members.into(), cpu: None }];
    let profile = super::Profile::of(&flight, 0, None);
    let groups = profile.nodes.iter().map(|node| node.group.as_deref());
    assert_eq!(groups.collect::<Vec<_>>(), [Some("body"), Some("body"), None]);
    let page = String::from_utf8(profile.page("a run", &flight)).unwrap();
    for text in [profile.to_string(), page] {
        assert!(text.contains("imu [body]") && !text.contains("controller [body]"));
    }
}

#[test]
fn names_cannot_break_the_page() {
    let mut flight = free_flight();
    flight.plan.nodes[PLANT].name = "</script><b>".to_owned();
    let profile = super::Profile::of(&flight, 0, None);
    let page = String::from_utf8(profile.page("a \"run\"", &flight)).unwrap();
    assert!(!page.contains("</script><b>"));
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    let data: Value = serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap();
    assert_eq!(data["nodes"][PLANT]["name"], "</script><b>");
    assert_eq!(data["slowest"][0]["tick"], 0);
}
