//! Manifests that are wrong: refused before anything starts, with the place, the fault and the way out.

use crate::nodes::table;
use crate::support::{Ended, Place, repository};

/// Marks the place that a refusal must name, in the text put into a manifest.
const HERE: char = '§';

/// A small manifest that flies.
pub fn good() -> String {
    let vehicle = repository("vehicles/hummingbird.toml");
    format!(
        r#"[run]
duration_s = 0.1
window_ticks = 64

[process.plant]
kind = "plant"
vehicle = "{vehicle}"
inputs.command = {{ topic = "/controller/command", delay_ticks = 1, initial = {{ command = [70, 70, 70, 70] }} }}

[process.imu]
kind = "imu"
inputs.state = "/plant/state"

[process.mocap]
kind = "mocap"
period_ticks = 5
inputs.state = "/plant/state"

[process.ekf]
kind = "ekf"
inputs.imu = "/imu/imu"
inputs.mocap = "/mocap/mocap"

[process.controller]
kind = "pid"
vehicle = "{vehicle}"
inputs.set_point = "/pilot/set_point"
inputs.estimate = "/ekf/estimate"

[process.pilot]
kind = "pilot"

[process.pilot.parameters]
initial_altitude_m = 1.0
set_points = [{{ kind = "step", channel = "altitude", at_s = 0.1, to = 1.5, unit = "m" }}]

[process.recorder]
kind = "recorder"
"#
    )
}

/// The `text`, made of the good manifest, as that of a run at real time that lasts until it is ended.
pub fn endless(text: &str) -> String {
    let duration = "duration_s = 0.1";
    assert!(text.contains(duration), "{text}");
    text.replace(duration, "duration_s = 4000000\npace = \"realtime\"")
}

/// Refuses the good manifest with `from` replaced by `to`, at the place marked in `to`.
#[track_caller]
pub fn refused(from: &str, to: &str) -> Ended {
    assert_eq!(good().matches(from).count(), 1, "{from} stands once in the good manifest");
    refused_text(&good().replace(from, to))
}

/// Refuses the good manifest with `more` at its end.
#[track_caller]
pub fn refused_with(more: &str) -> Ended {
    refused_text(&(good() + more))
}

/// Refuses `marked`, a manifest, at the place that it marks.
#[track_caller]
pub fn refused_text(marked: &str) -> Ended {
    let place = Place::new();
    let path = place.write("wrong.toml", marked.replace(HERE, ""));
    let ended = place.call(&["run", &path]).with_code(2);
    let (line, column) = place_of_mark(marked);
    let start = format!("error: {path}:{line}:{column}: ");
    assert!(ended.error.starts_with(&start), "expected {start}\n{ended}");
    // `check` prints the same message.
    assert_eq!(place.call(&["check", &path]).with_code(2).error, ended.error);
    ended
}

fn place_of_mark(marked: &str) -> (usize, usize) {
    let before = marked.split_once(HERE).expect("a mark").0;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    (before.matches('\n').count() + 1, column)
}

/// Calls `hummingbus` with `args`, which it must refuse at a place in `file`.
#[track_caller]
pub fn refused_args(args: &[&str], file: &str) -> Ended {
    let ended = Place::new().call(args).with_code(2);
    let rest = ended.error.strip_prefix(&format!("error: {file}:"));
    let mut numbers = rest.unwrap_or_else(|| panic!("{file} is not named\n{ended}")).splitn(3, ':');
    let is_number = |part: Option<&str>| part.is_some_and(|part| part.parse::<usize>().is_ok());
    assert!(is_number(numbers.next()) && is_number(numbers.next()), "no line and column\n{ended}");
    ended
}

/// Runs `manifest` with `settings`, the last of which it must refuse.
#[track_caller]
pub fn refused_setting(manifest: &str, settings: &[&str]) -> Ended {
    let args = settings.iter().flat_map(|setting| ["--set", setting]);
    let args: Vec<&str> = ["check", manifest].into_iter().chain(args).collect();
    let ended = Place::new().call(&args).with_code(2);
    let start = format!("error: {manifest}: --set {}: ", settings.last().unwrap());
    assert!(ended.error.starts_with(&start), "expected {start}\n{ended}");
    ended
}

