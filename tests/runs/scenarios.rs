//! The thesis's scenarios and those beyond: every condition holds, whatever the seed, and no controller is told the
//! truth.

use crate::recordings::rows;
use crate::skipped::{cases, first, is_left, is_thorough, leave};
use crate::support::{Ended, Place, repository};
use serde_json::Value;
use std::collections::BTreeSet;

/// Thorough tests fly the hover with all; the longer scenarios have one each here, and all by `scripts/scenarios`.
const SEEDS: [u32; 3] = [1, 2, 3];

/// The kinds of node that may read the plant's state: sensors, and those who judge or place.
const MAY_KNOW: [&str; 12] = [
    "barometer",
    "clearance",
    "gps",
    "imu",
    "magnetometer",
    "mocap",
    "plant",
    "range",
    "recorder",
    "rpm",
    "traffic",
    "battery",
];

/// The messages that hold it.
pub const TRUTHS: [&str; 8] = [
    "Clearance",
    "Contact",
    "MeasuredState",
    "Odometry",
    "PlantState",
    "PoseStamped",
    "TFMessage",
    "Traffic",
];

/// Flies the manifest at `path` composed: the bytes are those of single processes (`compose`, `in_process`), and are there
/// sooner on a machine that has other things to do.
pub fn composed(place: &Place, path: &str, recording: &str, settings: &[&str]) -> Ended {
    let mut args = vec!["run", path, "--record", recording, "--compose", "all"];
    settings.iter().for_each(|setting| args.extend(["--set", setting]));
    place.call(&args)
}

/// Flies the scenarios that the running test takes: all, or those of `quick`. `scripts/scenarios` flies all with every seed.
fn fly_some(all: &[&str], quick: &[&str]) {
    cases("scenarios", all.iter().copied(), |name| quick.contains(name)).into_iter().for_each(fly);
}

/// Flies `name` with one seed, or with each of several; its own conditions decide.
fn fly(name: &str) {
    fly_with(name, &SEEDS[..1]);
}

fn fly_with(name: &str, seeds: &[u32]) {
    let manifest = repository(&format!("manifests/{name}.toml"));
    for seed in first(1, &format!("seeds of {name}"), seeds) {
        let place = Place::new();
        let (recording, seed) = (place.path("flight.mcap"), format!("run.seed={seed}"));
        let ended = composed(&place, &manifest, &recording, &[&seed]);
        assert_eq!(ended.code, Some(0), "{ended}");
    }
}

#[test]
fn hover_and_doublet_on_both_backends() {
    fly_with("hover", &SEEDS);
    fly_with("hover-rapier", &SEEDS);
}

/// All processes at eight times the rate, whose delays are as long as before.
#[test]
fn hover_and_doublet_at_8_khz() {
    let (place, hover) = (Place::new(), repository("manifests/hover.toml"));
    let args = ["run", &hover, "--record", "none", "--in-process", "--set", "run.rate_hz=8000"];
    place.call(&args).with_code(0).prints(&["hover: 96000 ticks (12.000 s)", "\npassed"]);
}

#[test]
fn take_off_in_disturbed_air() {
    fly("take-off");
    fly("take-off-attitude");
}

/// Quick tests fly rig A until both sticks were answered: a rig takes longer than its simulated time.
#[test]
fn sticks_in_both_rigs() {
    if is_thorough() {
        return ["rig-a", "rig-b"].into_iter().for_each(fly);
    }
    let (place, manifest) = (Place::new(), repository("manifests/rig-a.toml"));
    composed(&place, &manifest, &place.path("flight.mcap"), &["run.duration_s=16"]).with_code(0);
    leave(2, "scenarios");
}

#[test]
fn hovers_with_an_imu_in_detail() {
    fly_with("imu-detail", &SEEDS);
}

#[test]
fn rotors_hover_faster_where_they_lift_what_hangs_in_the_rig() {
    fly("rig-hover");
}

/// Of each the conditions in its first seconds, roll and pitch; `scripts/rig_delay` flies them whole.
#[test]
fn a_delay_beside_the_loop_shows_as_it_is_and_one_inside_is_not_flyable() {
    for name in cases("delays", ["nothing", "print-b", "imu"], |name| *name != "nothing") {
        let (place, manifest) = (Place::new(), repository(&format!("manifests/rig-delay/{name}.toml")));
        let recording = place.path("flight.mcap");
        composed(&place, &manifest, &recording, &["run.duration_s=7"]).with_code(0);
    }
}

#[test]
fn stops_before_a_wall_by_our_law_at_three_speeds() {
    fly_some(&["wall-stop-slow", "wall-stop", "wall-stop-fast"], &["wall-stop"]);
}

