//! Contracts of backups: a swap, a shadow, a standby and a restart change what the manifest says and nothing
//! else.

use crate::skipped::{first, is_left};
use crate::support::{Ended, Place, repository};
use recorder::reader::Recording;
use std::fs;
use std::path::Path;

/// hover.toml, cut to 1.5 s, with more tables.
fn hover_with(place: &Place, name: &str, tables: &str) -> String {
    flight_with(place, "hover", name, tables)
}

/// The shipped manifest `base`, cut to 1.5 s, with more tables.
fn flight_with(place: &Place, base: &str, name: &str, tables: &str) -> String {
    let base = repository(&format!("manifests/{base}.toml"));
    place.write(name, format!("include = [{base:?}]\n[run]\nduration_s = 1.5\n{tables}"))
}

fn fly(place: &Place, manifest: &str, recording: &str) -> Ended {
    place.call(&["run", manifest, "--record", recording, "--json"])
}

/// The undisturbed flight of the same length.
fn undisturbed(place: &Place) -> String {
    undisturbed_flight(place, "hover")
}

/// The undisturbed flight of `base` of the same length.
fn undisturbed_flight(place: &Place, base: &str) -> String {
    let (manifest, recording) = (flight_with(place, base, "plain.toml", ""), place.path("plain.mcap"));
    fly(place, &manifest, &recording).flown();
    recording
}

/// Every message but those of shadows: topic, tick and bytes.
fn messages(recording: &str) -> Vec<(String, u32, Vec<u8>)> {
    let recording = Recording::open(Path::new(recording)).unwrap();
    let all = recording.messages().map(Result::unwrap);
    all.filter(|record| !record.topic.starts_with("/shadow/"))
        .map(|record| (record.topic, record.tick, record.cdr))
        .collect()
}

fn ticks_of(recording: &str, topic: &str) -> Vec<u32> {
    let recording = Recording::open(Path::new(recording)).unwrap();
    let all = recording.messages().map(Result::unwrap);
    all.filter(|record| record.topic == topic).map(|record| record.tick).collect()
}

const SWAP: &str = "[[swap]]\nprocess = \"controller\"\nat_tick = 700\nshadow_ticks = 50\n";
/// Every loop stiffer, so that the commands differ.
const GAINS: &str = "with.parameters.gains.altitude = { proportional_1_s2 = 16.0, integral_1_s3 = 3.0, \
                     derivative_1_s = 7.0 }\n";

#[test]
fn a_swap_to_an_identical_controller_changes_no_message() {
    let place = Place::new();
    let (manifest, recording) = (hover_with(&place, "swap.toml", SWAP), place.path("swap.mcap"));
    let ended = fly(&place, &manifest, &recording).flown();
    let succession = &ended.json()["successions"][0];
    assert_eq!(succession["take_over_tick"], 700, "{ended}");
    assert_eq!(succession["hand_over"], "state", "{ended}");
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
    assert_eq!(ticks_of(&recording, "/shadow/controller/command"), (650..700).collect::<Vec<u32>>());
}

#[test]
fn the_plant_gets_exactly_one_command_a_tick_throughout() {
    let place = Place::new();
    let swaps = format!("{SWAP}repeat = 4\nevery_ticks = 100\n{GAINS}");
    let (manifest, recording) = (hover_with(&place, "swaps.toml", &swaps), place.path("swaps.mcap"));
    let ended = fly(&place, &manifest, &recording).flown();
    assert_eq!(ended.json()["successions"].as_array().unwrap().len(), 4, "{ended}");
    assert_eq!(ticks_of(&recording, "/controller/command"), (0..1500).collect::<Vec<u32>>());
}

#[test]
fn two_runs_with_the_same_swap_are_the_same_file() {
    let place = Place::new();
    let manifest = hover_with(&place, "swap.toml", &format!("{SWAP}{GAINS}"));
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| place.path(name));
    fly(&place, &manifest, &a).flown();
    let args =
        ["run", &manifest, "--record", &b, "--json", "--window", "3", "--set", "run.start_order_seed=5"];
    place.call(&args).flown();
    assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "the files differ");
}

