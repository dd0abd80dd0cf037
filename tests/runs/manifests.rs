//! Manifests beyond a flat list of processes: includes, sets of processes, settings of any key.

use crate::nodes::{manifest, sender, table};
use crate::recordings::{open, require_same};
use crate::refusals::{good, refused, refused_text};
use crate::scenarios::{kind, nodes};
use crate::skipped::is_left;
use crate::support::{Place, repository};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Every manifest that is shipped, but those with programs in other languages, which `tests/bindings` builds and flies.
pub fn shipped() -> Vec<String> {
    let entries = fs::read_dir(repository("manifests")).unwrap().map(|entry| entry.unwrap().path());
    let is_flown_here = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.ends_with(".toml") && !["cpp", "python", "fmu"].iter().any(|language| name.contains(language))
    };
    let mut paths: Vec<String> =
        entries.filter(is_flown_here).map(|path| path.to_string_lossy().into_owned()).collect();
    // Whatever order the file system has them in: cases that are drawn are the same everywhere.
    paths.sort();
    paths
}

/// Manifests that have a node of every kind and every physics backend. They have meshes, free bodies, joints
/// and ropes, a rig and a radio link. They also have a node of another program, steps that take time, each
/// way to replace a node, and many vehicles.
const REPRESENTATIVE: [&str; 24] = [
    "by-hand",
    "commands-over-a-link",
    "computing-time",
    "custom-controller",
    "driven-joints",
    "ground-station-radio",
    "hexa-hover",
    "hover-rapier",
    "identify/excite",
    "imu-detail",
    "labyrinth",
    "replay-nanobench",
    "rig-delay/imu",
    "rig-hover",
    "sensors",
    "slung-load",
    "standby",
    "swap-laws",
    "ten-vehicles",
    "thesis/hover-estimated",
    "thesis/propeller-steps-noisy",
    "wall-follow-constant-thesis",
    "wall-stop-open-gps",
    "wall-stop-thesis-fast",
];

/// True for the manifests that quick tests of all shipped ones take.
fn is_representative(path: &str) -> bool {
    is_shipped_as(&REPRESENTATIVE, path)
}

/// True if `path` is that of a shipped manifest with one of these `names`.
fn is_shipped_as(names: &[&str], path: &str) -> bool {
    names.iter().any(|name| path.ends_with(&format!("/manifests/{name}.toml")))
}

/// Some of those: effects in detail, joints, a rig, a radio link, a node of another program, steps that take time, and a node that is replaced.
const BRIEF: [&str; 12] = [
    "commands-over-a-link",
    "computing-time",
    "custom-controller",
    "driven-joints",
    "hexa-hover",
    "identify/excite",
    "imu-detail",
    "replay-nanobench",
    "rig-hover",
    "sensors",
    "standby",
    "wall-stop-open-gps",
];

/// True for the manifests that quick tests take where each is flown several times.
pub fn is_brief(path: &str) -> bool {
    is_shipped_as(&BRIEF, path)
}

/// Manifests in the folders below that fly by themselves: no sets, campaigns and autopilots, which are parts of
/// others or need a program.
pub fn shipped_in_folders() -> Vec<String> {
    let of = |folder: &str, names: &[&str]| -> Vec<String> {
        names.iter().map(|name| repository(&format!("manifests/{folder}/{name}.toml"))).collect()
    };
    let thesis =
        ["hover-estimated", "hover", "take-off", "propeller-steps-noisy", "propeller-steps", "propeller"];
    let identify = ["excite", "hover-gentle", "low-passes", "rig-a-riddle"];
    let delays = ["command", "flight", "imu", "log", "nothing", "print-a", "print-b", "sticks"];
    [of("thesis", &thesis), of("identify", &identify), of("rig-delay", &delays)].concat()
}

/// Settings that make the shipped manifest at `path` find what is not part of the repository.
pub fn settings(place: &Place, path: &str) -> Vec<String> {
    let binary = Path::new(env!("CARGO_BIN_EXE_hummingbus")).parent().unwrap();
    match Path::new(path).file_stem().unwrap().to_str().unwrap() {
        "replay-nanobench" => {
            let flight = place.write("flight.csv", crate::replay::flight());
            let from_the_start = "process.player.parameters.from_s=0".to_owned();
            vec![format!("process.player.data={flight}"), from_the_start, "run.duration_s=1.001".into()]
        }
        "custom-controller" => {
            vec![format!("process.controller.command=[{:?}]", binary.join("examples/custom_controller"))]
        }
        _ => Vec::new(),
    }
}

