//! Measured flights flown by vehicles side by side: what errs and by how much, what is shown, what is refused.

use crate::support::{Place, repository};
use serde_json::Value;

/// A vehicle file: the Hummingbird with `effects`.
fn vehicle(place: &Place, name: &str, effects: &str) -> String {
    let base = repository("vehicles/hummingbird.toml");
    place.write(&format!("{name}.toml"), format!("base = {base:?}\nname = {name:?}\n{effects}"))
}

/// The effect of a wrong mass.
fn heavier(part: f64) -> String {
    format!(
        "[[effects]]\nname = \"mass-error\"\n\
         error = {{ value = {part:?}, unit = \"1\", source = \"a test\", uncertainty = \"exact\" }}\n"
    )
}

/// Flies 4 s of a manifest of manifests/identify, with sensors without noise unless `settings` say otherwise, and
/// returns a flights file that reads `channels` from it.
pub fn flown(place: &Place, manifest: &str, settings: &[&str], channels: &str) -> String {
    let (path, recording) =
        (repository(&format!("manifests/identify/{manifest}.toml")), place.path("flown.mcap"));
    let still = [
        "run.duration_s=4.001",
        "process.mocap.parameters.position_noise_m=0.0",
        "process.mocap.parameters.attitude_noise_deg=0.0",
        "process.imu.parameters.gyroscope_noise_density_rad_s_sqrt_hz=0.0",
        "process.imu.parameters.gyroscope_bias_walk_rad_s2_sqrt_hz=0.0",
    ];
    let settings = still.iter().chain(settings).flat_map(|setting| ["--set", setting]);
    let args = ["run", &path, "--json", "--record", &recording].into_iter().chain(settings);
    place.call(&args.collect::<Vec<_>>()).flown();
    let vehicle = repository("vehicles/hummingbird.toml");
    let command = "command = { topic = \"/controller/command\" }\n";
    place.write(
        "flights.toml",
        format!(
            "vehicle = {vehicle:?}\n[channels]\n{command}{channels}\n\
             [[flight]]\nname = \"course\"\nfile = \"flown.mcap\"\nrole = \"test\"\n"
        ),
    )
}

pub const ALL: &str = "position = { topic = \"/mocap/mocap\" }\nattitude = { topic = \"/mocap/mocap\" }\n\
                   angular_velocity = { topic = \"/imu/imu\" }";

fn rms(json: &Value, flight: &str, horizon: &str, channel: &str, vehicle: &str) -> f64 {
    let value = &json["flights"][flight]["horizons"][horizon][channel][vehicle];
    value.as_f64().unwrap_or_else(|| panic!("{flight} {horizon} {channel} {vehicle}: {json}"))
}

#[test]
fn a_flight_is_met_by_the_vehicle_that_flew_it_and_not_by_a_heavier_one() {
    let place = Place::new();
    let flights = flown(&place, "excite", &[], ALL);
    let (vehicle_file, heavy) = (vehicle(&place, "own", ""), vehicle(&place, "heavy", &heavier(0.1)));
    let json = place.call(&["validate", &vehicle_file, &heavy, &flights, "--json"]).with_code(0).json();
    // Timing is exact: what is left is that velocities are derived from positions.
    for (horizon, position_m) in [("0.1", 3e-4), ("0.5", 1e-3), ("1", 3e-3)] {
        assert!(rms(&json, "course", horizon, "position", "own") < position_m, "{json:#}");
        assert!(rms(&json, "course", horizon, "rates", "own") < 1e-4, "{json:#}");
        assert!(rms(&json, "course", horizon, "attitude", "own") < 2e-3, "{json:#}");
    }
    // A tenth more mass lacks a tenth of gravity, less what acts along the tilt: 0.45 m in the first second.
    let error_m = rms(&json, "course", "1", "position", "heavy");
    assert!((0.3..0.7).contains(&error_m), "{error_m}");
    let horizon = &json["flights"]["course"]["horizons"]["0.1"];
    assert_eq!((&horizon["position"]["unit"], &horizon["rates"]["unit"]), (&"m".into(), &"rad/s".into()));
    assert_eq!(horizon["windows"].as_u64().unwrap() + horizon["left_out"].as_u64().unwrap(), 40, "{horizon}");
    assert!(horizon["position"]["ratio"].as_f64().unwrap() > 10.0, "{horizon}");
    assert_eq!(json["flights"]["course"]["role"], "test");
}

