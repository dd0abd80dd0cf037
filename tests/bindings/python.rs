//! Nodes, runs and recordings in Python: same bytes, hand-over of state, own messages, and what is said where one fails.

use crate::support::{Ended, HUMMINGBUS, Place, repository};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// A Python with numpy, pandas and polars, and the folder of the package that was built with the tests.
pub(crate) struct Python {
    interpreter: PathBuf,
    packages: PathBuf,
}

/// The Python of the readers, or a skipped test.
pub(crate) fn python() -> Option<&'static Python> {
    static PYTHON: OnceLock<Option<Python>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| {
        let readers = std::env::var_os("HUMMINGBUS_READERS")?;
        let target = Path::new(HUMMINGBUS).parent().unwrap();
        let packages = target.join("bindings/python");
        let package = packages.join("hummingbus");
        fs::create_dir_all(&package).unwrap();
        for file in fs::read_dir(repository("python/hummingbus")).unwrap().flatten() {
            if file.path().is_file() {
                fs::copy(file.path(), package.join(file.file_name())).unwrap();
            }
        }
        let built = target.join("libhummingbus_native.so");
        fs::copy(&built, package.join("_native.abi3.so")).unwrap_or_else(|error| {
            panic!("{}: {error}; cargo build --workspace --lib builds it", built.display())
        });
        Some(Python { interpreter: Path::new(&readers).join("venv/bin/python3"), packages })
    });
    if python.is_none() {
        crate::skipped::skip("HUMMINGBUS_READERS, the Python with numpy, is not set");
    }
    python.as_ref()
}

impl Python {
    /// Variables by which programs find the package, and runs this Python.
    pub(crate) fn variables(&self) -> Vec<(&'static str, String)> {
        let folder = self.interpreter.parent().unwrap();
        let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap_or_default());
        vec![
            ("PATH", path),
            ("PYTHONPATH", self.packages.to_string_lossy().into_owned()),
            ("PYTHONDONTWRITEBYTECODE", "1".to_owned()),
            ("HUMMINGBUS_PROGRAM", HUMMINGBUS.to_owned()),
        ]
    }

    fn call(&self, place: &Place, args: &[&str]) -> Ended {
        let variables = self.variables();
        let variables: Vec<_> = variables.iter().map(|(name, value)| (*name, value.as_str())).collect();
        place.start_with(args, &variables).end()
    }

    fn run(&self, program: &[&str]) -> Output {
        let mut command = Command::new(&self.interpreter);
        command.args(program).envs(self.variables()).current_dir(repository("."));
        command.output().unwrap()
    }

    /// Runs `code`, which has to succeed; returns what it prints.
    #[track_caller]
    fn eval(&self, code: &str) -> String {
        let ended = self.run(&["-c", code]);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(ended.status.success(), "{code}\n{}{}", text(&ended.stdout), text(&ended.stderr));
        text(&ended.stdout)
    }
}

/// The shipped manifest `name` with its paths from the repository.
fn shipped(place: &Place, name: &str) -> String {
    let text = fs::read_to_string(repository(&format!("manifests/{name}"))).unwrap();
    let text = text
        .replace("\"../examples/", &format!("\"{}/", repository("examples")))
        .replace("\"sets/", &format!("\"{}/", repository("manifests/sets")))
        .replace("\"../vehicles/", &format!("\"{}/", repository("vehicles")));
    place.write(name, text)
}

/// A hover of 0.3 s whose pilot is the Python program `code`, with the vehicle's state as its input `state`.
fn hover(place: &Place, code: &str, more: &str) -> String {
    hover_with_input(place, "state", code, more)
}

/// The same with the vehicle's state as the input `port`.
fn hover_with_input(place: &Place, port: &str, code: &str, more: &str) -> String {
    let program = place.write("pilot.py", format!("#!/usr/bin/env python3\nimport hummingbus as hb\n{code}"));
    let mut permissions = fs::metadata(&program).unwrap().permissions();
    std::os::unix::fs::PermissionsExt::set_mode(&mut permissions, 0o755);
    fs::set_permissions(&program, permissions).unwrap();
    let (flight, vehicle) =
        (repository("manifests/sets/flight.toml"), repository("vehicles/hummingbird.toml"));
    let text = format!(
        "include = [{flight:?}]\n[run]\nduration_s = 0.3\n\
         [process.controller]\nkind = \"pid\"\nvehicle = {vehicle:?}\n\
         inputs = {{ set_point = \"/pilot/set_point\", estimate = \"/ekf/estimate\" }}\n\
         [process.pilot]\ncommand = [{program:?}]\n\
         inputs.{port} = {{ topic = \"/plant/state\", delay_ticks = 1, initial = {{}} }}\n\
         outputs.set_point = {{ type = \"hummingbus_msgs/msg/SetPoint\" }}\n{more}"
    );
    place.write("hover.toml", text)
}

fn fly(python: &Python, place: &Place, manifest: &str) -> Ended {
    python.call(place, &["run", manifest, "--record", &place.path("flight.mcap")])
}