#[test]
fn a_swap_to_other_gains_steps_no_further_than_the_new_law_asks() {
    let place = Place::new();
    let manifest = hover_with(&place, "swap.toml", &format!("{SWAP}{GAINS}"));
    let ended = fly(&place, &manifest, &place.path("swap.mcap")).flown();
    let step = &ended.json()["successions"][0]["steps"][0];
    let number = |key: &str| step[key].as_f64().unwrap_or_else(|| panic!("no {key} in {ended}"));
    // The new law's own difference, and what a tick's noise moves the commands of either law by.
    let noise = 3.0 * number("step_before").max(0.1);
    assert!(number("step") <= number("law_difference") + noise, "{ended}");
}

#[test]
fn a_user_s_controller_in_its_own_binary_can_be_swapped_in() {
    let place = Place::new();
    let example = Path::new(env!("CARGO_BIN_EXE_hummingbus")).with_file_name("examples/custom_controller");
    let with = format!(
        "with = {{ command = [{example:?}], parameters = {{ hover_count = 76.5, altitude = [63.6, 31.8], \
         tilt = [11.6, 4.4] }} }}\n"
    );
    let manifest = hover_with(&place, "swap.toml", &format!("{SWAP}{with}"));
    let recording = place.path("swap.mcap");
    let ended = fly(&place, &manifest, &recording).flown();
    let succession = &ended.json()["successions"][0];
    assert_eq!(succession["hand_over"], "last output", "{ended}");
    assert!(succession["refused"].is_null(), "{ended}");
    assert!(messages(&recording) != messages(&undisturbed(&place)), "nothing was swapped");
}

#[test]
fn a_shadow_reports_its_difference_and_changes_no_message() {
    let place = Place::new();
    let shadow = format!("[[shadow]]\nprocess = \"controller\"\n{GAINS}");
    let (manifest, recording) = (hover_with(&place, "shadow.toml", &shadow), place.path("shadow.mcap"));
    let ended = fly(&place, &manifest, &recording).flown();
    let differences = ended.json()["shadows"].as_array().unwrap().clone();
    assert_eq!(differences.len(), 4, "{ended}");
    assert!(differences.iter().all(|difference| difference["samples"] == 1500), "{ended}");
    assert!(differences.iter().any(|difference| difference["rms"].as_f64() > Some(1e-4)), "{ended}");
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
    place.call(&["shadow", &recording]).with_code(0).prints(&["/controller/command", "rms"]);
}

#[test]
fn a_controller_can_be_tried_as_a_shadow_without_a_change_of_the_manifest() {
    let place = Place::new();
    let manifest = hover_with(&place, "plain.toml", "");
    let with = GAINS.trim_start_matches("with.");
    let recording = place.path("shadow.mcap");
    let args = ["shadow", &manifest, "--process", "controller", "--with", with, "--record", &recording];
    let ended = place.call(&args);
    assert!(ended.is_quiet(), "{ended}");
    ended.prints(&["/controller/command command[0]", "1500 samples"]);
    place.call(&["shadow", &manifest, "--process", "recorder"]).with_code(2).says(&["recorder"]);
}

#[test]
fn a_process_of_a_live_run_is_swapped() {
    let place = Place::new();
    let (manifest, recording) = (hover_with(&place, "plain.toml", ""), place.path("live.mcap"));
    let mut launch = place.start(&["run", &manifest, "--record", &recording, "--json"]);
    launch.hold_at(300);
    let run = place.run_id();
    let args = ["swap", "controller", "--with", "kind = \"pid\"", "--shadow-ticks", "20", "--run", &run];
    let swap = place.start(&args);
    // The run is held: the backup joins at the tick at which it stands.
    launch.await_slot("controller", 1);
    let refused = place.start(&["swap", "recorder", "--run", &run]).end_among_others().with_code(2);
    refused.says(&["recorder"]);
    launch.release();
    swap.end_among_others().with_code(0).prints(&["controller.1", "from tick 320", "handed over: state"]);
    let ended = launch.end().flown();
    assert_eq!(ended.json()["successions"][0]["join_tick"], 300, "{ended}");
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
}

