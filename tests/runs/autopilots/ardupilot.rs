//! ArduPilot: a stand-in for ArduCopter's SITL (`ardupilot.c`) flies, and fails in every way; the real one where
//! `HUMMINGBUS_ARDUPILOT` names it.

use super::{a_lost_radio_reaches_the_firmware, call, compiled, each_flies_its_own, files_are_attached};
use crate::recordings::{require_same, topics};
use crate::skipped::{cases, first, is_left, variable_or_skip};
use crate::support::{HUMMINGBUS, Place, poll, repository};
use std::fs;
use std::process::Command;
use std::sync::OnceLock;

/// The manifest of the hover and the doublet.
fn manifest() -> String {
    repository("manifests/autopilots/ardupilot.toml")
}

fn program() -> &'static [u8] {
    static PROGRAM: OnceLock<Vec<u8>> = OnceLock::new();
    PROGRAM.get_or_init(|| compiled("ardupilot.c", &[]))
}

/// The stand-in in `place`, with the parameters of the manifest and `more`; as settings of the manifest.
fn stand_in(place: &Place, more: &str) -> Vec<String> {
    let program = place.write("arducopter", program());
    let parameters = fs::read_to_string(repository("manifests/autopilots/ardupilot.parm")).unwrap();
    let configuration = place.write("ardupilot.parm", parameters + more);
    vec![
        format!("process.controller.firmware={program}"),
        format!("process.controller.configuration={configuration}"),
        "process.controller.parameters.rest_s=6".to_owned(),
    ]
}

#[test]
fn ardupilot_flies_the_hover_and_its_doublet_and_two_runs_are_the_same_bytes() {
    let place = Place::new();
    let (settings, first, second) = (stand_in(&place, ""), place.path("a.mcap"), place.path("b.mcap"));
    call(&place, "run", &manifest(), &settings, &["--record", &first]).with_code(0);
    let folder = place.path("a blank, a colon: ");
    fs::create_dir(&folder).unwrap();
    let manifest = manifest();
    let set = settings.iter().flat_map(|setting| ["--set", setting]);
    let args: Vec<&str> =
        ["run", &manifest, "--record", &second, "--compose", "all"].into_iter().chain(set).collect();
    place.start_with(&args, &[("TMPDIR", &folder)]).end().with_code(0);
    require_same(&fs::read(&first).unwrap(), &second);
}

#[test]
fn packets_that_come_twice_or_late_or_from_others_change_nothing() {
    let place = Place::new();
    // Behind its rest of 6 s, a flight of 3 s has as many kinds of packets as a whole one.
    let flight = |more: &str, name: &str| {
        let recording = place.path(name);
        let args = ["--record", &recording, "--set", "run.duration_s=3"];
        let ended = call(&place, "run", &manifest(), &stand_in(&place, more), &args);
        assert!(matches!(ended.code, Some(0 | 1)), "{ended}");
        topics(&recording)
    };
    let undisturbed = flight("", "undisturbed.mcap");
    for more in first(1, "disturbances", ["RESENDS 1\n", "LATE 1\n", "FOREIGN 1\n"]) {
        let disturbed = flight(more, "disturbed.mcap");
        assert!(disturbed == undisturbed, "{more}");
    }
}

#[test]
fn a_lost_radio_is_lost_for_ardupilot() {
    if is_left("`a_lost_radio_is_lost_for_the_firmware` loses it") {
        return;
    }
    let place = Place::new();
    a_lost_radio_reaches_the_firmware(&manifest(), &stand_in(&place, ""));
}

#[test]
fn an_ardupilot_and_its_parameters_are_attached() {
    let place = Place::new();
    let settings = stand_in(&place, "# Differs from the shipped file.\n");
    let files = ["arducopter", "ardupilot.parm"].map(|name| place.path(name));
    files_are_attached(&place, &manifest(), &settings, &files.each_ref().map(String::as_str));
}

#[test]
fn each_ardupilot_of_a_run_flies_its_own_vehicle() {
    if is_left("`px4::each_px4_of_a_run_flies_its_own_vehicle` has several") {
        return;
    }
    let place = Place::new();
    let settings = stand_in(&place, "");
    each_flies_its_own(&place, &manifest(), &settings);
}