#[test]
fn a_controller_in_python_flies_the_hover_and_two_runs_are_the_same_bytes() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let manifest = shipped(&place, "python-controller.toml");
    let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
        let recording = place.path(name);
        python.call(&place, &["run", &manifest, "--record", &recording]).with_code(0);
        fs::read(recording).unwrap()
    });
    assert!(first == second, "two runs differ");
}

#[test]
fn a_controller_in_python_takes_over_from_pid_with_its_state_and_pid_from_it() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let manifest = shipped(&place, "swap-python.toml");
    let recording = place.path("swap.mcap");
    let ended = python.call(&place, &["run", &manifest, "--record", &recording, "--json"]).with_code(0);
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap();
    assert_eq!(successions.len(), 2, "{ended}");
    assert!(successions.iter().all(|succession| succession["hand_over"] == "state"), "{ended}");
    let shadows = summary["shadows"].as_array().unwrap().iter().filter(|shadow| shadow["from_tick"] == 2800);
    let rms: Vec<f64> = shadows.map(|shadow| shadow["rms"].as_f64().unwrap()).collect();
    assert!(rms.len() == 4 && rms.iter().all(|count| *count < 1e-6), "{rms:?}\n{ended}");
}

/// The pilot before has another state.
#[test]
fn a_node_that_gets_no_state_knows_what_its_predecessor_sent_last() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let code = "class Keep(hb.Component):\n\
                \x20   inputs, outputs = {'state': 'PlantState'}, {'set_point': 'SetPoint'}\n\
                \x20   altitude = 0.0\n\
                \x20   def take_over(self, sent): self.altitude = float(sent['set_point']['altitude'])\n\
                \x20   def step(self, tick, state, set_point): set_point['altitude'] = self.altitude\n\
                hb.run_node(Keep)\n";
    let swap = "[process.recorder]\nkind = \"recorder\"\n[[swap]]\nprocess = \"pilot\"\nat_tick = 200\n[swap.with]\n";
    let text = fs::read_to_string(hover(&place, code, swap)).unwrap();
    // The program is the successor of the pilot of the flight.
    let (before, program) = text.split_once("[process.pilot]\n").unwrap();
    let (program, swap) = program.split_once("[process.recorder]").unwrap();
    let program = program.lines().filter(|line| !line.starts_with("outputs")).collect::<Vec<_>>().join("\n");
    let pilot = "[process.pilot]\nkind = \"pilot\"\nparameters = { initial_altitude_m = 1.25 }\n";
    let manifest = place.write("swap.toml", format!("{before}{pilot}[process.recorder]{swap}{program}\n"));
    python.call(&place, &["run", &manifest, "--record", &place.path("swap.mcap")]).with_code(0);
    let altitudes = crate::fmu::column(&place, "swap.mcap", "/pilot/set_point", "altitude");
    assert!(altitudes.len() == 300 && altitudes.iter().all(|altitude| *altitude == 1.25), "{altitudes:?}");
}

#[test]
fn a_run_with_a_controller_in_python_goes_on_from_a_checkpoint_with_the_same_bytes() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let manifest = shipped(&place, "python-controller.toml");
    let [whole, rest] = ["whole.mcap", "rest.mcap"].map(|name| place.path(name));
    let text = fs::read_to_string(manifest).unwrap();
    let manifest = place.write("python.toml", format!("{text}\n[[checkpoint]]\nat_tick = 2500\n"));
    python.call(&place, &["run", &manifest, "--record", &whole]).flown();
    let from = place.path("whole.2500.ckpt");
    python.call(&place, &["run", "--from", &from, "--record", &rest]).flown();
    let expected = "begins at tick 2500, and from there on all messages are those of";
    place.call(&["diff", &whole, &rest]).with_code(1).prints(&[expected]);
}

#[test]
fn a_new_project_in_python_passes_its_own_test() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let folder = place.path("my-quad");
    place.call(&["new", &folder, "--language", "python", "--sources", &repository("")]).with_code(0);
    // In the place of an environment with the package: the interpreter of the tests, which finds it.
    let bin = format!("{folder}/controller/venv/bin");
    fs::create_dir_all(&bin).unwrap();
    let interpreter = format!("{bin}/python");
    fs::write(&interpreter, format!("#!/bin/sh\nexec '{}' \"$@\"\n", python.interpreter.display())).unwrap();
    fs::set_permissions(&interpreter, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let mut test = Command::new(&interpreter);
    test.arg(format!("{folder}/controller/test_hover.py")).envs(python.variables());
    let ended = place.mark(&mut test).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success() && said.contains("Ran 1 test"), "{said}");
}

#[test]
fn a_message_and_a_state_of_the_program_s_own() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let code = "\
cells = hb.message('test_msgs/msg/Cells', [hb.Field('stamp', 'Time'), hb.Field('voltage', unit='V'),
                                           hb.Field('cells', unit='V', length=2)])