#[test]
fn programs_find_a_refusal_as_json() {
    let place = Place::new();
    let path = place.write("wrong.toml", good().replace("duration_s = 0.1", "duration_s = 0.1\nrate = 1"));
    for command in ["run", "check", "profile"] {
        let ended = place.call(&[command, &path, "--json"]).with_code(2);
        let found = ended.json();
        let fault = &found["faults"][0];
        assert_eq!((&fault["file"], &fault["key"]), (&path.as_str().into(), &"run.rate".into()), "{ended}");
        assert_eq!((fault["line"].as_u64(), fault["column"].as_u64()), (Some(3), Some(1)), "{ended}");
        assert!(fault["message"].as_str().unwrap().starts_with("unknown key `run.rate`"), "{ended}");
        let text = found["error"].as_str().unwrap();
        assert!(ended.error.contains(text) && text.contains(":3:1: unknown key"), "{ended}");
        // Nobody who asks for no JSON gets any.
        assert_eq!(place.call(&[command, &path]).with_code(2).output, "");
    }
    let ended = place.call(&["check", "--json"]).with_code(2);
    assert!(ended.json()["error"].as_str().unwrap().contains("required arguments"), "{ended}");
}

#[test]
fn programs_find_the_faults_of_a_flights_file_and_of_its_vehicle_as_json() {
    let place = Place::new();
    let vehicle = std::fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let line = vehicle.lines().position(|line| line.starts_with("mass = {")).unwrap() as u64 + 1;
    place.write("v.toml", vehicle.replacen("\nmass = {", "\nmass = -1 # {", 1));
    let flights =
        "vehicle = \"v.toml\"\n[[flight]]\nname = \"a\"\nfile = \"a.csv\"\nrole = \"fit\"\nto_s = -1.0\n";
    let flights = place.write("flights.toml", flights);
    let ended = place.call(&["identify", &flights, "--out", &place.path("out"), "--json"]).with_code(2);
    let found = ended.json();
    let of_fault = |fault: &serde_json::Value| {
        let file = fault["file"].as_str().unwrap();
        let file = file.rsplit('/').next().unwrap_or(file).to_owned();
        (file, fault["key"].as_str().unwrap().to_owned(), fault["line"].as_u64())
    };
    let faults: Vec<_> = found["faults"].as_array().unwrap().iter().map(of_fault).collect();
    let expected = [("flights.toml", "flight.0.to_s", 6), ("v.toml", "body.mass", line)];
    let expected = expected.map(|(file, key, line)| (file.to_owned(), key.to_owned(), Some(line)));
    assert_eq!(faults, expected, "{ended}");
    for words in ["`flight.0.to_s` must be", "`body.mass` must be"] {
        assert_eq!(ended.error.matches(words).count(), 1, "{ended}");
    }
}

#[test]
fn the_good_manifest_flies() {
    let place = Place::new();
    let path = place.write("good.toml", good());
    place.call(&["run", &path]).with_code(0);
}

#[test]
fn a_file_that_is_not_there() {
    let place = Place::new();
    let path = place.path("none.toml");
    place.call(&["run", &path]).with_code(2).says(&[&path, "cannot be read", "give the path of a manifest"]);
}

#[test]
fn text_that_is_not_toml() {
    refused("kind = \"imu\"", "kind = §imu\"");
}

#[test]
fn an_unknown_key() {
    refused("kind = \"imu\"", "§knid = \"imu\"")
        .says(&["unknown key `process.imu.knid`", "did you mean `kind`?"]);
    refused("window_ticks", "§windwo_ticks").says(&["unknown key `run.windwo_ticks`", "`window_ticks`?"]);
}

#[test]
fn an_unknown_kind() {
    let ended = refused("kind = \"imu\"", "kind = §\"imus\"");
    ended.says(&["there is no kind `imus`", "did you mean `imu`?", "recorder"]);
    assert!(!ended.error.contains("judge"), "a manifest cannot use it: {ended}");
    refused("kind = \"imu\"", "kind = §\"IMU\"").says(&["did you mean `imu`?"]);
    refused("kind = \"imu\"", "kind = §\"baro\"").says(&["did you mean `barometer`?"]);
    refused("kind = \"imu\"", "kind = §\"lidar\"").says(&["the kinds are", "attitude, barometer"]);
}

#[test]
fn a_process_without_a_kind_or_a_command() {
    refused("[process.imu]\nkind = \"imu\"", "[process.§imu]").says(&["process `imu` needs either"]);
}