/// The graph of the manifest at `path` with `settings`. Nodes of the tests look at their run before they join, and there is none.
#[track_caller]
pub fn graph(path: &str, settings: &[&str]) -> Value {
    let args = settings.iter().flat_map(|setting| ["--set", setting]);
    let args: Vec<&str> = ["check", path, "--json", "--no-programs"].into_iter().chain(args).collect();
    Place::new().call(&args).with_code(0).json()
}

/// The node `name` of a graph.
#[track_caller]
pub fn node<'g>(graph: &'g Value, name: &str) -> &'g Value {
    let mut nodes = graph["nodes"].as_array().unwrap().iter();
    nodes.find(|node| node["name"] == name).unwrap_or_else(|| panic!("no node {name} in {graph}"))
}

/// The topic that input `port` of node `name` reads.
#[track_caller]
fn read_by<'g>(graph: &'g Value, name: &str, port: &str) -> &'g str {
    let input = node(graph, name)["inputs"].as_array().unwrap().iter().find(|input| input["port"] == port);
    let topic = usize::try_from(input.unwrap()["topic"].as_u64().unwrap()).unwrap();
    graph["topics"][topic]["name"].as_str().unwrap()
}

/// The representative ones have every kind of node that any has.
#[test]
fn every_shipped_manifest_is_accepted() {
    assert!(BRIEF.iter().all(|name| REPRESENTATIVE.contains(name)), "{BRIEF:?}");
    if is_left(
        "`the_truth_as_an_estimate_is_flown_by_what_the_thesis_prints_and_by_nothing_else` checks them, too",
    ) {
        return;
    }
    let place = Place::new();
    let shipped = shipped();
    assert!(shipped.len() >= 7, "{shipped:?}");
    let (mut all, mut representative, mut count) = (BTreeSet::new(), BTreeSet::new(), 0);
    for path in shipped.into_iter().chain(shipped_in_folders()) {
        let settings = settings(&place, &path);
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        let graph = graph(&path, &settings);
        let kinds: BTreeSet<String> = nodes(&graph).map(|node| kind(node).to_owned()).collect();
        if is_representative(&path) {
            count += 1;
            representative.extend(kinds.iter().cloned());
        }
        all.extend(kinds);
    }
    assert_eq!(representative, all);
    assert_eq!(count, REPRESENTATIVE.len(), "one of {REPRESENTATIVE:?} is not shipped");
}

// Includes

#[test]
fn an_including_manifest_flies_as_if_it_were_whole() {
    let place = Place::new();
    let whole = place.write("whole.toml", good().replace("duration_s = 0.1", "duration_s = 0.2"));
    place.write("base.toml", good());
    let including = place.write("including.toml", "include = [\"base.toml\"]\n[run]\nduration_s = 0.2\n");
    for path in [&whole, &including] {
        place.call(&["run", path]).with_code(0);
    }
    let [whole, including] =
        ["whole.mcap", "including.mcap"].map(|name| crate::recordings::topics(&place.path(name)));
    crate::recordings::require_same_messages(&whole, &including);
    assert_eq!(attached(&place, "including.mcap", "base.toml"), good());
}

/// The text of an attachment of a recording.
#[track_caller]
fn attached(place: &Place, recording: &str, name: &str) -> String {
    let recording = open(&place.path(recording));
    let mut attachments = recording.attachments().unwrap().into_iter();
    let (_, bytes) = attachments.find(|(found, _)| found == name).unwrap_or_else(|| panic!("no {name}"));
    String::from_utf8(bytes).unwrap()
}

