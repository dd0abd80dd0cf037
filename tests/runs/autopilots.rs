//! Autopilots: a stand-in for Betaflight's SITL (`autopilots/sitl.c`) flies, and fails in every way; the real one where
//! `HUMMINGBUS_BETAFLIGHT` names it. [`ardupilot`] and [`px4`] have the same for ArduPilot and PX4.

mod ardupilot;
mod px4;

use crate::documentation::code_blocks;
use crate::recordings::{open, require_same};
use crate::skipped::{cases, is_left, variable_or_skip};
use crate::support::{Ended, Place, repository};
use ::autopilots::betaflight::mixers::MIXERS;
use ::autopilots::layout::Motor;
use serde_json::{Value, json};
use std::f64::consts::SQRT_2;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

/// The manifest of the hover and the doublet.
fn manifest() -> String {
    repository("manifests/autopilots/betaflight.toml")
}

/// The program of the stand-in `source`, linked with `more`.
fn compiled(source: &str, more: &[&str]) -> Vec<u8> {
    let place = Place::new();
    let program = place.path("sitl");
    let mut compiler = Command::new("cc");
    let source = repository(&format!("tests/runs/autopilots/{source}"));
    compiler.args(["-O1", "-o", &program, &source, "-lpthread", "-lm"]);
    let ended = compiler.args(more).output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    fs::read(program).unwrap()
}

/// The stand-in in `place`, and its configuration of these words; as settings of the manifest.
fn stand_in(place: &Place, words: &str) -> Vec<String> {
    static PROGRAM: OnceLock<Vec<u8>> = OnceLock::new();
    let program = place.write("sitl", PROGRAM.get_or_init(|| compiled("sitl.c", &[])));
    let configuration = place.write("configuration", words);
    vec![
        format!("process.controller.firmware={program}"),
        format!("process.controller.configuration={configuration}"),
    ]
}

/// Runs `command` on `manifest` with `settings` and `more`.
fn call(place: &Place, command: &str, manifest: &str, settings: &[String], more: &[&str]) -> Ended {
    let settings = settings.iter().flat_map(|setting| ["--set", setting]);
    let args: Vec<&str> =
        [command, manifest].into_iter().chain(settings).chain(more.iter().copied()).collect();
    place.call(&args)
}

#[test]
fn a_firmware_flies_the_hover_and_its_doublet_and_two_runs_are_the_same_bytes() {
    let place = Place::new();
    let (settings, first, second) = (stand_in(&place, ""), place.path("a.mcap"), place.path("b.mcap"));
    call(&place, "run", &manifest(), &settings, &["--record", &first]).with_code(0);
    // The firmware's folder lies in a path that cannot be preloaded from as it is.
    let folder = place.path("a blank, a colon: ");
    fs::create_dir(&folder).unwrap();
    let manifest = manifest();
    let set = settings.iter().flat_map(|setting| ["--set", setting]);
    let args: Vec<&str> =
        ["run", &manifest, "--record", &second, "--compose", "all"].into_iter().chain(set).collect();
    place.start_with(&args, &[("TMPDIR", &folder)]).end().with_code(0);
    require_same(&fs::read(&first).unwrap(), &second);
}

/// The page sends what the gamepad asks for: without a page the firmware hovers.
#[test]
fn a_firmware_that_a_person_flies_hovers_while_nobody_asks() {
    if is_left(
        "`a_firmware_flies_the_hover_and_its_doublet_and_two_runs_are_the_same_bytes` has the firmware",
    ) {
        return;
    }
    let place = Place::new();
    let manifest = repository("manifests/autopilots/betaflight-by-hand.toml");
    let mut settings = stand_in(&place, "");
    call(&place, "check", &manifest, &settings, &[]).with_code(0);
    settings.push("run.duration_s=3".to_owned());
    let [first, second] = ["a.mcap", "b.mcap"].map(|name| place.path(name));
    for recording in [&first, &second] {
        let args = ["--record", recording, "--pace", "free"];
        call(&place, "run", &manifest, &settings, &args).with_code(0);
    }
    require_same(&fs::read(&first).unwrap(), &second);
}

