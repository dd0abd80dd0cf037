//! Refused: parameters, vehicles, rates and other numbers of a manifest, and settings.

use crate::refusals::{good, refused, refused_args, refused_setting, refused_with};
use crate::support::{Place, repository};
use std::fs;

#[test]
fn set_points_that_cannot_be_flown() {
    let with = |from: &str, to: &str| refused(from, to);
    let ended = with("unit = \"m\"", "unit = §\"ft\"");
    ended.says(&["process `pilot`: `set_points.0.unit` must be \"m\"", "found \"ft\""]);
    with("\"altitude\"", "§\"height\"").says(&["`set_points.0.channel` must be", "found \"height\""]);
    with("kind = \"step\"", "kind = §\"stp\"").says(&["`set_points.0.kind`", "did you mean `step`?"]);
    with("\"altitude\"", "§\"altitud\"").says(&["`set_points.0.channel`", "did you mean `altitude`?"]);
    with("at_s = 0.1, to", "at_s = 0.1, §too")
        .says(&["unknown key `set_points.0.too`", "did you mean `to`?"]);
    with(
        "[{ kind = \"step\", channel = \"altitude\", at_s = 0.1, to = 1.5, ",
        "[§{ kind = \"step\", channel = \"altitude\", at_s = 0.1, ",
    )
    .says(&["`set_points.0.to` must be a finite number in a step, found nothing"]);
}

#[test]
fn a_file_and_a_parameter_that_say_the_same() {
    let gains = repository("controllers/gains/pid.toml");
    let with = |parameter: &str| {
        refused("kind = \"pid\"", &format!("kind = \"pid\"\ngains = \"{gains}\"\n{parameter}"))
    };
    let ended = with("parameters.§gains = \"pid.toml\"");
    ended.says(&["`controller` has `gains` twice", "leave one of them out"]);
    // A table replaces values of the file, and is read as such.
    with("parameters.gains.§rol = 1").says(&["unknown key `gains.rol`", "did you mean `roll`?"]);
    with("parameters.gains.roll = §1").says(&["`gains.roll`"]);
}

#[test]
fn a_parameter_that_is_unknown() {
    let ended = refused("initial_altitude_m", "§initial_altitude_ft");
    ended.says(&["process `pilot`", "unknown key `initial_altitude_ft`", "initial_altitude_m"]);
}

#[test]
fn a_parameter_whose_name_has_only_begun() {
    let with = |kind: &str, parameter: &str| {
        let kind = format!("kind = \"{kind}\"");
        refused(&kind, &format!("{kind}\nparameters.§{parameter} = 1"))
    };
    let noise = "did you mean `accelerometer_noise_density_m_s2_sqrt_hz`?";
    with("imu", "accelerometer_noise").says(&["unknown key `accelerometer_noise`", noise]);
    let noises = ["did you mean `position_noise_m` or `attitude_noise_deg`?"];
    with("mocap", "nois").says(&noises);
}

#[test]
fn a_parameter_of_another_type_is_named() {
    let place = Place::new();
    let path = place.write("type.toml", good().replace("altitude_m = 1.0", "altitude_m = \"high\""));
    let ended = refused_args(&["run", &path], &path);
    ended.says(&["process `pilot`", "initial_altitude_m", "\"high\"", "must be a number, found the text"]);
    let path = place.write("unit.toml", good().replace("altitude_m = 1.0", "altitude_m = \"1.5 m\""));
    refused_args(&["run", &path], &path).says(&["process `pilot`", "write `initial_altitude_m = 1.5`"]);
}

#[test]
fn a_parameter_that_the_recorder_does_not_have() {
    let ended = refused_with("\n[process.recorder.parameters]\n§compression = \"none\"\n");
    ended.says(&["recorder", "no parameter `compression`"]);
}

#[test]
fn a_vehicle_file_that_is_not_there() {
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let vehicle = place.path("none.toml");
    let ended = refused_setting(&manifest, &[&format!("process.plant.vehicle={vehicle}")]);
    ended.says(&["process `plant`", &vehicle, "cannot read this file", "check the path"]);
    let start = "here, a relative path starts at the folder of the manifest";
    refused_setting(&manifest, &["process.plant.vehicle=none.toml"]).says(&["check the path", start]);
    // Programs find it in the same words.
    let set = format!("process.plant.vehicle={vehicle}");
    let json = place.call(&["check", &manifest, "--set", &set, "--json"]).with_code(2).json();
    let message = json["faults"][0]["message"].as_str().unwrap();
    assert!(message.contains("cannot read this file") && !message.contains("os error"), "{message}");
}

