//! FMUs of others' tools, and one in C: same bytes, states that are proved, units, and what is said where one fails.

use crate::support::{Ended, HUMMINGBUS, Place, repository};
use recorder::reader::Recording;
use std::fmt::Write as _;
use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// FMUs that PythonFMU has built, and what flies them: Python's library, and the packages.
struct Fmus {
    folder: PathBuf,
    python: String,
    packages: String,
}

/// The FMUs, built once, or a skipped test.
fn fmus() -> Option<&'static Fmus> {
    static FMUS: OnceLock<Option<Fmus>> = OnceLock::new();
    let fmus = FMUS.get_or_init(|| {
        let readers = PathBuf::from(std::env::var_os("HUMMINGBUS_READERS")?);
        let interpreter = readers.join("venv/bin/python3");
        let folder = Path::new(HUMMINGBUS).parent().unwrap().join("bindings/fmu");
        fs::create_dir_all(&folder).unwrap();
        let built = [
            ("pythonfmu", "examples/fmu/controller.py"),
            ("pythonfmu3", "tests/bindings/fmu/controller3.py"),
            ("pythonfmu", "tests/bindings/fmu/forgetful.py"),
        ];
        for (tool, source) in built {
            let mut command = Command::new(&interpreter);
            command.args([
                "-m",
                tool,
                "build",
                "--handle-state",
                "--serialize-state",
                "-f",
                &repository(source),
            ]);
            command.arg("-d").arg(&folder);
            crate::build::succeed(command);
        }
        let mut asked = Command::new(&interpreter);
        asked.args(["-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])"]);
        let packages = crate::build::succeed(asked).trim().to_owned();
        Some(Fmus { folder, python: python_library()?, packages })
    });
    if fmus.is_none() {
        crate::skipped::skip(
            "HUMMINGBUS_READERS with PythonFMU is not set, or there is no shared library of Python",
        );
    }
    fmus.as_ref()
}

/// Name of the shared library of Python 3 that the dynamic linker knows.
pub(crate) fn python_library() -> Option<String> {
    let known = Command::new("/sbin/ldconfig").arg("-p").output().ok()?;
    let known = String::from_utf8_lossy(&known.stdout).into_owned();
    let mut names = known.lines().filter_map(|line| line.split_whitespace().next());
    names.find(|name| name.starts_with("libpython3.") && name.ends_with(".so.1.0")).map(str::to_owned)
}

impl Fmus {
    fn path(&self, name: &str) -> String {
        self.folder.join(name).to_string_lossy().into_owned()
    }

    /// The environment of a process that holds one of them.
    fn environment(&self) -> String {
        format!("{{ LD_PRELOAD = {:?}, PYTHONPATH = {:?} }}", self.python, self.packages)
    }

    /// The shipped manifest, whose FMU is `name`.
    fn shipped(&self, place: &Place, name: &str) -> String {
        let text = fs::read_to_string(repository("manifests/fmu-controller.toml")).unwrap();
        let environment = "environment = { LD_PRELOAD = \"libpython3.11.so.1.0\" }";
        assert!(text.contains(environment));
        let text = text
            .replace("\"../target/fmu/Controller.fmu\"", &format!("{:?}", self.path(name)))
            .replace(environment, &format!("environment = {}", self.environment()))
            .replace("\"sets/", &format!("\"{}/", repository("manifests/sets")));
        place.write(&name.replace(".fmu", ".toml"), text)
    }