#[test]
fn a_controller_takes_over_from_a_firmware_and_gives_back() {
    let place = Place::new();
    let swap = repository("manifests/autopilots/betaflight-swap.toml");
    let args = ["run", &swap, "--record", &place.path("a.mcap"), "--json"];
    let program = place.write("sitl", compiled("sitl.c", &[]));
    let ended = place.start_with(&args, &[("HUMMINGBUS_BETAFLIGHT", &program)]).end();
    let summary = ended.with_code(0).json();
    let all = summary["successions"].as_array().unwrap();
    let shapes: Vec<_> = all.iter().map(|it| (&it["take_over_tick"], it["hand_over"].as_str())).collect();
    let last = Some("last output");
    assert_eq!(
        shapes,
        [(&json!(4000), last), (&json!(10_000), last)],
        "nobody knows what a firmware remembers"
    );
    // The controller goes on from the command before; the firmware from its own start, near it.
    let jump = |succession: &Value| succession["steps"][0]["step"].as_f64().unwrap().abs();
    assert!(jump(&all[0]) < 1e-9 && jump(&all[1]) < 15.0, "{summary}");
}

/// A manifest in `place` with two vehicles as that of `manifest`: each has a firmware of its own, and all conditions.
fn pair(place: &Place, manifest: &str) -> String {
    let one = fs::read_to_string(manifest).unwrap();
    let (nodes, rest) = one.split_once("[process.recorder]").unwrap();
    let nodes = &nodes[nodes.find("[process.plant]").unwrap()..];
    let conditions = &rest[rest.find("[[pass]]").unwrap()..];
    let conditions = conditions.replace("name = \"", "name = \"second vehicle: ");
    let names = ["plant", "imu", "mocap", "ekf", "controller", "sticks", "pilot"];
    let second = names.iter().fold(format!("{conditions}\n{nodes}"), |text, name| {
        text.replace(&format!("[process.{name}"), &format!("[process.{name}2"))
            .replace(&format!("\"/{name}/"), &format!("\"/{name}2/"))
    });
    let second = second.replace(
        "outputs.pose = { every_ticks = 10 }\noutputs.tf = { topic = \"/tf\", every_ticks = 10 }\n",
        "",
    );
    place.write("two.toml", format!("{one}\n{second}").replace("../../", &repository("")))
}

/// The settings of a firmware, for both of a [`pair`].
fn of_both(settings: &[String]) -> Vec<String> {
    let second =
        settings.iter().map(|setting| setting.replace("process.controller.", "process.controller2."));
    settings.iter().cloned().chain(second).collect()
}

/// Altitudes at the end of the recording of a [`pair`].
fn last_altitudes(place: &Place, recording: &str) -> [f64; 2] {
    ["/plant/state", "/plant2/state"].map(|topic| {
        let args = ["cat", recording, "--topic", topic, "--field", "position.z", "--csv"];
        let rows = place.call(&args).with_code(0).output;
        rows.lines().last().unwrap().rsplit(',').next().unwrap().parse().unwrap()
    })
}

/// Flies `manifest` with `settings` for 3 s, and a second vehicle beside it with a firmware of its own.
fn each_flies_its_own(place: &Place, manifest: &str, settings: &[String]) {
    let settings = [of_both(settings), vec!["run.duration_s=3".to_owned()]].concat();
    let recording = place.path("two.mcap");
    call(place, "run", &pair(place, manifest), &settings, &["--record", &recording]).flown();
    // Their noise differs, so that no firmware has flown both.
    let [first, second] = last_altitudes(place, &recording);
    assert!((first - 1.4).abs() < 0.2 && (second - 1.4).abs() < 0.2 && first != second, "{first} {second}");
}

/// Requires that the recording of a flight of `manifest` has all bytes of `files` attached, under their names.
fn files_are_attached(place: &Place, manifest: &str, settings: &[String], files: &[&str]) {
    let settings = [settings, &["run.duration_s=0.1".to_owned()]].concat();
    let recording = place.path("attached.mcap");
    call(place, "run", manifest, &settings, &["--record", &recording]).flown();
    let attached = open(&recording).attachments().unwrap();
    for file in files {
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        let found: Vec<String> = attached
            .iter()
            .filter(|(attached, _)| attached == name)
            .map(|(_, bytes)| ::inputs::sha256(bytes))
            .collect();
        assert_eq!(found, [::inputs::sha256(&fs::read(file).unwrap())], "SHA-256 of {name}");
    }
}