#[test]
fn the_including_file_wins_then_the_later_include_and_lists_add_up() {
    let place = Place::new();
    let pass = |name: &str| {
        format!(
            "[[pass]]\nname = \"{name}\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 1.0\n"
        )
    };
    let measure = |name: &str| pass(name).replace("[[pass]]", "[[measure]]").replace("max = 1.0\n", "");
    place.write("base.toml", good() + &pass("base") + &measure("lowest"));
    let other =
        "include = [\"base.toml\"]\nrun.seed = 5\nprocess.imu.parameters.gyroscope_range_rad_s = 3.0\n";
    place.write("other.toml", other.to_owned() + &pass("other") + &measure("highest"));
    // The base is included by two: it lies below both, and its condition is judged once.
    let top = "include = [\"other.toml\", \"base.toml\"]\nrun.duration_s = 0.3\n";
    let path = place.write("top.toml", top.to_owned() + &pass("top"));
    let graph = graph(&path, &[]);
    assert_eq!((&graph["seed"], &graph["duration_ticks"]), (&5.into(), &300.into()));
    assert_eq!(node(&graph, "imu")["parameters"]["gyroscope_range_rad_s"], 3.0);
    let summary = place.call(&["run", &path, "--json"]).with_code(0).json();
    let names: Vec<&Value> = summary["pass"].as_array().unwrap().iter().map(|pass| &pass["name"]).collect();
    assert_eq!(names, ["base", "other", "top"]);
    let measures = summary["measures"].as_array().unwrap();
    let names: Vec<&Value> = measures.iter().map(|measure| &measure["name"]).collect();
    assert_eq!(names, ["lowest", "highest"]);
    let told = place.call(&["run", &path]).with_code(0).output;
    let height = measures[0]["values"][0].as_f64().unwrap();
    assert!(told.contains(&format!("  value  lowest: {height:.4} m\n")), "{told}");
}

#[test]
fn a_path_is_relative_to_the_file_it_is_written_in() {
    let place = Place::new();
    fs::create_dir(place.path("below")).unwrap();
    let vehicle = repository("vehicles/hummingbird.toml");
    fs::copy(&vehicle, place.path("below/bird.toml")).unwrap();
    place.write("below/base.toml", good().replace(&vehicle, "bird.toml"));
    let path = place.write("top.toml", "include = [\"below/base.toml\"]\n");
    let expected = place.path("below/bird.toml");
    assert_eq!(node(&graph(&path, &[]), "plant")["parameters"]["vehicle"], expected);
    // A setting's path starts at the manifest.
    fs::copy(&vehicle, place.path("bird.toml")).unwrap();
    let graph = graph(&path, &["process.plant.vehicle=bird.toml"]);
    assert_eq!(node(&graph, "plant")["parameters"]["vehicle"], place.path("bird.toml"));
}

#[test]
fn a_process_that_becomes_another_keeps_no_parameters_of_the_one_it_was() {
    let place = Place::new();
    place.write("base.toml", good());
    let pilot = table("pilot", "outputs.set_point = { type = \"hummingbus_msgs/msg/SetPoint\" }");
    let path = place.write("top.toml", format!("include = [\"base.toml\"]\n{pilot}"));
    assert_eq!(node(&graph(&path, &[]), "pilot")["parameters"], serde_json::json!({}));
}

#[test]
fn an_error_in_an_included_file_names_that_file() {
    let place = Place::new();
    let base = place.write("base.toml", good().replace("kind = \"imu\"", "knid = \"imu\""));
    let path = place.write("top.toml", "# A line more.\ninclude = [\"base.toml\"]\n");
    let line = good().lines().position(|line| line == "kind = \"imu\"").unwrap() + 1;
    let ended = place.call(&["check", &path]).with_code(2);
    let start = format!("error: {base}:{line}:1: unknown key `process.imu.knid`");
    assert!(ended.error.starts_with(&start), "expected {start}\n{ended}");
    place.write("base.toml", "[run\n");
    let ended = place.call(&["check", &path]).with_code(2);
    assert!(ended.error.starts_with(&format!("error: {base}:1:5: ")), "{ended}");
}

#[test]
fn an_include_that_is_missing_or_goes_round_or_is_no_file() {
    refused_text("include = [§\"none.toml\"]\n").says(&["none.toml cannot be read: No such file"]);
    refused_text("include = §\"none.toml\"\n").says(&["`include` is a list of files"]);
    refused_text("include = [§3]\n").says(&["`include` is a list of files"]);
    // `refused_text` names its manifest so.
    let ended = refused_text("include = [§\"wrong.toml\"]\n");
    ended.says(&["a cycle of includes: ", "wrong.toml → ", "leave one of these includes out"]);
    let place = Place::new();
    place.write("b.toml", "include = [\"a.toml\"]\n");
    let path = place.write("a.toml", "include = [\"b.toml\"]\n");
    let ended = place.call(&["check", &path]).with_code(2);
    let start = format!("error: {}:1:12: a cycle of includes: {path} → ", place.path("b.toml"));
    assert!(ended.error.starts_with(&start), "expected {start}\n{ended}");
}

// Sets and vehicles

