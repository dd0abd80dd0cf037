//! Manifests that are wrong: refused before anything starts, with the place, the fault and the way out.

use crate::nodes::{sender, table};
use crate::replay::flight;
use crate::support::{Ended, Place, repository};
use std::fs;

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
    // `check` refuses in the same words.
    assert_eq!(place.call(&["check", &path]).with_code(2).error, ended.error);
    ended
}

fn place_of_mark(marked: &str) -> (usize, usize) {
    let before = marked.split_once(HERE).expect("a mark").0;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    (before.matches('\n').count() + 1, column)
}

/// Calls `hummingbus` with `words`, which it must refuse at a place in `file`.
#[track_caller]
fn refused_words(words: &[&str], file: &str) -> Ended {
    let ended = Place::new().call(words).with_code(2);
    let rest = ended.error.strip_prefix(&format!("error: {file}:"));
    let mut numbers = rest.unwrap_or_else(|| panic!("{file} is not named\n{ended}")).splitn(3, ':');
    let is_number = |part: Option<&str>| part.is_some_and(|part| part.parse::<usize>().is_ok());
    assert!(is_number(numbers.next()) && is_number(numbers.next()), "no line and column\n{ended}");
    ended
}

/// Runs `manifest` with `settings`, the last of which it must refuse.
#[track_caller]
pub fn refused_setting(manifest: &str, settings: &[&str]) -> Ended {
    let words = settings.iter().flat_map(|setting| ["--set", setting]);
    let words: Vec<&str> = ["check", manifest].into_iter().chain(words).collect();
    let ended = Place::new().call(&words).with_code(2);
    let start = format!("error: {manifest}: --set {}: ", settings.last().unwrap());
    assert!(ended.error.starts_with(&start), "expected {start}\n{ended}");
    ended
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
    refused("kind = \"imu\"", "§knid = \"imu\"").says(&["unknown field `knid`", "did you mean `kind`?"]);
    refused("window_ticks", "§windwo_ticks").says(&["unknown field `windwo_ticks`", "`window_ticks`?"]);
}

#[test]
fn an_unknown_kind() {
    let ended = refused("kind = \"imu\"", "kind = §\"imus\"");
    ended.says(&["there is no kind `imus`", "did you mean `imu`?", "recorder"]);
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
    refused_with(&untyped).says(&["output `note` of a command has no `type`", "hummingbus schema"]);
}

#[test]
fn a_name_that_is_taken_or_has_capitals() {
    refused("[process.imu]", "[process.§clock]").says(&["`clock` cannot name a process", "clock service"]);
    refused("[process.imu]", "[process.§Imu]").says(&["`Imu` cannot name a process", "lower-case"]);
}

#[test]
fn an_unknown_port() {
    let ended = refused("inputs.imu =", "inputs.§imuu =");
    ended.says(&["process `ekf` has no input `imuu`", "did you mean `imu`?"]);
    let ended = refused("kind = \"imu\"", "kind = \"imu\"\noutputs.§image = {}");
    ended.says(&["process `imu` has no output `image`", "imu"]);
}

#[test]
fn a_topic_that_nobody_publishes() {
    let ended = refused("inputs.imu = \"/imu/imu\"", "inputs.§imu = \"/imu/imi\"");
    ended.says(&["input `imu` of `ekf`", "nobody publishes /imu/imi", "did you mean /imu/imu?"]);
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
        refused("kind = \"imu\"", "kind = \"imu\"\nperiod_ticks = 2\noutputs.§imu = { every_ticks = 3 }");
    ended.says(&["output `imu` is due every 3 ticks", "runs every 2", "multiple"]);
    refused("kind = \"imu\"", "kind = \"imu\"\nperiod_ticks = §0").says(&["`period_ticks` is 0"]);
}