/// A path goes on from the manifest's folder; a message shows where it leads.
#[test]
fn a_path_is_told_without_ways_down_and_up_again() {
    let place = Place::new();
    fs::create_dir(place.path("manifests")).unwrap();
    let vehicle = repository("vehicles/hummingbird.toml");
    let text = good().replace(&vehicle, "../none.toml");
    let manifest = place.write("manifests/lost.toml", text);
    let ended = place.call(&["check", &manifest]).with_code(2);
    ended.says(&[&place.path("none.toml")]);
    assert!(!ended.error.contains("manifests/.."), "{ended}");
}

/// An IMU measures whenever it computes.
#[test]
fn a_rate_of_a_component_that_has_none_leads_to_its_period() {
    let ended = refused("kind = \"imu\"", "kind = \"imu\"\nparameters = { §rate_hz = 500.0 }");
    ended.says(&[
        "unknown key `rate_hz`",
        "help: the rate of `imu` follows from `period_ticks` in [process.imu]",
    ]);
}

#[test]
fn a_vehicle_file_with_a_unit_of_another_quantity() {
    let place = Place::new();
    let text = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    let line = text.lines().position(|line| line.starts_with("mass =")).unwrap() + 1;
    let vehicle = place.write("stone.toml", text.replacen("unit = \"kg\"", "unit = \"stone\"", 1));
    let manifest = repository("manifests/hover.toml");
    let ended = refused_setting(&manifest, &[&format!("process.plant.vehicle={vehicle}")]);
    ended.says(&["process `plant`", &format!("{vehicle}:{line}:"), "body.mass", "stone", "kg"]);
}

#[test]
fn a_run_of_no_length() {
    let with = |duration: &str| refused("duration_s = 0.1", &format!("duration_s = §{duration}"));
    with("0").says(&["`duration_s` is 0 s, which is 0 ticks", "between 1 and"]);
    with("-1.0").says(&["`duration_s` is -1 s"]);
    with("nan").says(&["`run.duration_s` is nan, expected a finite number"]);
    with("1e9").says(&["`duration_s` is 1000000000 s"]);
    with("\"8 s\"").says(&["found the text \"8 s\"", "unit is in the key's name: write `duration_s = 8.0`"]);
    with("\"800 ms\"").says(&["write `duration_s = 0.8`"]);
    with("\"long\"").says(&["`run.duration_s` must be a number, found the text \"long\""]);
}

#[test]
fn a_rate_whose_tick_is_no_whole_number_of_nanoseconds() {
    let with = |rate: &str| refused("duration_s = 0.1", &format!("duration_s = 0.1\nrate_hz = §{rate}"));
    with("300").says(&["`rate_hz` is 300", "divisor of 1 000 000 000, here 256 or 320"]);
    with("3000").says(&["`rate_hz` is 3000", "here 2560 or 3125"]);
    with("0").says(&["`rate_hz` is 0", "here 1\n"]);
    with("2000000").says(&["`rate_hz` is 2000000", "here 1000000\n"]);
    with("-5").says(&["-5"]);
}

#[test]
fn a_window_of_no_tick_or_of_too_many() {
    let with = |window: &str| refused("window_ticks = 64", &format!("window_ticks = §{window}"));
    with("0").says(&["`window_ticks` is 0", "1 to 4096 ticks"]);
    with("5000").says(&["`window_ticks` is 5000"]);
}

#[test]
fn a_window_argument_is_not_blamed_on_the_manifest() {
    let manifest = repository("manifests/hover.toml");
    let ended = Place::new().call(&["run", &manifest, "--window", "0"]).with_code(2);
    ended.says(&["--window", "0 is not in 1..=4096"]);
    assert!(!ended.error.contains("hover.toml:1:1"), "a place that has nothing to do with it: {ended}");
}

#[test]
fn a_pace_that_is_none() {
    let manifest = repository("manifests/hover.toml");
    for pace in ["fast", "0", "-1", "nan", "inf"] {
        let ended = Place::new().call(&["run", &manifest, &format!("--pace={pace}")]).with_code(2);
        ended.says(&[&format!("`{pace}` is not a pace"), "free, realtime, or a factor"]);
    }
    refused("window_ticks = 64", "pace = §\"slow\"").says(&["`slow` is not a pace", "free, realtime"]);
}