count = hb.message('test_msgs/msg/Count', [hb.Field('steps', 'uint64', unit='1')])
def step(tick, state, battery, set_point, more):
    assert more is None
    if battery is None:
        assert tick % 3 != 0
    else:
        battery['voltage'] = 11.5 + 0.001 * tick
        battery['cells'] = [3.8, 3.9]
    set_point['altitude'] = 1.0
hb.run_node(step, inputs={'state': 'PlantState', 'more': hb.Optional('Imu')},
            outputs={'set_point': 'SetPoint', 'battery': cells})
";
    let battery = "outputs.battery = { type = \"test_msgs/msg/Cells\", every_ticks = 3 }\n";
    fly(python, &place, &hover(&place, code, battery)).flown();
    let recording = place.path("flight.mcap");
    let printed = python.eval(&format!(
        "import hummingbus as hb\nr = hb.Recording({recording:?})\nc = r.numpy('/pilot/battery')\n\
         print(len(c['time_s']), c['voltage'][-1], c['cells[1]'][0], r.units('/pilot/battery')['voltage'])"
    ));
    assert_eq!(printed, "100 11.797 3.9 V\n");
}

#[test]
fn a_step_gets_the_same_arrays_again_with_the_messages_of_its_tick() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let code = "\
import weakref
first = []
def step(tick, state, set_point):
    if not first:
        first.extend((weakref.ref(state), weakref.ref(set_point)))
    assert all(array() is not None for array in first), 'an array is gone'
    assert tick == 0 or state['stamp'].item() == (0, 1_000_000 * (tick - 1)), (tick, state['stamp'])
    assert set_point.item() == ((0, 0), 0.0, 0.0, 0.0, 0.0), set_point
    set_point['altitude'] = 1.0
hb.run_node(step, inputs={'state': 'PlantState'}, outputs={'set_point': 'SetPoint'})
";
    fly(python, &place, &hover(&place, code, "")).flown();
}

#[test]
fn what_goes_wrong_in_a_program_is_said_with_node_and_reason() {
    let Some(python) = python() else { return };
    let run = "hb.run_node(step, inputs={'state': 'PlantState'}, outputs={'set_point': 'SetPoint'})\n";
    let step = |body: &str| format!("kept = []\ndef step(tick, state, set_point):\n    {body}\n{run}");
    let class = "class Pilot(hb.Component):\n    inputs = {'state': 'PlantState'}\n    outputs = {'set_point': 'SetPoint'}\n";
    let cases = [
        (
            step("if tick == 100: raise ValueError('the battery is empty')"),
            "node `pilot` failed at tick 100 (t = 0.100 s): ValueError: the battery is empty",
        ),
        (step("if tick == 100: raise ValueError('the battery is empty')"), "pilot.py\", line 5, in step"),
        (step("kept.append(state)"), "the step has kept a view of `state`"),
        (step("kept.append(state['position'])"), "the step has kept a view of `state`"),
        // The array of an earlier tick, which the step gets again.
        (
            step("if tick == 200: kept.append(state)"),
            "failed at tick 200 (t = 0.200 s): the step has kept a view of `state`",
        ),
        (
            step("if tick == 200: kept.append(hb.vector(state['velocity']))"),
            "the step has kept a view of `state`",
        ),
        (step("if tick == 200: kept.append(state.base)"), "the step has kept a view of `state`"),
        (step("kept.append(hb.vector(set_point))"), "its parts are of several types"),
        (
            format!("def step(tick, state): pass\n{}", run.replace("'set_point'", "'state'")),
            "two values under the name `state`",
        ),
        (
            run.replace("step,", "print,").replace(
                "'SetPoint'",
                "hb.message('a/msg/B', [hb.Field('a', 'uint32'), hb.Field('b', unit='V')])",
            ),
            "its offset has to be a multiple of 8",
        ),
        (step("kept.append(set_point)"), "the step has kept a view of `set_point`"),
        (step("state['position']['z'] = 1.0"), "read-only"),
        (step("set_point['altitude'] = float('nan')"), "holds altitude = NaN, expected a finite number"),
        (
            run.replace("step,", "print,").replace("'SetPoint'", "'MotorCommand'"),
            "publishes hummingbus_msgs/msg/MotorCommand on its output `set_point`",
        ),
        (run.replace("step,", "print,").replace("'SetPoint'", "'Nothing'"), "there is no message Nothing"),
        (
            run.replace("step,", "print,").replace("'state'", "'stat'"),
            "declares the input `stat`, which the manifest does not wire; it has `state`",
        ),
        (
            run.replace("step,", "print,").replace("inputs={'state': 'PlantState'}, ", ""),
            "gives node `pilot` the input `state`, which the node does not declare",
        ),
        (
            format!("{class}    def __init__(self, node): node.parameters['gain']\nhb.run_node(Pilot)\n"),
            "parameters.gain is missing; the manifest gives `extra`",
        ),
        (format!("{class}hb.run_node(Pilot)\n"), "parameters.extra is not read"),
        ("import sys\nsys.exit(3)\n".to_owned(), "exit code 3"),
    ];
    for (number, (code, words)) in cases.iter().enumerate() {
        let place = Place::new();
        let parameters = if words.contains("parameters.") { "parameters = { extra = 1 }\n" } else { "" };
        let ended = fly(python, &place, &hover(&place, code, parameters));
        assert!(
            ended.code == Some(2) && ended.error.contains(words),
            "case {number}: no {words:?} in\n{ended}"
        );
    }
}

