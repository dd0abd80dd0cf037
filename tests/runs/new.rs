//! `hummingbus new vehicle`: a vehicle file from a model, which flies; files are not replaced.

use crate::skipped::first;
use crate::support::{HUMMINGBUS, Place, repository};
use recorder::reader::Recording;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use vehicles::Vehicle;

const MODELS: [(&str, &str); 2] =
    [("vehicles/tests/models/plus.urdf", "0.8400 kg"), ("vehicles/tests/models/cross.sdf", "1.5000 kg")];

/// A hover at 1 m by the controller `cascade`.
fn hover(vehicle: &str) -> String {
    let command = Vehicle::load(Path::new(vehicle)).unwrap().hover_command();
    let text = |path: &str| toml::Value::from(path).to_string();
    let (set, gains) =
        (repository("manifests/sets/flight.toml"), repository("controllers/gains/cascade.toml"));
    let (set, gains, vehicle) = (text(&set), text(&gains), text(vehicle));
    format!(
        r#"include = [{set}]
[run]
duration_s = 6.0
seed = 1
[process.plant]
vehicle = {vehicle}
inputs.command = {{ topic = "/controller/command", delay_ticks = 1, initial = {{ command = [{command:?}, {command:?}, {command:?}, {command:?}] }} }}
[process.controller]
kind = "cascade"
vehicle = {vehicle}
gains = {gains}
inputs.set_point = "/pilot/set_point"
inputs.estimate = "/ekf/estimate"
[process.pilot]
kind = "pilot"
parameters = {{ initial_altitude_m = 1.0 }}
"#
    )
}

#[test]
fn a_model_becomes_a_vehicle_file_that_hovers() {
    for (model, mass) in first(1, "models", MODELS) {
        let place = Place::new();
        let out = place.path("quad.toml");
        let made = place.call(&["new", "vehicle", "--from", &repository(model), "-o", &out]).with_code(0);
        assert!(made.output.contains(mass) && made.output.contains("command.min"), "{}", made.output);
        assert!(!made.output.contains("body.gravity"), "a choice needs no measurement: {}", made.output);
        let line = format!("vehicle = {}", toml::Value::from(out.as_str()));
        let flown = hover(&out);
        assert!(made.output.contains(&line) && flown.contains(&line), "{}", made.output);
        let manifest = place.write("hover.toml", flown);
        place.call(&["check", &manifest]).with_code(0);
        place.call(&["run", &manifest]).with_code(0);
        let read = Recording::open(Path::new(&place.path("hover.mcap"))).unwrap();
        let topic = "/plant/state";
        let series = read
            .series(&[(topic, "position.z"), (topic, "attitude.roll"), (topic, "attitude.pitch")])
            .unwrap();
        let last: Vec<f64> = series.iter().map(|of| *of.value.last().unwrap()).collect();
        assert!((last[0] - 1.0).abs() < 0.05, "{model}: height {} m", last[0]);
        assert!(last[1].abs() < 0.02 && last[2].abs() < 0.02, "{model}: attitude {last:?}");
    }
}

#[test]
fn the_line_for_manifests_holds_in_every_folder() {
    let place = Place::new();
    let out = place.path("quad.toml");
    let folder = Path::new(&out).parent().unwrap().canonicalize().unwrap();
    let mut command = Command::new(HUMMINGBUS);
    let model = repository(MODELS[0].0);
    command.current_dir(&folder).args(["new", "vehicle", "--from", &model, "-o", "quad.toml"]);
    let made = place.launch(command).end().with_code(0);
    let line =
        format!("vehicle = {}", toml::Value::from(folder.join("quad.toml").to_string_lossy().as_ref()));
    assert!(made.output.contains(&line), "{}", made.output);
}

#[test]
fn a_file_that_exists_stays_and_what_is_wrong_leaves_no_file() {
    let place = Place::new();
    let (model, out) = (repository(MODELS[0].0), place.path("quad.toml"));
    let new = |from: &str, out: &str| place.call(&["new", "vehicle", "--from", from, "-o", out]);
    new("none.urdf", &out).with_code(2).says(&["none.urdf", "No such file"]);
    let broken = place.write("broken.urdf", "<robot name=\"q\">\n  <link name=\"a\">\n</robot>");
    new(&broken, &out).with_code(2).says(&["broken.urdf:3:", "expected XML"]);
    new(&model, "/nowhere/quad.toml").with_code(2).says(&["/nowhere/quad.toml", "there is no folder"]);
    assert!(!Path::new(&out).exists());
    new(&model, &out).with_code(0);
    let edited = format!("{}# mine\n", fs::read_to_string(&out).unwrap());
    fs::write(&out, &edited).unwrap();
    new(&model, &out).with_code(2).says(&["quad.toml already exists", "does not replace files"]);
    assert_eq!(fs::read_to_string(&out).unwrap(), edited);
    new(&model, &model).with_code(2).says(&["plus.urdf already exists"]);
    // A model in the place of a vehicle file: the message has the way.
    place.call(&["urdf", &model]).with_code(2).says(&["URDF", "hummingbus new vehicle --from"]);
}

/// A new project in `place`, as its folder.
fn project(place: &Place) -> String {
    project_in(place, "rust")
}

/// A new project in `place` with a controller in `language`, as its folder.
fn project_in(place: &Place, language: &str) -> String {
    let folder = place.path("my-quad");
    let args = ["new", &folder, "--language", language, "--sources", &repository("")];
    let made = place.call(&args).with_code(0);
    assert!(made.output.contains("hover.toml") && made.output.contains("README.md"), "{}", made.output);
    folder
}