#[test]
fn a_cycle_without_delay() {
    let command = ", delay_ticks = 1, initial = { command = [70, 70, 70, 70] }";
    let place = Place::new();
    let path = place.write("cycle.toml", good().replace(command, ""));
    let ended = refused_words(&["run", &path], &path);
    ended.says(&["a cycle without delay: ", "delay_ticks = 1", "initial value"]);
    // The loop through the IMU is as good an answer.
    let cycles = [&["plant", "mocap", "ekf", "controller"][..], &["plant", "imu", "ekf", "controller"]];
    assert!(cycles.iter().any(|cycle| names_cycle(&ended, cycle)), "{ended}");
}

/// Whether a cycle is named in the direction of the data, from any of its nodes on.
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
    let ended = refused_words(&["run", &path], &path);
    assert!(names_cycle(&ended, &["a", "b", "c"]), "{ended}");
}

#[test]
fn a_delay_without_an_initial_value_or_the_other_way_round() {
    let edge = "inputs.imu = \"/imu/imu\"";
    let ended = refused(edge, "inputs.§imu = { topic = \"/imu/imu\", delay_ticks = 1 }");
    ended.says(&["input `imu` of `ekf` is delayed and has no initial value", "initial ="]);
    let ended = refused(edge, "inputs.§imu = { topic = \"/imu/imu\", initial = {} }");
    ended.says(&["has an initial value but no delay", "add delay_ticks = 1"]);
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
    with("{ command = [70, 70, 70] }").says(&["`command` is [70,70,70], expected an array of 4"]);
    with("{ command = [70, 70, 70, \"70\"] }").says(&["`command[3]` is \"70\", expected a number"]);
    with("{ command = 70 }").says(&["`command` is 70, expected an array of 4"]);
    with("70").says(&["is 70, expected a table of fields", "hummingbus_msgs/msg/MotorCommand"]);
}

#[test]
fn set_points_that_cannot_be_flown() {
    let marked = good().replace("\nset_points =", "\n§set_points =");
    let with = |from: &str, to: &str| {
        assert_eq!(marked.matches(from).count(), 1);
        refused_text(&marked.replace(from, to))
    };
    let ended = with("unit = \"m\"", "unit = \"ft\"");
    ended.says(&["process `pilot`: `set_points`: set point 0", "`unit` must be \"m\"", "found \"ft\""]);
    with("\"altitude\"", "\"height\"").says(&["`channel` must be", "found \"height\""]);
    with("to = 1.5, ", "").says(&["`to` must be a finite number in a step, found nothing"]);
}

#[test]
fn a_file_and_a_parameter_that_say_the_same() {
    let gains = repository("controllers/gains/pid.toml");
    let ended = refused(
        "kind = \"pid\"",
        &format!("kind = \"pid\"\ngains = §\"{gains}\"\nparameters.gains.roll = 1"),
    );
    ended.says(&["`controller` has `gains` twice", "leave one of them out"]);
}

#[test]
fn a_parameter_that_is_unknown() {
    let ended = refused("initial_altitude_m", "§initial_altitude_ft");
    ended.says(&["process `pilot`", "unknown field `initial_altitude_ft`", "initial_altitude_m"]);
}

#[test]
fn a_parameter_of_another_type_is_named() {
    let place = Place::new();
    let path = place.write("type.toml", good().replace("altitude_m = 1.0", "altitude_m = \"high\""));
    let ended = refused_words(&["run", &path], &path);
    ended.says(&["process `pilot`", "initial_altitude_m", "\"high\"", "must be f64"]);
}

#[test]
fn a_parameter_that_the_recorder_does_not_have() {
    let ended = refused_with("\n[process.recorder.parameters]\n§compression = \"none\"\n");
    ended.says(&["recorder", "no parameter `compression`"]);
}

#[test]
fn a_vehicle_file_that_is_not_there() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let vehicle = place.path("none.toml");
    let ended = refused_setting(&manifest, &[&format!("process.plant.vehicle={vehicle}")]);
    ended.says(&["process `plant`", &vehicle, "cannot read this file", "check the path"]);
}