/// The controller of a run that starts slowly connects once the file `go` is there.
#[test]
fn a_swap_of_a_run_that_is_still_starting_waits_until_it_flies() {
    let place = Place::new();
    let example = Path::new(env!("CARGO_BIN_EXE_hummingbus")).with_file_name("examples/custom_controller");
    let go = place.path("go");
    let script = format!("until [ -e '{go}' ]; do sleep 0.02; done; exec '{}'", example.display());
    let command = format!("process.controller.command=[\"sh\", \"-c\", {script:?}]");
    let (manifest, recording) = (repository("manifests/custom-controller.toml"), place.path("live.mcap"));
    let launch = place.start_endless(&["run", &manifest, "--record", &recording, "--set", &command]);
    place.process_of("controller");
    let run = place.run_id();
    let swap = place.start(&["swap", "imu", "--shadow-ticks", "20", "--run", &run]);
    swap.await_said("the run is still starting, and the swap waits until it flies");
    fs::write(go, "").unwrap();
    swap.end_among_others().with_code(0).prints(&["`imu.1` flies from tick", "handed over: state"]);
    place.start(&["ctl", "stop", "--run", &run]).end_among_others().with_code(0);
    launch.end().with_code(1);
}

#[test]
fn a_swap_to_a_program_that_never_joins_says_that_it_waits() {
    let place = Place::new();
    let (hover, recording) = (repository("manifests/hover.toml"), place.path("live.mcap"));
    let mut launch = place.start_endless(&["run", &hover, "--record", &recording]);
    launch.await_ticks(1);
    let run = place.run_id();
    let with = "command = [\"sleep\", \"600\"]\nwatchdog_ms_host = 600_000";
    let swap = place.start(&["swap", "controller", "--with", with, "--run", &run]);
    swap.await_said("waiting for `controller.1` to join (20 s at most, or its `watchdog_ms_host`)");
    place.start(&["ctl", "stop", "--run", &run]).end_among_others().with_code(0);
    let refused = swap.end_among_others().with_code(2);
    refused.says(&["the run ended before `controller.1` could join"]);
    launch.end().with_code(1);
}

/// A swap of the plant of `base` with this line; returns the end of the run and its recording.
fn swap_plant(place: &Place, base: &str, with: &str) -> (Ended, String) {
    let swap = format!("[[swap]]\nprocess = \"plant\"\nat_tick = 700\nshadow_ticks = 50\n{with}\n");
    let (manifest, recording) = (flight_with(place, base, "swap.toml", &swap), place.path("swap.mcap"));
    (fly(place, &manifest, &recording), recording)
}

/// Manifests with the backend `newton-euler`, and with `rapier`, bodies and a rope.
const BACKENDS: [&str; 2] = ["hover", "slung-load"];

#[test]
fn a_swap_to_an_identical_plant_changes_no_message() {
    let place = Place::new();
    for base in first(1, "backends", BACKENDS) {
        let (ended, recording) = swap_plant(&place, base, "");
        let ended = ended.flown();
        assert_eq!(ended.json()["successions"][0]["hand_over"], "state", "{ended}");
        let whole = undisturbed_flight(&place, base);
        assert!(messages(&recording) == messages(&whole), "{base}: the flights differ");
        let compared = place.call(&["diff", "--tolerance", "0", &whole, &recording]);
        compared.with_code(1).prints(&["messages are the same", "has no topic /shadow/plant/"]);
    }
}

#[test]
fn a_plant_hands_its_state_to_one_with_other_numbers() {
    let place = Place::new();
    for base in first(1, "backends", BACKENDS) {
        let (ended, recording) = swap_plant(&place, base, "with.parameters.substeps = 4");
        let ended = ended.flown();
        assert_eq!(ended.json()["successions"][0]["hand_over"], "state", "{ended}");
        let (flown, whole) = (messages(&recording), messages(&undisturbed_flight(&place, base)));
        assert!(flown != whole, "{base}: nothing was swapped");
        assert_eq!(ticks_of(&recording, "/plant/state"), (0..1500).collect::<Vec<u32>>());
    }
}

#[test]
fn a_plant_of_another_backend_is_refused_before_it_takes_over() {
    let place = Place::new();
    let parts = ["the backup of `plant` does not go on from its state", "another backend"];
    let (ended, _) = swap_plant(&place, "hover", "with.parameters.backend = \"rapier\"");
    ended.with_code(2).says(&parts);
    place.call(&["check", &place.path("swap.toml")]).with_code(2).says(&parts);
    let (manifest, recording) = (hover_with(&place, "plain.toml", ""), place.path("live.mcap"));
    let mut launch = place.start(&["run", &manifest, "--record", &recording]);
    launch.hold_at(300);
    let swap = ["swap", "plant", "--with", "parameters.backend = \"rapier\"", "--run", &place.run_id()];
    place.start(&swap).end_among_others().with_code(2).says(&parts);
    launch.release();
    launch.end().flown();
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
}