#[test]
fn an_override_that_is_none() {
    let manifest = repository("manifests/hover.toml");
    let set = |text: &str| refused_setting(&manifest, &[text]);
    set("run.seed").says(&["--set run.seed: expected KEY=VALUE", "run.seed=3"]);
    set("run.seed.low=1").says(&[
        "--set run.seed.low=1",
        "`seed` is not a table",
        "docs/manifest-reference.md",
    ]);
    set("run.seeed=1").says(&["unknown key `run.seeed`", "did you mean `seed`?"]);
    set("run.seed=one").says(&["\"one\""]);
    set("process.plnat.cpu=1").says(&["there is no process `plnat`", "did you mean `plant`?"]);
    set("process.h1/plant.cpu=1").says(&["there is no process `h1/plant`"]);
    set("=1").says(&["expected keys with dots between them"]);
    set("pass.9.max=1").says(&["`pass` is a list of 6, and `9` is none of them", "numbered from 0"]);
    for (key, help) in [
        ("process.plant.vehicle.body.centre[0]", "write `centre.0`"),
        ("process.plant.parameters.initial_position_m[2]", "write `initial_position_m.2`"),
        ("pass[0].max", "write `pass.0`"),
    ] {
        set(&format!("{key}=1")).says(&["an element of a list is a key of its own", help]);
    }
    set("include=[]").says(&["unknown key `include`"]);
    set("process.plant.vehicle.effects.winds.x=3")
        .says(&["the vehicle file lists no effect `winds`", "did you mean `wind`?"]);
}

#[test]
fn an_override_in_a_file_is_told_with_its_text_and_the_file_that_exists() {
    let place = Place::new();
    let (manifest, vehicle) = with_vehicle(&place, "[motor]", "[motor]");
    for (set, says) in [
        ("body.mas=0.5", "unknown key `body.mas`"),
        ("body.mass=-1", "`body.mass` must be a finite number above 0, found -1"),
        ("body.mass=heavy", "`body.mass.value` must be"),
        ("body.mass.unit=lb", "`body.mass.unit` must be a unit of mass"),
    ] {
        let set = format!("process.plant.vehicle.{set}");
        let ended = refused_setting(&manifest, &[&set]);
        ended.says(&[says, "by process `plant`"]);
        assert!(!ended.error.contains("@plant"), "{ended}");
    }
    // A fault at another key of the file, which has a line.
    let set = "process.plant.vehicle.command.min=300";
    let ended = place.call(&["check", &manifest, "--set", set]).with_code(2);
    ended.says(&[&format!("error: {vehicle}:"), "`command.max` must be", &format!(", with --set {set}")]);
    assert!(!ended.error.contains("read with"), "{ended}");
    assert!(!ended.error.contains("@plant"), "{ended}");
}

#[test]
fn a_vehicle_that_contradicts_itself_by_an_override_is_told_with_the_override_and_lines_of_the_file_that_exists()
 {
    let place = Place::new();
    let (manifest, vehicle) = with_vehicle(&place, "[motor]", "[motor]");
    let text = fs::read_to_string(&vehicle).unwrap();
    let gravity = text.lines().position(|line| line.starts_with("gravity")).unwrap() + 1;
    // Refused, and with a warning.
    for (mass, says) in [("0.0075", "cannot come down"), ("2.0", "can hardly climb or tilt")] {
        let set = format!("process.plant.vehicle.body.mass={mass}");
        let ended = place.call(&["check", &manifest, "--set", &set]);
        ended
            .says(&[says, &format!("look at --set {set}: `body.mass`, {vehicle}:{gravity}: `body.gravity`")]);
        assert!(!ended.error.contains("@plant"), "{ended}");
    }
}

/// Writes the good manifest with another vehicle into `place`: the Hummingbird with `from` replaced by `to`.
fn with_vehicle(place: &Place, from: &str, to: &str) -> (String, String) {
    let text = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    assert_eq!(text.matches(from).count(), 1, "{from} stands once in the vehicle file");
    let vehicle = place.write("vehicle.toml", text.replace(from, to));
    let manifest = good().replace(&repository("vehicles/hummingbird.toml"), &vehicle);
    (place.write("vehicle-manifest.toml", manifest), vehicle)
}

