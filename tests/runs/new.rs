//! `hummingbus new vehicle`: a vehicle file from a model, which flies; files are not replaced.

use crate::support::{HUMMINGBUS, Place, repository};
use recorder::reader::Recording;
use std::fs;
use std::path::Path;
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
    for (model, mass) in MODELS {
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