#[test]
fn a_command_without_words_or_types() {
    refused("kind = \"imu\"", "command = §[]").says(&["`command` is empty", "name an executable"]);
    let untyped = table("other", "outputs.§note = {}");
    refused_with(&untyped).says(&["output `note` of `other` has no `type`", "hummingbus schema"]);
}

#[test]
fn a_name_that_is_taken_or_has_capitals() {
    refused("[process.imu]", "[process.§clock]").says(&["`clock` cannot name a process", "clock service"]);
    refused("[process.imu]", "[process.§Imu]").says(&["`Imu` cannot name a process", "lower-case"]);
}

#[test]
fn an_unknown_port() {
    let ended = refused("inputs.imu =", "inputs.§imuu =");
    ended.says(&["process `ekf`: kind `ekf` has no input `imuu`", "did you mean `imu`?"]);
    let ended = refused("kind = \"imu\"", "kind = \"imu\"\noutputs.§image = {}");
    ended.says(&["process `imu`: kind `imu` has no output `image`", "imu"]);
    // The ports stay where an argument or a backup changes the kind alone.
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let set = ["check", &hover, "--set", "process.controller.kind=lqr"];
    place.call(&set).with_code(2).says(&[
        "hover.toml:37:8: process `controller`: kind `lqr` has no input `set_point`",
        "it has reference, estimate, attitude",
        "--set process.controller.kind=lqr keeps the inputs: write those of `lqr` as inputs = {",
    ]);
    let swap =
        "\n[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\nwith = { kind = \"lqr\" }\n";
    let manifest = place.write("swap.toml", good() + swap);
    place.call(&["check", &manifest]).with_code(2).says(&[
        "process `controller`: kind `lqr` has no input `set_point`",
        "the backup of `controller` keeps the inputs",
    ]);
}

#[test]
fn a_topic_that_nobody_publishes() {
    let ended = refused("inputs.imu = \"/imu/imu\"", "inputs.§imu = \"/imu/imi\"");
    ended.says(&["input `imu` of `ekf`", "nobody publishes /imu/imi", "did you mean `/imu/imu`?"]);
}

#[test]
fn a_required_input_that_is_not_wired() {
    let ended = refused(
        "[process.ekf]\nkind = \"ekf\"\ninputs.imu = \"/imu/imu\"\n",
        "[process.§ekf]\nkind = \"ekf\"\n",
    );
    ended.says(&["process `ekf` has no publisher for its input `imu`", "hummingbus_msgs/msg/Imu"]);
}

#[test]
fn a_topic_of_another_type() {
    let ended = refused("inputs.imu = \"/imu/imu\"", "inputs.§imu = \"/plant/state\"");
    ended.says(&["reads hummingbus_msgs/msg/Imu", "/plant/state carries hummingbus_msgs/msg/PlantState"]);
}

#[test]
fn a_type_that_a_command_states_wrongly_is_blamed_on_the_command() {
    let law = "command = [\"/bin/true\"]\ninputs.set_point = \"/pilot/set_point\"\ninputs.estimate = \"/ekf/estimate\"\n";
    let vehicle = repository("vehicles/hummingbird.toml");
    let pid = format!(
        "kind = \"pid\"\nvehicle = \"{vehicle}\"\ninputs.set_point = \"/pilot/set_point\"\ninputs.estimate = \"/ekf/estimate\"\n"
    );
    let stated = |outputs: &str| refused(&pid, &format!("{law}{outputs}"));
    stated("outputs.command = { type = §\"hummingbus_msgs/msg/StateEstimate\" }").says(&[
        "output `command` of `controller` is stated as hummingbus_msgs/msg/StateEstimate",
        "input `command` of `plant` reads hummingbus_msgs/msg/MotorCommand",
    ]);
    for name in ["hummingbus_msgs/msg/MotorComand", "MotorComand"] {
        stated(&format!("outputs.command = {{ type = §\"{name}\" }}"))
            .says(&["did you mean `hummingbus_msgs/msg/MotorCommand`?"]);
    }
}

#[test]
fn a_key_that_is_there_twice_is_shown_at_both_places() {
    let ended = refused("window_ticks = 64", "window_ticks = 64\nseed = 1\n§window_ticks = 32");
    ended.says(&[
        "the key `window_ticks` is there twice, first in line 3",
        "3 | window_ticks = 64",
        "5 | window_ticks = 32",
    ]);
    assert!(!ended.error.contains("help:"), "{ended}");
}