#[test]
fn a_check_and_a_run_refuse_a_program_whose_ports_and_parameters_do_not_fit() {
    let Some(python) = python() else { return };
    let run = "hb.run_node(step, inputs={'state': 'PlantState'}, outputs={'set_point': 'SetPoint'})\n";
    let of_function = |from: &str, to: &str| {
        assert!(run.contains(from), "{from}");
        format!("def step(tick, state, set_point): pass\n{}", run.replace(from, to))
    };
    let of_class = |body: &str| {
        format!(
            "class Pilot(hb.Component):\n    inputs = {{'state': 'PlantState'}}\n    outputs = {{'set_point': 'SetPoint'}}\n\
             \x20   def __init__(self, node):\n        {body}\n    def step(self, tick, state, set_point): pass\nhb.run_node(Pilot)\n"
        )
    };
    let gains = "parameters = { gains = { rol = 1.0, yaw = 2.0 } }\n";
    let cases = [
        (of_function("'state'", "'stat'"), "", "declares the input `stat`, which the manifest does not wire"),
        (of_function("'state': 'PlantState'", ""), "", "the input `state`, which the node does not declare"),
        (of_function("'set_point'", "'points'"), "", "declares the output `points`"),
        (of_function("'SetPoint'", "'MotorCommand'"), "", "publishes hummingbus_msgs/msg/MotorCommand"),
        (of_function("'PlantState'", "'Imu'"), "", "/plant/state"),
        (of_function("'SetPoint'", "'Nothing'"), "", "there is no message Nothing"),
        (of_function("", ""), gains, "parameters.gains is not read; the program reads none"),
        (of_class("node.parameters['gains']['pitch']"), gains, "parameters.gains.pitch is missing"),
        (
            of_class("gains = node.parameters['gains']; gains['yaw'], gains.get('roll', 1.0)"),
            gains,
            "parameters.gains.rol is not read; the program reads `gains.roll`, `gains.yaw`",
        ),
    ];
    let mut wrong = String::new();
    for (number, (code, parameters, words)) in cases.iter().enumerate() {
        let place = Place::new();
        let manifest = hover(&place, code, parameters);
        for command in ["check", "run"] {
            let ended = python.call(&place, &[command, &manifest]);
            if ended.code != Some(2) || !ended.error.contains(words) {
                wrong += &format!("case {number}, {command}: no {words:?} in\n{ended}\n");
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// Its keys may be read at any step.
#[test]
fn a_table_of_parameters_may_be_kept_whole() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let code = "\
class Pilot(hb.Component):
    outputs = {'set_point': 'SetPoint'}
    inputs = {'state': 'PlantState'}
    def __init__(self, node): self.asked = node.parameters['asked']
    def step(self, tick, state, set_point): set_point['altitude'] = self.asked['altitude_m']
hb.run_node(Pilot)
";
    let manifest = hover(&place, code, "parameters = { asked = { altitude_m = 1.25, spare = 0 } }\n");
    python.call(&place, &["check", &manifest]).with_code(0);
    fly(python, &place, &manifest).flown();
    let recording = place.path("flight.mcap");
    let last = python.eval(&format!(
        "import hummingbus as hb\nprint(hb.Recording({recording:?}).numpy('/pilot/set_point', ['altitude'])['altitude'][-1])"
    ));
    assert_eq!(last, "1.25\n");
}

#[test]
fn a_step_that_blocks_is_ended_by_the_watchdog_with_its_tick() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let code = "\
import time
def step(tick, state, set_point):
    if tick == 100: time.sleep(1000)
hb.run_node(step, inputs={'state': 'PlantState'}, outputs={'set_point': 'SetPoint'})
";
    // The interpreter has to join within this time, too.
    let manifest = hover(&place, code, "watchdog_ms_host = 15000\n");
    let words = ["`pilot` was killed by the watchdog", "tick 100 is not completed by `pilot`"];
    fly(python, &place, &manifest).with_code(2).says(&words);
}

#[test]
fn a_node_in_python_is_in_the_profile() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let manifest = shipped(&place, "python-controller.toml");
    let set = ["--set", "run.duration_s=0.3", "--set", "run.profile=true", "--json"];
    let ended = python
        .call(&place, &[&["run", &manifest, "--record", &place.path("flight.mcap")], &set[..]].concat());
    let summary = ended.json();
    let nodes = summary["profile"]["nodes"].as_array().unwrap();
    let controller = nodes.iter().find(|node| node["name"] == "controller").unwrap();
    assert_eq!(controller["compute"]["count"], 300, "{ended}");
}

#[test]
fn ctrl_c_ends_a_long_step_and_a_run_and_other_threads_go_on() {
    let Some(python) = python() else { return };
    python.eval(
        "import hummingbus as hb, os, signal, threading\n\
         # Programs in the background of a script ignore it.\n\
         signal.signal(signal.SIGINT, signal.default_int_handler)\n\
         def interrupt(call):\n\
         \x20   try:\n\
         \x20       threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()\n\
         \x20       call()\n\
         \x20   except KeyboardInterrupt: return\n\
         \x20   raise AssertionError('nothing ended it')\n\
         simulation = hb.Simulation('manifests/hover.toml')\n\
         interrupt(lambda: simulation.step(2_000_000))\n\
         tick = simulation.tick\n\
         simulation.step(10)\n\
         assert tick < 2_000_000 and simulation.tick == tick + 10, tick\n\
         run = hb.start('manifests/hover.toml', pace='realtime', set={'run.duration_s': 600.0})\n\
         def wait():\n\
         \x20   with run: run.wait()\n\
         interrupt(wait)\n\
         assert run._process.poll() is not None, 'the run goes on'",
    );
}

#[test]
fn the_columns_of_a_recording_are_what_cat_prints() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    place.call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.2"]).flown();
    let cat = ["cat", &recording, "--topic", "/plant/state", "--field", "position", "--csv"];
    let printed = place.call(&cat).with_code(0).output;
    let columns = python.eval(&format!(
        "import hummingbus as hb\nr = hb.Recording({recording:?})\nf = r.pandas('/plant/state')\np = r.polars('/plant/state')\n\
         assert (p['velocity.x'].to_numpy() == f['velocity.x'].to_numpy()).all() and p.columns[0] == 'time_s'\n\
         assert f.index.name == 'time_s' and 'attitude.w' in f and 'rotor_speed[3]' in f, f.columns\n\
         for x, y, z in zip(f['position.x'], f['position.y'], f['position.z']): print(f'{{x!r}},{{y!r}},{{z!r}}')"
    ));
    let numbers = |line: &str, skip: usize| -> Vec<f64> {
        line.split(',').skip(skip).map(|number| number.parse().unwrap()).collect()
    };
    let header = printed.lines().next().unwrap();
    let skip =
        header.split(',').position(|name| name.starts_with("position")).unwrap_or_else(|| panic!("{header}"));
    let expected: Vec<_> = printed.lines().skip(1).map(|line| numbers(line, skip)).collect();
    let found: Vec<_> = columns.lines().map(|line| numbers(line, 0)).collect();
    assert!(found.len() == 200 && found == expected, "{header}\n{:?}\n{:?}", found.last(), expected.last());
}

