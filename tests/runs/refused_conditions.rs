//! Refused: pass conditions and comparisons.

use crate::refusals::{good, refused, refused_setting, refused_text, refused_with};
use crate::support::{Place, repository};

/// A condition that holds at the start of the good manifest's flight.
const PASS: &str = "[[pass]]\nname = \"low\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 1\n";

#[test]
fn a_condition_on_a_topic_that_nobody_publishes() {
    let pass = "name = \"high\"\ntopic = \"/plant/stat\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmin = 1\n";
    let ended = refused_with(&format!("\n[[pass]]\n{}", pass.replace("\"/plant", "§\"/plant")));
    ended.says(&["nobody publishes /plant/stat", "did you mean `/plant/state`?"]);
    let compare = "simulated = \"/plant/state\"\nmeasured = §\"/player/measured\"\nwindow_s = 0.1\n";
    refused_with(&format!("\n[[compare]]\n{compare}")).says(&["nobody publishes /player/measured"]);
}

#[test]
fn a_condition_on_a_field_or_in_a_unit_that_is_none() {
    let with = |from: &str, to: &str| {
        let mark = if to.contains('§') { "" } else { "§" };
        refused_with(&format!("\n{mark}{}", PASS.replace(from, to)))
    };
    let wrong = PASS.replace("\"position.z", "§\"position.q");
    refused_with(&format!("\n{wrong}")).says(&["pass condition `low`", "`position.q`", "position.z"]);
    let misspelt = PASS.replace("\"position.z", "§\"postion.z");
    refused_with(&format!("\n{misspelt}")).says(&["`postion.z`", "did you mean `position.z`?"]);
    with("\"m\"", "§\"deg\"").says(&["pass condition `low`", "`deg` is not a unit of length", "cm"]);
    with("max = 1\n", "").says(&["pass condition `low`", "no limit", "add `min`, `max`"]);
}

#[test]
fn a_measure_that_has_a_limit_or_measures_nothing() {
    let with = |from: &str, to: &str| {
        let measure = PASS.replace("[[pass]]", "[[measure]]").replace("max = 1\n", "");
        let mark = if to.contains('§') { "" } else { "§" };
        refused_with(&format!("\n{mark}{}", measure.replace(from, to)))
    };
    with("name", "max = §1\nname").says(&["measure `low`: it has a limit", "write [[pass]]"]);
    with("\"position.z", "§\"position.q").says(&["measure `low`", "`position.q`", "position.z"]);
    with("\"/plant/state", "§\"/plant/stat").says(&["nobody publishes /plant/stat"]);
}

#[test]
fn a_lag_or_gain_without_a_reference_that_it_can_have() {
    let with = |keys: &str| {
        let mark = if keys.contains('§') { "" } else { "§" };
        let lag = PASS.replace("\"max\"", &format!("{mark}\"lag\"")).replace("unit = \"m\"", "unit = \"ms\"");
        refused_with(&format!("\n{lag}{keys}"))
    };
    let reference = |rest: &str| format!("reference = {{ topic = \"/plant/state\", {rest} }}\n");
    let height = reference("field = \"position.z\"");
    with("").says(&["pass condition `low`", "`lag` has no `reference`", "add what it is measured against"]);
    with(&reference("field = §\"position.q\"")).says(&["`position.q`", "position.z"]);
    with(&reference("field = §\"attitude.roll\"")).says(&["the field is in `m`, its `reference` in `rad`"]);
    for (within_s, said) in [("0.0", "0 s"), ("1e300", "1000000")] {
        let said = format!("`within_s` of `reference` is {said}");
        with(&reference(&format!("field = \"position.z\", within_s = §{within_s}"))).says(&[&said]);
    }
    with(&height.replace("\"/plant/state", "§\"/plant/stat"))
        .says(&["nobody publishes /plant/stat", "did you mean"]);
    let minus = height.replace("reference = ", "minus = §");
    with(&format!("{height}{minus}")).says(&["the statistic `lag` cannot have `minus`", "from_s and to_s"]);
    let marked = height.replace("reference = ", "reference = §");
    refused_with(&format!("\n{PASS}{marked}")).says(&["`reference` is there", "`lag` and `gain`"]);
    let metres = PASS.replace("\"max\"", "\"lag\"").replace("\"m\"", "§\"m\"");
    refused_with(&format!("\n{metres}{height}")).says(&["`m` is not a unit of time"]);
}

#[test]
fn a_condition_on_a_topic_that_the_recorder_leaves_out() {
    let recorder = "[process.recorder]\nkind = \"recorder\"\n";
    let ended = refused(
        recorder,
        &format!("{recorder}inputs.imu = \"/imu/imu\"\n{}", PASS.replace("\"/plant", "§\"/plant")),
    );
    ended.says(&["/plant/state is judged but not recorded", "kind = \"recorder\""]);
}

/// Faults are refused before the start without a recording, too.
#[test]
fn a_condition_without_a_recorder_on_a_topic_or_field_that_is_none() {
    let recorder = "[process.recorder]\nkind = \"recorder\"\n";
    let with = |from: &str, to: &str| {
        let mark = if to.contains('§') { "" } else { "§" };
        refused(recorder, &format!("{mark}{}", PASS.replace(from, to)))
    };
    with("\"/plant/state", "§\"/plant/stat").says(&["nobody publishes /plant/stat", "did you mean"]);
    with("\"position.z", "§\"position.q").says(&["pass condition `low`", "`position.q`", "position.z"]);
    with("\"m\"", "§\"deg\"").says(&["pass condition `low`", "`deg` is not a unit of length"]);
}