#[test]
fn a_vehicle_file_with_a_unit_of_another_quantity() {
    let place = Place::new();
    let text = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let line = text.lines().position(|line| line.starts_with("mass =")).unwrap() + 1;
    let vehicle = place.write("stone.toml", text.replacen("unit = \"kg\"", "unit = \"stone\"", 1));
    let manifest = repository("manifests/hover.toml");
    let ended = refused_setting(&manifest, &[&format!("process.plant.vehicle={vehicle}")]);
    ended.says(&["process `plant`", &format!("{vehicle}:{line}:"), "body.mass", "stone", "kg"]);
}

/// Replays `flight` with more overrides.
fn replay<'a>(place: &'a Place, flight: &str, more: &[&str]) -> crate::support::Launch<'a> {
    let manifest = repository("manifests/replay-nanobench.toml");
    let data = format!("process.player.data={}", place.write("flight.csv", flight));
    let recording = place.path("replay.mcap");
    let words = ["run", &manifest, "--record", &recording, "--set", &data];
    place.start(&[&words, more].concat())
}

/// Requires that the replay of `flight` is refused at a place in its manifest, or at a setting.
#[track_caller]
fn refused_replay(flight: &str, more: &[&str]) -> Ended {
    let ended = replay(&Place::new(), flight, more).end().with_code(2);
    let start = format!("error: {}:", repository("manifests/replay-nanobench.toml"));
    let rest = ended.error.strip_prefix(&start).unwrap_or_else(|| panic!("no place in\n{ended}"));
    let is_place = |c: char| c.is_ascii_digit();
    assert!(rest.starts_with(is_place) || rest.starts_with(" --set process.player."), "no place in\n{ended}");
    ended
}

const FROM_THE_START: [&str; 4] =
    ["--set", "process.player.parameters.from_s=0", "--set", "run.duration_s=1"];

#[test]
fn the_good_flight_is_replayed() {
    let place = Place::new();
    replay(&place, &flight(), &[&FROM_THE_START[..], &["--set", "run.duration_s=1.001"]].concat())
        .end()
        .flown();
}

#[test]
fn a_flight_that_is_not_there() {
    let manifest = repository("manifests/replay-nanobench.toml");
    let ended = refused_setting(&manifest, &["process.player.data=/no/flight.csv"]);
    ended.says(&["process `player`", "/no/flight.csv cannot be read", "--set process.<player>.data=PATH"]);
}

#[test]
fn a_flight_without_a_column() {
    let flight = flight().replacen(",py,", ",sideways,", 1);
    refused_replay(&flight, &FROM_THE_START).says(&[
        "process `player`",
        "no column `py`",
        "`position`",
        "sideways",
    ]);
}

#[test]
fn a_flight_with_a_cell_that_is_no_number() {
    let flight = flight().replacen("0.010,0.001,", "0.010,left,", 1);
    refused_replay(&flight, &FROM_THE_START)
        .says(&["line 3, column `px`", "\"left\" is not a finite number"]);
}

#[test]
fn a_flight_with_a_quotation_mark_that_swallows_rows() {
    let flight = flight().replacen("0.010,0.001,", "0.010,\"0.001,", 1);
    refused_replay(&flight, &FROM_THE_START).says(&["line 3, cell 2", "quotation mark", "remove the mark"]);
}

#[test]
fn a_flight_whose_time_stands_still() {
    let flight = flight().replacen("0.020,", "0.010,", 1);
    refused_replay(&flight, &FROM_THE_START).says(&["time does not grow from line 3"]);
}

#[test]
fn a_column_map_without_a_unit_or_with_a_wrong_one() {
    let columns = "process.player.parameters.columns.time";
    let missing = format!("{columns}={{ columns = [\"t\"] }}");
    refused_replay(&flight(), &["--set", &missing])
        .says(&["process `player`", "missing field `columns.time.unit`"]);
    let wrong = format!("{columns}.unit=h");
    refused_replay(&flight(), &["--set", &wrong])
        .says(&["`time` has the unit `h`", "\"s\" or \"ms\" or \"us\""]);
}