#[test]
fn the_notebook_runs_from_a_launch_to_plots() {
    let Some(python) = python() else { return };
    let said = python.eval(
        "import nbformat, nbclient\nnotebook = nbformat.read('examples/python/hover.ipynb', 4)\n\
         assert not any(cell.get('outputs') for cell in notebook.cells), 'it is kept without outputs'\n\
         options = {'metadata': {'path': 'examples/python'}}\n\
         nbclient.NotebookClient(notebook, timeout=300, resources=options).execute()\n\
         outputs = [output for cell in notebook.cells for output in cell.get('outputs', [])]\n\
         print(sum('image/png' in output.get('data', {}) for output in outputs), 'pictures')\n\
         print(*(output['text'] for output in outputs if output['output_type'] == 'stream' and output['name'] == 'stdout'))",
    );
    assert!(said.starts_with("4 pictures\n") && said.contains("with its state"), "{said}");
}

#[test]
fn a_campaign_returns_its_report_and_wrong_files_raise_the_words_of_the_program() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let (hover, out) = (repository("manifests/hover.toml"), place.path("out"));
    let text = format!(
        "manifest = {hover:?}\nflights = 3\nset = [\"run.duration_s=1.0\"]\n[[vary]]\nname = \"mass\"\n\
         key = \"process.plant.vehicle.body.mass\"\nuniform = [0.47, 0.49]\n"
    );
    let file = place.write("small.toml", text);
    python.eval(&format!(
        "import hummingbus as hb\nc = hb.campaign({file:?}, {out:?}, workers=1, require='pass_rate >= 0.9 at 95 %')\n\
         assert c.report['flights'] == 3 and not c.holds, c.report\n\
         rows = c.polars()\nassert rows.height == 3 and rows['mass'].is_between(0.47, 0.49).all(), rows\n\
         assert (c.pandas()['mass'] == rows['mass'].to_numpy()).all()\n\
         for wrong in (lambda: hb.campaign('nowhere.toml', {out:?}), lambda: hb.identify('nowhere.toml', {out:?})):\n\
         \x20   try: wrong()\n\
         \x20   except hb.Error as error: assert 'nowhere.toml' in str(error), error\n\
         \x20   else: raise AssertionError"
    ));
}

