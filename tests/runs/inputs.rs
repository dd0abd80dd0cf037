//! Input files are read once: a file that is edited after that changes nothing of the run or the fit.

use crate::recordings::{open, require_same};
use crate::skipped::{cases, is_left};
use crate::support::{Launch, Place, poll, repository};
use hummingbus::{COMPONENTS, Graph, Host, Launcher, Manifest};
use rustix::process::{Signal, kill_process};
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

const VEHICLE: &str = "vehicle.toml";
/// Attachment that lists the files of commands.
const PROGRAMS: &str = "hummingbus/programs.toml";
/// The manifest's files as they lie in the repository, each with one number, and the number after an edit.
const FILES: [(&str, &str, &str, &str); 3] = [
    ("vehicles/hummingbird.toml", VEHICLE, "mass = { value = 0.480", "mass = { value = 0.520"),
    ("controllers/gains/pid.toml", "gains.toml", "value = 12, unit", "value = 14, unit"),
    ("manifests/hover.toml", "base.toml", "amplitude = 10.0", "amplitude = 20.0"),
];

/// The text of the file `name` of the test, as it is first, and as it is after an edit.
fn texts(name: &str) -> [String; 2] {
    let (source, _, before, after) = FILES.iter().find(|file| file.1 == name).unwrap();
    let old = fs::read_to_string(repository(source)).unwrap();
    assert!(old.contains(before), "{source} has no {before}");
    [old.clone(), old.replacen(before, after, 1)]
}

/// Replaces the file `name` as editors do: by another that was written beside it.
fn replace(place: &Place, name: &str, text: &str) {
    let draft = place.write(&format!("{name}.draft"), text);
    fs::rename(draft, place.path(name)).unwrap();
}

/// Writes a manifest that includes hover.toml and flies files of the test, for `duration_s`, with more `tables`.
fn manifest(place: &Place, duration_s: f64, tables: &str) -> String {
    for (_, name, ..) in FILES {
        replace(place, name, &texts(name)[0]);
    }
    let text = format!(
        "include = [\"base.toml\"]\n[run]\nduration_s = {duration_s:?}\n[process.plant]\nvehicle = {VEHICLE:?}\n\
         [process.controller]\nvehicle = {VEHICLE:?}\ngains = \"gains.toml\"\n{tables}"
    );
    place.write("manifest.toml", text)
}

fn edit_all(place: &Place) {
    FILES.iter().for_each(|(_, name, ..)| replace(place, name, &texts(name)[1]));
}

fn start<'a>(place: &'a Place, manifest: &str, recording: &str) -> Launch<'a> {
    place.start(&["run", manifest, "--record", recording, "--json"])
}

/// The recording of the unedited files, and that of an edited vehicle.
fn references(duration_s: f64, tables: &str) -> [Vec<u8>; 2] {
    [0, 1].map(|version| {
        let place = Place::new();
        let (manifest, recording) = (manifest(&place, duration_s, tables), place.path("reference.mcap"));
        replace(&place, VEHICLE, &texts(VEHICLE)[version]);
        start(&place, &manifest, &recording).end().flown();
        fs::read(recording).unwrap()
    })
}

/// Requires that the recording has the files as they were before any edit.
fn require_attached(recording: &str) {
    let attached = open(recording).attachments().unwrap();
    for (_, name, ..) in FILES {
        let (_, bytes) = attached.iter().find(|(attached, _)| attached == name).unwrap();
        assert!(bytes == texts(name)[0].as_bytes(), "{name} is attached as it is after the edit");
    }
    assert!(attached.iter().all(|(name, _)| name != PROGRAMS), "there is no command");
}

/// Every process of the run edits the vehicle before it reads anything: each would find another file.
#[test]
fn no_process_sees_an_edit_between_the_check_and_its_own_start() {
    let place = Place::new();
    let manifest = Manifest::load(manifest(&place, 0.3, "").as_ref(), &[], COMPONENTS).unwrap();
    let hummingbus = crate::support::HUMMINGBUS;
    let script = format!(
        "#!/bin/sh\nsed \"s/value = 0.480/value = 0.6$$/\" {0:?} >{0:?}.$$\nmv {0:?}.$$ {0:?}\nexec {hummingbus:?} \"$@\"\n",
        place.path(VEHICLE)
    );
    let editor = place.write("editor", script);
    fs::set_permissions(&editor, fs::Permissions::from_mode(0o755)).unwrap();
    let recording = place.path("edited.mcap");
    Launcher::new(Host::Exe(editor.into())).fly(&manifest, Path::new(&recording)).unwrap();
    assert_ne!(fs::read_to_string(place.path(VEHICLE)).unwrap(), texts(VEHICLE)[0], "nothing was edited");
    require_same(&references(0.3, "")[0], &recording);
    require_attached(&recording);
}