#[test]
fn a_start_beyond_the_end_of_the_flight() {
    refused_replay(&flight(), &[]).says(&["`from_s` is 6 s, the flight lasts 1.000 s"]);
}

#[test]
fn a_condition_on_a_topic_that_nobody_publishes() {
    let pass = "name = \"high\"\ntopic = \"/plant/stat\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmin = 1\n";
    let ended = refused_with(&format!("\n§[[pass]]\n{pass}"));
    ended.says(&["nobody publishes /plant/stat", "did you mean /plant/state?"]);
    let compare = "simulated = \"/plant/state\"\nmeasured = \"/player/measured\"\nwindow_s = 0.1\n";
    refused_with(&format!("\n§[[compare]]\n{compare}")).says(&["nobody publishes /player/measured"]);
}

#[test]
fn a_condition_on_a_field_or_in_a_unit_that_is_none() {
    let with = |from: &str, to: &str| refused_with(&format!("\n§{}", PASS.replace(from, to)));
    with("position.z", "position.q").says(&["pass condition `low`", "`position.q`", "position.z"]);
    with("\"m\"", "\"deg\"").says(&["pass condition `low`", "`deg` is not a unit of length", "cm"]);
    with("max = 1\n", "").says(&["pass condition `low`", "no limit", "add `min`, `max`"]);
}

/// A condition that holds at the start of the good manifest's flight.
const PASS: &str = "[[pass]]\nname = \"low\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 1\n";

#[test]
fn a_condition_without_a_recorder() {
    let ended = refused("[process.recorder]\nkind = \"recorder\"\n", &format!("§{PASS}"));
    ended.says(&["/plant/state is judged but not recorded", "kind = \"recorder\""]);
}

#[test]
fn a_condition_on_a_topic_that_only_another_reader_takes() {
    let nodes = sender("source", 1, "") + &table("reader", "inputs.input = \"/source/note\"");
    let pass = PASS.replace("/plant/state", "/source/note").replace("position.z", "tick");
    let ended = refused_text(&format!("[run]\nduration_s = 0.1\n{nodes}§{pass}"));
    ended.says(&["/source/note is judged but not recorded", "kind = \"recorder\""]);
}

#[test]
fn a_second_recorder_on_the_same_file() {
    let place = Place::new();
    let path = place.write("two.toml", good() + "\n[process.recorder2]\nkind = \"recorder\"\n");
    refused_words(&["run", &path], &path).says(&["recorder", "recorder2"]);
}

#[test]
fn a_run_of_no_length() {
    let with = |duration: &str| refused("duration_s = 0.1", &format!("duration_s = §{duration}"));
    with("0").says(&["`duration_s` is 0 s, which is 0 ticks", "between 1 and"]);
    with("-1.0").says(&["`duration_s` is -1 s"]);
    with("nan").says(&["`run.duration_s` is nan, expected a finite number"]);
    with("1e9").says(&["`duration_s` is 1000000000 s"]);
    with("\"long\"").says(&["expected f64"]);
}

#[test]
fn a_rate_whose_tick_is_no_whole_number_of_nanoseconds() {
    let with = |rate: &str| refused("duration_s = 0.1", &format!("duration_s = 0.1\nrate_hz = §{rate}"));
    with("300").says(&["`rate_hz` is 300", "divisor of 1 000 000 000"]);
    with("0").says(&["`rate_hz` is 0"]);
    with("-5").says(&["-5"]);
}

#[test]
fn a_window_of_no_tick_or_of_too_many() {
    let with = |window: &str| refused("window_ticks = 64", &format!("window_ticks = §{window}"));
    with("0").says(&["`window_ticks` is 0", "1 to 4096 ticks"]);
    with("5000").says(&["`window_ticks` is 5000"]);
}