/// A manifest with a set of a source and a relay behind it, a source outside of the set, and `vehicles`.
fn fleet(vehicles: &str) -> String {
    let set = |text: String| text.replace("[process.", "[set.pair.process.");
    let source = set(sender("source", 1, ""));
    let relay = set(sender("relay", 1, "inputs.input = \"/source/note\""));
    let outsider = set(sender("listener", 1, "inputs.input = \"/beacon/note\""));
    manifest(20, &[source, relay, outsider, sender("beacon", 1, ""), vehicles.to_owned()])
}

#[test]
fn a_vehicle_has_the_processes_of_its_set_under_its_name() {
    let place = Place::new();
    let path = place.write("fleet.toml", fleet("[[vehicle]]\nname = \"a\"\nset = \"pair\"\n"));
    let graph = graph(&path, &[]);
    let names: Vec<&Value> = graph["nodes"].as_array().unwrap().iter().map(|node| &node["name"]).collect();
    assert_eq!(names, ["a/listener", "a/relay", "a/source", "beacon", "recorder"]);
    // A topic of the set is the vehicle's own; any other is the run's.
    assert_eq!(read_by(&graph, "a/relay", "input"), "/a/source/note");
    assert_eq!(read_by(&graph, "a/listener", "input"), "/beacon/note");
    place.call(&["run", &path]).with_code(0).prints(&["a/source", "20 ticks"]);
}

#[test]
fn a_count_makes_numbered_vehicles_and_each_has_its_own_noise() {
    let place = Place::new();
    let set = repository("manifests/sets/hover-set.toml");
    let text = format!(
        "include = [{set:?}]\n[run]\nduration_s = 0.05\n[process.recorder]\nkind = \"recorder\"\n\
         [[vehicle]]\nname = \"h\"\nset = \"hummingbird\"\ncount = 3\n"
    );
    let path = place.write("three.toml", text);
    let graph = graph(&path, &[]);
    assert_eq!(graph["nodes"].as_array().unwrap().len(), 3 * 6 + 1);
    assert_eq!(read_by(&graph, "h3/controller", "set_point"), "/h3/pilot/set_point");
    place.call(&["run", &path]).with_code(0);
    let topics = crate::recordings::topics(&place.path("three.mcap"));
    let [first, second] = ["/h1/imu/imu", "/h2/imu/imu"].map(|topic| &topics[topic]);
    assert_eq!((first.len(), second.len()), (50, 50));
    assert!(first.iter().zip(second).all(|(a, b)| a.cdr != b.cdr), "two vehicles share their noise");
}

#[test]
fn a_vehicle_differs_from_its_set_where_it_says_so() {
    let path = repository("manifests/swarm.toml");
    let graph = graph(
        &path,
        &[
            "process.h2/plant.parameters.substeps=2",
            "vehicle.2.process.plant.parameters.initial_position_m=[5.0, 5.0, 1.0]",
        ],
    );
    let position = |name: &str| &node(&graph, name)["parameters"]["initial_position_m"];
    assert_eq!(*position("h1/plant"), serde_json::json!([0.0, 0.0, 1.0]));
    assert_eq!(*position("h2/plant"), serde_json::json!([2.0, 0.0, 1.0]));
    assert_eq!(*position("h3/plant"), serde_json::json!([5.0, 5.0, 1.0]));
    assert_eq!(node(&graph, "h2/plant")["parameters"]["substeps"], 2);
    assert_eq!(node(&graph, "h1/plant")["parameters"]["substeps"], Value::Null);
}

#[test]
fn every_loop_of_a_swarm_stays_on_one_core_and_all_cores_are_used() {
    let graph = graph(&repository("manifests/swarm.toml"), &[]);
    let core = |name: String| node(&graph, &name)["cpu"].as_u64();
    let mut used = BTreeSet::new();
    for vehicle in 1..=4 {
        let cores = ["plant", "imu", "ekf", "controller"].map(|node| core(format!("h{vehicle}/{node}")));
        assert!(cores.iter().all(|core| *core == cores[0]), "h{vehicle}: {cores:?}");
        used.insert(cores[0]);
    }
    assert_eq!(used.len(), bus::process::allowed_cores().len().min(4), "{used:?}");
}