#[test]
fn a_live_swap_that_cannot_be_is_refused_and_the_run_flies_on() {
    let place = Place::new();
    let (manifest, recording) = (hover_with(&place, "plain.toml", ""), place.path("live.mcap"));
    let mut launch = place.start(&["run", &manifest, "--record", &recording, "--json"]);
    launch.hold_at(300);
    let run = place.run_id();
    let not_a_program = place.write("not-a-program", "");
    fs::set_permissions(&not_a_program, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let cases: [(&[&str], &str); 7] = [
        (
            &["--with", "command = [\"/bin/true\"]"],
            "exit code 0 before the run did (it had not joined yet; to join, a program calls",
        ),
        (&["--with", "kind = \"lqr\""], "--with keeps the inputs: write those of `lqr` as inputs = {"),
        (&["--at-tick", "5"], "is not ahead of the run, which has granted"),
        (&["--at-tick", "5"], "the least tick that works now is"),
        (&["--with", &format!("command = [{not_a_program:?}]")], "cannot start"),
        (
            &["--with", "command = [\"/bin/sleep\", \"600\"]\nwatchdog_ms_host = 300"],
            "did not join within 300 ms",
        ),
        (&["--shadow-ticks", "4294967295"], "4294967295 ticks"),
    ];
    for (args, reason) in cases {
        let args = [&["swap", "controller", "--run", &run], args].concat();
        place.start(&args).end_among_others().with_code(2).says(&[reason]);
    }
    launch.release();
    let ended = launch.end().with_code(1);
    assert_eq!(ended.json()["ticks"], 1500, "{ended}");
    assert!(messages(&recording) == messages(&undisturbed(&place)), "the flights differ");
}

/// As `check` does for a swap in the manifest.
#[test]
fn a_live_swap_to_a_sensor_with_new_measurements_at_other_ticks_is_warned_of() {
    let place = Place::new();
    let gps = "[process.gps]\nkind = \"gps\"\ninputs.state = \"/plant/state\"\n";
    let (manifest, recording) = (hover_with(&place, "gps.toml", gps), place.path("live.mcap"));
    let mut launch = place.start(&["run", &manifest, "--record", &recording]);
    launch.hold_at(300);
    let run = place.run_id();
    let swap = |with: &str| place.start(&["swap", "gps", "--with", with, "--run", &run, "--json"]);
    let first = swap("parameters.rate_hz = 20.0");
    launch.await_slot("gps", 1);
    refuse_heavy(&place, &run);
    launch.release();
    let told = ["warning: ", "0, 80, 140, 180, … (20 Hz)", "some of its samples are never sent"];
    let ended = first.end_among_others().with_code(0);
    ended.says(&told);
    let answer = ended.json();
    let warnings = answer["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|one| one.as_str().unwrap().contains("as before")), "{answer}");
    launch.end().with_code(1);
}

/// Asks `run` for a swap of the plant to a vehicle that is too heavy to fly: the refusal has the warning about it.
fn refuse_heavy(place: &Place, run: &str) {
    let text = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let heavy =
        place.write("heavy.toml", text.replace("mass = { value = 0.480,", "mass = { value = 1000.0,"));
    let with = format!("vehicle = {heavy:?}");
    let swap = ["swap", "plant", "--with", &with, "--run", run, "--json"];
    let ended = place.start(&swap).end_among_others().with_code(2);
    ended.says(&["cannot fly", "warning: ", "moment of inertia"]);
    assert!(ended.json()["warnings"][0].as_str().unwrap().contains("moment of inertia"), "{ended}");
}

/// The last measurement of its gps arrives at tick 1480.
#[test]
fn a_live_swap_whose_take_over_would_come_after_the_last_measurement_is_refused_as_it_joins() {
    let place = Place::new();
    let gps = "[process.gps]\nkind = \"gps\"\ninputs.state = \"/plant/state\"\n";
    let (manifest, recording) = (hover_with(&place, "gps.toml", gps), place.path("live.mcap"));
    let mut launch = place.start(&["run", &manifest, "--record", &recording]);
    launch.hold_at(300);
    let swap = ["swap", "gps", "--shadow-ticks", "1300", "--run", &place.run_id()];
    // The run is still held.
    place.start(&swap).end_among_others().with_code(2).says(&["no tick at which it could take over is left"]);
    launch.release();
    launch.end().with_code(1);
}

#[test]
fn a_publisher_that_sends_seldom_can_be_swapped() {
    let place = Place::new();
    let swap = |at: u32, shadow: u32| {
        format!(
            "[process.pilot.outputs.set_point]\nevery_ticks = 100\n[[swap]]\nprocess = \"pilot\"\nat_tick = {at}\nshadow_ticks = {shadow}\n"
        )
    };
    let manifest = hover_with(&place, "swap.toml", &swap(700, 250));
    let (plain, recording) = (place.path("plain.mcap"), place.path("swap.mcap"));
    let without = hover_with(&place, "plain.toml", "[process.pilot.outputs.set_point]\nevery_ticks = 100\n");
    fly(&place, &without, &plain).flown();
    fly(&place, &manifest, &recording).flown();
    assert!(messages(&recording) == messages(&plain), "the flights differ");
    assert_eq!(ticks_of(&recording, "/shadow/pilot/set_point"), [500, 600]);
    let manifest = hover_with(&place, "between.toml", &swap(750, 50));
    place.call(&["check", &manifest]).with_code(2).says(&["`pilot` sends every 100 ticks"]);
}

/// File descriptors of every process of a run, and its files in shared memory.
fn held(place: &Place) -> (usize, usize) {
    let count = |folder: String| fs::read_dir(folder).map_or(0, Iterator::count);
    let processes = place.processes();
    let descriptors =
        processes.iter().map(|(pid, _)| count(format!("/proc/{}/fd", pid.as_raw_nonzero()))).sum();
    let prefix = format!("hb_{}_", place.run_id());
    let files = fs::read_dir("/dev/shm").unwrap().flatten();
    (descriptors, files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix)).count())
}

