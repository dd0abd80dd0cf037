//! `check` asks programs for their ports and finds what a run would.

use crate::build::built;
use crate::support::{Ended, HUMMINGBUS, Place, repository};
use std::path::Path;

/// A hover of 0.3 s with this controller and this pilot.
fn hover(place: &Place, controller: &str, pilot: &str) -> String {
    let flight = repository("manifests/sets/flight.toml");
    let text = format!(
        "include = [{flight:?}]\n[run]\nduration_s = 0.3\n[process.controller]\n{controller}[process.pilot]\n{pilot}"
    );
    place.write("hover.toml", text)
}

/// The controller of the example in Rust, with the inputs and parameters that it needs and `more`.
fn custom(inputs: &str, parameters: &str) -> String {
    let program = Path::new(HUMMINGBUS).with_file_name("examples/custom_controller");
    format!(
        "command = [{program:?}]\noutputs.command = {{ type = \"hummingbus_msgs/msg/MotorCommand\" }}\n\
         inputs = {{ {inputs} }}\nparameters = {{ hover_count = 76.5, altitude = [63.6, 31.8]{parameters} }}\n"
    )
}

const INPUTS: &str = "set_point = \"/pilot/set_point\", estimate = \"/ekf/estimate\"";
const TILT: &str = ", tilt = [11.6, 4.4]";
const PILOT: &str = "kind = \"pilot\"\nparameters = { initial_altitude_m = 1.0 }\n";

/// The controller `pid`.
fn pid() -> String {
    format!(
        "kind = \"pid\"\nvehicle = {:?}\ninputs = {{ {INPUTS} }}\n",
        repository("vehicles/hummingbird.toml")
    )
}

/// The pilot of the tests in C++ with this fault.
fn faulty(fault: &str) -> String {
    let (program, extra) = (built().program("faulty"), if fault == "unread" { ", extra = 1" } else { "" });
    format!(
        "command = [{program:?}]\noutputs.set_point = {{ type = \"hummingbus_msgs/msg/SetPoint\" }}\n\
         outputs.battery = {{ type = \"test_msgs/msg/Cells\" }}\nparameters = {{ fault = {fault:?}{extra} }}\n"
    )
}

fn check(controller: &str, pilot: &str) -> Ended {
    let place = Place::new();
    let manifest = hover(&place, controller, pilot);
    place.call(&["check", &manifest])
}

#[test]
fn a_manifest_that_fits_its_programs_is_accepted_without_a_word() {
    let ended = check(&custom(INPUTS, TILT), &faulty("none")).with_code(0);
    assert!(ended.error.is_empty(), "{ended}");
    ended.prints(&["/pilot/battery"]);
}

#[test]
fn a_check_finds_what_a_run_would() {
    let (controller, none) = (custom(INPUTS, TILT), faulty("none"));
    let cases = [
        (custom(INPUTS, ""), none.clone(), "missing key `tilt`"),
        (custom(INPUTS, ", tilt = [11.6, 4.4], tild = 1.0"), none.clone(), "unknown key `tild`"),
        (
            custom("estimate = \"/ekf/estimate\"", TILT),
            none.clone(),
            "declares the input `set_point`, which the manifest does not wire",
        ),
        (
            custom(&format!("{INPUTS}, imu = \"/imu/imu\""), TILT),
            none.clone(),
            "gives node `controller` the input `imu`",
        ),
        (
            custom("set_point = \"/pilot/battery\", estimate = \"/ekf/estimate\"", TILT),
            none,
            "layout mismatch on topic /pilot/battery",
        ),
        (controller.clone(), faulty("unread"), "parameters.extra is not read"),
        (controller.clone(), faulty("port"), "declares the output `nothing`"),
        (controller.clone(), faulty("type"), "the manifest states"),
        (controller.clone(), faulty("layout"), "process `controller` reads its port `set_point` as"),
        (controller.clone(), faulty("layout"), "and process `pilot` sends its port `set_point` as"),
        // What the program sends is read by a component.
        (pid(), faulty("layout"), "process `pilot` sends its port `set_point` as"),
        (pid(), faulty("layout"), "and process `controller` reads its port `set_point` as"),
        (pid(), faulty("layout"), "rebuild the program of `pilot` against this version"),
        (controller.clone(), faulty("padding"), "at byte 8, and the fields before it end at 4"),
    ];
    for (controller, pilot, words) in cases {
        let ended = check(&controller, &pilot).with_code(2);
        assert!(ended.error.contains(words), "no {words:?} in\n{ended}");
        assert!(ended.error.contains("hover.toml:"), "no place in\n{ended}");
    }
}