#[test]
fn a_firmware_and_its_configuration_are_attached() {
    let place = Place::new();
    let settings = stand_in(&place, "# gains\nset p_roll = 17\n");
    let files = ["sitl", "configuration"].map(|name| place.path(name));
    files_are_attached(&place, &manifest(), &settings, &files.each_ref().map(String::as_str));
}

/// Raw channels, without set points: a switch arms in the run, and the throttle lifts the vehicle off.
#[test]
fn a_firmware_takes_off_by_the_sticks_of_a_script() {
    let place = Place::new();
    let manifest = repository("manifests/autopilots/betaflight-sticks.toml");
    let flown = ["--record", &place.path("a.mcap")];
    call(&place, "run", &manifest, &stand_in(&place, ""), &flown).with_code(0);
    // The conditions notice a firmware that the switch does not arm.
    let settings = [stand_in(&place, "unarmed\n"), vec!["run.duration_s=2".to_owned()]].concat();
    let grounded = ["--record", &place.path("b.mcap"), "--json"];
    let summary = call(&place, "run", &manifest, &settings, &grounded).with_code(1).json();
    let verdicts = summary["pass"].as_array().unwrap();
    let is_armed =
        verdicts.iter().find(|it| it["name"] == "the motors idle faster once it is armed").unwrap();
    assert_eq!(is_armed["passed"], false, "{summary}");
}

/// Runs `manifest` with `settings` for 4 s, its sticks behind a radio link that loses the part `loss`; returns the last commands.
fn last_commands_behind_a_radio(place: &Place, manifest: &str, settings: &[String], loss: f64) -> Vec<f64> {
    let link = format!(
        "[process.radio]\nkind = \"link\"\nparameters = {{ baud = 1000000, latency_ms = 10.0, loss = {loss:?}, streams.rc.rate_hz = 50.0 }}\n\
         inputs.rc = {{ topic = \"/sticks/rc\", delay_ticks = 1, initial = {{}} }}\n"
    );
    let text = fs::read_to_string(manifest).unwrap().replace("../../", &repository(""));
    let (flown, _) = text.split_once("[[pass]]").unwrap();
    let flown = flown.replace("inputs.rc = \"/sticks/rc\"", "inputs.rc = \"/radio/rc\"");
    let path = place.write("radio.toml", flown + &link);
    let recording = place.path("radio.mcap");
    let settings = [settings, &["run.duration_s=4".to_owned()]].concat();
    call(place, "run", &path, &settings, &["--record", &recording]).with_code(0);
    let args = ["cat", &recording, "--topic", "/controller/command", "--csv"];
    let rows = place.call(&args).with_code(0).output;
    let cells: Vec<&str> = rows.lines().last().unwrap().split(',').collect();
    cells[cells.len() - 4..].iter().map(|cell| cell.parse().unwrap()).collect()
}

/// Flies `manifest` behind a radio: a lost one has the firmware act, which stops its motors.
fn a_lost_radio_reaches_the_firmware(manifest: &str, settings: &[String]) {
    let place = Place::new();
    let flying = last_commands_behind_a_radio(&place, manifest, settings, 0.0);
    assert!(flying.iter().all(|counts| (50.0..120.0).contains(counts)), "it hovers: {flying:?}");
    let lost = last_commands_behind_a_radio(&place, manifest, settings, 1.0);
    assert!(lost.iter().all(|counts| *counts <= 1.0), "its failsafe stops the motors: {lost:?}");
}

#[test]
fn a_lost_radio_is_lost_for_the_firmware() {
    let place = Place::new();
    a_lost_radio_reaches_the_firmware(&manifest(), &stand_in(&place, ""));
}