#[test]
fn a_new_project_flies_as_it_is() {
    let place = Place::new();
    let folder = project(&place);
    let recording = place.path("hover.mcap");
    let args = ["run", &format!("{folder}/hover.toml"), "--record", &recording];
    let flown = place.call(&args).with_code(0);
    assert!(!flown.error.contains("warning"), "{}", flown.error);
    flown.prints(&["ok     altitude within 5 %", "ok     roll reaches", "passed"]);
}

/// The controller's template is built with the tests, as an example of this package.
#[test]
fn the_controller_of_a_new_project_flies_as_a_program() {
    let place = Place::new();
    let folder = project(&place);
    let program = Path::new(HUMMINGBUS).with_file_name("examples/project_controller");
    assert!(program.exists(), "{} is not built: cargo build --examples", program.display());
    let command = format!("process.controller.command=[{:?}]", program.display().to_string());
    let manifest = format!("{folder}/hover-rust.toml");
    let recording = place.path("hover.mcap");
    place
        .call(&["run", &manifest, "--record", &recording, "--set", &command])
        .with_code(0)
        .prints(&["passed"]);
}

#[test]
fn the_campaign_of_a_new_project_passes() {
    let place = Place::new();
    let folder = project(&place);
    let text = fs::read_to_string(format!("{folder}/campaign.toml")).unwrap();
    let few = format!("{folder}/few.toml");
    fs::write(&few, text.replace("flights = 50", "flights = 4")).unwrap();
    let args = ["campaign", &few, "--out", &place.path("out"), "--require", "pass_rate >= 1"];
    place.call(&args).with_code(0);
}

#[test]
fn the_package_of_a_new_project_stands_on_the_stated_sources() {
    let place = Place::new();
    let folder = project(&place);
    let text = fs::read_to_string(format!("{folder}/controller/Cargo.toml")).unwrap();
    let package: toml::Table = text.parse().unwrap();
    assert_eq!(package["package"]["name"].as_str(), Some("my-quad-controller"));
    let of = |table: &str, name: &str| -> toml::Table {
        let path = package[table][name]["path"].as_str().unwrap();
        fs::read_to_string(format!("{path}/Cargo.toml")).unwrap().parse().unwrap()
    };
    assert_eq!(of("dependencies", "bus")["package"]["name"].as_str(), Some("hummingbus-bus"));
    assert_eq!(of("dev-dependencies", "hummingbus")["package"]["name"].as_str(), Some("hummingbus"));
    let test = fs::read_to_string(format!("{folder}/controller/src/hover_test.rs")).unwrap();
    assert!(test.contains("\"/../hover-rust.toml\""), "{test}");
}

#[test]
fn files_that_a_new_project_names_exist_and_no_placeholder_is_left() {
    for (language, title) in [("rust", "Rust"), ("cpp", "C++"), ("python", "Python")] {
        let place = Place::new();
        let folder = project_in(&place, language);
        let readme = fs::read_to_string(format!("{folder}/README.md")).unwrap();
        assert!(readme.starts_with("# my-quad\n"), "{readme}");
        assert!(readme.contains(&format!("a controller in {title}, ")), "{readme}");
        let rows: Vec<_> =
            readme.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next()).collect();
        assert!(rows.len() > 5, "{rows:?}");
        if language == "python" {
            let controller = fs::read_to_string(format!("{folder}/controller/controller.py")).unwrap();
            assert!(controller.contains("controller/venv/bin/pip install "), "{controller}");
            assert!(readme.contains("compiles the package with Cargo: it needs Rust"), "{readme}");
            // Its environment is not there yet.
            let ended = place.call(&["check", &format!("{folder}/hover-python.toml")]).with_code(2);
            ended.says(&["venv/bin/python: there is no such file", "README.md", "pip install"]);
        }
        rows.iter().for_each(|row| assert!(Path::new(&format!("{folder}/{row}")).exists(), "{row}"));
        for path in files(Path::new(&folder)) {
            let text = fs::read_to_string(&path).unwrap();
            let has_name = |word: &str| word.len() > 2 && word.chars().all(|c| c.is_ascii_lowercase());
            let left: Vec<_> = text.split('@').skip(1).filter(|word| has_name(word)).collect();
            assert!(left.is_empty() && !text.contains("drone"), "{}: {left:?}", path.display());
        }
    }
    let place = Place::new();
    place.call(&["new", &place.path("quad"), "--language", "ada"]).with_code(2).says(&["ada", "python"]);
}

/// All files below `folder`.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn a_project_is_refused_whole() {
    let place = Place::new();
    let count = || fs::read_dir(place.path("")).unwrap().count();
    let before = count();
    for name in ["2fast", "no spaces", "ünicode", "-x/..", &"long".repeat(20)] {
        place.call(&["new", "--", &place.path(name)]).with_code(2).says(&["not a project name", "letter"]);
    }
    place.call(&["new", &place.path("absent/quad")]).with_code(2).says(&["cannot make a folder", "absent"]);
    place
        .call(&["new", &place.path("quad"), "--sources", &place.path("")])
        .with_code(2)
        .says(&["not a checkout"]);
    place.call(&["new"]).with_code(2).says(&["NAME"]);
    assert_eq!(count(), before);
    let taken = place.write("taken", "a letter");
    place.call(&["new", &taken]).with_code(2).says(&["already exists"]);
    assert_eq!(fs::read_to_string(taken).unwrap(), "a letter");
    assert_eq!(count(), before + 1);
}