#[test]
fn a_window_argument_is_not_blamed_on_the_manifest() {
    let manifest = repository("manifests/hover.toml");
    let ended = Place::new().call(&["run", &manifest, "--window", "0"]).with_code(2);
    ended.says(&["--window", "0 is not in 1..=4096"]);
    assert!(!ended.error.contains("hover.toml:1:1"), "a place that has nothing to do with it: {ended}");
}

#[test]
fn a_pace_that_is_none() {
    let manifest = repository("manifests/hover.toml");
    for pace in ["fast", "0", "-1", "nan", "inf"] {
        let ended = Place::new().call(&["run", &manifest, &format!("--pace={pace}")]).with_code(2);
        ended.says(&[&format!("`{pace}` is not a pace"), "free, realtime, or a factor"]);
    }
    refused("window_ticks = 64", "pace = §\"slow\"").says(&["`slow` is not a pace", "free, realtime"]);
}

#[test]
fn an_override_that_is_none() {
    let manifest = repository("manifests/hover.toml");
    let set = |text: &str| refused_setting(&manifest, &[text]);
    set("run.seed").says(&["--set run.seed: expected KEY=VALUE", "run.seed=3"]);
    set("run.seed.low=1").says(&["--set run.seed.low=1", "`seed` is not a table"]);
    set("run.seeed=1").says(&["unknown field `seeed`", "did you mean `seed`?"]);
    set("run.seed=one").says(&["\"one\""]);
    set("process.plnat.cpu=1").says(&["there is no process `plnat`", "did you mean `plant`?"]);
    set("process.h1/plant.cpu=1").says(&["there is no process `h1/plant`"]);
    set("=1").says(&["expected keys with dots between them"]);
    set("pass.9.max=1").says(&["`pass` is a list of 4, and `9` is none of them", "numbered from 0"]);
    set("include=[]").says(&["unknown field `include`"]);
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

#[test]
fn a_comparison_without_a_limit_or_with_another_window_than_the_plant_has() {
    let place = Place::new();
    let flight = format!("process.player.data={}", place.write("flight.csv", crate::replay::flight()));
    let manifest = repository("manifests/replay-nanobench.toml");
    let set =
        |words: &[&str]| place.call(&[&["check", &manifest, "--set", &flight], words].concat()).with_code(2);
    let window = [
        "--set",
        "process.player.parameters.from_s=0.0",
        "--set",
        "run.duration_s=1.001",
        "--set",
        "process.plant-1s.parameters.window_s=0.2",
    ];
    set(&window).says(&["`window_s` is 1 s, but the plant behind /plant-1s/state is set every 0.2 s"]);
    let text = std::fs::read_to_string(&manifest).unwrap().replace("../vehicles", &repository("vehicles"));
    let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with("max_")).collect();
    let limitless = place.write("limitless.toml", lines.join("\n"));
    let words = ["check", &limitless, "--set", &flight, "--set", "process.player.parameters.from_s=0.0"];
    let words = [&words[..], &["--set", "run.duration_s=1.001"]].concat();
    place.call(&words).with_code(2).says(&["the comparison has no limit, so it cannot fail"]);
}

/// Writes the good manifest with a vehicle of its own into `place`: the Hummingbird with `from` replaced by `to`.
fn with_vehicle(place: &Place, from: &str, to: &str) -> (String, String) {
    let text = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    assert_eq!(text.matches(from).count(), 1, "{from} stands once in the vehicle file");
    let vehicle = place.write("vehicle.toml", text.replace(from, to));
    let manifest = good().replace(&repository("vehicles/hummingbird.toml"), &vehicle);
    (place.write("own.toml", manifest), vehicle)
}