/// As the log of a receiver: the channels of one flight fly it again.
#[test]
fn recorded_channels_fly_the_flight_again() {
    let place = Place::new();
    let settings = [&stand_in(&place, "")[..], &["run.duration_s=3".to_owned()]].concat();
    let (first, second) = (place.path("a.mcap"), place.path("b.mcap"));
    call(&place, "run", &manifest(), &settings, &["--record", &first]).flown();
    let cat = |recording: &str, topic: &str| {
        place.call(&["cat", recording, "--topic", topic, "--csv"]).with_code(0).output
    };
    let mut rows = "time_s,ch1,ch2,ch3,ch4,ch5,ch6\n".to_owned();
    for line in cat(&first, "/sticks/rc").lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        // Half a tick before the tick that sends it.
        let time_s = (cells[0].parse::<f64>().unwrap() - 0.5) * 1e-3;
        rows += &format!("{time_s},{}\n", cells[cells.len() - 6..].join(","));
    }
    let data = place.write("receiver.csv", rows);
    let text = fs::read_to_string(manifest()).unwrap().replace("../../", &repository(""));
    let (before, sticks) = text.split_once("[process.sticks]").unwrap();
    let behind = &sticks[sticks.find("[process.pilot]").unwrap()..];
    let sticks = format!("[process.sticks]\nkind = \"rc\"\ndata = {data:?}\n");
    let again = place.write("again.toml", format!("{before}{sticks}{behind}"));
    call(&place, "run", &again, &settings, &["--record", &second]).flown();
    for topic in ["/sticks/rc", "/controller/command", "/plant/state"] {
        assert!(cat(&first, topic) == cat(&second, topic), "{topic} differs");
    }
}

#[test]
fn each_firmware_of_a_run_flies_its_own_vehicle() {
    if is_left("`px4::each_px4_of_a_run_flies_its_own_vehicle` has several") {
        return;
    }
    let place = Place::new();
    each_flies_its_own(&place, &manifest(), &stand_in(&place, ""));
}

#[test]
fn a_firmware_that_fails_ends_the_run_with_its_last_words() {
    let all: [(&str, &[&str]); 5] = [
        // While it starts, and in flight: 7 s of its time are before tick 0.
        ("ends 1\n", &["betaflight ended with exit code 3", "out of coffee"]),
        ("ends 8\n", &["betaflight ended with exit code 3", "out of coffee"]),
        ("crashes 8\n", &["betaflight was killed by signal 6"]),
        ("mute 8\n", &["it has sent no motor outputs for 0.1 s of its time"]),
        ("hangs 8\n", &["betaflight runs and gave no answer for 3 s", "thinking"]),
    ];
    // While it starts, without outputs, and without an answer.
    let quick = ["ends 1\n", "mute 8\n", "hangs 8\n"];
    for (words, told) in cases("failures", all, |(words, _)| quick.contains(words)) {
        let place = Place::new();
        let mut settings = stand_in(&place, words);
        // A short limit only where it is to pass: a loaded host answers late.
        if words.starts_with("hangs") {
            settings.push("process.controller.parameters.reply_timeout_s=3".to_owned());
        }
        let recording = place.path("a.mcap");
        let ended = call(&place, "run", &manifest(), &settings, &["--record", &recording]).with_code(2);
        ended.says(told);
        ended.says(&["node `controller`"]);
        assert!(place.left().is_empty(), "{words}: {:?}", place.left());
    }
}

#[test]
fn a_firmware_that_is_not_armed_is_told_before_tick_0() {
    let place = Place::new();
    let ended = call(&place, "run", &manifest(), &stand_in(&place, "unarmed\n"), &["--record", "none"]);
    ended.with_code(2).says(&["it is not armed at tick 0", "armed_by_channel"]);
}

#[test]
fn a_command_that_the_firmware_refuses_is_told_before_tick_0() {
    let place = Place::new();
    let ended =
        call(&place, "run", &manifest(), &stand_in(&place, "# one\nnonsense 7\n"), &["--record", "none"]);
    ended
        .with_code(2)
        .says(&["/configuration:2: ", "a command that Betaflight refuses: `nonsense 7`: ###ERROR"]);
}