#[test]
fn a_vehicle_with_a_number_that_none_has_is_refused_with_its_file_line_and_key() {
    let cases = [
        (
            "{ value = 8600, unit = \"rpm\"",
            "{ value = 1e308, unit = \"rpm\"",
            "command.speed_at_max",
            "1e308",
        ),
        ("{ value = 9.81,", "{ value = 9e300,", "body.gravity", "9e300"),
        ("{ value = 9.81,", "{ value = -9.81,", "body.gravity", "-9.81"),
        ("{ value = 0.480,", "{ value = 4.8e-300,", "body.mass", "4.8e-300"),
        ("{ value = 7.6184e-8,", "{ value = inf,", "rotor.thrust_coefficient", "inf"),
        ("{ value = [0.17, 0, 0]", "{ value = [0.17, 1e200, 0]", "rotors.0.position", "1e200"),
    ];
    for (from, to, key, found) in cases {
        let place = Place::new();
        let (manifest, vehicle) = with_vehicle(&place, from, to);
        let number = if found == "1e308" { "1.047" } else { found };
        // The line of the vehicle file, and the manifest that names it.
        let ended = refused_args(&["run", &manifest], &vehicle);
        ended.says(&[&format!("`{key}"), number, &format!("named in {manifest}:"), "by process `"]);
        let found = place.call(&["run", &manifest, "--json"]).with_code(2).json();
        let fault = &found["faults"][0];
        assert!(
            fault["file"] == vehicle.as_str() && fault["key"].as_str().unwrap().starts_with(key),
            "{fault}"
        );
        let told = format!("named in {manifest}:{}:", fault["named_in"]["line"]);
        assert!(ended.error.contains(&format!("error: {vehicle}:{}:", fault["line"])), "{fault}");
        assert!(ended.error.contains(&told), "{fault}");
    }
}

#[test]
fn a_fault_of_a_file_that_two_processes_read_is_told_once_with_both() {
    let place = Place::new();
    let (manifest, vehicle) = with_vehicle(&place, "[motor]", "[moter]");
    let ended = refused_args(&["run", &manifest], &vehicle);
    ended.says(&[
        "unknown key `moter`",
        "did you mean `motor`?",
        "by process `plant`, and in",
        "by process `controller`",
    ]);
    assert_eq!(ended.error.matches("moter`").count(), 1, "{ended}");
    assert!(!ended.error.contains("missing key"), "{ended}");
    let found = place.call(&["run", &manifest, "--json"]).with_code(2).json();
    assert_eq!(found["faults"].as_array().unwrap().len(), 1, "{found}");
    let fault = &found["faults"][0];
    assert_eq!(fault["named_in"]["component"], "process `plant`", "{fault}");
    assert_eq!(fault["also_named_in"][0]["component"], "process `controller`", "{fault}");
}

#[test]
fn a_vehicle_that_its_rotors_do_not_carry_is_refused_and_one_they_hardly_carry_is_told() {
    let place = Place::new();
    let (manifest, vehicle) = with_vehicle(&place, "{ value = 0.480,", "{ value = 480,");
    let ended = refused_args(&["run", &manifest], &manifest);
    ended.says(&[
        "process `plant`",
        "cannot fly",
        "weighs 4708.8 N with 480 kg, the unit of the file",
        "thrust to weight of 0.0047",
        &format!("{vehicle}:21: `body.mass`"),
    ]);
    let (manifest, _) = with_vehicle(&place, "{ value = 0.480,", "{ value = 2.0,");
    let ended = place.call(&["run", &manifest, "--json"]).with_code(0);
    ended.says(&["warning: ", "process `plant`", "can hardly climb or tilt"]);
    let warnings = ended.json()["warnings"].clone();
    let told = warnings.as_array().unwrap().iter().find(|warning| {
        warning["message"].as_str().unwrap().contains("can hardly climb")
            && warning["line"].as_u64().is_some()
            && warning["file"].as_str() == Some(&manifest)
    });
    assert!(told.is_some(), "{warnings}");
    let ended = place.call(&["check", &manifest, "--json"]).with_code(0);
    ended.says(&["can hardly climb or tilt"]);
    assert_eq!(ended.json()["warnings"], warnings);
}