#[test]
fn a_vehicle_with_a_number_that_none_has_is_refused_with_its_file_line_and_key() {
    let cases = [
        (
            "{ value = 8600, unit = \"rpm\"",
            "{ value = 1e308, unit = \"rpm\"",
            "command.speed_at_max",
            "1e308",
        ),
        ("{ value = 9.81,", "{ value = 9e300,", "body.gravity", "9e300"),
        ("{ value = 9.81,", "{ value = -9.81,", "body.gravity", "-9.81"),
        ("{ value = 0.480,", "{ value = 4.8e-300,", "body.mass", "4.8e-300"),
        ("{ value = 7.6184e-8,", "{ value = inf,", "rotor.thrust_coefficient", "inf"),
        ("{ value = [0.17, 0, 0]", "{ value = [0.17, 1e200, 0]", "rotors[0].position", "1e200"),
    ];
    for (from, to, key, found) in cases {
        let place = Place::new();
        let (manifest, vehicle) = with_vehicle(&place, from, to);
        let number = if found == "1e308" { "1.047" } else { found };
        refused_words(&["run", &manifest], &manifest).says(&[
            &format!("{vehicle}:"),
            &format!("`{key}"),
            number,
        ]);
    }
}

#[test]
fn a_vehicle_that_its_rotors_do_not_carry_is_refused_and_one_they_hardly_carry_is_told() {
    let place = Place::new();
    let (manifest, vehicle) = with_vehicle(&place, "{ value = 0.480,", "{ value = 480,");
    let ended = refused_words(&["run", &manifest], &manifest);
    ended.says(&[
        "process `plant`",
        "cannot fly",
        "thrust to weight of 0.0048",
        &format!("{vehicle}:21: `body.mass`"),
    ]);
    let (manifest, _) = with_vehicle(&place, "{ value = 0.480,", "{ value = 2.0,");
    let ended = place.call(&["run", &manifest, "--json"]).with_code(0);
    ended.says(&["warning: ", "process `plant`", "can hardly climb or tilt"]);
    let warnings = ended.json()["warnings"].clone();
    let told = warnings.as_array().unwrap().iter().find(|warning| {
        warning["message"].as_str().unwrap().contains("can hardly climb")
            && warning["line"].as_u64().is_some()
            && warning["file"].as_str() == Some(&manifest)
    });
    assert!(told.is_some(), "{warnings}");
    let ended = place.call(&["check", &manifest, "--json"]).with_code(0);
    ended.says(&["can hardly climb or tilt"]);
    assert_eq!(ended.json()["warnings"], warnings);
}

#[test]
fn a_rate_at_which_a_sensor_cannot_measure_or_a_plant_cannot_move() {
    let sensor = "[process.rpm]\nkind = \"rpm\"\ninputs.state = \"/plant/state\"\n";
    let text = good().replace("duration_s = 0.1", "duration_s = 10\nrate_hz = 10");
    let text =
        text.replace("[process.imu]", &format!("{sensor}[process.imu]")).replace("period_ticks = 5\n", "");
    let place = Place::new();
    let path = place.write("slow.toml", &text);
    // Motion capture at 100 Hz comes first.
    refused_words(&["check", &path], &path)
        .says(&["process `mocap`", "`rate_hz` is 100 Hz, expected at most 10 Hz"]);
    let path = place
        .write("slow.toml", text.replace("kind = \"mocap\"", "kind = \"mocap\"\nparameters.rate_hz = 5"));
    let ended = refused_words(&["check", &path], &path);
    ended.says(&["process `rpm`", "`rate_hz` is 200 Hz, expected at most 10 Hz", "run.rate_hz = 10"]);
    let text = text.replace("rate_hz = 10", "rate_hz = 4").replace(sensor, "");
    let path = place
        .write("slow.toml", text.replace("kind = \"mocap\"", "kind = \"mocap\"\nparameters.rate_hz = 2"));
    refused_words(&["check", &path], &path).says(&["process `plant`", "the integration diverges"]);
}