#[test]
fn what_cannot_be_a_firmware_is_refused_by_check() {
    let place = Place::new();
    let unset = "process.controller.firmware=${HUMMINGBUS_UNSET}".to_owned();
    call(&place, "check", &manifest(), &[unset], &[]).with_code(2).says(&["HUMMINGBUS_UNSET is not set"]);
    let text = place.write("text", "no program");
    let in_static = place.write("static", compiled("sitl.c", &["-static"]));
    let settings = stand_in(&place, "");
    let old = place.write("old", compiled("sitl.c", &["-DOLD"]));
    // The front left rotor of eight stands 15° beside its place.
    let octocopter = fs::read_to_string(repository("vehicles/tarot-t18.toml")).unwrap();
    let place_of_rotor = "[0.586664, 0.243004, 0]";
    assert!(octocopter.contains(place_of_rotor));
    let askew = place.write("askew.toml", octocopter.replacen(place_of_rotor, "[0.5038, 0.3866, 0]", 1));
    let cases: [(&str, &[&str]); 8] = [
        (
            &format!("process.controller.firmware={old}"),
            &["/old: this version of Betaflight cannot load", "`--config`"],
        ),
        ("process.controller.firmware=/bin/ls", &["/bin/ls: it is not Betaflight's SITL", "`Betaflight`"]),
        (&format!("process.controller.firmware={text}"), &["firmware", "expected a 64-bit Linux program"]),
        (&format!("process.controller.firmware={in_static}"), &["linked statically", "would stall"]),
        ("process.controller.firmware=/nowhere/sitl", &["/nowhere/sitl", "No such file"]),
        ("process.controller.parameters.armed_by_channel=4", &["expected 5 to 16"]),
        ("process.controller.parameters.rc_rate_hz=0", &["rc_rate_hz"]),
        (&format!("process.controller.vehicle={askew}"), &["rotors match none of the frames QUADX, QUADP"]),
    ];
    for (setting, told) in cases {
        let settings = [&settings[..], &[setting.to_owned()]].concat();
        call(&place, "check", &manifest(), &settings, &[]).with_code(2).says(told);
    }
}

#[test]
fn all_faults_of_the_settings_of_a_firmware_are_told() {
    let place = Place::new();
    let check = |settings: &[&str]| {
        let settings: Vec<String> =
            settings.iter().map(|setting| format!("process.controller.{setting}")).collect();
        call(&place, "check", &manifest(), &settings, &[]).with_code(2)
    };
    let settings = [
        "vehicle=/nowhere/bird.toml",
        "firmware=/bin/ls",
        "configuration=/nowhere/configuration",
        "parameters.armed_by_channel=4",
    ];
    check(&settings).says(&[
        "/nowhere/bird.toml",
        "/bin/ls: it is not Betaflight's SITL",
        "cannot read /nowhere/configuration",
        "`armed_by_channel` is 4, expected 5 to 16",
    ]);
    let ranges = ["parameters.rc_rate_hz=0", "parameters.reply_timeout_s=0", "parameters.colour=1"];
    check(&[&settings[1..2], &ranges].concat()).says(&["rc_rate_hz", "reply_timeout_s", "colour"]);
}

/// The Hummingbird with the text `from` of its file replaced by `to`, as a setting of the manifest.
fn vehicle_with(place: &Place, from: &str, to: &str) -> String {
    let text = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    assert!(text.contains(from), "{from}");
    format!("process.controller.vehicle={}", place.write("bird.toml", text.replacen(from, to, 1)))
}

#[test]
fn a_firmware_has_vehicles_checked_as_controllers_do() {
    let place = Place::new();
    let settings = stand_in(&place, "");
    let check = |from: &str, to: &str| {
        let settings = [&settings[..], &[vehicle_with(&place, from, to)]].concat();
        call(&place, "check", &manifest(), &settings, &[])
    };
    let (front, name) = ("value = [0.17, 0, 0]", "name = \"front\"");
    let failed = check(name, &format!("{name}\nfailed = {{ value = true, source = \"test\" }}"));
    failed.with_code(2).says(&["its 3 working rotors of 4 cannot", "bird.toml:"]);
    check(front, "value = [0.05, 0, 0]").with_code(0).says(&[
        "has arms of 0.0500 m and 0.1700 m, and the mixer QUADP counts on equal ones",
        "bird.toml:",
        "`rotors.0.position`",
    ]);
    let leaning =
        "axis = { value = [0, 0.6, 0.8], unit = \"1\", source = \"test\", uncertainty = \"not stated\" }";
    check(name, &format!("{name}\n{leaning}")).with_code(0).says(&[
        "\"front\" that leans by 36.9 degrees, and the mixer QUADP counts on upright ones",
        "`rotors.0.axis`",
    ]);
}