#[test]
fn an_ardupilot_that_fails_ends_the_run_with_its_last_words() {
    let all: [(&str, &[&str]); 9] = [
        ("MUTE 1\n", &["ardupilot runs and gave no answer for 3 s", "Stands in for ArduCopter"]),
        // While it rests, and in flight: 6 s of its time are before tick 0.
        ("ENDS 1\n", &["ardupilot ended with exit code 3", "out of coffee"]),
        ("ENDS 8\n", &["ardupilot ended with exit code 3", "out of coffee"]),
        ("CRASHES 8\n", &["ardupilot was killed by signal 6"]),
        ("HANGS 8\n", &["ardupilot runs and gave no answer for 3 s", "thinking"]),
        ("WRONG_MAGIC 8\n", &["magic number 4711, expected 18458"]),
        ("SHORT 8\n", &["a packet of 39 bytes, expected 40 (16 channels) or 72 (32 channels)"]),
        ("GOES_BACK 8\n", &["its frame count went back from ", " to 1, expected "]),
        ("UNARMED 1\n", &["it is not armed at tick 0", "armed_by_channel"]),
    ];
    // While it starts, in flight, by a wrong packet, and at tick 0.
    let quick = ["MUTE 1\n", "ENDS 8\n", "WRONG_MAGIC 8\n", "UNARMED 1\n"];
    for (more, told) in cases("failures", all, |(more, _)| quick.contains(more)) {
        let place = Place::new();
        let mut settings = stand_in(&place, more);
        // A short limit only where it is to pass: a loaded host answers late.
        if more.starts_with("MUTE") || more.starts_with("HANGS") {
            settings.push("process.controller.parameters.reply_timeout_s=3".to_owned());
        }
        let recording = place.path("a.mcap");
        let ended = call(&place, "run", &manifest(), &settings, &["--record", &recording]).with_code(2);
        ended.says(told);
        ended.says(&["node `controller`"]);
        assert!(place.left().is_empty(), "{more}: {:?}", place.left());
    }
}

/// Firmwares that run out of `place`.
fn firmwares(place: &Place) -> usize {
    let folder = fs::canonicalize(place.path("")).unwrap();
    let processes = fs::read_dir("/proc").unwrap().flatten();
    let programs = processes.filter_map(|process| fs::read_link(process.path().join("exe")).ok());
    programs
        .filter(|program| program.starts_with(&folder) && program.to_string_lossy().contains("/ardupilot"))
        .count()
}

#[test]
fn no_ardupilot_outlives_a_killed_launcher() {
    let place = Place::new();
    let (manifest, recording) = (manifest(), place.path("killed.mcap"));
    let mut args = vec!["run", &manifest, "--record", &recording, "--pace", "realtime"];
    let settings = stand_in(&place, "");
    args.extend(settings.iter().flat_map(|setting| ["--set", setting]));
    let mut launch = place.start(&args);
    launch.await_ticks(100);
    assert_eq!(firmwares(&place), 1);
    launch.kill();
    poll("the end of the firmware", || (firmwares(&place) == 0).then_some(()));
}

#[test]
fn what_cannot_be_an_ardupilot_is_refused_by_check() {
    let place = Place::new();
    let settings = stand_in(&place, "");
    let [text, wrong] =
        [place.write("text", "no program"), place.write("wrong.parm", "# one\nFRAME_CLASS\n")];
    let hexacopter = fs::read_to_string(repository("vehicles/dji-f550.toml")).unwrap();
    let swapped = hexacopter
        .replace("\"counter-clockwise\"", "\"?\"")
        .replace("\"clockwise\"", "\"counter-clockwise\"");
    let mirrored = place.write("mirrored.toml", swapped.replace("\"?\"", "\"clockwise\""));
    let cases: [(&str, &[&str]); 9] = [
        ("process.controller.firmware=/bin/ls", &["/bin/ls: it is not ArduCopter's SITL", "`ArduCopter`"]),
        ("process.controller.firmware=${HUMMINGBUS_UNSET}", &["HUMMINGBUS_UNSET is not set"]),
        (&format!("process.controller.firmware={text}"), &["firmware", "build/sitl/bin/arducopter"]),
        (&format!("process.controller.configuration={wrong}"), &["line 2: expected a name", "FRAME_CLASS"]),
        ("process.controller.parameters.armed_by_channel=17", &["expected 5 to 16"]),
        ("process.controller.parameters.rest_s=0", &["rest_s", "above 0"]),
        ("process.controller.parameters.origin.latitude_deg=90", &["origin.latitude_deg"]),
        ("process.controller.period_ticks=100", &["the period is 0.1 s, expected less than 0.1 s"]),
        (
            &format!("process.controller.vehicle={mirrored}"),
            &["hexa X", "each turns the other way than there"],
        ),
    ];
    for (setting, told) in cases {
        let settings = [&settings[..], &[setting.to_owned()]].concat();
        call(&place, "check", &manifest(), &settings, &[]).with_code(2).says(told);
    }
}

