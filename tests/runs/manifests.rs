//! What a manifest can say beyond a flat list of processes: includes, sets of processes, settings of any key,
//! backups, sidecars, and how a process runs on the host.

use crate::nodes::{manifest, sender, table};
use crate::recordings::{open, require_same};
use crate::refusals::{good, refused, refused_setting, refused_text, refused_with};
use crate::support::{Launch, Place, repository};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Every manifest that is shipped.
pub fn shipped() -> Vec<String> {
    let entries = fs::read_dir(repository("manifests")).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some());
    paths.map(|path| path.to_string_lossy().into_owned()).filter(|path| path.ends_with(".toml")).collect()
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

/// The graph of the manifest at `path` with `settings`.
#[track_caller]
fn graph(path: &str, settings: &[&str]) -> Value {
    let words = settings.iter().flat_map(|setting| ["--set", setting]);
    let words: Vec<&str> = ["check", path, "--json"].into_iter().chain(words).collect();
    Place::new().call(&words).with_code(0).json()
}

/// The node `name` of a graph.
#[track_caller]
fn node<'g>(graph: &'g Value, name: &str) -> &'g Value {
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

#[test]
fn every_shipped_manifest_is_accepted() {
    let place = Place::new();
    let shipped = shipped();
    assert!(shipped.len() >= 7, "{shipped:?}");
    for path in shipped {
        let settings = settings(&place, &path);
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        graph(&path, &settings);
    }
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
    place.write("base.toml", good() + &pass("base"));
    let other =
        "include = [\"base.toml\"]\nrun.seed = 5\nprocess.imu.parameters.gyroscope_range_rad_s = 3.0\n";
    place.write("other.toml", other.to_owned() + &pass("other"));
    // The base is included by two: it lies below both, and its condition is judged once.
    let top = "include = [\"other.toml\", \"base.toml\"]\nrun.duration_s = 0.3\n";
    let path = place.write("top.toml", top.to_owned() + &pass("top"));
    let graph = graph(&path, &[]);
    assert_eq!((&graph["seed"], &graph["duration_ticks"]), (&5.into(), &300.into()));
    assert_eq!(node(&graph, "imu")["parameters"]["gyroscope_range_rad_s"], 3.0);
    let summary = place.call(&["run", &path, "--json"]).with_code(0).json();
    let names: Vec<&Value> = summary["pass"].as_array().unwrap().iter().map(|pass| &pass["name"]).collect();
    assert_eq!(names, ["base", "other", "top"]);
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
    let start = format!("error: {base}:{line}:1: unknown field `knid`");
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
    let mut used = std::collections::BTreeSet::new();
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
    vehicle("name = \"a\"\nset = \"pair\"\n§cuont = 2").says(&["unknown field `cuont`", "`count`?"]);
    let ended = vehicle("name = \"a\"\nset = \"pair\"\nprocess.§sorce.wait = \"spin\"");
    ended.says(&["the vehicle's set has no process `sorce`", "did you mean `source`?"]);
    let twice = "name = \"a1\"\nset = \"pair\"\n[[vehicle]]\nname = §\"a\"\nset = \"pair\"\ncount = 2";
    vehicle(twice).says(&["a vehicle `a1` is there twice"]);
    let ended = refused_text(&(fleet("") + "[set.pair]\n§proces = {}\n"));
    ended.says(&["unknown field `proces`"]);
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
    let words =
        ["run", &path, "--record", &recording, "--set", "run.duration_s=4.1", "--set", "pass.0.max=9"];
    let more = ["--set", "process.h2/imu.parameters.gyroscope_range_rad_s=3.0", "--set", "run.pace=50"];
    place.call(&[&words[..], &more].concat()).flown();
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
        let words = settings.iter().flat_map(|setting| ["--set", setting]);
        let words: Vec<&str> = ["run", &path, "--record", &recording].into_iter().chain(words).collect();
        place.call(&words).with_code(0);
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

// Backups

/// The good manifest with a swap of the controller, its keys `keys`.
fn swap(keys: &str) -> String {
    format!("\n§[[swap]]\nprocess = \"controller\"\n{keys}\n")
}

#[test]
fn a_swap_joins_before_it_takes_over() {
    let place = Place::new();
    let swap = "\n[[swap]]\nprocess = \"controller\"\nat_s = 0.05\nshadow_ticks = 9\nrepeat = 3\nevery_ticks = 30\n\
                with = { parameters.gains.altitude_integral_max_m_s2 = 1.0 }\n";
    let path = place.write("swap.toml", good().replace("0.1\nwindow", "0.2\nwindow") + swap);
    let graph = graph(&path, &[]);
    let ticks = |backup: &Value| (backup["join_tick"].as_u64(), backup["take_over_tick"].as_u64());
    let backups = graph["backups"].as_array().unwrap();
    let found: Vec<_> = backups.iter().map(ticks).collect();
    assert_eq!(found, [(41, 50), (71, 80), (101, 110)].map(|(join, take)| (Some(join), Some(take))));
    for backup in backups {
        let plan = &backup["plan"];
        assert_eq!(plan["parameters"]["gains"]["altitude_integral_max_m_s2"], 1.0);
        assert_eq!(plan["parameters"]["vehicle"], node(&graph, "controller")["parameters"]["vehicle"]);
        for key in ["name", "inputs", "outputs", "period_ticks", "cpu", "wait"] {
            assert_eq!(plan[key], node(&graph, "controller")[key], "{key}");
        }
    }
}

#[test]
fn a_shadow_and_a_standby_are_there_from_the_first_tick() {
    let place = Place::new();
    let shadow = "\n[[shadow]]\nprocess = \"imu\"\nwith = { parameters.gyroscope_range_rad_s = 3.0 }\n";
    let standby = "kind = \"pid\"\non_exit = \"standby\"\nstandby = { wait = \"spin\" }";
    let path = place.write("s.toml", good().replace("kind = \"pid\"", standby) + shadow);
    let graph = graph(&path, &[]);
    let [standby, shadow] = [0, 1].map(|index| &graph["backups"][index]);
    for (backup, process, is_standby) in [(standby, "controller", true), (shadow, "imu", false)] {
        assert_eq!(backup["process"], process);
        assert_eq!((&backup["join_tick"], &backup["take_over_tick"]), (&0.into(), &Value::Null));
        assert_eq!(backup["is_standby"], is_standby);
    }
    assert_eq!(standby["plan"]["wait"], "spin");
    assert_eq!(shadow["plan"]["parameters"]["gyroscope_range_rad_s"], 3.0);
    let ended = place.call(&["check", &path]).with_code(0);
    ended.prints(&["if it ends, pid is promoted, which shadows it", "shadowed by imu"]);
}

#[test]
fn a_backup_of_another_kind_has_parameters_and_inputs_of_its_own() {
    let place = Place::new();
    let other = table("other", "").replace("[process.other]\ncommand = ", "");
    let with = format!("command = {}, inputs.set_point = \"/pilot/set_point\"", other.trim());
    let swap = format!(
        "\n[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\nwith = {{ {with} }}\n"
    );
    let path = place.write("other.toml", good() + &swap);
    let graph = graph(&path, &[]);
    let plan = &graph["backups"][0]["plan"];
    assert_eq!(plan["parameters"], serde_json::json!({}));
    assert_eq!(plan["inputs"].as_array().unwrap().len(), 1);
    // What it publishes is what the process before it publishes.
    assert_eq!(plan["outputs"], node(&graph, "controller")["outputs"]);
}

#[test]
fn a_swap_that_comes_too_early_too_late_or_between_two_computations() {
    let at = |keys: &str, more: &str| {
        let text =
            swap(keys).replace('§', "").replace("at_tick = ", "at_tick = §").replace("at_s = ", "at_s = §");
        refused_text(&(good().replace("kind = \"pid\"", &format!("kind = \"pid\"\n{more}")) + &text))
    };
    at("at_tick = 50", "").says(&["would join 100 ticks before, ahead of tick 1", "lower `shadow_ticks`"]);
    at("at_tick = 9\nshadow_ticks = 9", "").says(&["ahead of tick 1"]);
    at("at_tick = 100\nshadow_ticks = 9", "").says(&["tick 100 lies beyond the run, which has 100 ticks"]);
    let ended = at("at_tick = 50\nshadow_ticks = 9\nrepeat = 6\nevery_ticks = 10", "");
    ended.says(&["the take-over at tick 100 lies beyond the run"]);
    let ended = at("at_tick = 50\nshadow_ticks = 9", "period_ticks = 4");
    ended.says(&["it takes over at tick 50, but `controller` computes every 4 ticks"]);
    let ended = at("at_tick = 52\nshadow_ticks = 9", "period_ticks = 4");
    ended.says(&["it joins at tick 43, but `controller` computes every 4 ticks"]);
    at("at_s = 0.05005", "").says(&["`at_s` is 0.05005 s, which is 50.05 ticks"]);
    at("at_s = nan", "").says(&["`swap.0.at_s` is nan, expected a finite number"]);
}

#[test]
fn a_swap_whose_times_say_too_little_or_too_much() {
    refused_with(&swap("")).says(&["the swap has no time", "add at_tick"]);
    refused_with(&swap("at_tick = 50\nshadow_ticks = 0")).says(&["`shadow_ticks` is 0"]);
    let marked = |keys: &str| refused_with(&(swap("").replace('§', "") + keys + "\n"));
    marked("at_tick = 50\nat_s = §0.05").says(&["both `at_tick` and `at_s`"]);
    marked("at_tick = 50\nshadow_ticks = 9\nrepeat = §2").says(&["`repeat` without `every_ticks`"]);
    marked("at_tick = 50\nshadow_ticks = 9\nevery_ticks = §2").says(&["`every_ticks` without `repeat`"]);
    marked("at_tick = 50\nshadow_ticks = 9\nevery_ticks = 2\nrepeat = §0").says(&["`repeat` is 0"]);
    marked("§at_tik = 50").says(&["unknown field `at_tik`", "did you mean `at_tick`?"]);
}

#[test]
fn backups_of_one_process_that_are_there_at_the_same_time() {
    let first = swap("at_tick = 30\nshadow_ticks = 9").replace('§', "");
    let ended = refused_with(&(first.clone() + &swap("at_tick = 40\nshadow_ticks = 9")));
    ended.says(&["would join at tick 31, too soon after the take-over at tick 30", "at tick 42 or later"]);
    let ended = refused_with(&swap("at_tick = 30\nshadow_ticks = 9\nrepeat = 2\nevery_ticks = 12"));
    ended.says(&["would join at tick 33, too soon after the take-over at tick 30"]);
    let shadow = "\n[[shadow]]\nprocess = \"controller\"\n";
    let ended = refused_with(&(shadow.to_owned() + &swap("at_tick = 30\nshadow_ticks = 9")));
    ended.says(&["`controller` has a shadow already", "one shadow at a time"]);
    let standby = good().replace("kind = \"pid\"", "kind = \"pid\"\non_exit = \"standby\"");
    let ended = refused_text(&(standby + &swap("at_tick = 30\nshadow_ticks = 9")));
    ended.says(&["`controller` has a standby already"]);
}

#[test]
fn a_process_that_cannot_be_succeeded() {
    let of = |process: &str| {
        let text = swap("at_tick = 30\nshadow_ticks = 9").replace('§', "");
        refused_with(&text.replace("\"controller\"", &format!("§\"{process}\"")))
    };
    of("contorller").says(&["there is no process `contorller`", "did you mean `controller`?"]);
    of("recorder").says(&["`recorder` cannot be succeeded: it is the recorder, and its file would be torn"]);
    let kept = |text: &str| refused_with(&format!("\n{text}"));
    let sink = table("sink", "inputs.input = \"/imu/imu\"\non_exit = §\"restart\"");
    kept(&sink).says(&["`on_exit` of `sink`: it has no outputs"]);
    let recorder = "kind = \"recorder\"\n";
    refused(recorder, &format!("{recorder}on_exit = §\"restart\"\n"))
        .says(&["`on_exit` of `recorder`", "torn"]);
    refused("kind = \"pid\"", "kind = \"pid\"\nstandby = §{}").says(&["nothing stands by", "on_exit ="]);
    refused("kind = \"pid\"", "kind = \"pid\"\non_exit = §\"revive\"").says(&["`revive`", "`restart`"]);
}

#[test]
fn a_backup_that_would_not_fit_the_graph() {
    let swap = |with: &str| {
        let head = "\n[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\n";
        refused_with(&format!("{head}[swap.with]\n{with}\n"))
    };
    swap("§period_ticks = 2").says(&["a backup cannot have another `period_ticks`"]);
    swap("§outputs.command.topic = \"/x\"").says(&["a backup cannot have another `outputs`"]);
    swap("§knid = \"pid\"").says(&["unknown field `knid`"]);
    swap("kind = §\"pdi\"").says(&["there is no kind `pdi`"]);
    let inputs = "inputs.set_point = \"/pilot/set_point\"\n";
    let ended = swap(&format!("{inputs}inputs.§estimate = \"/plant/stat\""));
    ended.says(&["input `estimate` of `controller`: nobody publishes /plant/stat"]);
    let ended = swap("parameters.§gain = 3");
    ended.says(&["process `controller`", "unknown field `gain`"]);
    swap("parameters = §3").says(&["invalid type"]);
    let at_swap = |with: &str| {
        let head = "\n§[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\n";
        refused_with(&format!("{head}[swap.with]\n{with}\n"))
    };
    at_swap("inputs = {}").says(&["process `controller` has no publisher for its input"]);
    let ended = at_swap("kind = \"imu\"\ninputs = { state = \"/plant/state\" }");
    ended.says(&["the kind `imu` publishes `imu` [hummingbus_msgs/msg/Imu]"]);
    ended.says(&[
        "`controller`, which it would succeed, publishes `command` [hummingbus_msgs/msg/MotorCommand]",
    ]);
}

#[test]
fn a_backup_that_would_close_a_cycle_or_has_too_many_inputs() {
    let [a, b] = [sender("a", 1, ""), sender("b", 1, "inputs.input = \"/a/note\"")];
    let base = manifest(100, &[a, b]);
    let swap = |inputs: &str| {
        let head = "\n§[[swap]]\nprocess = \"a\"\nat_tick = 50\nshadow_ticks = 9\n";
        refused_text(&format!("{base}{head}with = {{ inputs = {{ {inputs} }} }}\n"))
    };
    swap("input = \"/b/note\"").says(&["a cycle without delay: ", "a → b"]);
    let many: Vec<String> = (0..9)
        .map(|port| format!("i{port} = {{ topic = \"/b/note\", delay_ticks = 1, initial = {{}} }}"))
        .collect();
    swap(&many.join(", ")).says(&["the backup of `a` has 9 inputs", "it may have 8"]);
}

// Processes on the host

/// Flies a script as a command beside the good manifest's nodes; it writes what it finds to a file.
#[test]
fn a_sidecar_runs_beside_the_ticks_and_ends_with_the_run() {
    let place = Place::new();
    let script =
        "echo \"$COLOUR $PWD ${HUMMINGBUS_NODE-none} $(basename \"$HUMMINGBUS_RUN\")\" > \"$OUT\"; sleep 600";
    let (out, folder) = (place.path("out"), repository("docs"));
    let sidecar = format!(
        "\n[process.viewer]\nlockstep = false\ncommand = [\"sh\", \"-c\", {script:?}]\n\
         environment = {{ COLOUR = \"blue\", OUT = {out:?} }}\nworking_directory = {folder:?}\n"
    );
    let text = good().replace("duration_s = 0.1", "duration_s = 100\npace = \"realtime\"") + &sidecar;
    let path = place.write("beside.toml", text);
    place.call(&["check", &path]).with_code(0).prints(&["viewer (", "takes no part in the ticks"]);
    let mut launch = place.start(&["run", &path]);
    let written =
        await_it(&mut launch, || fs::read_to_string(&out).ok().filter(|written| written.ends_with('\n')));
    assert!(written.starts_with(&format!("blue {folder} none hummingbus-")), "{written}");
    // It leaves nothing behind, although the script would sleep on.
    launch.signal(rustix::process::Signal::INT);
    launch.end().with_code(1);
}

/// Looks again and again, while a long run goes on.
fn await_it<T>(launch: &mut Launch<'_>, look: impl Fn() -> Option<T>) -> T {
    let looks = (1..1000).find_map(|step| {
        launch.await_ticks(50 * step);
        look()
    });
    looks.expect("it does not come")
}

#[test]
fn a_sidecar_dies_with_a_launcher_that_is_killed() {
    let place = Place::new();
    let sidecar = "\n[process.viewer]\nlockstep = false\ncommand = [\"sleep\", \"600\"]\n";
    let text = good().replace("duration_s = 0.1", "duration_s = 100\npace = \"realtime\"") + sidecar;
    let mut launch = place.start(&["run", &place.write("beside.toml", text)]);
    // The launcher, the clock, seven nodes and the sidecar.
    await_it(&mut launch, || (place.processes().len() >= 10).then_some(()));
    launch.kill();
    place.await_no_process();
}

#[test]
fn a_sidecar_that_would_be_a_node() {
    let with = |more: &str| {
        refused_with(&format!("\n[process.viewer]\nlockstep = false\ncommand = [\"sleep\"]\n{more}\n"))
    };
    with("inputs.§state = \"/plant/state\"").says(&["`inputs` of `viewer`, which has lockstep = false"]);
    with("on_exit = §\"standby\"").says(&["`on_exit` of `viewer`", "nothing can stand by for it"]);
    refused("kind = \"imu\"", "kind = \"imu\"\non_exit = §\"ignore\"").says(&["`on_exit` of `imu`"]);
    refused("kind = \"imu\"", "kind = \"imu\"\nready = §\"notify\"").says(&["`ready` of `imu`"]);
    with("period_ticks = §2").says(&["`period_ticks` of `viewer`", "takes no part in the ticks"]);
    refused("kind = \"imu\"", "lockstep = false\nkind = §\"imu\"").says(&["`kind` of `imu`"]);
}

#[test]
fn a_command_that_is_not_there_or_not_executable() {
    let place = Place::new();
    let text = place.write("text", "no program");
    let with = |word: &str| refused("kind = \"imu\"", &format!("command = §[{word:?}]"));
    with("./none").says(&["process `imu`: cannot start ", "/none: there is no such file", "relative"]);
    with(&text).says(&["it is not executable", "chmod +x"]);
    with("no-such-program").says(&["cannot start `no-such-program`: no folder of PATH"]);
    with("").says(&["no folder of PATH"]);
}

#[test]
fn a_core_that_the_machine_does_not_allow() {
    let cores = bus::process::allowed_cores().iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let list = format!("the allowed cores are {cores}");
    refused("kind = \"imu\"", "kind = \"imu\"\ncpu = §1000").says(&["`cpu` is 1000, a core", &list]);
    refused("window_ticks = 64", "clock_cpu = §1000").says(&["`clock_cpu` is 1000, a core", &list]);
    let manifest = repository("manifests/hover.toml");
    refused_setting(&manifest, &["process.plant.cpu=5000"]).says(&["`cpu` is 5000", &list]);
}

#[test]
fn host_settings_that_no_system_has() {
    let with = |key: &str| refused("kind = \"imu\"", &format!("kind = \"imu\"\n{key}"));
    with("nice = §20").says(&["`nice` is 20", "from -20 to 19"]);
    with("realtime_priority = §0").says(&["`realtime_priority` is 0", "from 1 to 99"]);
    with("watchdog_ms_host = §0").says(&["`watchdog_ms_host` is 0"]);
    with("working_directory = §\"none\"").says(&["`working_directory`: ", "/none is no folder"]);
    with("log = §\"none/imu.log\"").says(&["`log`: the folder of ", "/none/imu.log is not there"]);
    with("log = §\".\"").says(&["is a folder"]);
    let twice = "kind = \"ekf\"\nlog = \"a.log\"";
    let marked = good().replace("kind = \"ekf\"", twice);
    let ended = refused_text(&marked.replace("kind = \"imu\"", "kind = \"imu\"\nlog = §\"./a.log\""));
    ended.says(&["`log`: `imu` writes to the file of `ekf`"]);
    with("environment.§HUMMINGBUS_RUN = \"x\"").says(&["HUMMINGBUS_RUN is set by the launcher"]);
    with("environment.§\"A=B\" = \"x\"").says(&["cannot be an environment variable"]);
    with("environment.A = §3").says(&["invalid type"]);
    with("lockstep = §3").says(&["invalid type"]);
    with("command = §[\"sleep\"]").says(&["process `imu` has both `kind` and `command`"]);
}

#[test]
fn a_priority_is_given_or_refused_with_the_right_that_it_takes() {
    // Numbers of fields in proc_pid_stat(5): niceness, and priority under SCHED_FIFO.
    let keys = [("nice = -20", "ulimit -e", 19, "-20"), ("realtime_priority = 2", "ulimit -r", 40, "2")];
    for (key, limit, field, value) in keys {
        let place = Place::new();
        let text = good().replace("kind = \"imu\"", &format!("kind = \"imu\"\n{key}"));
        let ended = place.call(&["run", &place.write("priority.toml", &text)]);
        if ended.code == Some(0) {
            assert_eq!(running(&place, &text, |process| stat(process, field)), value, "{key}");
        } else {
            let ended = ended.with_code(2);
            ended.says(&[&format!("process `imu`: `{key}` is refused: "), "CAP_SYS_NICE", limit]);
        }
    }
}

#[test]
fn niceness_and_generation_reach_the_process() {
    let text = good().replace("kind = \"imu\"", "kind = \"imu\"\nnice = 7");
    let look = |process: &str| (stat(process, 19), fs::read_to_string(format!("{process}/environ")).unwrap());
    let (nice, environment) = running(&Place::new(), &text, look);
    assert_eq!(nice, "7");
    assert!(environment.split('\0').any(|variable| variable == "HUMMINGBUS_GENERATION=0"), "{environment}");
}

/// What `look` finds in the folder of /proc of the IMU, amid a long run of `text`.
fn running<T>(place: &Place, text: &str, look: impl Fn(&str) -> T) -> T {
    let text = text.replace("duration_s = 0.1", "duration_s = 60\npace = \"realtime\"");
    let mut launch = place.start(&["run", &place.write("running.toml", text)]);
    launch.await_ticks(50);
    let found = look(&format!("/proc/{}", place.process_of("imu").as_raw_nonzero()));
    launch.kill();
    place.await_no_process();
    found
}

/// Field `number` of a process's proc_pid_stat(5); the third, behind the name in brackets, is its state.
fn stat(process: &str, number: usize) -> String {
    let text = fs::read_to_string(format!("{process}/stat")).unwrap();
    let fields = text.rsplit(')').next().unwrap();
    fields.split_whitespace().nth(number - 3).unwrap().to_owned()
}

// Documentation

/// The keys that the refusal of `unknown_key` in the good manifest, with `from` replaced by `to`, names as known.
#[track_caller]
fn known_keys(from: &str, to: &str) -> Vec<String> {
    let place = Place::new();
    assert_eq!(good().matches(from).count(), 1, "{from}");
    let ended = place.call(&["check", &place.write("keys.toml", good().replace(from, to))]).with_code(2);
    ended.says(&["unknown field `", "unknown_key`, expected "]);
    let list = ended.error.split("unknown_key`, expected ").nth(1).unwrap().lines().next().unwrap();
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_documentation_has_every_key() {
    let text = fs::read_to_string(repository("docs/manifest.md")).unwrap();
    let end = "[process.recorder]\nkind = \"recorder\"\n";
    let list = |name: &str| format!("{end}\n[[{name}]]\nunknown_key = 1\n");
    let within = |process: &str, key: &str| format!("kind = \"{process}\"\n{key}.unknown_key = 1");
    let sensor = |kind: &str| {
        let port = if kind == "battery" { "battery" } else { "state" };
        let input = format!("inputs.{port} = \"/plant/{port}\"\n[process.plant.outputs.battery]\n");
        format!("{end}\n[process.sensor]\n{}\n{input}", within(kind, "parameters"))
    };
    let keys = [
        known_keys("window_ticks = 64", "unknown_key = 64"),
        known_keys("kind = \"imu\"", "kind = \"imu\"\nunknown_key = 1"),
        known_keys("kind = \"imu\"", &within("imu", "outputs.imu")),
        known_keys(end, &list("pass")),
        known_keys(end, &list("compare")),
        known_keys(end, &list("swap")),
        known_keys(end, &list("shadow")),
        known_keys(end, &list("vehicle")),
        known_keys("kind = \"plant\"", &within("plant", "parameters")),
        known_keys("kind = \"imu\"", &within("imu", "parameters")),
        known_keys("kind = \"pid\"", &within("pid", "parameters.gains")),
        known_keys("kind = \"pid\"", &within("pid", "parameters.gains.roll")),
        known_keys("initial_altitude_m = 1.0", "initial_altitude_m = 1.0\nunknown_key = 1"),
    ];
    let sensors = ["gps", "barometer", "magnetometer", "mocap", "range", "battery", "rpm"];
    let keys = [keys.concat(), sensors.map(|kind| known_keys(end, &sensor(kind))).concat()].concat();
    assert!(keys.len() > 150, "{keys:?}");
    for key in keys {
        let is_named = [format!("`{key}`"), format!("`{key}."), format!(".{key}`")];
        let is_shown = [format!("{key} = "), format!("{key}.")];
        let is_there = is_named.iter().chain(&is_shown).any(|words| text.contains(words));
        assert!(is_there, "docs/manifest.md has no `{key}`");
    }
}

#[test]
fn the_examples_of_the_documentation_are_toml() {
    let text = fs::read_to_string(repository("docs/manifest.md")).unwrap();
    let examples: Vec<&str> =
        text.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(examples.len() >= 10, "{}", examples.len());
    for example in examples {
        toml::from_str::<toml::Table>(example).unwrap_or_else(|error| panic!("{error}\n{example}"));
    }
}