    /// The manifest with the FMU of FMI 2.0 and with that of 3.0, and their names.
    fn of_both_versions(&self, place: &Place) -> [(String, &'static str); 2] {
        let [two, three] = ["Controller.fmu", "Controller3.fmu"];
        let text = fs::read_to_string(self.shipped(place, three)).unwrap();
        let text = text.replace("\naltitude = \"set_point.altitude\"", "\nheight = \"set_point.altitude\"");
        let text = text.replace("altitude_gain = 12.0", "active = true");
        [(self.shipped(place, two), two), (place.write("three.toml", text), three)]
    }
}

/// Topic of the controller's commands.
pub(crate) const TOPIC: &str = "/controller/command";

pub(crate) fn fly(place: &Place, manifest: &str, name: &str) -> Ended {
    place.call(&["run", manifest, "--record", &place.path(name)])
}

#[test]
fn a_controller_of_fmi_2_or_3_flies_the_hover_and_two_runs_are_the_same_bytes() {
    let Some(fmus) = fmus() else { return };
    let place = Place::new();
    for (manifest, fmu) in fmus.of_both_versions(&place) {
        let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
            fly(&place, &manifest, name).flown();
            fs::read(place.path(name)).unwrap()
        });
        assert!(first == second, "two runs of {fmu} differ");
        let recording = Recording::open(Path::new(&place.path("first.mcap"))).unwrap();
        let attached = recording.attachments().unwrap();
        let (_, bytes) = attached.iter().find(|(name, _)| name.ends_with(fmu)).unwrap();
        assert!(*bytes == fs::read(fmus.path(fmu)).unwrap(), "another FMU is attached");
    }
}

#[test]
fn one_of_fmi_3_flies_the_same_in_its_own_units() {
    let Some(fmus) = fmus() else { return };
    let place = Place::new();
    let [(two, _), (three, _)] = fmus.of_both_versions(&place);
    fly(&place, &three, "three.mcap").flown();
    fly(&place, &two, "two.mcap").flown();
    let [two, three] = ["two.mcap", "three.mcap"].map(|name| commands(&place, name, TOPIC));
    let difference = two
        .iter()
        .zip(&three)
        .map(|(two, three)| (two - three).abs())
        .fold(0.0, |most: f64, one| if one.is_nan() { f64::NAN } else { most.max(one) });
    // The height in cm and the tilt in degrees cost the last digit.
    assert!(two.len() == 4 * 8000 && two.len() == three.len() && difference < 1e-6, "{difference}");
}

/// Returns all commands of a recording, four by four.
pub(crate) fn commands(place: &Place, name: &str, topic: &str) -> Vec<f64> {
    let columns = [0, 1, 2, 3].map(|index| column(place, name, topic, &format!("command[{index}]")));
    (0..columns[0].len()).flat_map(|row| columns.each_ref().map(|column| column[row])).collect()
}

/// The values of one field in a recording.
pub(crate) fn column(place: &Place, name: &str, topic: &str, field: &str) -> Vec<f64> {
    let cat = ["cat", &place.path(name), "--topic", topic, "--csv"];
    let printed = place.call(&cat).with_code(0).output;
    let header = printed.lines().next().unwrap();
    let index = header.split(',').position(|name| name == field);
    let index = index.unwrap_or_else(|| panic!("no {field} in {header}"));
    printed.lines().skip(1).map(|line| line.split(',').nth(index).unwrap().parse().unwrap()).collect()
}

#[test]
fn its_state_goes_over_to_a_successor_and_into_a_checkpoint() {
    let Some(fmus) = fmus() else { return };
    let place = Place::new();
    for (manifest, _) in fmus.of_both_versions(&place) {
        require_its_state_goes_over(&fs::read_to_string(&manifest).unwrap());
    }
}

/// The FMU of the manifest `whole` gives its state to a successor that is the same, and to a run from a checkpoint.
fn require_its_state_goes_over(whole: &str) {
    let place = Place::new();
    let checkpoint = place.path("whole.4000.ckpt");
    place.write("whole.toml", format!("{whole}\n[[checkpoint]]\nat_tick = 4000\n"));
    fly(&place, &place.path("whole.toml"), "whole.mcap").flown();
    let rest = place.path("rest.mcap");
    place.call(&["run", "--from", &checkpoint, "--record", &rest]).with_code(0);
    let said = place.call(&["diff", &place.path("whole.mcap"), &rest]).output;
    assert!(said.contains("from there on all messages are those of"), "{said}");

    // The process table of the manifest, once more as the successor.
    let process =
        |from: &str| whole[whole.find(from).unwrap()..].split("\n[process.pilot]").next().unwrap().to_owned();
    let process = process("kind = \"fmu\"");
    let process =
        process.replace("[process.controller.", "[swap.with.").replace("outputs.command = {", "# {");
    place.write(
        "swap.toml",
        format!("{whole}\n[[swap]]\nprocess = \"controller\"\nat_tick = 2000\n[swap.with]\n{process}"),
    );
    let ended =
        place.call(&["run", &place.path("swap.toml"), "--record", &place.path("swap.mcap"), "--json"]);
    let summary = ended.with_code(0).json();
    assert_eq!(summary["successions"][0]["hand_over"], "state", "{summary}");
    assert!(
        commands(&place, "whole.mcap", TOPIC) == commands(&place, "swap.mcap", TOPIC),
        "the successor computes otherwise"
    );
}