/// Flights take long enough that some are left when the first has ended.
#[test]
fn ctrl_c_lets_a_campaign_write_what_it_has_flown() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let (hover, out) = (repository("manifests/hover.toml"), place.path("out"));
    let text = format!("manifest = {hover:?}\nflights = 40\nset = [\"run.duration_s=10.0\"]\n");
    let file = place.write("long.toml", text);
    python.eval(&format!(
        "import hummingbus as hb, os, signal, threading, time\n\
         signal.signal(signal.SIGINT, signal.default_int_handler)\n\
         def interrupt():\n\
         \x20   rows = {out:?} + '/rows.jsonl'\n\
         \x20   while not os.path.exists(rows) or os.path.getsize(rows) == 0: time.sleep(0.01)\n\
         \x20   os.kill(os.getpid(), signal.SIGINT)\n\
         threading.Thread(target=interrupt).start()\n\
         try: hb.campaign({file:?}, {out:?}, workers=1)\n\
         except KeyboardInterrupt as stop: assert 'was interrupted; the same command flies' in str(stop), stop\n\
         else: raise AssertionError('nothing ended it')"
    ));
    let rows = fs::read_to_string(place.path("out/rows.jsonl")).unwrap();
    assert!((1..40).contains(&rows.lines().count()), "{rows}");
}

/// A flight of the Hummingbird, held against one that is declared a tenth heavier.
const IDENTIFIED: &str = r#"
import json, os, hummingbus as hb
os.chdir(FOLDER)
hb.fly(ROOT + "manifests/identify/excite.toml", record="flown.mcap", set={"run.duration_s": 18.0})
error = 'error = { value = 0.1, unit = "1", source = "a test", uncertainty = "exact" }'
with open("heavy.toml", "w") as file:
    file.write(f'base = "{ROOT}vehicles/hummingbird.toml"\nname = "heavy"\n[[effects]]\nname = "mass-error"\n{error}\n')
topics = {"command": "/controller/command", "position": "/mocap/mocap", "attitude": "/mocap/mocap", "angular_velocity": "/imu/imu"}
with open("flights.toml", "w") as file:
    file.write('vehicle = "heavy.toml"\n[channels]\n')
    file.writelines(f'{channel} = {{ topic = "{topic}" }}\n' for channel, topic in topics.items())
    for name, role, times in (("early", "fit", "from_s = 1.0\nto_s = 10.0"), ("late", "test", "from_s = 10.0")):
        file.write(f'[[flight]]\nname = "{name}"\nfile = "flown.mcap"\nrole = "{role}"\n{times}\n')
report = hb.identify("flights.toml", "found", on_bus=False)
assert report["verdict"] == ["mass-error"], report["verdict"]
missing = {"vehicle", "flights", "effects", "held_out", "noise_floor", "not_identifiable", "next_flight"} - set(report)
assert not missing, missing
late = report["held_out"]["late"]["1"]["position"]
assert late["after"] < 0.2 * late["before"] and late["unit"] == "m", late
assert os.path.getsize("found/report.html") > 100_000 and "mass-error" in open("found/vehicle.toml").read()
"#;

#[test]
fn an_identification_returns_the_report_of_a_flight_that_python_has_flown() {
    let Some(python) = python() else { return };
    let place = Place::new();
    python.eval(&format!("FOLDER, ROOT = {:?}, {:?}\n{IDENTIFIED}", place.path(""), repository("")));
}

#[test]
fn the_stubs_have_the_names_of_the_library() {
    let Some(python) = python() else { return };
    python.eval(
        "import ast, inspect\nfrom hummingbus import _native\n\
         def names(body):\n\
         \x20   found = {n.target.id if isinstance(n, ast.AnnAssign) else n.name: n for n in body if not isinstance(n, (ast.ImportFrom, ast.Expr))}\n\
         \x20   return {name: node for name, node in found.items() if not name.startswith('__')}\n\
         public = lambda of: {name for name in vars(of) if not name.startswith('__')}\n\
         stubs = names(ast.parse(open('python/hummingbus/_native.pyi').read()).body)\n\
         assert public(_native) == set(stubs), public(_native) ^ set(stubs)\n\
         for name in ('Node', 'Recording', 'Saved', 'Simulation'):\n\
         \x20   stub, found = set(names(stubs[name].body)), public(getattr(_native, name))\n\
         \x20   assert stub == found, (name, stub ^ found)\n\
         # Parameters have the same names in the same order.\n\
         def require_same(stub, found):\n\
         \x20   declared = [argument.arg for argument in stub.args.args if argument.arg != 'self']\n\
         \x20   known = [name for name in inspect.signature(found).parameters if name != 'self']\n\
         \x20   assert declared == known, (stub.name, declared, known)\n\
         for name, stub in stubs.items():\n\
         \x20   if isinstance(stub, ast.FunctionDef): require_same(stub, getattr(_native, name))\n\
         \x20   for method in getattr(stub, 'body', []) if isinstance(stub, ast.ClassDef) else []:\n\
         \x20       if not isinstance(method, ast.FunctionDef) or method.decorator_list: continue\n\
         \x20       of_class = getattr(_native, name)\n\
         \x20       require_same(method, of_class if method.name == '__init__' else getattr(of_class, method.name))",
    );
}

