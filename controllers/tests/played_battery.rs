//! The voltage of a flight drives the motors of a plant: from the output `battery` of a player to the input of that name.
#![allow(non_snake_case, reason = "V is the volt")]

use component::Harness;
use component::context::NodeContext;
use component::messages::Battery;
use controllers::player::Player;
use inputs::InputFiles;
use plant::node::{Inputs, Plant};
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;
use vehicles::Vehicle;

/// A Hummingbird with a battery of 12.6 V, which sags by itself if no voltage is measured.
const SAGGING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird-battery.toml");
/// The same with another exponent.
const VEHICLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird-of-this-test.toml");
const NOMINAL_V: f64 = 12.6;
/// Part of the nominal voltage in the second half of the flight.
const PART: f64 = 0.9;
/// Ticks of 1 ms in each half: the rotors settle in a small part of one.
const HALF: u32 = 2000;

/// The files of a vehicle whose motors follow the voltage by this exponent, and of a flight that hovers by the declared map.
fn files(exponent: f64) -> InputFiles {
    let sagging = std::fs::read_to_string(SAGGING).unwrap();
    let exponent = format!(
        "exponent = {{ value = {exponent}, unit = \"1\", source = \"this test\", uncertainty = \"exact\" }}\n"
    );
    let hover = Vehicle::load(Path::new(SAGGING)).unwrap().hover_command();
    let mut flight = String::from("t,m1,m2,m3,m4,px,py,pz,vx,vy,vz,qx,qy,qz,qw,wx,wy,wz,vbat\n");
    for row in 0..=2 * HALF / 10 {
        let part = if row < HALF / 10 { 1.0 } else { PART };
        let (time_s, battery_V) = (f64::from(row) * 0.01, part * NOMINAL_V);
        writeln!(flight, "{time_s},{hover},{hover},{hover},{hover},0,0,1,0,0,0,0,0,0,1,0,0,0,{battery_V}")
            .unwrap();
    }
    let files = InputFiles::default();
    files.keep(Path::new(VEHICLE), format!("{sagging}{exponent}").into_bytes());
    files.keep(Path::new("flight.csv"), flight.into_bytes());
    files
}

fn player(files: &InputFiles, has_voltage: bool) -> Harness<Player> {
    let mut columns = json!({
        "time": { "columns": ["t"], "unit": "s" },
        "command": { "columns": ["m1", "m2", "m3", "m4"], "unit": "count" },
        "position": { "columns": ["px", "py", "pz"], "unit": "m" },
        "velocity": { "columns": ["vx", "vy", "vz"], "unit": "m/s" },
        "attitude": { "columns": ["qx", "qy", "qz", "qw"], "unit": "1" },
        "angular_velocity": { "columns": ["wx", "wy", "wz"], "unit": "rad/s" },
    });
    if has_voltage {
        columns["battery_voltage"] = json!({ "columns": ["vbat"], "unit": "V" });
    }
    let parameters = json!({ "data": "flight.csv", "columns": columns });
    let mut context = NodeContext::new("player", &[]);
    context.files = files.clone();
    Harness::in_context(diagnostics::read(&parameters).unwrap(), &context).unwrap()
}

fn plant(files: &InputFiles) -> Harness<Plant> {
    let parameters = json!({ "vehicle": VEHICLE, "initial_position_m": [0.0, 0.0, 1.0] });
    let mut context = NodeContext::new("plant", &["command", "battery"]);
    context.files = files.clone();
    Harness::in_context(diagnostics::read(&parameters).unwrap(), &context).unwrap()
}

/// Thrust over mass at the end of each half, in m/s^2: the battery that the plant sees is made by `battery` of the one that the player sends.
fn thrusts(
    exponent: f64,
    has_voltage: bool,
    battery: impl Fn(Option<Battery>) -> Option<Battery>,
) -> [f64; 2] {
    let files = files(exponent);
    let (mut player, mut plant) = (player(&files, has_voltage), plant(&files));
    let mut fly = |ticks: u32| {
        let mut thrust_m_s2 = f64::NAN;
        for _ in 0..ticks {
            let sent = player.step(()).unwrap();
            let battery = battery(sent.battery);
            let inputs =
                Inputs { command: &sent.command, measured: None, battery: battery.as_ref(), traffic: None };
            thrust_m_s2 = plant.step(inputs).unwrap().state.specific_force.z;
        }
        thrust_m_s2
    };
    // The row before the voltage falls is the last one of the first half.
    [fly(HALF - 10), fly(HALF)]
}

#[test]
fn thrust_falls_with_the_played_voltage_by_the_exponent() {
    let gravity_m_s2 = Vehicle::load(Path::new(SAGGING)).unwrap().gravity_m_s2;
    for exponent in [0.0, 0.5, 1.0, 1.5] {
        let [full, low] = thrusts(exponent, true, |sent| sent);
        assert!((full / gravity_m_s2 - 1.0).abs() < 1e-6, "{exponent}: {full}, expected a hover");
        // Speed by the exponent, thrust by the square of the speed.
        let expected = libm::pow(PART, 2.0 * exponent);
        assert!((low / full - expected).abs() < 1e-6, "{exponent}: {}, expected {expected}", low / full);
    }
}

/// A flight without a voltage has a battery that is not valid: the plant's own sags under load.
#[test]
fn a_flight_without_a_voltage_leaves_the_battery_to_the_plant() {
    let played = thrusts(1.0, false, |sent| sent);
    assert_eq!(played, thrusts(1.0, true, |_| None), "as if the port were not connected");
    let [full, _] = thrusts(1.0, true, |sent| sent);
    assert!(played[0] < 0.99 * full && played[1] < played[0], "{played:?}, {full} at 12.6 V");
}
