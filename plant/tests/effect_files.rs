//! Effects as vehicle and scene files list them, and the errors for every fault.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::common;
use common::HUMMINGBIRD;
use inputs::InputFiles;
use plant::Airframe;
use scenes::Scene;
use std::path::Path;
use vehicles::Vehicle;

const DRAG: &str = r#"
[[effects]]
name = "rotor-drag"
coefficient = { value = 8e-5, unit = "N*s^2/(m*rad)", source = "test", uncertainty = "exact" }
"#;
const WIND: &str = r#"
[[effects]]
name = "wind"
x = { value = 3, unit = "m/s", source = "test", uncertainty = "exact" }
"#;

fn airframe(vehicle: &str, scene: &str) -> Result<Airframe, String> {
    let scene = Scene::parse(&format!("name = \"test\"\n{scene}"), "here.toml").map_err(|e| e.to_string())?;
    let vehicle =
        Vehicle::parse(&format!("{HUMMINGBIRD}{vehicle}"), "bird.toml").map_err(|e| e.to_string())?;
    Airframe::from_files(vehicle, &scene.effects).map_err(|error| error.to_string())
}

/// The fault is reported on `line` of the text that is added to the Hummingbird's file, with all these words.
fn assert_refused(effects: &str, line: usize, words: &[&str]) {
    let message = airframe(effects, "").unwrap_err().to_string();
    let start = format!("bird.toml:{}:", HUMMINGBIRD.lines().count() + line);
    assert!(message.starts_with(&start), "expected {start} in: {message}");
    for word in words {
        assert!(message.contains(word), "expected {word:?} in: {message}");
    }
}

#[test]
fn every_vehicle_and_scene_of_the_repository_lists_effects_that_there_are() {
    let files = |folder: &str| {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files: Vec<_> =
            entries.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
        files.into_iter().filter(|path| !path.ends_with("Cargo.toml"))
    };
    for path in files("../vehicles") {
        let airframe = Airframe::from_files(Vehicle::load(&path).unwrap(), &[]);
        assert!(airframe.is_ok(), "{}", airframe.unwrap_err());
    }
    let bird = Vehicle::load(Path::new("../vehicles/hummingbird-drag.toml")).unwrap();
    for path in files("../scenes") {
        let airframe = Airframe::from_files(bird.clone(), &Scene::load(&path).unwrap().effects);
        assert!(airframe.is_ok(), "{}", airframe.unwrap_err());
    }
}

#[test]
fn the_vehicles_effects_come_before_the_scenes() {
    let airframe = airframe(DRAG, WIND).unwrap();
    let found: Vec<_> =
        airframe.effects().iter().map(|effect| (effect.kind.name, effect.values[0])).collect();
    assert_eq!(found, [("rotor-drag", 8e-5), ("wind", 3.0)]);
    assert!(
        airframe.effects()[1].values[1..].iter().all(|value| *value == 0.0),
        "what is left out is neutral"
    );
}

#[test]
fn controllers_see_the_declared_vehicle_and_the_plant_flies_the_other() {
    let heavy = r#"
        [[effects]]
        name = "mass-error"
        error = { value = 10, unit = "%", source = "test", uncertainty = "exact" }
    "#;
    let flown = airframe(heavy, "").unwrap();
    assert!((flown.vehicle().mass_kg - 0.528).abs() < 1e-12);
    let declared = Vehicle::parse(&format!("{HUMMINGBIRD}{heavy}"), "bird.toml").unwrap();
    assert_eq!((declared.mass_kg, declared.effects.len()), (0.480, 1));
}

#[test]
fn a_fault_in_an_effect_is_named_with_its_place() {
    let replaced = |from: &str, to: &str| DRAG.replace(from, to);
    assert_refused(
        &replaced("rotor-drag", "rotordrag"),
        3,
        &["`effects.0.name`", "parasitic-drag", "rotordrag"],
    );
    assert_refused(&replaced("coefficient", "factor"), 4, &["unknown key `effects.0.factor`", "coefficient"]);
    let misspelt = airframe(&replaced("coefficient", "factor"), "").unwrap_err().to_string();
    let key = format!("bird.toml:{}:1:", HUMMINGBIRD.lines().count() + 4);
    assert!(misspelt.starts_with(&key), "the key is to blame: {misspelt}");
    assert_refused(&replaced("N*s^2/(m*rad)", "N"), 4, &["`effects.0.coefficient.unit`", "kg/rad", "\"N\""]);
    assert_refused(&replaced("8e-5", "8e-2"), 4, &["`effects.0.coefficient`", "0 to 0.001", "0.08"]);
    assert_refused(&replaced("8e-5", "-1e-9"), 4, &["0 to 0.001"]);
    assert_refused(&replaced("8e-5", "nan"), 4, &["finite"]);
    assert_refused(
        &replaced(", uncertainty = \"exact\"", ""),
        4,
        &["missing key `effects.0.coefficient.uncertainty`"],
    );
    assert_refused(
        &replaced("coefficient = {", "coefficient = 1 # {"),
        4,
        &["a table with value, unit, source"],
    );
    assert_refused("\n[[effects]]\n", 2, &["missing key `effects.0.name`"]);
    assert_refused(
        "\n[[effects]]\nname = \"ground-effect\"\n",
        2,
        &["missing key `effects.0.rotor_radius`", "length"],
    );
    assert_refused(&format!("{DRAG}{DRAG}"), 7, &["`effects.1.name`", "each effect once", "rotor-drag"]);
}