/// The vehicle brakes from its cruising speed to standstill without speeding up on the way, at each speed and seed.
#[test]
fn it_stops_once_before_a_wall() {
    const STOPPED_M_S: f64 = 0.1;
    const STEPS_M_S: f64 = 0.03;
    let flights = [("wall-stop-fast", 15), ("wall-stop", 22), ("wall-stop-slow", 35)];
    for (name, seconds) in first(2, "speeds", flights) {
        for seed in first(1, &format!("seeds of {name}"), SEEDS) {
            let (place, manifest) = (Place::new(), repository(&format!("manifests/{name}.toml")));
            let recording = place.path("flight.mcap");
            let [duration, seed_set] = [format!("run.duration_s={seconds}"), format!("run.seed={seed}")];
            composed(&place, &manifest, &recording, &[&duration, &seed_set]);
            let speeds_m_s = rows(&recording, "/plant/state").into_iter().map(|row| row.get("velocity.x"));
            let speeds_m_s = speeds_m_s.skip_while(|speed| *speed < 2.0 * STOPPED_M_S).collect::<Vec<_>>();
            let stopped = speeds_m_s.iter().position(|speed| *speed < STOPPED_M_S).expect("it stops");
            let (braking, after) = speeds_m_s.split_at(stopped);
            let again_m_s = after.iter().fold(0.0_f64, |most, speed| most.max(*speed));
            assert!(again_m_s <= STOPPED_M_S, "{name}, seed {seed}: stopped, and flew on at {again_m_s} m/s");
            let half_m_s = 0.5 * braking.iter().fold(0.0_f64, |most, speed| most.max(*speed));
            let begins = braking.iter().rposition(|speed| *speed > half_m_s).expect("it cruises");
            let mut slowest_m_s = half_m_s;
            for speed_m_s in &braking[begins + 1..] {
                slowest_m_s = slowest_m_s.min(*speed_m_s);
                let rise_m_s = speed_m_s - slowest_m_s;
                assert!(rise_m_s < STEPS_M_S, "{name}, seed {seed}: {rise_m_s} m/s faster while it brakes");
            }
        }
    }
}

#[test]
fn stops_before_a_wall_by_the_thesis_s_law_at_three_speeds() {
    fly_some(
        &["wall-stop-thesis-slow", "wall-stop-thesis", "wall-stop-thesis-fast"],
        &["wall-stop-thesis-fast"],
    );
}

#[test]
fn stops_before_a_wall_in_the_open_and_stands_there_with_gps() {
    fly_some(&["wall-stop-open", "wall-stop-open-gps"], &["wall-stop-open-gps"]);
}

#[test]
fn follows_the_walls_at_varying_speed() {
    fly_some(&["wall-follow-varying", "wall-follow-varying-thesis"], &["wall-follow-varying-thesis"]);
}

#[test]
fn follows_the_walls_at_a_constant_distance() {
    if is_left("`follows_the_walls_at_varying_speed` follows them") {
        return;
    }
    ["wall-follow-constant", "wall-follow-constant-thesis"].into_iter().for_each(fly);
}

#[test]
fn among_meshes_in_an_office_and_a_labyrinth() {
    first(1, "scenarios", ["labyrinth", "office"]).into_iter().for_each(fly);
}

#[test]
fn among_free_bodies_with_a_slung_load_in_a_workshop_and_with_driven_joints() {
    first(2, "scenarios", ["driven-joints", "slung-load", "workshop"]).into_iter().for_each(fly);
}

#[test]
fn a_hexacopter_and_an_octocopter_hover_and_follow_a_doublet() {
    ["hexa-hover", "octo-hover"].into_iter().for_each(|name| fly_with(name, &SEEDS));
}

/// Thrust over weight of 17 to 40: racers have 10 to 16.
#[test]
fn vehicles_that_lift_many_times_their_weight_hold_their_set_point() {
    let text = std::fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    for multiple in [17, 28, 40] {
        // Four times 7.6184e-8 N/rpm^2 at 8600 rpm.
        let mass_kg = 22.538 / 9.81 / f64::from(multiple);
        let place = Place::new();
        let strong = text.replacen("mass = { value = 0.480", &format!("mass = {{ value = {mass_kg}"), 1);
        let vehicle = place.write("strong.toml", strong);
        let sets = ["plant", "controller"].map(|process| format!("process.{process}.vehicle={vehicle}"));
        let ended = composed(
            &place,
            &repository("manifests/hover.toml"),
            &place.path("flight.mcap"),
            &sets.each_ref().map(String::as_str),
        );
        assert_eq!(ended.code, Some(0), "{multiple}: {ended}");
    }
}

/// Not for the two laps that the manifest asks for, which take a minute: for half a lap, and no contact.
#[test]
fn ten_vehicles_share_a_room() {
    let (place, manifest) = (Place::new(), repository("manifests/ten-vehicles.toml"));
    let recording = place.path("flight.mcap");
    let args = ["run", &manifest, "--record", &recording, "--json", "--compose", "all"];
    let ended = place.call(&[&args[..], &["--set", "run.duration_s=20"]].concat());
    let summary = ended.json();
    let (contacts, laps): (Vec<&Value>, Vec<&Value>) = summary["pass"]
        .as_array()
        .unwrap()
        .iter()
        .partition(|pass| pass["unit"] == "1" && pass["max"] == 0.0);
    assert_eq!((contacts.len(), laps.len()), (10, 10));
    assert!(contacts.iter().all(|pass| pass["passed"] == true), "{ended}");
    assert!(laps.iter().all(|pass| pass["values"][0].as_f64().unwrap() > 0.5), "{ended}");
}