#[test]
fn a_run_that_fails_raises_its_own_words() {
    let Some(python) = python() else { return };
    let said = python.eval(
        "import hummingbus as hb\ntry: hb.fly('manifests/hover.toml', set={'run.rate_hz': 7})\nexcept hb.Error as error: print(error)",
    );
    assert!(said.contains("choose a divisor"), "{said}");
}

#[test]
fn values_beyond_the_count_of_a_sequence_are_zeros_whoever_has_set_them() {
    let Some(python) = python() else { return };
    python.eval(
        "import hummingbus as hb\ncommand = hb.message('MotorCommand').zeros()['command']\n\
         command['values'][:5] = 76.5\nhb.set_values(command, [80.0] * 3)\n\
         assert command['values'][:5].tolist() == [80.0, 80.0, 80.0, 0.0, 0.0], command",
    );
}

#[test]
fn the_examples_of_the_page_and_of_the_package_run() {
    let Some(python) = python() else { return };
    let page = fs::read_to_string(repository("docs/python.md")).unwrap();
    let blocks: Vec<&str> =
        page.split("\n```python\n").skip(1).map(|rest| rest.split("\n```").next().unwrap()).collect();
    assert_eq!(blocks.len(), 5, "docs/python.md");
    python.eval(&blocks.join("\n"));
    python.eval("import doctest, hummingbus._messages as m\nassert doctest.testmod(m).failed == 0");
    python.eval(
        "import json, hummingbus as hb\nfrom hummingbus import _native\nnames = hb.messages()\nassert len(names) > 30\n\
         for name in names: assert hb.dtype(name).itemsize == json.loads(_native.message(name))['size'], name",
    );
}

/// The nodes of docs/python.md.
fn nodes_of_the_page() -> Vec<String> {
    let page = fs::read_to_string(repository("docs/python.md")).unwrap();
    let blocks = page.split("\n```python node\nimport hummingbus as hb\n").skip(1);
    blocks.map(|rest| rest.split("\n```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_nodes_of_the_page_fly() {
    let Some(python) = python() else { return };
    let nodes = nodes_of_the_page();
    let parameters = ["parameters = { more_m = 0.25 }\n", "parameters = { gain_1_s = 0.5 }\n"];
    assert_eq!(nodes.len(), parameters.len(), "docs/python.md");
    for (node, parameters) in nodes.iter().zip(parameters) {
        let place = Place::new();
        fly(python, &place, &hover_with_input(&place, "plant", node, parameters)).flown();
        let Some(gain_1_s) = parameters.contains("gain_1_s").then_some(0.5) else { continue };
        // The node integrates the error of the state of the tick before, which is zeros at tick 0.
        python.eval(&format!(
            "import hummingbus as hb, numpy as np\nr = hb.Recording({:?})\n\
             z = r.numpy('/plant/state', ['position.z'])['position.z']\n\
             asked = r.numpy('/pilot/set_point', ['altitude'])['altitude']\n\
             low = 1.0 - np.concatenate(([0.0], z[:-1]))\n\
             assert len(asked) == 300 and abs(asked - 1.0 - {gain_1_s} * 0.001 * np.cumsum(low)).max() < 1e-12, asked",
            place.path("flight.mcap")
        ));
    }
}

#[test]
fn the_schemas_of_all_messages_are_those_that_the_program_prints() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let printed = place.call(&["schema", "--json"]).with_code(0).json();
    let printed = place.write("schemas.json", printed.to_string());
    python.eval(&format!(
        "import json, hummingbus as hb\nprinted = json.load(open({printed:?}))\nassert len(printed) > 20\n\
         known = set(hb.messages())\n\
         for one in printed:\n\
         \x20   if one['type_name'] not in known: continue\n\
         \x20   found = hb.schema(one['type_name'])\n\
         \x20   assert (found.type_name, found.size, found.layout_hash) == (one['type_name'], one['size'], one['layout_hash']), found\n\
         motors = {{field.name: field for field in hb.schema('MotorCommand').fields}}\n\
         assert motors['command'].type.startswith('float64[<='), motors\n\
         assert {{field.name: field for field in hb.schema('PlantState').fields}}['position'].type == 'hummingbus_msgs/msg/Vector3'\n\
         try: hb.schema('Nothing')\n\
         except hb.Error as error: assert 'hummingbus.messages()' in str(error), error\n\
         else: raise AssertionError"
    ));
}

#[test]
fn a_simulation_that_is_stepped_has_the_samples_of_a_run() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/hover.toml"), place.path("hover.mcap"));
    place.call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=0.3"]).flown();
    python.eval(&format!(
        "import hummingbus as hb, numpy as np\n\
         recorded = hb.Recording({recording:?}).numpy('/plant/state', ['position.x', 'position.y', 'position.z', 'attitude.w'])\n\
         simulation = hb.Simulation({manifest:?}, set={{'run.duration_s': 0.3}})\n\
         assert simulation.read('/plant/state') is None and simulation.tick == 0\n\
         for tick in range(300):\n\
         \x20   simulation.step()\n\
         \x20   state = simulation.read('/plant/state')\n\
         \x20   found = [*hb.vector(state['position']), state['attitude']['w']]\n\
         \x20   assert found == [column[tick] for name, column in recorded.items() if name != 'time_s'], tick\n\
         assert abs(simulation.time_s - 0.3) < 1e-12\n\
         for wrong in (-1, 2**40):\n\
         \x20   try: simulation.step(wrong)\n\
         \x20   except hb.Error as error: assert f'ticks, found {{wrong}}' in str(error), error\n\
         \x20   else: raise AssertionError\n\
         assert simulation.tick == 300\n\
         try: simulation.read('/nothing')\n\
         except hb.Error as error: assert '/plant/state' in str(error)\n\
         else: raise AssertionError"
    ));
}