#[test]
fn a_vehicle_that_is_not_well_formed() {
    let vehicle = |text: &str| refused_text(&fleet(&format!("[[vehicle]]\n{text}\n")));
    vehicle("name = \"a\"\nset = §\"pari\"").says(&["there is no set `pari`", "did you mean `pair`?"]);
    vehicle("name = §\"A\"\nset = \"pair\"").says(&["`A` cannot name a vehicle", "lower-case"]);
    vehicle("name = \"a\"\nset = \"pair\"\ncount = §0").says(&["`count` is 0", "1 to 256"]);
    vehicle("name = \"a\"\nset = \"pair\"\n§cuont = 2").says(&["unknown key `cuont`", "`count`?"]);
    let ended = vehicle("name = \"a\"\nset = \"pair\"\nprocess.§sorce.wait = \"spin\"");
    ended.says(&["the vehicle's set has no process `sorce`", "did you mean `source`?"]);
    let twice = "name = \"a1\"\nset = \"pair\"\n[[vehicle]]\nname = §\"a\"\nset = \"pair\"\ncount = 2";
    vehicle(twice).says(&["a vehicle `a1` is there twice"]);
    let ended = refused_text(&(fleet("") + "[set.pair]\n§proces = {}\n"));
    ended.says(&["unknown key `proces`"]);
}

#[test]
fn a_process_of_no_vehicle_cannot_have_a_slash_in_its_name() {
    let ended = refused_text(&fleet(
        "[[vehicle]]\nname = \"a\"\nset = \"pair\"\n[process.§\"a/sorce\"]\nwait = \"spin\"\n",
    ));
    ended.says(&["no vehicle makes a process `a/sorce`", "did you mean `a/source`?"]);
    refused("[process.imu]", "[process.§\"h1/imu\"]").says(&["no vehicle makes a process `h1/imu`"]);
}

// Settings

#[test]
fn a_setting_reaches_elements_of_lists_and_of_included_files() {
    let path = repository("manifests/swap-identical.toml");
    let graph = graph(&path, &["swap.0.at_tick=500", "process.pilot.parameters.set_points.1.amplitude=5.0"]);
    assert_eq!(graph["backups"][0]["take_over_tick"], 500);
    assert_eq!(node(&graph, "pilot")["parameters"]["set_points"][1]["amplitude"], 5.0);
    assert_eq!(node(&graph, "pilot")["parameters"]["set_points"][0]["to"], 1.5);
}

#[test]
fn the_attached_manifest_with_its_settings_flies_the_same() {
    let place = Place::new();
    let (path, recording) = (repository("manifests/swarm.toml"), place.path("a.mcap"));
    let args = ["run", &path, "--record", &recording, "--set", "run.duration_s=4.1", "--set", "pass.0.max=9"];
    let more = ["--set", "process.h2/imu.parameters.gyroscope_range_rad_s=3.0", "--set", "run.pace=50"];
    place.call(&[&args[..], &more].concat()).flown();
    let text = attached(&place, "a.mcap", "swarm.toml");
    assert!(
        text.contains("# Four Hummingbirds") && text.contains("max = 9") && !text.contains("pace"),
        "{text}"
    );
    // Where it lay, it finds what it includes.
    let text = text.replace("sets/hover-set.toml", &repository("manifests/sets/hover-set.toml"));
    let again = place.write("again.toml", text);
    let settings: [&str; 0] = [];
    let graph = graph(&again, &settings);
    assert_eq!(node(&graph, "h2/imu")["parameters"]["gyroscope_range_rad_s"], 3.0);
    assert_eq!(graph["duration_ticks"], 4100);
}

#[test]
fn settings_of_where_and_how_fast_change_no_byte_of_a_recording() {
    let place = Place::new();
    let path = place.write("good.toml", good());
    let fly = |name: &str, settings: &[&str]| {
        let recording = place.path(name);
        let args = settings.iter().flat_map(|setting| ["--set", setting]);
        let args: Vec<&str> = ["run", &path, "--record", &recording].into_iter().chain(args).collect();
        place.call(&args).with_code(0);
        recording
    };
    let plain = fly("plain.mcap", &[]);
    let folder = format!("process.pilot.working_directory={}", repository("docs"));
    let log = format!("process.imu.log={}", place.path("imu.log"));
    let settings = [
        "process.plant.environment.COLOUR=blue",
        "process.plant.nice=3",
        "process.plant.watchdog_ms_host=30000",
        &folder,
        &log,
    ];
    require_same(&fs::read(plain).unwrap(), &fly("set.mcap", &settings));
    assert!(Path::new(&place.path("imu.log")).exists(), "the log was not written");
}