/// Start values are part of the state: a successor with others is given none, so that they hold.
#[test]
fn a_successor_with_other_start_values_begins_anew() {
    let Some(fmus) = fmus() else { return };
    let place = Place::new();
    let whole = fs::read_to_string(fmus.shipped(&place, "Controller.fmu")).unwrap();
    let process = whole[whole.find("kind = \"fmu\"").unwrap()..].split("\n[process.pilot]").next().unwrap();
    let process =
        process.replace("[process.controller.", "[swap.with.").replace("outputs.command = {", "# {");
    let process = process.replace("altitude_gain = 12.0", "altitude_gain = 6.0");
    let swap = format!("{whole}\n[[swap]]\nprocess = \"controller\"\nat_tick = 2000\n[swap.with]\n{process}");
    let swap = place.write("swap.toml", swap);
    let ended = place.call(&["run", &swap, "--record", &place.path("swap.mcap"), "--json"]);
    let summary = ended.json();
    assert_ne!(summary["successions"][0]["hand_over"], "state", "{summary}");
}

/// An FMU of these entries.
fn archive(place: &Place, name: &str, entries: &[(&str, &[u8])]) -> String {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (entry, bytes) in entries {
        archive.start_file(*entry, SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    place.write(name, archive.finish().unwrap().into_inner())
}

/// The library of a C program.
fn compiled(place: &Place, source: &str) -> Vec<u8> {
    let (source, library) = (place.write("library.c", source), place.path("library.so"));
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", &source, "-o", &library]);
    crate::build::succeed(compiler);
    fs::read(library).unwrap()
}

/// The library of `native.c`.
fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        compiled(&Place::new(), &fs::read_to_string(repository("tests/bindings/fmu/native.c")).unwrap())
    })
}

fn description() -> String {
    fs::read_to_string(repository("tests/bindings/fmu/native.xml")).unwrap()
}

/// The FMU of `native.c`.
pub(crate) fn native(place: &Place) -> String {
    native_of(place, &description())
}

/// The FMU of `native.c` with another description.
fn native_of(place: &Place, xml: &str) -> String {
    let folder = if cfg!(target_arch = "aarch64") { "aarch64-linux" } else { "x86_64-linux" };
    let path = format!("binaries/{folder}/native.so");
    archive(place, "native.fmu", &[("modelDescription.xml", xml.as_bytes()), (&path, library())])
}