/// A message that says what is expected needs no advice to correct the value.
#[test]
fn a_value_of_a_wrong_type_has_no_help() {
    let with = |value: &str| refused("window_ticks = 64", &format!("{value}\nwindow_ticks = 64"));
    for value in ["seed = §-1", "profile = §3", "pace = §[]"] {
        let ended = with(value);
        assert!(!ended.error.contains("help:"), "{ended}");
    }
}

#[test]
fn samples_that_are_never_read_are_warned_of() {
    let place = Place::new();
    let path = place.write("good.toml", good());
    let told = |settings: &[&str]| {
        let settings = settings.iter().flat_map(|setting| ["--set", setting]);
        let args: Vec<&str> =
            ["check", &path, "--set", "run.duration_s=1"].into_iter().chain(settings).collect();
        place.call(&args).with_code(0).error
    };
    for (settings, said) in [
        (
            &["process.imu.period_ticks=2", "process.ekf.period_ticks=3"][..],
            "33 % of the measurements are never read",
        ),
        (&["process.ekf.period_ticks=4"], "75 % of the measurements are never read"),
        (
            &["process.imu.period_ticks=2", "process.ekf.period_ticks=10"],
            "80 % of the measurements are never read",
        ),
        (&["process.ekf.period_ticks=20", "process.imu.period_ticks=20"], "input `mocap` of `ekf`"),
        (
            &["process.mocap.parameters.delay_ms=300"],
            "at least 300 ms old when they arrive, and `ekf` remembers 200 ms",
        ),
        (&["process.mocap.outputs.mocap.every_ticks=30"], "67 % of the measurements are never sent"),
    ] {
        let error = told(settings);
        assert!(error.starts_with("warning: ") && error.contains(said), "{settings:?}: {error}");
    }
    for harmless in [
        &["process.imu.period_ticks=4", "process.ekf.period_ticks=4"][..],
        &["process.imu.period_ticks=4", "process.ekf.period_ticks=2"],
        &["process.controller.period_ticks=4"],
        &["process.mocap.parameters.delay_ms=200"],
        // A sensor that measures at every tick may send less often, and a sensor with a rate may repeat its measurements.
        &["process.imu.outputs.imu.every_ticks=2", "process.ekf.period_ticks=2"],
        &["process.mocap.outputs.mocap.every_ticks=5"],
        &["run.rate_hz=4000", "process.ekf.period_ticks=4", "process.mocap.period_ticks=20"],
    ] {
        assert_eq!(told(harmless), "", "{harmless:?}");
    }
}

#[test]
fn two_publishers_on_one_topic() {
    let second = "[process.imu2]\nkind = \"imu\"\ninputs.state = \"/plant/state\"\n";
    let ended = refused_with(&format!("\n{second}outputs.§imu = {{ topic = \"/imu/imu\" }}\n"));
    ended.says(&["two publishers on topic /imu/imu: `imu` and `imu2`", "[process.imu2.outputs]"]);
}

#[test]
fn a_topic_without_a_slash() {
    let ended = refused("kind = \"imu\"", "kind = \"imu\"\noutputs.§imu = { topic = \"imu\" }");
    ended.says(&["`imu` cannot name a topic", "starts with `/`"]);
}

#[test]
fn an_output_between_two_ticks_of_its_process() {
    let ended =
        refused("kind = \"imu\"", "kind = \"imu\"\nperiod_ticks = 2\noutputs.imu = { every_ticks = §3 }");
    ended.says(&[
        "output `imu` is due every 3 ticks (333.333 Hz), its process runs every 2 (500 Hz)",
        "a multiple of the process's `period_ticks`: 2 (500 Hz) or 4 (250 Hz)",
    ]);
    let place = Place::new();
    let path = place.write("good.toml", good());
    refused_setting(&path, &["process.imu.period_ticks=2", "process.imu.outputs.imu.every_ticks=3"])
        .says(&["every 3 ticks (333.333 Hz)"]);
    refused("kind = \"imu\"", "kind = \"imu\"\nperiod_ticks = §0").says(&["`period_ticks` is 0"]);
}

#[test]
fn a_cycle_without_delay() {
    let command = ", delay_ticks = 1, initial = { command = [70, 70, 70, 70] }";
    let place = Place::new();
    let path = place.write("cycle.toml", good().replace(command, ""));
    let ended = refused_args(&["run", &path], &path);
    ended.says(&["a cycle without delay: ", "delay_ticks = 1", "initial value"]);
    // The loop through the IMU is as good an answer.
    let cycles = [&["plant", "mocap", "ekf", "controller"][..], &["plant", "imu", "ekf", "controller"]];
    assert!(cycles.iter().any(|cycle| names_cycle(&ended, cycle)), "{ended}");
}