#[test]
fn the_table_sets_vehicles_side_by_side_and_progress_goes_to_standard_error() {
    let place = Place::new();
    let flights = flown(&place, "hover-gentle", &[], ALL);
    let (vehicle_file, heavy) = (vehicle(&place, "own", ""), vehicle(&place, "heavy", &heavier(0.1)));
    let kept = place.path("kept");
    let ended = place.call(&["validate", &vehicle_file, &heavy, &flights, "--keep", &kept]).with_code(0);
    ended.prints(&["own", "heavy", "ratio", "position, m", "rates, rad/s", "0.5 s"]);
    ended.says(&["course: 4.0 s flown in"]);
    let quiet = place.call(&["validate", &vehicle_file, &flights, "--quiet"]).with_code(0);
    assert!(quiet.error.is_empty(), "{quiet}");
    // What was kept can be flown again.
    place.call(&["run", &format!("{kept}/course/manifest.toml"), "--json"]).with_code(0);
}

#[test]
fn a_flight_that_has_no_position_shows_rotation_alone() {
    let place = Place::new();
    let rotation = "attitude = { topic = \"/mocap/mocap\" }\nangular_velocity = { topic = \"/imu/imu\" }";
    let flights = flown(&place, "rig-a-riddle", &[], rotation);
    let (declared, truth) =
        (repository("vehicles/hummingbird.toml"), repository("vehicles/hummingbird-on-rig.toml"));
    let json = place.call(&["validate", &declared, &truth, &flights, "--json"]).with_code(0).json();
    let horizon = &json["flights"]["course"]["horizons"]["0.5"];
    assert!(horizon["position"].is_null() && horizon["velocity"].is_null(), "{horizon}");
    assert!(rms(&json, "course", "0.5", "attitude", "hummingbird-on-rig") < 1e-3, "{horizon}");
    assert!(rms(&json, "course", "0.5", "attitude", "hummingbird") > 1.0, "{horizon}");
}

#[test]
fn windows_with_a_gap_are_not_counted_and_said() {
    let place = Place::new();
    let lossy = ["process.mocap.parameters.dropout=0.2", "process.mocap.parameters.dropout_mean_s=0.2"];
    let flights = flown(&place, "hover-gentle", &lossy, ALL);
    let vehicle_file = repository("vehicles/hummingbird.toml");
    let ended = place.call(&["validate", &vehicle_file, &flights]).with_code(0);
    ended.prints(&["course: not counted, at the start, at gaps"]);
    let json = place.call(&["validate", &vehicle_file, &flights, "--json"]).with_code(0).json();
    // The first five begin where the rotors' speeds are not known, and the last ends where a velocity is one-sided.
    assert!(json["flights"]["course"]["horizons"]["0.1"]["left_out"].as_u64().unwrap() > 5, "{json:#}");
}