#[test]
fn a_program_that_takes_no_part_is_refused_and_none_is_started_where_that_is_asked_for() {
    let silent = "command = [\"true\"]\noutputs.set_point = { type = \"hummingbus_msgs/msg/SetPoint\" }\n";
    let place = Place::new();
    let manifest = hover(&place, &custom(INPUTS, TILT), silent);
    let words =
        ["hover.toml:", "process `pilot` would not take part in a run: it ended with", "lockstep = false"];
    place.call(&["check", &manifest]).with_code(2).says(&words);
    let ended = place.call(&["check", &manifest, "--no-programs"]).with_code(0);
    assert!(ended.error.is_empty(), "{ended}");
    let failing = hover(&place, &custom(INPUTS, TILT), &silent.replace("true", "false"));
    place.call(&["check", &failing]).with_code(2).says(&["process `pilot` would not take part in a run"]);
    let crash = silent.replace("\"true\"", "\"sh\", \"-c\", \"kill -SEGV $$\"");
    let crashing = hover(&place, &custom(INPUTS, TILT), &crash);
    let words =
        ["it ended with signal: 11 (SIGSEGV)", "the program crashed before it had declared its ports"];
    place.call(&["check", &crashing]).with_code(2).says(&words);
}

#[test]
fn a_program_in_python_without_the_package_gets_advice_on_it() {
    let without = "command = [\"sh\", \"-c\", \"echo ModuleNotFoundError: No module named \\\\'hummingbus\\\\' >&2; exit 1\"]\n\
                   outputs.set_point = { type = \"hummingbus_msgs/msg/SetPoint\" }\n";
    let place = Place::new();
    let manifest = hover(&place, &pid(), without);
    for command in ["check", "run"] {
        place.call(&[command, &manifest]).with_code(2).says(&[
            "No module named 'hummingbus'",
            "hummingbus is not installed in the Python that starts this program",
            "docs/python.md",
        ]);
    }
}

#[test]
fn a_program_that_hangs_is_refused_as_a_run_would_end_at_its_watchdog() {
    let hanging = "command = [\"sleep\", \"100\"]\nwatchdog_ms_host = 500\n\
                   outputs.set_point = { type = \"hummingbus_msgs/msg/SetPoint\" }\n";
    let place = Place::new();
    let manifest = hover(&place, &custom(INPUTS, TILT), hanging);
    place.call(&["check", &manifest]).with_code(2).says(&[
        "hover.toml:",
        "process `pilot` would not take part in a run: it did not report its ports within 500 ms",
        "lockstep = false",
        "watchdog_ms_host",
    ]);
    place.call(&["run", &manifest]).with_code(2).says(&["process `pilot` was killed by the watchdog"]);
}

#[test]
fn the_first_of_two_programs_that_hang_ends_the_check_and_the_second_ends_with_it() {
    let place = Place::new();
    let id = place.path("id");
    let first = custom(INPUTS, TILT).replacen("[\"", "[\"sh\", \"-c\", \"sleep 100\", \"", 1);
    let second = format!(
        "command = [\"sh\", \"-c\", \"echo $$ >{id}; exec sleep 1000\"]\nwatchdog_ms_host = 1000000\n\
         outputs.set_point = {{ type = \"hummingbus_msgs/msg/SetPoint\" }}\n"
    );
    let manifest = hover(&place, &format!("{first}watchdog_ms_host = 5000\n"), &second);
    // A check that waits for the second one is ended, and fails, by the support's own watchdog.
    place
        .call(&["check", &manifest])
        .with_code(2)
        .says(&["process `controller` would not take part", "it did not report its ports within 5000 ms"]);
    let id = std::fs::read_to_string(id).unwrap();
    assert!(!Path::new("/proc").join(id.trim()).exists(), "the second program {id} goes on");
}

/// The place of a parameter that a program refuses.
#[test]
fn a_parameter_that_a_program_refuses_is_told_with_its_line() {
    let place = Place::new();
    let manifest = hover(&place, &custom(INPUTS, TILT), &faulty("unread"));
    let text = std::fs::read_to_string(&manifest).unwrap();
    let line = 1 + text.lines().position(|line| line.contains("extra = 1")).unwrap();
    place.call(&["check", &manifest]).with_code(2).says(&[&format!("hover.toml:{line}:"), "extra = 1"]);
}

/// As one that is linked with an older library, which knows nothing of a check.
#[test]
fn a_program_that_joins_instead_of_describing_itself_is_refused_and_leaves_nothing() {
    let pilot =
        faulty("none").replacen("command = [", "command = [\"env\", \"-u\", \"HUMMINGBUS_DESCRIBE\", ", 1);
    let ended = check(&custom(INPUTS, TILT), &pilot).with_code(2);
    ended.says(&["process `pilot` would not take part in a run"]);
}

#[test]
fn programs_that_take_over_are_asked_too() {
    let place = Place::new();
    let program = built().program("controller");
    let swap = format!(
        "{PILOT}[[swap]]\nprocess = \"controller\"\nat_tick = 200\nwith = {{ command = [{program:?}] }}\n"
    );
    let manifest = hover(&place, &pid(), &swap);
    place.call(&["check", &manifest]).with_code(2).says(&["parameters.mass_kg is missing"]);
}
