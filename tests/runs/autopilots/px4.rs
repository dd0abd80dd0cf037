//! PX4: a stand-in for its SITL (`px4.c`) flies, and fails in every way; the real one where `HUMMINGBUS_PX4` names it.

use super::{a_lost_radio_reaches_the_firmware, call, compiled, each_flies_its_own, files_are_attached};
use crate::recordings::{require_same, topics};
use crate::skipped::{cases, is_left, variable_or_skip};
use crate::support::{Place, poll, repository};
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

/// The manifest of the hover and the doublet.
fn manifest() -> String {
    repository("manifests/autopilots/px4.toml")
}

fn program() -> &'static [u8] {
    static PROGRAM: OnceLock<Vec<u8>> = OnceLock::new();
    PROGRAM.get_or_init(|| compiled("px4.c", &[]))
}

/// Start-up script of the stand-in: as PX4's, it finds its commands and other scripts by the search path, and starts its estimator beside
/// the commands that follow.
const START_UP: &str = r#"
. px4-alias.sh
PATH="$PATH:${R}etc/init.d-posix"
. "$(echo ${R}etc/init.d-posix/airframes/*_"$PX4_SIM_MODEL")"
. px4-rc.simulator
ekf2 start &
logger start
. px4-rc.mavlink
"#;

/// A folder of a build of PX4 in `place`, with the stand-in as its program, which is returned.
fn build(place: &Place) -> String {
    let folder = place.path("build");
    let [bin, scripts] = ["bin", "etc/init.d-posix"].map(|name| Path::new(&folder).join(name));
    if !bin.exists() {
        fs::create_dir_all(&bin).unwrap();
        fs::create_dir_all(scripts.join("airframes")).unwrap();
        fs::write(scripts.join("rcS"), START_UP).unwrap();
        fs::write(scripts.join("px4-rc.simulator"), "simulator start\n").unwrap();
        fs::write(scripts.join("px4-rc.mavlink"), "mavlink start\n").unwrap();
        fs::write(scripts.join("airframes/10016_none_iris"), "param set CA_ROTOR_COUNT 6\n").unwrap();
        fs::write(scripts.join("airframes/1000_iris"), "exit 1\n").unwrap();
        fs::write(bin.join("px4"), program()).unwrap();
        let alias = |name| format!("alias {name}='px4-{name} --instance $px4_instance'\n");
        let aliases = ["param", "simulator", "ekf2", "logger", "mavlink"].map(alias).concat();
        let begin = "R=\"`pwd`/\"\npx4_instance=$1\n";
        fs::write(bin.join("px4-alias.sh"), format!("{begin}{aliases}")).unwrap();
    }
    bin.join("px4").to_str().unwrap().to_owned()
}

/// The stand-in in `place`, with the parameters of the manifest and `more`; as settings of the manifest.
fn stand_in(place: &Place, more: &str) -> Vec<String> {
    let program = build(place);
    let parameters = fs::read_to_string(repository("manifests/autopilots/px4.parm")).unwrap();
    let configuration = place.write("px4.parm", parameters + more);
    vec![
        format!("process.controller.firmware={program}"),
        format!("process.controller.configuration={configuration}"),
        "process.controller.parameters.rest_s=6".to_owned(),
    ]
}