#[test]
fn an_effect_in_both_files_is_refused_where_the_scene_repeats_it() {
    let message = airframe(WIND, WIND).unwrap_err().to_string();
    assert!(message.starts_with("here.toml:4:") && message.contains("each effect once"), "{message}");
}

#[test]
fn an_inertia_that_no_body_has_is_refused() {
    let error = |value: f64| {
        format!(
            "\n[[effects]]\nname = \"inertia-error\"\nerror_zz = {{ value = {value}, unit = \"1\", source = \"t\", uncertainty = 0 }}\n"
        )
    };
    assert!(airframe(&error(0.3), "").is_ok());
    assert_refused(&error(0.5), 3, &["larger than the sum of the other two"]);
}

#[test]
fn a_base_gives_the_vehicle_and_the_file_its_effects() {
    let path = Path::new("../vehicles/hummingbird-drag.toml");
    let with_drag = Vehicle::load(path).unwrap();
    let declared = Vehicle::load(Path::new("../vehicles/hummingbird.toml")).unwrap();
    assert_eq!(Vehicle { name: declared.name.clone(), effects: Vec::new(), ..with_drag.clone() }, declared);
    assert_eq!(with_drag.name, "AscTec Hummingbird with drag");
    let airframe = Airframe::from_files(with_drag, &[]).unwrap();
    let names: Vec<_> = airframe.effects().iter().map(|effect| effect.kind.name).collect();
    assert_eq!(names, ["rotor-drag", "parasitic-drag"]);
    assert_eq!(
        Vehicle::base(&InputFiles::default(), path).unwrap(),
        Path::new("../vehicles/hummingbird.toml")
    );
    assert_eq!(Vehicle::base(&InputFiles::default(), Path::new("../vehicles/hummingbird.toml")), None);
}

#[test]
fn a_base_that_is_not_there_or_has_a_base_itself_is_refused() {
    let on = |base: &str| {
        let text = format!("name = \"x\"\nbase = \"{base}\"\n");
        Vehicle::parse(&text, "../vehicles/x.toml").unwrap_err().to_string()
    };
    let missing = on("nowhere.toml");
    assert!(
        missing.starts_with("../vehicles/x.toml:2:8: `base`") && missing.contains("nowhere.toml"),
        "{missing}"
    );
    let nested = on("hummingbird-drag.toml");
    assert!(
        nested.starts_with("../vehicles/hummingbird-drag.toml:") && nested.contains("`base`"),
        "{nested}"
    );
    let more = Vehicle::parse("name = \"x\"\nbase = \"hummingbird.toml\"\n[bdoy]\n", "../vehicles/x.toml");
    assert!(more.unwrap_err().to_string().contains("unknown key `bdoy`"));
}

#[test]
fn a_misspelt_effect_is_told_with_the_one_that_was_meant() {
    let error = airframe("\n[[effects]]\nname = \"parasitc-drag\"\n", "").unwrap_err();
    assert!(error.ends_with("did you mean \"parasitic-drag\"?"), "{error}");
}

#[test]
fn a_motor_of_another_model_replaces_that_of_its_base() {
    let declared = Vehicle::load(Path::new("../vehicles/hummingbird.toml")).unwrap();
    let head = "name = \"x\"\nbase = \"hummingbird.toml\"\n";
    let of = |tables: &str| Vehicle::parse(&format!("{head}{tables}"), "../vehicles/x.toml");
    let motor = "[motor]\nmodel = \"first-order\"\n\
                 time_constant = { value = 50, unit = \"ms\", source = \"test\", uncertainty = 0 }\n";
    let quick = of(motor).unwrap();
    assert_eq!(quick.motor, vehicles::MotorModel::FirstOrder { time_constant_s: 0.05 });
    let place = |vehicle: &Vehicle, key: &str| {
        let number = vehicle.provenance.iter().find(|number| number.key == key);
        number.map(|number| (number.file.clone(), number.line))
    };
    assert_eq!(place(&quick, "motor.time_constant"), Some(("../vehicles/x.toml".into(), 5)));
    assert_eq!(place(&quick, "motor.natural_frequency"), None, "the base's motor is gone");
    assert_eq!(place(&quick, "body.mass"), place(&declared, "body.mass"));
    let Vehicle { motor, provenance, name, .. } = declared.clone();
    assert_eq!(Vehicle { motor, provenance, name, ..quick }, declared);
}

/// A Hummingbird lacks a fifth rotor, and a hexacopter has it.
#[test]
fn a_loss_of_a_rotor_that_the_vehicle_lacks_is_refused() {
    let weak = |rotor: usize| {
        format!(
            "\n[[effects]]\nname = \"weak-rotor\"\nloss_{rotor} = {{ value = 0.1, unit = \"1\", source = \"test\", \
             uncertainty = \"exact\" }}\n"
        )
    };
    assert!(airframe(&weak(4), "").is_ok());
    assert_refused(&weak(5), 4, &["loss_5", "a rotor of the vehicle, which has 4"]);
    let hexacopter = Vehicle::load(Path::new("../vehicles/dji-f550.toml")).unwrap();
    for (rotor, is_there) in [(6, true), (7, false)] {
        let scene = Scene::parse(&format!("name = \"test\"\n{}", weak(rotor)), "here.toml").unwrap();
        assert_eq!(Airframe::from_files(hexacopter.clone(), &scene.effects).is_ok(), is_there, "{rotor}");
    }
}