#[test]
fn a_checkpoint_of_a_firmware_is_refused_in_words() {
    if is_left("`ardupilot::a_checkpoint_of_an_ardupilot_is_refused_in_words` refuses one") {
        return;
    }
    let place = Place::new();
    let settings = stand_in(&place, "");
    let recording = place.path("a.mcap");
    let says = "the state of `controller` is in a firmware, which does not tell it";
    let planned = ["--record", &recording, "--checkpoint-every", "500ms"];
    call(&place, "run", &manifest(), &settings, &planned).with_code(2).says(&["at tick 500", says]);
    // What is asked for in flight is refused, and the run flies on.
    let manifest = manifest();
    let mut args = vec!["run", &manifest, "--record", &recording, "--pace", "realtime"];
    for setting in &settings {
        args.extend(["--set", setting.as_str()]);
    }
    let mut launch = place.start(&args);
    launch.await_ticks(100);
    let run = place.run_id();
    place.start(&["ctl", "checkpoint", "--run", &run]).end_among_others().with_code(2).says(&[says]);
    place.start(&["ctl", "pace", "free", "--run", &run]).end_among_others().with_code(0);
    launch.end().flown();
}

#[test]
fn betaflight_flies_the_hover_and_its_doublet() {
    let Some(program) = variable_or_skip("HUMMINGBUS_BETAFLIGHT", "the program of Betaflight's SITL") else {
        return;
    };
    let place = Place::new();
    let settings = [format!("process.controller.firmware={program}")];
    for manifest in
        ["betaflight", "betaflight-swap", "betaflight-sticks", "betaflight-hexa", "betaflight-octo"]
    {
        let path = repository(&format!("manifests/autopilots/{manifest}.toml"));
        let [first, second] = ["a", "b"].map(|name| place.path(&format!("{manifest}-{name}.mcap")));
        for recording in [&first, &second] {
            call(&place, "run", &path, &settings, &["--record", recording]).with_code(0);
        }
        require_same(&fs::read(&first).unwrap(), &second);
    }
}

#[test]
fn the_process_of_the_page_about_firmware_passes_its_check() {
    let place = Place::new();
    let [block] = &code_blocks("docs/firmware.md", "toml")[..] else { panic!("one block of TOML") };
    let vehicles = format!("\"{}/", repository("vehicles"));
    let block = block.replace("\"../vehicles/", &vehicles);
    // Beside the page's manifest.
    place.write("betaflight.cli", fs::read(repository("manifests/autopilots/betaflight.cli")).unwrap());
    let settings = stand_in(&place, "");
    let page = place.write("page.toml", format!("include = [{:?}]\n{block}\n", manifest()));
    call(&place, "check", &page, &settings[..1], &[]).with_code(0);
}

/// The stand-in flies quadrotors alone: without the real firmware these two are checked, and not flown.
#[test]
fn the_hexacopter_and_the_octocopter_of_betaflight_pass_their_check() {
    let place = Place::new();
    let settings = stand_in(&place, "");
    for manifest in ["betaflight-hexa", "betaflight-octo"] {
        let path = repository(&format!("manifests/autopilots/{manifest}.toml"));
        // The firmware alone: each has a configuration of its own.
        let ended = call(&place, "check", &path, &settings[..1], &[]).with_code(0);
        assert!(ended.error.is_empty(), "{ended}");
    }
}

/// The shipped vehicle that has as many rotors as a mixer has `motors`, its arm in metres, and the manifest that flies it. Four coaxial pairs
/// are a Hummingbird with each rotor twice. In an X of four arms all of them make roll, in a plus two: shorter arms make the same torque.
fn like_mixer(motors: &[Motor]) -> (&'static str, f64, &'static str) {
    let is_x = motors[0].0 % 90.0 != 0.0;
    match (motors.len(), has_pairs(motors)) {
        (6, _) => ("dji-f550", 0.27, "betaflight-hexa"),
        (8, false) => ("tarot-t18", 0.635, "betaflight-octo"),
        _ => ("hummingbird", if is_x { 0.17 / SQRT_2 } else { 0.17 }, "betaflight"),
    }
}