#[test]
fn a_condition_that_nothing_can_hold() {
    let with = |limits: &str| refused_with(&format!("§{}", PASS.replace("max = 1\n", limits)));
    with("min = 2\nmax = 1\n").says(&[
        "pass condition `low`",
        "`min` is 2 and `max` is 1",
        "nothing lies between",
    ]);
    with("max = 1\nfrom_s = 0.1\n")
        .says(&["`from_s` is 0.1 s, and the run ends at 0.1 s", "raise run.duration_s"]);
    with("max = 1\nfrom_s = 5\nto_s = 4\n").says(&["`from_s` is 5 s and `to_s` is 4 s"]);
    with("max = 1\nfrom_s = 0.0501\nto_s = 0.0504\n")
        .says(&["no sample of /plant/state", "it comes every 0.001 s"]);
    with("max = 1\nfrom_s = -1\n").says(&["`from_s` is -1 s"]);
    let gate = "max = 1\nwhile = { topic = \"/plant/state\", field = \"position.z\", min = 1, max = 0 }\n";
    with(gate).says(&["`while`: `min` is 1 and `max` is 0"]);
    let rms = PASS.replace("statistic = \"max\"", "statistic = \"rms\"").replace("max = 1\n", "max = -1\n");
    refused_with(&format!("§{rms}")).says(&["`max` is -1", "the root of a mean square is never below 0"]);
    for number in ["nan", "inf", "-inf", "1e999"] {
        let ended = refused_with(&PASS.replace("max = 1\n", &format!("max = §{number}\n")));
        ended.says(&[&format!("`pass.0.max` is {number}, expected a finite number")]);
    }
}

#[test]
fn a_number_that_is_none_anywhere_is_refused_where_it_stands() {
    let ended = refused("initial_altitude_m = 1.0", "initial_altitude_m = §nan");
    ended.says(&["`process.pilot.parameters.initial_altitude_m` is nan, expected a finite number"]);
    refused("70, 70, 70, 70", "70, §inf, 70, 70")
        .says(&["`process.plant.inputs.command.initial.command.1` is inf"]);
    let ended = refused("initial_altitude_m = 1.0", "§initial_altitude_m = 1e300");
    ended.says(&["`initial_altitude_m` is 1e300 m, expected at most 1e7 m in size"]);
    let manifest = repository("manifests/hover.toml");
    refused_setting(&manifest, &["pass.0.max=nan"]).says(&["`pass.0.max` is nan"]);
}

#[test]
fn a_period_that_overflows_the_count_of_ticks() {
    let ended = refused("period_ticks = 5", "period_ticks = §4294967295");
    ended.says(&["`period_ticks` of `mocap` is 4294967295, and the run has 100 ticks", "32 bits"]);
}

#[test]
fn what_is_odd_is_told_by_check_and_run_and_flies() {
    let place = Place::new();
    let path = place.write("good.toml", good());
    let line = good().lines().position(|line| line.starts_with("set_points")).unwrap() + 1;
    let words = [
        format!("warning: {path}:{line}:1: process `pilot`: `set_points`: set point 0"),
        "`at_s` is 0.1 s, and the run ends at 0.1 s: it never acts".to_owned(),
    ];
    let words = words.each_ref().map(String::as_str);
    place.call(&["check", &path]).with_code(0).says(&words);
    place.call(&["run", &path]).with_code(0).says(&words);
    let longer = place.call(&["check", &path, "--set", "run.duration_s=1"]).with_code(0);
    assert_eq!(longer.error, "");
    // A run that is cut short by hand flies: what cannot be judged then is told, and does not pass.
    let pass = PASS.replace("max = 1\n", "max = 1\nfrom_s = 0.05\n");
    let path = place.write("judged.toml", good() + &pass);
    let ended = place.call(&["run", &path, "--set", "run.duration_s=0.04"]).with_code(1);
    ended.says(&["warning: ", "--set run.duration_s=0.04", "a condition without a sample does not pass"]);
}