/// A program that embeds the library may check now and fly later.
#[test]
fn a_graph_is_flown_with_the_files_that_were_checked() {
    let place = Place::new();
    let manifest = Manifest::load(manifest(&place, 0.3, "").as_ref(), &[], COMPONENTS).unwrap();
    let mut graph = Graph::build(&manifest).unwrap();
    edit_all(&place);
    let recording = place.path("edited.mcap");
    let mut outputs =
        hummingbus::runtime::outputs::Outputs::of(&manifest, &graph, Path::new(&recording), Vec::new())
            .unwrap();
    Launcher::new(Host::Threads).launch(&manifest, &mut graph, &mut outputs).unwrap();
    outputs.finish().unwrap();
    require_same(&references(0.3, "")[0], &recording);
    require_attached(&recording);
}

/// The edit comes when so many processes of the run have started.
#[test]
fn an_edit_at_any_moment_gives_the_recording_of_one_file() {
    let [old, new] = references(0.3, "");
    assert!(old != new, "the edit changes the flight");
    // Before the first process, while they start, and behind the last; quick tests leave out the first.
    for count in cases("moments", 0..=9, |count| [3, 9].contains(count)) {
        let place = Place::new();
        let (manifest, recording) = (manifest(&place, 0.3, ""), place.path("edited.mcap"));
        let mut launch = start(&place, &manifest, &recording);
        poll("processes", || (launch.has_ended() || place.processes().len() >= count).then_some(()));
        replace(&place, VEHICLE, &texts(VEHICLE)[1]);
        launch.end().flown();
        let found = fs::read(&recording).unwrap();
        assert!(found == old || found == new, "edited after {count} processes: a mix of both files");
    }
}

/// Flies until a process of the run is replaced, edits all files before that, and returns the recording.
fn replaced_after_an_edit(place: &Place, tables: &str, replace: impl FnOnce(&mut Launch<'_>)) -> String {
    let (manifest, recording) = (manifest(place, 0.6, tables), place.path("edited.mcap"));
    let mut launch = start(place, &manifest, &recording);
    launch.hold_at(300);
    edit_all(place);
    replace(&mut launch);
    // Its conditions are about later times.
    launch.end().with_code(1);
    require_attached(&recording);
    recording
}

#[test]
fn a_restart_flies_the_files_of_the_run() {
    let place = Place::new();
    let recording = replaced_after_an_edit(&place, "on_exit = \"restart\"\n", |launch| {
        kill_process(place.process_of("controller"), Signal::KILL).unwrap();
        launch.release();
    });
    require_same(&references(0.6, "on_exit = \"restart\"\n")[0], &recording);
}

#[test]
fn a_backup_that_joins_late_flies_the_files_of_the_run() {
    if is_left("`a_live_swap_flies_the_files_of_the_run_and_reads_a_new_one_once` has a backup") {
        return;
    }
    let place = Place::new();
    let tables = "[[swap]]\nprocess = \"controller\"\nat_tick = 500\nshadow_ticks = 20\n";
    let recording = replaced_after_an_edit(&place, tables, |launch| launch.release());
    require_same(&references(0.6, tables)[0], &recording);
}

#[test]
fn a_live_swap_flies_the_files_of_the_run_and_reads_a_new_one_once() {
    let place = Place::new();
    let gains = fs::read_to_string(repository("controllers/gains/pid.toml")).unwrap();
    let swap = |launch: &mut Launch<'_>, with: &str| {
        let run = place.run_id();
        let args = ["swap", "controller", "--with", with, "--shadow-ticks", "20", "--run", &run];
        let swap = place.start(&args);
        launch.await_slot("controller", 1);
        // What the request has named is read by now.
        place.write("late.toml", "no gains");
        // The run goes on to where the swap is over, and no further before that is told.
        launch.hold_at(400);
        swap.end_among_others().with_code(0).prints(&["handed over: state"]);
        launch.release();
    };
    let same = replaced_after_an_edit(&place, "", |launch| swap(launch, "kind = \"pid\""));
    let tables =
        "[[swap]]\nprocess = \"controller\"\nat_tick = 320\nshadow_ticks = 20\nwith.kind = \"pid\"\n";
    let without_manifest = |recording: &str| crate::recordings::topics(recording);
    let reference = |version: &[u8]| place.write("reference.mcap", version);
    assert!(without_manifest(&same) == without_manifest(&reference(&references(0.6, tables)[0])));

    place.write("late.toml", gains);
    let late = replaced_after_an_edit(&place, "", |launch| swap(launch, "gains = \"late.toml\""));
    assert!(without_manifest(&late) == without_manifest(&same), "the same gains in another file");
}