#[test]
fn all_faults_of_the_settings_of_an_ardupilot_are_told() {
    let place = Place::new();
    let wrong = place.write("wrong.parm", "FRAME_CLASS\n# two\nPSC_X one\n");
    let settings = [
        "process.controller.firmware=/bin/ls".to_owned(),
        format!("process.controller.configuration={wrong}"),
        "process.controller.parameters.rest_s=3".to_owned(),
        "process.controller.period_ticks=100".to_owned(),
    ];
    call(&place, "check", &manifest(), &settings, &[]).with_code(2).says(&[
        "/bin/ls: it is not ArduCopter's SITL",
        "line 1: expected a name",
        "line 3: expected a name",
        "`rest_s` is 3 s, expected more than 4 s",
        "the period is 0.1 s, expected less than 0.1 s",
    ]);
}

#[test]
fn the_shipped_hexacopter_and_octocopter_are_taken() {
    let place = Place::new();
    let settings = stand_in(&place, "");
    for (name, hover) in [("dji-f550", [0.523; 6].to_vec()), ("tarot-t18", [0.4933; 8].to_vec())] {
        let vehicle = repository(&format!("vehicles/{name}.toml"));
        let sets = ["plant", "controller"].map(|process| format!("process.{process}.vehicle={vehicle}"));
        let initial = format!("process.plant.inputs.command.initial.command={hover:?}");
        let settings = [&settings[..], &sets[..], &[initial]].concat();
        call(&place, "check", &manifest(), &settings, &[]).with_code(0);
    }
}

#[test]
fn a_checkpoint_of_an_ardupilot_is_refused_in_words() {
    let place = Place::new();
    let planned = ["--record", &place.path("a.mcap"), "--checkpoint-every", "500ms"];
    let says = "the state of `controller` is in a firmware, which does not tell it";
    call(&place, "run", &manifest(), &stand_in(&place, ""), &planned)
        .with_code(2)
        .says(&["at tick 500", says]);
}

/// Exit code and output of `scripts/firmware-check` with `firmware` as the program of ArduCopter's SITL.
fn firmware_check(place: &Place, firmware: &str) -> (Option<i32>, String) {
    let mut script = Command::new(repository("scripts/firmware-check"));
    script.arg(HUMMINGBUS).env("HUMMINGBUS_ARDUPILOT", firmware);
    script.env_remove("HUMMINGBUS_BETAFLIGHT").env_remove("HUMMINGBUS_PX4");
    let ended = place.mark(&mut script).output().unwrap();
    let text =
        [ended.stdout, ended.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    (ended.status.code(), text)
}

#[test]
fn the_check_of_firmware_flies_each_manifest_twice_and_fails_where_one_does() {
    let place = Place::new();
    let (code, text) = firmware_check(&place, "/bin/ls");
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("ardupilot: the run aborted with exit code 2"), "{text}");
    assert!(text.contains("ardupilot: not compared, a recording is missing"), "{text}");
    if is_left("three flights with a rest of 45 s; nothing else runs the script to its end") {
        return;
    }
    let (code, text) = firmware_check(&place, &place.write("arducopter", program()));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(text.matches("ardupilot: passed, ").count(), 3, "{text}");
    assert!(text.contains("ardupilot: twice the same bytes"), "{text}");
}

#[test]
fn arducopter_flies_the_hover_and_its_doublet() {
    let Some(program) = variable_or_skip("HUMMINGBUS_ARDUPILOT", "the program of ArduCopter's SITL") else {
        return;
    };
    let place = Place::new();
    let settings = [format!("process.controller.firmware={program}")];
    let [first, second] = ["a.mcap", "b.mcap"].map(|name| place.path(name));
    for recording in [&first, &second] {
        call(&place, "run", &manifest(), &settings, &["--record", recording]).with_code(0);
    }
    require_same(&fs::read(&first).unwrap(), &second);
}