/// Mappings of a process that holds the FMU `native`, as the manifest below has them.
pub(crate) const MAPPED: &str = "\
inputs = { position = \"state.position\", seconds = \"state.stamp.sec\" }
outputs = { passed = \"command.command\" }
";

/// A plant that nobody steers, and an FMU that reads its state; `more` stands in its parameters, `process` in its table.
fn beside(place: &Place, fmu: &str, process: &str, parameters: &str) -> String {
    let vehicle = repository("vehicles/hummingbird.toml");
    let mut text = format!(
        "[run]\nrate_hz = 1000\nduration_s = 1.2\n[process.plant]\nkind = \"plant\"\nvehicle = {vehicle:?}\n"
    );
    text += "inputs.command = { topic = \"/still/command\", delay_ticks = 1, initial = { command = [1, 1, 1, 1] } }\n";
    write!(text, "[process.still]\nkind = \"fmu\"\nfmu = {fmu:?}\n{process}").unwrap();
    if !process.contains("inputs.") {
        text += "inputs.state = \"/plant/state\"\n";
    }
    if !process.contains("outputs.") {
        text += "outputs.command = { type = \"hummingbus_msgs/msg/MotorCommand\" }\n";
    }
    write!(text, "[process.still.parameters]\n{parameters}\n[process.recorder]\nkind = \"recorder\"\n")
        .unwrap();
    place.write("beside.toml", text)
}

#[test]
fn arrays_and_integers_pass_through_one_in_c() {
    let place = Place::new();
    let manifest = beside(&place, &native(&place), "", MAPPED);
    fly(&place, &manifest, "flight.mcap").with_code(0);
    let passed = commands(&place, "flight.mcap", "/still/command");
    for (index, axis) in ["x", "y", "z"].iter().enumerate() {
        let position = column(&place, "flight.mcap", "/plant/state", &format!("position.{axis}"));
        assert!(
            position.len() == 1200
                && position.iter().zip(passed.chunks(4)).all(|(position, passed)| *position == passed[index])
        );
    }
    assert_eq!(passed[4 * 1199 + 3], 1.0, "the seconds of the last stamp");
}

/// A process of 200 Hz in a run of 1 kHz: the FMU steps over 5 ms, from its own time 0 on. Its ticks are in the profile.
#[test]
fn an_fmu_steps_over_the_period_of_its_process() {
    let place = Place::new();
    let ports = "period_ticks = 5\noutputs.command = { type = \"hummingbus_msgs/msg/MotorCommand\" }\n\
                 outputs.set_point = { type = \"hummingbus_msgs/msg/SetPoint\" }\n";
    let mapped =
        MAPPED.replace("command.command\"", "command.command\", reached_us = \"set_point.altitude\"");
    let manifest = beside(&place, &native(&place), ports, &mapped);
    let recording = place.path("flight.mcap");
    let args = ["run", &manifest, "--record", &recording, "--set", "run.profile=true", "--json"];
    let summary = place.call(&args).with_code(0).json();
    let nodes = summary["profile"]["nodes"].as_array().unwrap();
    let still = nodes.iter().find(|node| node["name"] == "still").unwrap();
    assert_eq!(still["compute"]["count"], 240, "{summary}");
    let reached_us = column(&place, "flight.mcap", "/still/set_point", "altitude");
    assert_eq!(reached_us, (1..=240).map(|step| 5000.0 * f64::from(step)).collect::<Vec<_>>());
    let (heights, passed) = (
        column(&place, "flight.mcap", "/plant/state", "position.z"),
        commands(&place, "flight.mcap", "/still/command"),
    );
    let read: Vec<f64> = passed.chunks(4).map(|passed| passed[2]).collect();
    assert_eq!(read, heights.into_iter().step_by(5).collect::<Vec<_>>(), "the newest samples of its ticks");
}

/// The page's manifest, with the FMU in C under the page's names.
#[test]
fn the_manifest_of_the_page_passes_its_check() {
    let place = Place::new();
    let page = fs::read_to_string(repository("docs/fmu.md")).unwrap();
    let block = page.split("\n```toml\n").nth(1).unwrap().split("\n```").next().unwrap();
    let xml = description()
        .replace("\"passed\"", "\"counts\"")
        .replace("name=\"weight\"", "name=\"altitude_gain\"");
    let fmu = native_of(&place, &xml);
    let path = "\"../target/fmu/Controller.fmu\"";
    assert!(block.contains(path), "{block}");
    let flight = repository("manifests/sets/flight.toml");
    let run = "[run]\nduration_s = 1.0\n";
    let text = format!("include = [{flight:?}]\n{run}{}\n", block.replace(path, &format!("{fmu:?}")));
    place.call(&["check", &place.write("page.toml", text)]).with_code(0);
}

#[test]
fn a_state_that_is_none_is_refused_and_flown_without() {
    let Some(fmus) = fmus() else { return };
    let place = Place::new();
    let mapped = "inputs = { u = \"state.position.z\" }\noutputs = { y = \"command.command[0]\" }\n";
    let process = format!("environment = {}\n", fmus.environment());
    let manifest = beside(&place, &fmus.path("Forgetful.fmu"), &process, mapped);
    let ended = place.call(&["check", &manifest]);
    assert!(ended.error.contains("a replay does not prove it: after its state was restored in"), "{ended}");
    assert!(ended.error.contains("`y` is "), "{ended}");
    let manifest = beside(&place, &fmus.path("Forgetful.fmu"), &process, &format!("{mapped}state = false\n"));
    let ended = fly(&place, &manifest, "flight.mcap");
    // Its one command is not the four of this vehicle: it has flown until then.
    assert!(ended.error.contains("node `plant`") && !ended.error.contains("replay"), "{ended}");
}

#[test]
fn what_does_not_fit_is_said_by_check_with_its_key() {
    let place = Place::new();
    let fmu = native(&place);
    let mapped = |from: &str, to: &str| {
        assert!(MAPPED.contains(from), "{from}");
        MAPPED.replace(from, to)
    };
    let start = |value: &str| format!("{MAPPED}start = {{ {value} }}\n");
    let cases = [
        (
            "",
            mapped("position =", "positio ="),
            "`parameters.inputs.positio`: the FMU has no variable `positio`; did you mean `position`?",
        ),
        (
            "",
            mapped("state.position\"", "state.positions\""),
            "has no field `positions`; did you mean `position",
        ),
        (
            "",
            mapped("state.stamp", "stat.stamp"),
            "the inputs of the process have no `stat`; did you mean `state`?",
        ),
        (
            "",
            mapped("\"state.position\"", "[\"state.position\", \"state.position.x\"]"),
            "has 3 elements, and [\"state.position\", \"state.position.x\"] are 4 fields",
        ),
        (
            "",
            mapped("seconds =", "weight ="),
            "`parameters.inputs.weight` is in `kg`, and the field is in `s`",
        ),
        (
            "",
            mapped("\"command.command\"", "[\"command.command\", \"command.command\"]"),
            "has 4 elements, and",
        ),
        ("", mapped("\"state.stamp.sec\"", "\"state\""), "is `state`; a field is `PORT.FIELD`"),
        ("", mapped("seconds =", "steps ="), "`parameters.inputs.steps` is no input of the FMU"),
        ("", mapped("passed =", "label ="), "`parameters.outputs.label` is a string"),
        (
            "",
            mapped("passed = \"command.command\"", "steps = \"command.command[1]\""),
            "and not all values before it",
        ),
        (
            "",
            mapped("\"command.command\"", "\"command.command\", negative = \"command.command[2]\""),
            "more than one variable writes `command.command[2]`",
        ),
        (
            "",
            mapped("passed = \"command.command\"", "negative = \"command.stamp.nanosec\""),
            "the bus fills in the stamp",
        ),
        (
            "",
            "outputs = { passed = \"command.command\" }".to_owned(),
            "`inputs.state` is wired, and no variable",
        ),
        ("", start("crash_at = -1"), "`parameters.start.crash_at`: -1 is not an unsigned 64-bit integer"),
        ("", start("crash_at = [1, 2]"), "it has 1 elements, found 2"),
        ("", start("crash_at = \"late\""), "it is a number, found the text"),
        ("", start("label = \"x\""), "fmi3SetString returned the status `error`"),
        ("", start("crash_at = 100"), "it ended with signal: 11 (SIGSEGV)"),
        ("", start("crash_at = 100"), "`fmu` crashed in the library that it loads"),
        (
            "",
            format!("{MAPPED}state_bytes = 8\n"),
            "there is room for 8; give parameters.state_bytes, at least 56",
        ),
        ("", format!("{MAPPED}colour = 1\n"), "colour"),
        ("period_ticks = 1\nlog = \"no/such/folder/x.log\"\n", MAPPED.to_owned(), "no/such/folder"),
        (
            "inputs.state = \"/plant/state\"\ninputs.command = { topic = \"/still/command\", delay_ticks = 1, initial = {} }\n",
            MAPPED.to_owned(),
            "`inputs.command` is wired",
        ),
        ("outputs.command = { type = \"my_msgs/msg/Own\" }\n", MAPPED.to_owned(), "my_msgs/msg/Own"),
        ("outputs.command = {}\n", MAPPED.to_owned(), "output `command` of `still` has no `type`"),
    ];
    let mut wrong = String::new();
    for (number, (process, parameters, words)) in cases.iter().enumerate() {
        let manifest = beside(&place, &fmu, process, parameters);
        let ended = place.call(&["check", &manifest]);
        if ended.code != Some(2) || !ended.error.contains(words) {
            writeln!(wrong, "case {number}: no {words:?} in\n{ended}").unwrap();
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// Only a flight has values.
#[test]
fn a_value_that_is_no_integer_ends_the_flight_with_its_variable() {
    let place = Place::new();
    let parameters = MAPPED.replace("seconds = \"state.stamp.sec\"", "seconds = \"state.position.z\"");
    let ended = place.call(&["run", &beside(&place, &native(&place), "", &parameters)]);
    assert!(ended.code == Some(2) && ended.error.contains("is not a signed 32-bit integer"), "{ended}");
}

#[test]
fn a_check_points_at_the_variable_that_does_not_fit() {
    let place = Place::new();
    let manifest = beside(&place, &native(&place), "", &MAPPED.replace("position =", "positio ="));
    let text = fs::read_to_string(&manifest).unwrap();
    let line = 1 + text.lines().position(|line| line.contains("positio =")).unwrap();
    place.call(&["check", &manifest]).with_code(2).says(&[&format!("beside.toml:{line}:12"), "did you mean"]);
}

#[test]
fn what_is_no_fmu_for_this_machine_is_refused() {
    let place = Place::new();
    let xml = description();
    let platform = if cfg!(target_arch = "aarch64") { "aarch64-linux" } else { "x86_64-linux" };
    let path = format!("binaries/{platform}/native.so");
    let fmu = |name: &str, xml: &str, library: (&str, &[u8])| {
        archive(&place, name, &[("modelDescription.xml", xml.as_bytes()), library])
    };
    let cases = [
        (place.write("a.fmu", "MATLAB 5.0 MAT-file"), "a ZIP archive with a modelDescription.xml"),
        (archive(&place, "b.fmu", &[("other.xml", b"<a/>")]), "holds no modelDescription.xml"),
        (fmu("c.fmu", "<a>", (&path, library())), "is no XML"),
        (fmu("d.fmu", &xml.replace("\"3.0\"", "\"1.0\""), (&path, library())), "is of FMI 1.0"),
        (
            fmu("e.fmu", &xml.replace("CoSimulation", "ModelExchange"), (&path, library())),
            "for model exchange alone",
        ),
        (
            fmu("f.fmu", &xml, ("binaries/x86_64-windows/native.dll", b"MZ")),
            "it holds those of x86_64-windows: export it for Linux",
        ),
        (fmu("g.fmu", &xml, (&path, b"not a library")), "cannot load the FMU's library"),
        (
            fmu("h.fmu", &xml, (&path, &compiled(&place, "int nothing;"))),
            "no function fmi3InstantiateCoSimulation",
        ),
        (
            fmu("i.fmu", &xml.replace("Token=\"native\"", "Token=\"other\""), (&path, library())),
            "the token is wrong",
        ),
        (
            fmu("j.fmu", &xml.replace("0.0005", "0.003"), (&path, library())),
            "in steps of 0.003 s, and its process every 0.001 s",
        ),
        (place.path("none.fmu"), "cannot read"),
    ];
    for (fmu, words) in &cases {
        let manifest = beside(&place, fmu, "", MAPPED);
        let ended = place.call(&["check", &manifest]);
        assert!(ended.code != Some(0) && ended.error.contains(words), "{fmu}: no {words:?} in\n{ended}");
    }
}

#[test]
fn an_exception_and_a_crash_end_the_run_in_words() {
    let place = Place::new();
    let crash = format!("{MAPPED}state = false\nstart = {{ crash_at = 100 }}\n");
    let ended = fly(&place, &beside(&place, &native(&place), "", &crash), "flight.mcap");
    assert!(
        ended.code == Some(2) && ended.error.contains("`still` was killed by signal 11 (SIGSEGV)"),
        "{ended}"
    );
    assert!(ended.error.contains("at tick 99"), "{ended}");

    let Some(fmus) = fmus() else { return };
    let mapped =
        "inputs = { u = \"state.stamp.nanosec\" }\noutputs = { y = \"command.command[0]\" }\nstate = false\n";
    let process = format!("environment = {}\n", fmus.environment());
    let vehicle_of_one = beside(&place, &fmus.path("Forgetful.fmu"), &process, mapped);
    let text = fs::read_to_string(&vehicle_of_one)
        .unwrap()
        .replace("\"/still/command\", delay", "\"/steady/command\", delay");
    let set = format!(
        "{text}[process.steady]\nkind = \"fmu\"\nfmu = {:?}\ninputs.state = \"/plant/state\"\noutputs.command = {{ type = \"hummingbus_msgs/msg/MotorCommand\" }}\n[process.steady.parameters]\n{MAPPED}",
        native(&place)
    );
    let ended = fly(&place, &place.write("exception.toml", set), "exception.mcap");
    assert!(ended.code == Some(2) && ended.error.contains("which no sensor measures"), "{ended}");
    assert!(ended.error.contains("node `still` failed at tick 2"), "{ended}");
}

/// The reference FMUs of the Modelica Association, of both versions, as its release has them: `2.0/*.fmu` and `3.0/*.fmu`.
#[test]
fn the_reference_fmus_save_their_states_and_pass_their_inputs_through() {
    let Some(folder) = std::env::var_os("HUMMINGBUS_REFERENCE_FMUS") else {
        return crate::skipped::skip("HUMMINGBUS_REFERENCE_FMUS is not set");
    };
    let place = Place::new();
    for version in ["2.0", "3.0"] {
        let path = |name: &str| Path::new(&folder).join(version).join(name).to_string_lossy().into_owned();
        let mapped = "inputs = { Float64_continuous_input = \"state.position.z\", Int32_input = \"state.stamp.sec\" }\n\
                      outputs = { Float64_continuous_output = \"command.command[0]\", Int32_output = \"command.command[1]\", \
                      Float64_discrete_output = \"command.command[2]\", Boolean_output = \"command.command[3]\" }\n\
                      start = { Float64_fixed_parameter = 1.5, String_input = \"x\" }\n";
        fly(
            &place,
            &beside(&place, &path("Feedthrough.fmu"), "period_ticks = 100\n", mapped),
            "through.mcap",
        )
        .with_code(0);
        let passed = commands(&place, "through.mcap", "/still/command");
        assert_eq!(passed[4 * 11 + 1], 1.0, "the seconds of the last stamp");
        let heights = column(&place, "through.mcap", "/plant/state", "position.z");
        let heights = heights.iter().step_by(100);
        assert!(
            passed.len() == 48 && heights.zip(passed.chunks(4)).all(|(height, passed)| *height == passed[0])
        );

        // dx/dt = -k x by Euler's method in steps of 0.1 s: its process computes every 100 ticks.
        let dahlquist = path("Dahlquist.fmu");
        let text = format!(
            "[run]\nrate_hz = 1000\nduration_s = 1.0\n[process.still]\nkind = \"fmu\"\nfmu = {dahlquist:?}\n\
             period_ticks = 100\noutputs.command = {{ type = \"hummingbus_msgs/msg/MotorCommand\" }}\n\
             [process.still.parameters]\noutputs = {{ x = \"command.command[0]\" }}\nstart = {{ k = 2.0 }}\n\
             [process.recorder]\nkind = \"recorder\"\n"
        );
        fly(&place, &place.write("decay.toml", text), "decay.mcap").with_code(0);
        let decayed = column(&place, "decay.mcap", "/still/command", "command[0]");
        let expected = (1..=10).map(|step| 0.8_f64.powi(step));
        assert!(
            decayed.len() == 10
                && decayed.iter().zip(expected).all(|(x, expected)| (x - expected).abs() < 1e-12)
        );
    }
}