/// Motors in another order, commands that the logger held and gaps are told as `identify` tells them.
#[test]
fn notes_of_the_reader_and_faults_stand_below_the_table() {
    let place = Place::new();
    let flights = flown(&place, "excite", &[], ALL);
    let vehicle_file = repository("vehicles/hummingbird.toml");
    let text = std::fs::read_to_string(&flights).unwrap();
    let topic = "command = { topic = \"/controller/command\"";
    let fields = ["2", "1", "0", "3"].map(|rotor| format!("\"command[{rotor}]\"")).join(", ");
    let swapped = text.replace(topic, &format!("{topic}, fields = [{fields}], unit = \"count\""));
    let swapped = place.write("swapped.toml", swapped);
    let args = ["validate", &vehicle_file, &swapped, "--steps-ahead", "5"];
    place.call(&args).with_code(0).prints(&["note: course: command.1+3 (swapped)", "the order 3, 2, 1, 4"]);
    let json = place.call(&[&args[..], &["--json"]].concat()).with_code(0).json();
    let notes = json["flights"]["course"]["notes"].as_array().unwrap_or_else(|| panic!("{json:#}"));
    assert!(notes.iter().any(|note| note.as_str().unwrap().contains("command.1+3 (swapped)")), "{json:#}");
    // The sum over one step is the error after it.
    for (steps, has_sum) in [("1", false), ("5", true)] {
        let table = place.call(&["validate", &vehicle_file, &flights, "--steps-ahead", steps]).with_code(0);
        assert_eq!(table.output.contains(" sum "), has_sum, "{table}");
    }
    let sound = place
        .call(&["validate", &vehicle_file, &flights, "--steps-ahead", "5", "--json"])
        .with_code(0)
        .json();
    let notes = sound["flights"]["course"]["notes"].as_array().unwrap();
    assert!(notes.iter().all(|note| !note.as_str().unwrap().contains("swapped")), "{sound:#}");
}

#[test]
fn a_file_that_is_missing_is_named() {
    let place = Place::new();
    let vehicle_file = repository("vehicles/hummingbird.toml");
    let flights = place.write(
        "flights.toml",
        format!(
            "vehicle = {vehicle_file:?}\n[[flight]]\nname = \"a\"\nfile = \"lost.mcap\"\nrole = \"fit\"\n"
        ),
    );
    place.call(&["validate", &vehicle_file, &flights]).with_code(2).says(&["lost.mcap", "flights.toml"]);
    place.call(&["validate", &vehicle_file, &place.path("no.toml")]).with_code(2).says(&["no.toml"]);
    place.call(&["validate", &place.path("nobody.toml"), &flights]).with_code(2);
}

#[test]
fn a_measured_flight_errs_as_its_replay_does() {
    let Some(data) = crate::replay::data() else { return };
    let place = Place::new();
    let vehicle = repository("vehicles/crazyflie-2.1.toml");
    let flights = place.write(
        "flights.toml",
        format!(
            "vehicle = {vehicle:?}\n[channels]\ntime = {{ columns = [\"t\"], unit = \"s\" }}\n\
             command = {{ columns = [\"motor_motor_m1\", \"motor_motor_m2\", \"motor_motor_m3\", \"motor_motor_m4\"], unit = \"count\" }}\n\
             position = {{ columns = [\"px\", \"py\", \"pz\"], unit = \"m\" }}\n\
             velocity = {{ columns = [\"vx\", \"vy\", \"vz\"], unit = \"m/s\" }}\n\
             attitude = {{ columns = [\"qx\", \"qy\", \"qz\", \"qw\"], unit = \"1\" }}\n\
             angular_velocity = {{ columns = [\"imu_gyro_x\", \"imu_gyro_y\", \"imu_gyro_z\"], unit = \"rad/s\" }}\n\
             [[flight]]\nname = \"B3\"\nfile = \"{data}/nanobench/B3_figure8_fast_rep1.csv\"\nrole = \"test\"\n\
             from_s = 6.0\nto_s = 22.0\n"
        ),
    );
    let json = place.call(&["validate", &vehicle, &flights, "--json"]).with_code(0).json();
    // docs/replay.md; the first windows do not count here.
    let expected = [("0.1", 0.043, 0.87, 20.7), ("0.5", 0.86, 4.0, 110.0), ("1", 3.4, 8.0, 120.0)];
    for (horizon, position_m, velocity_m_s, attitude_deg) in expected {
        let near = |channel, expected: f64| {
            let found = rms(&json, "B3", horizon, channel, "crazyflie-2.1");
            assert!((found / expected - 1.0).abs() < 0.08, "{horizon} {channel}: {found}, {expected}");
        };
        near("position", position_m);
        near("velocity", velocity_m_s);
        near("attitude", attitude_deg);
    }
}