/// True if a cycle is named in the direction of the data, from any of its nodes on.
fn names_cycle(ended: &Ended, nodes: &[&str]) -> bool {
    (0..nodes.len()).any(|start| {
        let path: Vec<_> = (0..=nodes.len()).map(|step| nodes[(start + step) % nodes.len()]).collect();
        ended.error.contains(&format!("a cycle without delay: {}\n", path.join(" → ")))
    })
}

#[test]
fn a_cycle_of_three_is_named_in_the_direction_of_the_data() {
    let node = |name: &str, before: &str| {
        table(name, &format!("inputs.input = \"/{before}/x\"\noutputs.x = {{ type = \"a/msg/X\" }}"))
    };
    let place = Place::new();
    let nodes = [node("a", "c"), node("b", "a"), node("c", "b")].concat();
    let path = place.write("cycle.toml", format!("[run]\nduration_s = 1\n{nodes}"));
    let ended = refused_args(&["run", &path], &path);
    assert!(names_cycle(&ended, &["a", "b", "c"]), "{ended}");
}

#[test]
fn a_delay_without_an_initial_value_or_the_other_way_round() {
    let edge = "inputs.imu = \"/imu/imu\"";
    let ended = refused(edge, "inputs.§imu = { topic = \"/imu/imu\", delay_ticks = 1 }");
    ended.says(&["input `imu` of `ekf` is delayed and has no initial value", "initial ="]);
    let ended = refused(edge, "inputs.§imu = { topic = \"/imu/imu\", initial = {} }");
    ended.says(&["has an initial value but no delay", "add delay_ticks = 1", "leave the initial value out"]);
    // The argument is named, not the line of the file that it changes.
    let hover = repository("manifests/hover.toml");
    let ended = refused_setting(&hover, &["process.plant.inputs.command.delay_ticks=0"]);
    ended.says(&["has an initial value but no delay", "process.plant.inputs.command=/controller/command"]);
    let ended = refused_setting(&hover, &["process.plant.inputs.command.topic=/controller/comand"]);
    ended.says(&["nobody publishes /controller/comand", "did you mean `/controller/command`?"]);
    let ended = refused(edge, "inputs.§imu = { topic = \"/imu/imu\", delay_ticks = 2, initial = {} }");
    ended.says(&["has delay_ticks = 2", "0 or 1"]);
}

#[test]
fn an_initial_value_that_does_not_fit() {
    let initial = "inputs.command = { topic = \"/controller/command\", delay_ticks = 1, initial = { command = [70, 70, 70, 70] } }";
    let with = |value: &str| {
        let text = initial.replace("inputs.command", "inputs.§command");
        refused(initial, &text.replace("{ command = [70, 70, 70, 70] }", value))
    };
    with("{ comand = [70, 70, 70, 70] }").says(&["no field `comand`", "stamp, command"]);
    with("{ command = [70, 70, 70] }").says(&[
        "3 motor commands, expected 4, one for each rotor",
        "the input's `initial` a number for each rotor",
    ]);
    with("{ command = [70, 70, 70, \"70\"] }").says(&["`command[3]` is \"70\", expected a number"]);
    with("{ command = 70 }").says(&["`command` is 70, expected an array of at most 12"]);
    with("70").says(&["is 70, expected a table of fields", "hummingbus_msgs/msg/MotorCommand"]);
}

#[test]
fn a_second_recorder_on_the_same_file() {
    let place = Place::new();
    let path = place.write("two.toml", good() + "\n[process.recorder2]\nkind = \"recorder\"\n");
    refused_args(&["run", &path], &path).says(&["recorder", "recorder2"]);
}

#[test]
fn a_recorder_that_would_leave_samples_out() {
    let manifest = repository("manifests/hover.toml");
    let delayed = "process.recorder.inputs.state={topic=\"/plant/state\",delay_ticks=1,initial={}}";
    for setting in ["process.recorder.period_ticks=10", delayed] {
        let ended = Place::new().call(&["check", &manifest, "--set", setting]).with_code(2);
        ended.says(&["the recorder `recorder` would leave samples out"]);
    }
}