#[test]
fn a_rate_at_which_a_sensor_cannot_measure_or_a_plant_cannot_move() {
    let sensor = "[process.rpm]\nkind = \"rpm\"\ninputs.state = \"/plant/state\"\n";
    let text = good().replace("duration_s = 0.1", "duration_s = 10\nrate_hz = 10");
    let text =
        text.replace("[process.imu]", &format!("{sensor}[process.imu]")).replace("period_ticks = 5\n", "");
    let place = Place::new();
    let path = place.write("slow.toml", &text);
    // Motion capture at 100 Hz comes first.
    refused_args(&["check", &path], &path)
        .says(&["process `mocap`", "`rate_hz` is 100 Hz, expected at most 10 Hz"]);
    let path = place
        .write("slow.toml", text.replace("kind = \"mocap\"", "kind = \"mocap\"\nparameters.rate_hz = 5"));
    let ended = refused_args(&["check", &path], &path);
    ended.says(&["process `rpm`", "`rate_hz` is 200 Hz, expected at most 10 Hz", "run.rate_hz = 10"]);
    let text = text.replace("rate_hz = 10", "rate_hz = 2").replace(sensor, "");
    let path = place
        .write("slow.toml", text.replace("kind = \"mocap\"", "kind = \"mocap\"\nparameters.rate_hz = 1"));
    refused_args(&["check", &path], &path).says(&["process `plant`", "the integration diverges"]);
}

#[test]
fn a_number_that_is_none_anywhere_is_refused_where_it_stands() {
    let ended = refused("initial_altitude_m = 1.0", "initial_altitude_m = §nan");
    ended.says(&["`process.pilot.parameters.initial_altitude_m` is nan, expected a finite number"]);
    refused("70, 70, 70, 70", "70, §inf, 70, 70")
        .says(&["`process.plant.inputs.command.initial.command.1` is inf"]);
    let ended = refused("initial_altitude_m = 1.0", "§initial_altitude_m = 1e300");
    ended.says(&["`initial_altitude_m` is 1e300 m, expected at most 1e7 m in size"]);
    let manifest = repository("manifests/hover.toml");
    refused_setting(&manifest, &["pass.0.max=nan"]).says(&["`pass.0.max` is nan"]);
}

#[test]
fn a_period_that_overflows_the_count_of_ticks() {
    let ended = refused("period_ticks = 5", "period_ticks = §4294967295");
    ended.says(&["`period_ticks` of `mocap` is 4294967295, and the run has 100 ticks", "32 bits"]);
}

/// In the unit of the file, as the number that was found.
#[test]
fn the_bounds_of_an_effect_are_told_in_the_unit_of_the_file() {
    let place = Place::new();
    let vehicle = format!("process.plant.vehicle={}", repository("vehicles/hummingbird-uncertain.toml"));
    let delay = "process.plant.vehicle.effects.command-delay.delay=1000";
    let args = ["check", &repository("manifests/hover.toml"), "--set", &vehicle, "--set", delay];
    place.call(&args).with_code(2).says(&["must be 0 to 500 ms, found 1000 ms"]);
}

/// Faults of every stage, from the file's keys to its conditions, in the order of their lines.
#[test]
fn a_check_tells_the_faults_of_all_stages_at_once() {
    let place = Place::new();
    let pass = "\n[[pass]]\nname = \"a\"\ntopic = \"/plant/stat\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 2.0\n";
    let text = good()
        .replace("window_ticks = 64", "windo_ticks = 64")
        .replace("inputs.imu = \"/imu/imu\"", "inputs.imu = \"/imu/im\"")
        .replace("initial_altitude_m = 1.0", "initial_altitude_m = \"high\"");
    let manifest = place.write("faulty.toml", format!("{text}{pass}"));
    let found = place.call(&["check", &manifest, "--json"]).with_code(2).json();
    let faults = found["faults"].as_array().unwrap();
    let lines: Vec<u64> = faults.iter().map(|fault| fault["line"].as_u64().unwrap()).collect();
    assert!(lines.len() == 4 && lines.is_sorted(), "{found}");
    let keys = ["windo_ticks", "/imu/im", "initial_altitude_m", "/plant/stat"];
    for (fault, key) in faults.iter().zip(keys) {
        assert!(fault["message"].as_str().unwrap().contains(key), "{fault}");
    }
    let ended = place.call(&["check", &manifest]).with_code(2);
    assert_eq!(ended.error.matches("error: ").count(), 4, "{ended}");
}