#[test]
fn a_stored_copy_that_was_changed_is_refused() {
    let place = Place::new();
    let manifest = manifest(&place, 0.6, "on_exit = \"restart\"\n");
    let mut launch = start(&place, &manifest, &place.path("changed.mcap"));
    launch.hold_at(300);
    let copies = place.run_dirs()[0].join("inputs");
    for copy in fs::read_dir(copies).unwrap() {
        fs::write(copy.unwrap().path(), texts(VEHICLE)[1].as_bytes()).unwrap();
    }
    kill_process(place.process_of("controller"), Signal::KILL).unwrap();
    launch.release();
    launch.end().with_code(2).says(&["vehicle.toml", "was changed after the run had begun"]);
}

#[test]
fn the_files_of_a_command_are_part_of_the_run() {
    use crate::nodes::{manifest, sender};
    let place = Place::new();
    let keys = |expected: &str| {
        format!("data = \"list.txt\"\non_exit = \"restart\"\nparameters.expected_text = {expected:?}")
    };
    place.write("list.txt", "old");
    let flown = place.write("list.toml", manifest(300, &[sender("reader", 1, &keys("old"))]));
    let mut launch = start(&place, &flown, &place.path("list.mcap"));
    launch.hold_at(100);
    place.write("list.txt", "new");
    kill_process(place.process_of("reader"), Signal::KILL).unwrap();
    launch.release();
    launch.end().with_code(0);
    // The node looks at what it gets.
    place.call(&["run", &flown]).with_code(2).says(&["list.txt holds \"new\""]);
}

#[test]
fn a_script_that_is_edited_in_flight_is_told_at_a_restart_and_the_recording_lists_the_first() {
    use crate::nodes::{manifest, sender};
    let place = Place::new();
    let node = sender("reader", 1, "on_exit = \"restart\"");
    let (head, rest) = node.split_once("command = [").unwrap();
    let (words, rest) = rest.split_once("]\n").unwrap();
    let (script, folder) = (format!("exec {}\n", words.replace(", ", " ")), place.path(""));
    let node = format!("{head}command = [\"sh\", \"node.sh\"]\nworking_directory = {folder:?}\n{rest}");
    let flown = place.write("script.toml", manifest(300, &[node]));
    replace(&place, "node.sh", &script);
    let mut launch = start(&place, &flown, &place.path("script.mcap"));
    launch.hold_at(100);
    replace(&place, "node.sh", &format!("# Edited.\n{script}"));
    kill_process(place.process_of("reader"), Signal::KILL).unwrap();
    launch.release();
    let ended = launch.end().with_code(0);
    ended.says(&["warning: process `reader`: ", "node.sh has changed since the run first read it"]);
    assert_eq!(
        ended.error.matches("since the run first read it").count(),
        1,
        "the shell is the same: {ended}"
    );

    let attached = open(&place.path("script.mcap")).attachments().unwrap();
    let (_, record) = attached.iter().find(|(name, _)| name == PROGRAMS).unwrap();
    let record: toml::Table = std::str::from_utf8(record).unwrap().parse().unwrap();
    let programs = record["program"].as_array().unwrap();
    let files = programs.iter().map(|program| program["file"].as_str().unwrap());
    assert_eq!(files.collect::<Vec<_>>(), ["sh", "node.sh"]);
    assert_eq!(programs[1]["sha256"].as_str().unwrap(), ::inputs::sha256(script.as_bytes()));
    assert!(programs.iter().all(|program| program["process"].as_str() == Some("reader")), "{record:?}");

    // Another run of the same files lists the same, and one of the edited script does not.
    let attached_by = |recording: &str| {
        start(&place, &flown, recording).end().with_code(0);
        open(recording).attachments().unwrap()
    };
    assert!(attached_by(&place.path("edited.mcap")) != attached);
    replace(&place, "node.sh", &script);
    assert!(attached_by(&place.path("again.mcap")) == attached);
}