#[test]
fn px4_flies_the_hover_and_its_doublet_and_two_runs_are_the_same_bytes() {
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

/// Of several outputs of a step the last ones count. `LATE` answers 30 ms late, by the time of the host, after each hundredth message of the
/// sensors.
#[test]
fn answers_that_come_twice_or_late_change_nothing() {
    let place = Place::new();
    // Behind its rest of 6 s, a flight of 3 s has as many kinds of messages as a whole one.
    let flight = |more: &str, name: &str| {
        let recording = place.path(name);
        let settings = [stand_in(&place, more), vec!["run.duration_s=3".to_owned()]].concat();
        call(&place, "run", &manifest(), &settings, &["--record", &recording]).flown();
        topics(&recording)
    };
    let undisturbed = flight("", "undisturbed.mcap");
    for more in ["TWICE 1\n", "LATE 1\n"] {
        assert!(flight(more, "disturbed.mcap") == undisturbed, "{more}");
    }
}

#[test]
fn a_lost_radio_is_lost_for_px4() {
    if is_left("`a_lost_radio_is_lost_for_the_firmware` loses it") {
        return;
    }
    let place = Place::new();
    a_lost_radio_reaches_the_firmware(&manifest(), &stand_in(&place, "LOST 1\n"));
}

#[test]
fn each_px4_of_a_run_flies_its_own_vehicle() {
    let place = Place::new();
    let settings = stand_in(&place, "");
    each_flies_its_own(&place, &manifest(), &settings);
}

#[test]
fn a_px4_that_fails_ends_the_run_with_its_last_words() {
    let all: [(&str, &[&str]); 12] = [
        ("NEVER_CONNECTS 1", &["px4 runs and gave no answer for 2 s"]),
        ("NEVER_BOOTS 1", &["its start-up script has not ended within 120 s of its time"]),
        ("UNKNOWN 1", &["a parameter that PX4 refuses: ", "Parameter UNKNOWN not found"]),
        // While it starts, and in flight: about 6.1 s of its time are before tick 0.
        ("ENDS 0.5", &["px4 ended with exit code 3", "out of coffee"]),
        ("ENDS 7.5", &["px4 ended with exit code 3", "out of coffee"]),
        ("CRASHES 7.5", &["px4 was killed by signal 6"]),
        ("HANGS 7.5", &["px4 runs and gave no answer for 3 s", "thinking"]),
        ("MUTE 7.5", &["it has sent no motor outputs for 0.1 s of its time"]),
        ("WRONG_CRC 7.5", &["its message 93 has a wrong checksum"]),
        ("NOT_A_NUMBER 7.5", &["it sends the motor outputs [", "NaN"]),
        ("NO_LOCKSTEP 1", &["it was built without lockstep"]),
        ("UNARMED 1", &["it is not armed at tick 0", "armed_by_channel"]),
    ];
    // Before it answers, while it starts, and in flight.
    let quick = ["NEVER_CONNECTS 1", "UNKNOWN 1", "CRASHES 7.5", "HANGS 7.5", "WRONG_CRC 7.5"];
    for (more, told) in cases("failures", all, |(more, _)| quick.contains(more)) {
        let place = Place::new();
        let mut settings = stand_in(&place, more);
        // Short limits only where they are to pass: a loaded host answers late.
        if more.starts_with("HANGS") {
            settings.push("process.controller.parameters.reply_timeout_s=3".to_owned());
        }
        if more.starts_with("NEVER_CONNECTS") {
            settings.push("process.controller.parameters.boot_timeout_s=2".to_owned());
        }
        let recording = place.path("a.mcap");
        let ended = call(&place, "run", &manifest(), &settings, &["--record", &recording]).with_code(2);
        ended.says(told);
        ended.says(&["node `controller`"]);
        assert!(place.left().is_empty(), "{more}: {:?}", place.left());
    }
}

/// Number of processes whose program is that of the firmware's folder in `place`.
fn firmwares(place: &Place) -> usize {
    let folder = fs::canonicalize(place.path("")).unwrap();
    let processes = fs::read_dir("/proc").unwrap().flatten();
    let programs = processes.filter_map(|process| fs::read_link(process.path().join("exe")).ok());
    programs
        .filter(|program| program.starts_with(&folder) && program.to_string_lossy().contains("/px4-"))
        .count()
}

#[test]
fn no_px4_outlives_a_killed_launcher() {
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
fn what_cannot_be_a_px4_is_refused_by_check() {
    let place = Place::new();
    let settings = stand_in(&place, "");
    let [text, wrong] = [place.write("text", "no program"), place.write("wrong.parm", "# one\nMC_ROLL_P\n")];
    let cases: [(&str, &[&str]); 10] = [
        ("process.controller.firmware=${HUMMINGBUS_UNSET}", &["HUMMINGBUS_UNSET is not set"]),
        (&format!("process.controller.firmware={text}"), &["firmware", "build/px4_sitl_default/bin/px4"]),
        (&format!("process.controller.configuration={wrong}"), &["line 2: expected a name", "MC_ROLL_P"]),
        ("process.controller.parameters.armed_by_channel=17", &["expected 5 to 16"]),
        ("process.controller.parameters.rest_s=0", &["rest_s", "above 0"]),
        ("process.controller.parameters.boot_timeout_s=0", &["boot_timeout_s", "above 0"]),
        ("process.controller.parameters.origin.latitude_deg=90", &["origin.latitude_deg"]),
        ("process.controller.parameters.magnetic_field.field_T=0.5", &["magnetic_field.field_T"]),
        ("process.controller.parameters.model=iris2", &["no airframe with the name `iris2`"]),
        ("process.controller.period_ticks=3", &["the period is 0.003 s", "4 ms is a multiple"]),
    ];
    for (setting, told) in cases {
        let settings = [&settings[..], &[setting.to_owned()]].concat();
        call(&place, "check", &manifest(), &settings, &[]).with_code(2).says(told);
    }
}

#[test]
fn all_faults_of_the_settings_of_a_px4_are_told() {
    let place = Place::new();
    let mut settings = stand_in(&place, "");
    settings.extend(
        ["model=iris2", "armed_by_channel=17", "rest_s=2"]
            .map(|setting| format!("process.controller.parameters.{setting}")),
    );
    settings.push("process.controller.period_ticks=3".to_owned());
    call(&place, "check", &manifest(), &settings, &[]).with_code(2).says(&[
        "no airframe with the name `iris2`",
        "`armed_by_channel` is 17, expected 5 to 16",
        "the period is 0.003 s",
    ]);
}

#[test]
fn a_px4_without_its_start_up_script_is_refused_by_check() {
    let place = Place::new();
    let mut settings = stand_in(&place, "");
    settings[0] = format!("process.controller.firmware={}", place.write("px4", program()));
    let ended = call(&place, "check", &manifest(), &settings, &[]).with_code(2);
    ended.says(&["outside of a build of PX4", "the folder `etc` of the build"]);
    for other in ["no airframe", "cannot read"] {
        assert!(!ended.error.contains(other), "{ended}");
    }
}

/// The start-up scripts flew as well.
#[test]
fn a_px4_its_scripts_and_its_parameters_are_attached() {
    let place = Place::new();
    let settings = stand_in(&place, "# Differs from the shipped file.\n");
    let names = [
        "build/bin/px4",
        "build/bin/px4-alias.sh",
        "build/etc/init.d-posix/rcS",
        "build/etc/init.d-posix/px4-rc.simulator",
        "build/etc/init.d-posix/airframes/10016_none_iris",
        "px4.parm",
    ];
    let files = names.map(|name| place.path(name));
    files_are_attached(&place, &manifest(), &settings, &files.each_ref().map(String::as_str));
}

#[test]
fn a_checkpoint_of_a_px4_is_refused_in_words() {
    let place = Place::new();
    let planned = ["--record", &place.path("a.mcap"), "--checkpoint-every", "500ms"];
    let says = "the state of `controller` is in a firmware, which does not tell it";
    call(&place, "run", &manifest(), &stand_in(&place, ""), &planned)
        .with_code(2)
        .says(&["at tick 500", says]);
}

#[test]
fn the_real_px4_flies_the_hover_and_its_doublet() {
    let Some(program) = variable_or_skip("HUMMINGBUS_PX4", "the program of PX4's SITL") else {
        return;
    };
    let place = Place::new();
    for manifest in ["px4", "px4-swap"] {
        let path = repository(&format!("manifests/autopilots/{manifest}.toml"));
        let [first, second] = ["a", "b"].map(|name| place.path(&format!("{manifest}-{name}.mcap")));
        for recording in [&first, &second] {
            let args = ["run", &path, "--record", recording];
            place.start_with(&args, &[("HUMMINGBUS_PX4", &program)]).end().with_code(0);
        }
        require_same(&fs::read(&first).unwrap(), &second);
    }
}