/// True if two motors are on one arm.
fn has_pairs(motors: &[Motor]) -> bool {
    motors.iter().enumerate().any(|(number, motor)| motors[..number].iter().any(|other| other.0 == motor.0))
}

/// A vehicle file with rotors that stand and turn as `motors` do; the rest is that of the vehicle `base`.
fn vehicle_of_mixer(place: &Place, name: &str, motors: &[Motor], base: &str, arm_m: f64) -> String {
    let mut text = format!("base = {:?}\nname = {name:?}\n", repository(&format!("vehicles/{base}.toml")));
    if base == "hummingbird" && motors.len() == 8 {
        let halves = [
            ("thrust_coefficient", 7.6184e-8 / 2.0, "N/rpm^2"),
            ("torque_coefficient", 2.6839e-9 / 2.0, "N*m/rpm^2"),
            ("inertia", 3.1e-5 / 2.0, "kg*m^2"),
        ];
        text += "[rotor]\n";
        for (key, value, unit) in halves {
            text += &format!(
                "{key} = {{ value = {value:e}, unit = {unit:?}, source = \"a test\", uncertainty = \"exact\" }}\n"
            );
        }
    }
    for (number, (angle_deg, is_clockwise)) in motors.iter().enumerate() {
        let (right, front) = libm::sincos(angle_deg.to_radians());
        let stands_there = |other: &Motor| other.0 == *angle_deg;
        let [is_lower, is_upper] =
            [&motors[..number], &motors[number + 1..]].map(|others| others.iter().any(stands_there));
        let z_m = 0.02 * (f64::from(is_upper) - f64::from(is_lower));
        let (position_m, spin) = (
            [arm_m * front, -arm_m * right, z_m],
            if *is_clockwise { "clockwise" } else { "counter-clockwise" },
        );
        text += &format!(
            "[[rotors]]\nname = \"{number}\"\n\
             position = {{ value = {position_m:?}, unit = \"m\", source = \"a test\", uncertainty = \"exact\" }}\n\
             spin = {{ value = {spin:?}, source = \"a test\" }}\n"
        );
    }
    place.write(&format!("{name}.toml"), text)
}

#[test]
fn betaflight_flies_the_hover_and_its_doublet_with_each_mixer() {
    let Some(program) = variable_or_skip("HUMMINGBUS_BETAFLIGHT", "the program of Betaflight's SITL") else {
        return;
    };
    let place = Place::new();
    for (name, motors) in MIXERS {
        let (base, arm_m, manifest) = like_mixer(motors);
        let vehicle = vehicle_of_mixer(&place, name, motors, base, arm_m);
        let mut settings = vec![format!("process.controller.firmware={program}")];
        settings.extend(["plant", "controller"].map(|node| format!("process.{node}.vehicle={vehicle}")));
        if base == "hummingbird" {
            let hover = vec![76.5; motors.len()];
            settings.push(format!("process.plant.inputs.command.initial.command={hover:?}"));
        }
        let manifest = repository(&format!("manifests/autopilots/{manifest}.toml"));
        let recording = place.path(&format!("{name}.mcap"));
        call(&place, "run", &manifest, &settings, &["--record", &recording]).with_code(0);
    }
}

/// The hover and the doublet of both, by the conditions of both.
#[test]
fn each_betaflight_of_a_run_flies_its_own_vehicle() {
    let Some(program) = variable_or_skip("HUMMINGBUS_BETAFLIGHT", "the program of Betaflight's SITL") else {
        return;
    };
    let place = Place::new();
    let configuration = repository("manifests/autopilots/betaflight.cli");
    let settings = of_both(&[
        format!("process.controller.firmware={program}"),
        format!("process.controller.configuration={configuration}"),
    ]);
    let (manifest, [first, second]) =
        (pair(&place, &manifest()), ["a.mcap", "b.mcap"].map(|name| place.path(name)));
    for recording in [&first, &second] {
        call(&place, "run", &manifest, &settings, &["--record", recording]).with_code(0);
    }
    require_same(&fs::read(&first).unwrap(), &second);
    // Their noise differs, so that no firmware has flown both.
    let [one, other] = last_altitudes(&place, &first);
    assert!(one != other, "both end at {one} m");
}