#[test]
fn a_figure_eight_at_three_metres_a_second() {
    fly("figure-eight");
}

#[test]
fn four_laws_take_over_from_each_other() {
    fly("swap-laws");
}

#[test]
fn over_a_serial_radio_good_and_bad() {
    fly("ground-station");
    fly("ground-station-radio");
}

#[test]
fn by_controllers_whose_steps_take_time() {
    if is_left("`judging::a_run_without_a_recording_has_the_verdict_of_its_recording` flies half of it") {
        return;
    }
    fly("computing-time");
}

/// Every way from the plant's truth to a controller leads through a sensor.
#[test]
fn no_controller_is_told_the_truth() {
    let manifests = [
        "hover",
        "hover-rapier",
        "hexa-hover",
        "octo-hover",
        "take-off",
        "take-off-attitude",
        "rig-a",
        "rig-b",
        "rig-hover",
        "rig-delay/nothing",
        "rig-delay/command",
        "rig-delay/imu",
        "rig-delay/sticks",
        "rig-delay/log",
        "rig-delay/print-a",
        "rig-delay/print-b",
        "wall-stop-slow",
        "wall-stop",
        "wall-stop-fast",
        "wall-stop-thesis-slow",
        "wall-stop-thesis",
        "wall-stop-thesis-fast",
        "wall-stop-open",
        "wall-stop-open-gps",
        "wall-follow-varying",
        "wall-follow-constant",
        "wall-follow-varying-thesis",
        "wall-follow-constant-thesis",
        "ten-vehicles",
        "figure-eight",
        "swap-laws",
        "ground-station",
        "llp-hlp",
        "computing-time",
    ];
    // One of each kind.
    let quick = ["hexa-hover", "rig-hover", "rig-delay/imu", "wall-stop-thesis-fast", "wall-stop-open-gps"];
    let others = ["wall-follow-constant-thesis", "ten-vehicles", "swap-laws", "computing-time"];
    let is_quick = |name: &&str| quick.contains(name) || others.contains(name);
    for manifest in cases("manifests", manifests, is_quick) {
        let path = repository(&format!("manifests/{manifest}.toml"));
        let graph = Place::new().call(&["check", &path, "--json"]).with_code(0).json();
        let told = readers_of(&graph, &TRUTHS);
        assert!(told.contains("imu"), "{manifest}: {told:?}");
        let others: Vec<_> = told.iter().filter(|kind| !MAY_KNOW.contains(&kind.as_str())).collect();
        assert!(others.is_empty(), "{manifest}: {others:?} are told the truth");
    }
}

/// Of the wall scenarios the controllers know range finders, IMU and attitude alone.
#[test]
fn the_wall_scenarios_know_range_finders_and_imu_alone() {
    let manifests = [
        "wall-stop",
        "wall-stop-thesis",
        "wall-stop-open",
        "wall-follow-varying",
        "wall-follow-constant",
        "wall-follow-varying-thesis",
        "wall-follow-constant-thesis",
        "ten-vehicles",
    ];
    for manifest in manifests {
        let path = repository(&format!("manifests/{manifest}.toml"));
        let graph = Place::new().call(&["check", &path, "--json"]).with_code(0).json();
        let kinds: BTreeSet<_> = nodes(&graph).map(kind).collect();
        assert!(["gps", "mocap", "ekf"].iter().all(|kind| !kinds.contains(kind)), "{manifest}: {kinds:?}");
        let walls = readers_of(&graph, &["WallEstimate", "AttitudeEstimate"]);
        assert!(walls.iter().any(|kind| kind.starts_with("wall-")), "{manifest}: {walls:?}");
    }
}

/// The nodes of a graph and those that succeed them.
pub fn nodes(graph: &Value) -> impl Iterator<Item = &Value> {
    graph["nodes"].as_array().unwrap().iter().chain(graph["backups"].as_array().unwrap())
}

pub fn kind(node: &Value) -> &str {
    node["what"].as_str().unwrap()
}

/// The kinds of the nodes that read messages of `types`.
pub fn readers_of(graph: &Value, types: &[&str]) -> BTreeSet<String> {
    let type_of = |input: &Value| {
        let topic = &graph["topics"][usize::try_from(input["topic"].as_u64().unwrap()).unwrap()];
        topic["type_name"].as_str().unwrap().to_owned()
    };
    let is_one = |input: &Value| types.iter().any(|name| type_of(input).ends_with(&format!("/{name}")));
    let inputs = |node: &Value| node.get("plan").unwrap_or(node)["inputs"].as_array().unwrap().clone();
    let reads = |node: &&Value| inputs(node).iter().any(is_one);
    nodes(graph).filter(reads).map(|node| kind(node).to_owned()).collect()
}