#[test]
fn a_comparison_without_a_limit_or_with_another_window_than_the_plant_has() {
    let place = Place::new();
    let flight = format!("process.player.data={}", place.write("flight.csv", crate::replay::flight()));
    let manifest = repository("manifests/replay-nanobench.toml");
    let set =
        |args: &[&str]| place.call(&[&["check", &manifest, "--set", &flight], args].concat()).with_code(2);
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
    let is_kept = |line: &&str| !line.starts_with("max_") && !line.starts_with("judged");
    let lines: Vec<&str> = text.lines().filter(is_kept).collect();
    let limitless = place.write("limitless.toml", lines.join("\n"));
    let args = ["check", &limitless, "--set", &flight, "--set", "process.player.parameters.from_s=0.0"];
    let args = [&args[..], &["--set", "run.duration_s=1.001"]].concat();
    place
        .call(&args)
        .with_code(2)
        .says(&["the comparison has no limit, so it cannot fail", "judged = false"]);
    set(&[
        "--set",
        "process.player.parameters.from_s=0.0",
        "--set",
        "run.duration_s=1.001",
        "--set",
        "compare.0.judged=false",
    ])
    .says(&["`max_position_m` is a limit of a comparison that is not judged"]);
}

#[test]
fn a_condition_that_nothing_can_hold() {
    let with = |limits: &str| refused_with(&PASS.replace("max = 1\n", limits));
    with("min = §2\nmax = 1\n").says(&[
        "pass condition `low`",
        "`min` is 2 and `max` is 1",
        "nothing lies between: lower `min`, or raise `max`",
    ]);
    with("max = 1\nfrom_s = §0.1\n")
        .says(&["`from_s` is 0.1 s, and the run ends at 0.1 s", "raise run.duration_s"]);
    with("max = 1\nfrom_s = 5\nto_s = §4\n").says(&["`from_s` is 5 s and `to_s` is 4 s"]);
    with("max = 1\nfrom_s = §0.0501\nto_s = 0.0504\n")
        .says(&["no sample of /plant/state", "it comes every 0.001 s"]);
    with("max = 1\nfrom_s = §-1\n").says(&["`from_s` is -1 s"]);
    let gate = "max = 1\nwhile = { topic = \"/plant/state\", field = \"position.z\", min = §1, max = 0 }\n";
    with(gate).says(&["`while`: `min` is 1 and `max` is 0"]);
    let rms = PASS.replace("statistic = \"max\"", "statistic = \"rms\"").replace("max = 1\n", "max = §-1\n");
    refused_with(&rms).says(&["`max` is -1", "the root of a mean square is never below 0"]);
    for number in ["nan", "inf", "-inf", "1e999"] {
        let ended = refused_with(&PASS.replace("max = 1\n", &format!("max = §{number}\n")));
        ended.says(&[&format!("`pass.0.max` is {number}, expected a finite number")]);
    }
}

#[test]
fn a_computed_number_has_no_digits_of_its_rounding() {
    // Nine times 0.001 is 0.009000000000000001, and 0.003 goes 333.3333333333333 times into 1.
    let short = good().replace("duration_s = 0.1", "duration_s = 0.009");
    let late = PASS.replace("max = 1\n", "max = 1\nfrom_s = §0.1\n");
    refused_text(&(short + &late)).says(&["`from_s` is 0.1 s, and the run ends at 0.009 s: no sample"]);
    let place = Place::new();
    let path = place.write("good.toml", good());
    let odd = place.call(&["check", &path, "--set", "process.mocap.period_ticks=3"]).with_code(0);
    odd.says(&["`rate_hz` is 100 Hz, which does not divide the 333.33 Hz at which its node computes"]);
}

#[test]
fn a_limit_that_a_setting_states_is_blamed_on_the_setting() {
    let place = Place::new();
    let path = place.write("good.toml", good() + PASS);
    refused_setting(&path, &["pass.0.min=2"]).says(&["`min` is 2 and `max` is 1"]);
    refused_setting(&path, &["pass.0.unit=deg"]).says(&["`deg` is not a unit of length"]);
    // A setting of another key blames nothing but the line.
    let wrong = place.write("wrong.toml", good() + &PASS.replace("max = 1\n", "min = 2\nmax = 1\n"));
    let ended = place.call(&["check", &wrong, "--set", "pass.0.from_s=0.01"]).with_code(2);
    let line = good().lines().count() + 7;
    assert!(ended.error.starts_with(&format!("error: {wrong}:{line}:7: ")), "{ended}");
}

#[test]
fn what_is_odd_is_told_by_check_and_run_and_flies() {
    let place = Place::new();
    let path = place.write("good.toml", good());
    let line = good().lines().position(|line| line.starts_with("set_points")).unwrap() + 1;
    let expected = [
        format!("warning: {path}:{line}:1: process `pilot`: `set_points`: set point 0"),
        "`at_s` is 0.1 s, and the run ends at 0.1 s: it never acts".to_owned(),
    ];
    let expected = expected.each_ref().map(String::as_str);
    place.call(&["check", &path]).with_code(0).says(&expected);
    place.call(&["run", &path]).with_code(0).says(&expected);
    let longer = place.call(&["check", &path, "--set", "run.duration_s=1"]).with_code(0);
    assert_eq!(longer.error, "");
    // A run that is cut short by hand flies: what cannot be judged then is told, and does not pass.
    let pass = PASS.replace("max = 1\n", "max = 1\nfrom_s = 0.05\n");
    let path = place.write("judged.toml", good() + &pass);
    let ended = place.call(&["run", &path, "--set", "run.duration_s=0.04"]).with_code(1);
    ended.says(&["warning: ", "--set run.duration_s=0.04", "a condition without a sample does not pass"]);
}