/// A run that did not go back is not said to have, and readers find the list of programs, whatever the files are called.
#[test]
fn a_file_that_is_called_as_an_attachment_of_the_run_does_not_take_its_place() {
    use crate::nodes::{manifest, sender};
    let place = Place::new();
    let base = manifest(20, &[sender("reader", 1, "")]);
    // As a recording of a run that went back has it; unknown tables of a manifest are refused.
    let other = "# The run went back in flight.\n[run]\nseed = 5\n";
    place.write("programs.toml", &base);
    place.write("rewinds.toml", other);
    let flown = place.write("top.toml", "include = [\"programs.toml\", \"rewinds.toml\"]\n");
    let recording = place.path("top.mcap");
    start(&place, &flown, &recording).end().with_code(0);
    let attached = open(&recording).attachments().unwrap();
    let texts = |name: &str| -> Vec<String> {
        let found = attached.iter().filter(|(attached, _)| attached == name);
        found.map(|(_, bytes)| String::from_utf8(bytes.clone()).unwrap()).collect()
    };
    assert_eq!((texts("programs.toml"), texts("rewinds.toml")), (vec![base], vec![other.to_owned()]));
    assert!(texts(PROGRAMS)[0].contains("process = \"reader\""), "{:?}", texts(PROGRAMS));
    let told = place.call(&["diff", &recording, &recording]).with_code(0);
    assert!(!told.error.contains("went back"), "{told}");
}

#[test]
fn a_model_of_a_command_has_to_be_there_and_its_data_may_be_a_device() {
    let place = Place::new();
    let check = |keys: &str| {
        let command = format!("[process.other]\ncommand = [\"/bin/true\"]\n{keys}\n");
        // The program takes no part in a run.
        place.call(&["check", "--no-programs", &manifest(&place, 0.3, &command)])
    };
    let ended = check("vehicle = \"missing.toml\"").with_code(2);
    ended.says(&["process `other`: `vehicle`: cannot read", "missing.toml", "relative to the manifest"]);
    check("data = \"/dev/null\"").with_code(0);
}

/// The flights of a validation are flown one after the other: the edit comes while the first one flies.
#[test]
fn all_flights_of_a_validation_are_flown_with_one_file() {
    use crate::validate::{ALL, flown};
    if is_left("`an_edit_at_any_moment_gives_the_recording_of_one_file` edits one flight") {
        return;
    }
    let place = Place::new();
    let flights = flown(&place, "hover-gentle", &[], ALL);
    let text = fs::read_to_string(&flights).unwrap();
    let (head, course) = text.split_once("[[flight]]").unwrap();
    let part = |name: &str, part: &str| format!("[[flight]]{}{part}\n", course.replace("course", name));
    let parts = part("one", "to_s = 2.0") + &part("two", "from_s = 2.0");
    place.write("flights.toml", head.to_owned() + &parts);
    let validate = |kept: &str, edit: bool| {
        replace(&place, VEHICLE, &texts(VEHICLE)[0]);
        let (vehicle, kept) = (place.path(VEHICLE), place.path(kept));
        let launch = place.start(&["validate", &vehicle, &flights, "--json", "--keep", &kept]);
        if edit {
            poll("the first flight", || Path::new(&kept).join("one/manifest.toml").exists().then_some(()));
            replace(&place, VEHICLE, &texts(VEHICLE)[1]);
        }
        launch.end().with_code(0).json()
    };
    assert_eq!(validate("edited", true), validate("plain", false));
}

/// A component that opened a file by itself would read it at another time than the check.
#[test]
fn components_read_files_through_their_context_alone() {
    let by_itself =
        ["std::fs", "File::open", "read_bytes", "InputFiles::default", "Vehicle::load(", "Scene::load("];
    let mut count = 0;
    for folder in ["controllers/src", "plant/src", "sensors/src", "recorder/src/node.rs"] {
        // A gamepad is a device, and no file: its events come while the run flies.
        for file in
            rust_files(Path::new(&repository(folder))).into_iter().filter(|it| !it.ends_with("gamepad.rs"))
        {
            let text = fs::read_to_string(&file).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap().lines();
            for line in code.filter(|line| !line.trim_start().starts_with("//")) {
                count += 1;
                let other = line.replace("ControlledVehicle", "");
                assert!(!by_itself.iter().any(|name| other.contains(name)), "{}: {line}", file.display());
            }
        }
    }
    assert!(count > 10_000, "looked at {count} lines");
}

fn rust_files(path: &Path) -> Vec<std::path::PathBuf> {
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let entries = fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path());
    let files = entries.flat_map(|entry| if entry.is_dir() { rust_files(&entry) } else { vec![entry] });
    files.filter(|file| file.extension().is_some_and(|extension| extension == "rs")).collect()
}