/// Returns the numbers of [`held`] once they do not change any more.
fn settled(place: &Place) -> (usize, usize) {
    let mut last = held(place);
    let mut unchanged = 0;
    crate::support::poll("open files that never settle", || {
        let now = held(place);
        unchanged = if now == last { unchanged + 1 } else { 0 };
        last = now;
        (unchanged > 200).then_some(now)
    })
}

/// `SWAPS=1000` has a thousand of them. Fewer than 111 would leave less than the limit below, even if each leaked.
#[test]
fn hundreds_of_swaps_in_one_run_leak_nothing() {
    let place = Place::new();
    let asked = std::env::var("SWAPS").map(|text| text.parse::<u32>().expect("SWAPS is a number"));
    if asked.is_err() && is_left("other tests have a few swaps, which show no leak") {
        return;
    }
    let count = asked.unwrap_or(200);
    assert!(count >= 111, "too few swaps to show a leak: SWAPS={count}");
    let ticks = 1000 + 20 * count;
    let swaps = format!(
        "[[swap]]\nprocess = \"controller\"\nat_tick = 400\nshadow_ticks = 5\nrepeat = {count}\nevery_ticks = 20\n"
    );
    let hover = repository("manifests/hover.toml");
    let text = format!("include = [{hover:?}]\n[run]\nduration_s = {}\n{swaps}", f64::from(ticks) / 1000.0);
    let manifest = place.write("swaps.toml", text);
    let recording = place.path("swaps.mcap");
    let mut launch = place.start(&["run", &manifest, "--record", &recording, "--json"]);
    // Between two swaps, after the tenth and before the last: the backup before has left and the next is prepared.
    launch.hold_at(593);
    // The clock, seven nodes, and the backup that is prepared.
    launch.await_process_count(&place, 9);
    let before = settled(&place);
    launch.release();
    launch.hold_at(393 + 20 * (count - 1));
    // What one swap left behind would by now be there almost as often as there were swaps; the next backup may hold more or less
    // than that of then, as it is further with its preparations or not.
    let is_like_before =
        |(files, segments): (usize, usize)| files < before.0 + 100 && segments < before.1 + 100;
    let now = settled(&place);
    assert!(
        is_like_before(now),
        "open files and shared memory: {before:?} after 9 swaps, {now:?} after {}",
        count - 2
    );
    launch.release();
    let ended = launch.end().flown();
    let successions = ended.json()["successions"].as_array().unwrap().clone();
    assert_eq!(successions.len(), count as usize);
    assert!(successions.iter().all(|succession| succession["refused"].is_null()), "{ended}");
    assert_eq!(ticks_of(&recording, "/controller/command"), (0..ticks).collect::<Vec<u32>>());
}
