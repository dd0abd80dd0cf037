//! Nodes that fail: the run ends, says who failed and why, and leaves nothing behind.

use crate::nodes::{manifest, sender, table};
use crate::recordings::{open, require_same_messages, topics};
use crate::support::{Ended, Place, partial, repository};
use rustix::process::{Signal, kill_process};

/// Runs a source that shows `fault` at tick 50, a relay behind it, and a recorder.
fn fly_with(fault: &str) -> Ended {
    fly_with_variables(fault, &[])
}

fn fly_with_variables(fault: &str, variables: &[(&str, &str)]) -> Ended {
    let place = Place::new();
    let faulty = sender("faulty", 1, &format!("parameters = {{ fault = \"{fault}\", at_tick = 50 }}"));
    let relay = sender("relay", 1, "inputs.input = \"/faulty/note\"");
    let path = place.write("failing.toml", manifest(5_000, &[faulty, relay]));
    let ended = place.start_with(&["run", &path], variables).end().with_code(2);
    // A failed run leaves a whole file of what was recorded.
    let partial = partial(&place.path("failing.mcap"));
    open(&partial);
    ended.says(&[&format!("What was recorded until then is in {partial}")]);
    ended
}

#[test]
fn a_node_that_returns_an_error_is_quoted_with_tick_and_time() {
    let ended = fly_with("error");
    ended.says(&["process `faulty` ended with exit code 1", "node `faulty` failed at tick 50 (t = 0.050 s)"]);
    ended.says(&["the battery is empty", "aborted at tick 50"]);
}

#[test]
fn a_node_that_panics_is_quoted() {
    fly_with("panic").says(&["process `faulty` ended with exit code 101", "the propeller came off"]);
}

#[test]
fn a_panic_is_quoted_in_front_of_a_long_backtrace_too() {
    let ended = fly_with_variables("panic", &[("RUST_BACKTRACE", "1")]);
    ended.says(&["process `faulty` ended with exit code 101", "the propeller came off"]);
}

#[test]
fn a_node_that_exits_is_named_with_its_code() {
    fly_with("exit-with3").says(&["process `faulty` ended with exit code 3", "aborted at tick 50"]);
}

#[test]
fn what_a_starved_node_still_sends_after_a_failure_is_recorded() {
    let place = Place::new();
    let faulty = sender("faulty", 1, "parameters = { fault = \"exit-with3\", at_tick = 50 }");
    // It wakes up when the source is dead and the run is aborted.
    let relay = "inputs.input = \"/faulty/note\"\nparameters = { nap_ms = 500, at_tick = 1 }";
    let path = place.write("starved.toml", manifest(5_000, &[faulty, sender("relay", 1, relay)]));
    place.call(&["run", &path]).with_code(2).says(&["process `faulty` ended with exit code 3"]);
    for (topic, messages) in topics(&partial(&place.path("starved.mcap"))) {
        let ticks: Vec<_> = messages.iter().map(|message| message.tick).collect();
        assert_eq!(ticks, (0..50).collect::<Vec<_>>(), "{topic}");
    }
}

#[test]
fn a_node_that_leaves_early_is_named_although_its_exit_code_is_0() {
    fly_with("exit-with0").says(&["`faulty`", "tick 50"]);
}

#[test]
fn an_output_left_unwritten_is_named_with_node_and_tick() {
    let ended = fly_with("unwritten");
    ended.says(&[
        "process `faulty` ended",
        "node `faulty` computed tick 50 without writing its output `note`",
    ]);
}

#[test]
fn a_number_that_is_not_finite_ends_the_run_with_node_topic_tick_and_field() {
    let place = Place::new();
    let parameters = "parameters = { has_other_layout = true, is_nan = true, at_tick = 50 }";
    let path = place.write("nan.toml", manifest(5_000, &[sender("source", 1, parameters)]));
    let ended = place.call(&["run", &path]).with_code(2);
    ended.says(&["process `source` ended with exit code 1", "node `source` failed at tick 50 (t = 0.050 s)"]);
    ended.says(&["its output `note` on /source/note holds place[1] = NaN", "expected a finite number"]);
    // The sample was not sent: what is recorded ends at the tick before.
    assert_eq!(topics(&partial(&place.path("nan.mcap")))["/source/note"].last().unwrap().tick, 49);
}

#[test]
fn a_node_that_hangs_is_named_with_its_tick() {
    let place = Place::new();
    let keys = "watchdog_ms_host = 3000\nparameters = { fault = \"hang\", at_tick = 50 }";
    let relay = sender("relay", 1, "inputs.input = \"/faulty/note\"");
    let path = place.write("hanging.toml", manifest(5_000, &[sender("faulty", 1, keys), relay]));
    let ended = place.call(&["run", &path]).with_code(2);
    ended.says(&["stood still", "tick 50 is not completed by", "`faulty`"]);
}