#[test]
fn an_environment_is_what_gymnasium_expects_and_a_seed_gives_the_same_episode() {
    let Some(python) = python() else { return };
    python.eval(
        "import numpy as np, warnings\n\
         from gymnasium.utils.env_checker import check_env\n\
         import hummingbus as hb\n\
         from hummingbus.envs import HoverEnv\n\
         with warnings.catch_warnings():\n\
         \x20   warnings.filterwarnings('ignore', message='.*Box observation space (min|max)imum value is -?inf.*')\n\
         \x20   check_env(HoverEnv(), skip_render_check=True)\n\
         # In processes of their own as in this one: the same observations.\n\
         import gymnasium\n\
         def first(kind):\n\
         \x20   many = kind([HoverEnv] * 2)\n\
         \x20   seen = [many.reset(seed=1)[0]] + [many.step(np.full((2, 4), 0.1))[0] for _ in range(20)]\n\
         \x20   many.close()\n\
         \x20   return np.array(seen)\n\
         same = [first(kind) for kind in (gymnasium.vector.SyncVectorEnv, gymnasium.vector.AsyncVectorEnv)]\n\
         assert same[0].shape == (21, 2, 13) and (same[0] == same[1]).all()\n\
         def episode(seed):\n\
         \x20   env, found = HoverEnv(), []\n\
         \x20   observation, _ = env.reset(seed=seed)\n\
         \x20   for number in range(200):\n\
         \x20       tilt = np.clip(0.02 * observation[2] + 0.1 * np.sin(number) * np.array([1, -1, 1, -1]), -1, 1)\n\
         \x20       observation, reward, is_over, _, _ = env.step(tilt)\n\
         \x20       found.append([*observation, reward])\n\
         \x20       if is_over: break\n\
         \x20   env.close()\n\
         \x20   return np.array(found)\n\
         first, second, other = episode(1), episode(1), episode(2)\n\
         assert len(first) > 50 and (first == second).all() and not (first[0] == other[0]).all()\n\
         # An equal command for all rotors climbs straight up; a nose-down pair of commands moves forward.\n\
         env = HoverEnv()\n\
         env.reset(options={'position_m': [0, 0, 1]})\n\
         for _ in range(30): observation, *_ = env.step(np.full(4, 0.2))\n\
         assert observation[5] > 0.1 and abs(observation[3]) < 1e-9 and observation[2] < 0, observation\n\
         env.reset(options={'position_m': [0, 0, 1]})\n\
         for _ in range(40): observation, *_ = env.step(np.array([-0.05, 0, 0.05, 0]))\n\
         assert observation[3] > 0.01 and observation[7] > 0, observation\n\
         # Vehicles with other commands and numbers of rotors hover as they are.\n\
         for vehicle, rotors in (('crazyflie-2.1', 4), ('dji-f550', 6), ('tarot-t18', 8)):\n\
         \x20   env = HoverEnv(f'vehicles/{vehicle}.toml')\n\
         \x20   assert env.action_space.shape == (rotors,), (vehicle, env.action_space)\n\
         \x20   env.reset(options={'position_m': [0, 0, 1]})\n\
         \x20   for _ in range(50): observation, *_ = env.step(np.zeros(rotors))\n\
         \x20   assert abs(observation[:6]).max() < 0.01, (vehicle, observation)\n\
         \x20   for _ in range(20): observation, *_ = env.step(np.ones(rotors))\n\
         \x20   assert observation[5] > 0.1, (vehicle, observation)\n\
         # By its name, as programs for training make environments.\n\
         env = gymnasium.make('hummingbus.envs:hummingbus/Hover-v0', vehicle='vehicles/dji-f550.toml')\n\
         assert env.action_space.shape == (6,), env.action_space\n\
         many = gymnasium.make_vec('hummingbus/Hover-v0', num_envs=3)\n\
         assert (many.reset(seed=1)[0][:2] == same[0][0]).all() and many.action_space.shape == (3, 4)\n\
         many.close()\n\
         try: HoverEnv('vehicles/nothing.toml')\n\
         except hb.Error as error: assert 'vehicles/nothing.toml' in str(error), error\n\
         else: raise AssertionError",
    );
}