#[test]
fn a_killed_node_is_named_with_its_signal() {
    let place = Place::new();
    for node in ["plant", "imu", "recorder"] {
        let recording = place.path("killed.mcap");
        let manifest = repository("manifests/hover.toml");
        let mut launch = place.start_endless(&["run", &manifest, "--record", &recording]);
        launch.await_ticks(100);
        kill_process(place.process_of(node), Signal::KILL).unwrap();
        let ended = launch.end().with_code(2);
        ended.says(&[&format!("process `{node}` was killed by signal 9"), "aborted at tick"]);
    }
}

#[test]
fn a_killed_clock_is_named_too() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("killed.mcap"));
    let mut launch = place.start_endless(&["run", &manifest, "--record", &recording]);
    launch.await_ticks(100);
    kill_process(place.clock(), Signal::KILL).unwrap();
    launch.end().with_code(2).says(&["process `clock` was killed by signal 9"]);
}

#[test]
fn what_was_recorded_before_a_failure_is_that_of_an_undisturbed_run() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("killed.mcap"));
    let mut launch = place.start_endless(&["run", &manifest, "--record", &recording]);
    launch.await_ticks(300);
    kill_process(place.process_of("pilot"), Signal::KILL).unwrap();
    launch.end().with_code(2);
    let (mut killed, whole) = (topics(&partial(&recording)), place.path("whole.mcap"));
    place.call(&["run", &manifest, "--record", &whole]).with_code(0);
    let mut whole = topics(&whole);
    let ticks = killed.values().flatten().map(|message| message.tick).max().unwrap() + 1;
    assert!(ticks >= 200, "only {ticks} ticks were recorded");
    for topics in [&mut killed, &mut whole] {
        topics.values_mut().for_each(|messages| messages.retain(|message| message.tick < ticks));
    }
    require_same_messages(&whole, &killed);
}

#[test]
fn two_layouts_under_one_name_are_refused_and_both_printed() {
    let place = Place::new();
    let changed = sender("changed", 1, "parameters = { has_other_layout = true }");
    let reader = sender("reader", 1, "inputs.input = \"/changed/note\"");
    let path = place.write("layouts.toml", manifest(100, &[changed, reader]));
    let ended = place.call(&["run", &path]).with_code(2);
    ended.says(&["process `reader` ended", "layout mismatch on topic /changed/note", "port `input`"]);
    ended.says(&[
        "and node `changed` sends its port `",
        "Rebuild the program of node `changed` or that of `reader`",
    ]);
    ended.says(&["test_msgs/msg/Note (40 bytes)", "uint64       seen_tick", "lead_ticks"]);
    ended.says(&["test_msgs/msg/Note (32 bytes)", "float64[3]   place", "m        world"]);
}

#[test]
fn a_type_that_the_node_does_not_publish_is_refused() {
    let place = Place::new();
    let stated = "outputs.note = { type = \"hummingbus_msgs/msg/Imu\" }";
    let path = place.write("types.toml", manifest(100, &[table("liar", stated)]));
    let ended = place.call(&["run", &path]).with_code(2);
    ended.says(&[
        "node `liar` publishes test_msgs/msg/Note",
        "output `note`",
        "states hummingbus_msgs/msg/Imu",
    ]);
}

#[test]
fn a_port_that_is_declared_twice_is_refused_with_both_types() {
    let place = Place::new();
    let twice = sender("twice", 1, "parameters = { declares_twice = true }");
    let path = place.write("twice.toml", manifest(100, &[twice]));
    place.call(&["run", &path]).with_code(2).says(&[
        "node `twice` declares its output `note` twice",
        "as test_msgs/msg/Note and as test_msgs/msg/Note",
        "declare it once",
    ]);
}

#[test]
fn a_port_that_the_node_does_not_declare_is_refused() {
    let place = Place::new();
    let reader = sender("reader", 1, "inputs.inptu = \"/source/note\"");
    let path = place.write("ports.toml", manifest(100, &[sender("source", 1, ""), reader]));
    let ended = place.call(&["run", &path]).with_code(2);
    ended.says(&["node `reader`", "the input `inptu`", "does not declare"]);
}

#[test]
fn a_command_that_cannot_be_started_is_named() {
    let place = Place::new();
    let path = place
        .write("start.toml", manifest(100, &["[process.ghost]\ncommand = [\"./no-such-file\"]\n\n".into()]));
    place.call(&["run", &path]).with_code(2).says(&["process `ghost`: cannot start", "no-such-file"]);
}

#[test]
fn a_recording_that_cannot_be_written_ends_the_run_and_names_the_file() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let recording = place.path("no-such-folder/a.mcap");
    let ended = place.call(&["run", &manifest, "--record", &recording]).with_code(2);
    let folder = place.path("no-such-folder");
    ended.says(&["cannot create ", &recording, &format!("there is no folder {folder}")]);
}
