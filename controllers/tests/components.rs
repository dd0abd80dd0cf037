//! Parameters that the controllers and the pilot accept and refuse before a start, and that the documentation
//! says so.

use component::Registration;
use component::context::NodeContext;
use controllers::cascade::CascadeLaw;
use controllers::controller::Controller;
use controllers::pid::PidLaw;
use controllers::pilot::Pilot;
use controllers::position_hold::PositionHold;
use controllers::velocity::VelocityLaw;
use controllers::wall_follow::WallFollowLaw;
use controllers::wall_follow_thesis::WallFollowThesisLaw;
use controllers::wall_stop::WallStopLaw;
use controllers::wall_stop_thesis::WallStopThesisLaw;
use serde_json::{Value, json};

const VEHICLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");

fn gains(name: &str) -> String {
    format!("{}/gains/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Each component with parameters that it accepts, those without gains last.
fn accepted() -> [(Registration, Value); 9] {
    [
        (Registration::of::<Controller<PidLaw>>(), json!({ "vehicle": VEHICLE })),
        (Registration::of::<Controller<CascadeLaw>>(), json!({ "vehicle": VEHICLE })),
        (Registration::of::<Controller<VelocityLaw>>(), json!({ "vehicle": VEHICLE, "altitude_m": 1.5 })),
        (Registration::of::<Controller<WallStopLaw>>(), json!({ "vehicle": VEHICLE, "altitude_m": 1.5 })),
        (
            Registration::of::<Controller<WallFollowLaw>>(),
            json!({ "vehicle": VEHICLE, "altitude_m": 1.5, "mode": "constant" }),
        ),
        (
            Registration::of::<Controller<WallStopThesisLaw>>(),
            json!({ "vehicle": VEHICLE, "altitude_m": 1.5 }),
        ),
        (
            Registration::of::<Controller<WallFollowThesisLaw>>(),
            json!({ "vehicle": VEHICLE, "altitude_m": 1.5, "mode": "varying" }),
        ),
        (Registration::of::<Pilot>(), json!({ "initial_altitude_m": 1.0 })),
        (Registration::of::<PositionHold>(), json!({})),
    ]
}

/// `parameters` with `key` set.
fn with(parameters: &Value, key: &str, value: Value) -> Value {
    let mut parameters = parameters.clone();
    parameters[key] = value;
    parameters
}

#[test]
fn every_kind_flies_with_its_own_gains_file() {
    for (kind, parameters) in accepted() {
        kind.check(&parameters, &NodeContext::new("node", &[])).unwrap();
        if !["pilot", "position-hold"].contains(&kind.name) {
            kind.check(&with(&parameters, "gains", json!(gains(kind.name))), &NodeContext::new("node", &[]))
                .unwrap();
        }
    }
    let [(pid, parameters), ..] = accepted();
    pid.check(&with(&parameters, "gains", json!(gains("pid-thesis"))), &NodeContext::new("node", &[]))
        .unwrap();
}

#[test]
fn the_gains_file_of_another_law_is_refused_by_name_and_place() {
    for (kind, parameters) in accepted().into_iter().take(7) {
        let other = if kind.name == "cascade" { "pid" } else { "cascade" };
        let outcome =
            kind.check(&with(&parameters, "gains", json!(gains(other))), &NodeContext::new("node", &[]));
        // A velocity file may hold the cascade's tables alone.
        if kind.name != "velocity" {
            let error = outcome.unwrap_err().to_string();
            assert!(
                error.contains(&format!("{other}.toml:")) && error.contains('`'),
                "{}: {error}",
                kind.name
            );
        }
    }
}

#[test]
fn impossible_parameters_are_refused_by_their_key() {
    let [
        _,
        _,
        (velocity, fly),
        (wall_stop, stop),
        (wall_follow, follow),
        by_pitch,
        by_tilt,
        (pilot, hold),
        _,
    ] = accepted();
    let room = with(&follow, "room_m", json!([10.0, 10.0]));
    let cases = [
        (velocity, with(&fly, "velocity_m_s", json!([1.0])), "velocity_m_s"),
        (wall_stop, with(&stop, "cruise_speed_m_s", json!(0.0)), "cruise_speed_m_s"),
        (wall_stop, with(&stop, "cruise_speed_m_s", json!(9.0)), "cruise_speed_m_s"),
        (wall_stop, with(&stop, "distance_m", json!(-3.0)), "distance_m"),
        (wall_stop, with(&stop, "altitude_m", Value::Null), "altitude_m"),
        (wall_stop, with(&stop, "altitude_m", json!(-1.5)), "`altitude_m` must be a finite number above 0,"),
        (
            wall_follow,
            with(&follow, "altitude_m", json!(0.0)),
            "`altitude_m` must be a finite number above 0,",
        ),
        (wall_follow, with(&follow, "mode", json!("fast")), "mode"),
        (wall_follow, with(&follow, "start_state", json!(6)), "start_state"),
        (wall_follow, with(&follow, "speed_m_s", json!(-1.0)), "speed_m_s"),
        (wall_follow, with(&follow, "ahead_min_m", json!(1.0)), "ahead_min_m"),
        (wall_follow, with(&follow, "room_m", json!([10.0, 5.0])), "room_m"),
        (wall_follow, with(&room, "mode", json!("varying")), "room_m"),
        (wall_follow, with(&room, "start_in_room_m", json!([1.0, 11.0])), "start_in_room_m"),
        (by_pitch.0, with(&by_pitch.1, "pitch_deg", json!(0.0)), "pitch_deg"),
        (by_pitch.0, with(&by_pitch.1, "cruise_speed_m_s", json!(1.0)), "cruise_speed_m_s"),
        (by_tilt.0, with(&by_tilt.1, "tilt_deg", json!(45.0)), "tilt_deg"),
        (by_tilt.0, with(&by_tilt.1, "speed_m_s", json!(0.5)), "`speed_m_s` has a meaning only in the mode"),
        (by_tilt.0, with(&by_tilt.1, "start_state", json!(0)), "start_state"),
        (pilot, with(&hold, "data", json!("no-such.csv")), "no-such.csv"),
    ];
    for (kind, parameters, key) in cases {
        let error = kind.check(&parameters, &NodeContext::new("node", &[])).unwrap_err().to_string();
        assert!(error.contains(key), "{} with {parameters}: {error}", kind.name);
    }
    // Both faults of a room.
    let both = with(&with(&room, "mode", json!("varying")), "start_in_room_m", json!([1.0, 11.0]));
    let errors = wall_follow.check(&both, &NodeContext::new("node", &[])).unwrap_err().into_each();
    assert_eq!(errors.len(), 2, "{errors:?}");
}

#[test]
fn a_velocity_comes_from_a_reference_or_from_parameters_and_never_from_both() {
    let [_, _, (velocity, fly), ..] = accepted();
    let vehicle_only = json!({ "vehicle": VEHICLE });
    velocity.check(&vehicle_only, &NodeContext::new("node", &["estimate", "reference"])).unwrap();
    let error =
        velocity.check(&vehicle_only, &NodeContext::new("node", &["estimate"])).unwrap_err().to_string();
    assert!(error.starts_with("missing key `altitude_m`"), "{error}");
    let error =
        velocity.check(&fly, &NodeContext::new("node", &["estimate", "reference"])).unwrap_err().to_string();
    assert!(error.contains("`altitude_m`") && error.contains("`reference`"), "{error}");
}

/// The parameters that a kind's refusal of an unknown one names as known.
fn known(kind: &Registration, parameters: &Value) -> Vec<String> {
    let error = kind
        .check(&with(parameters, "unknown_key", json!(1)), &NodeContext::new("node", &[]))
        .unwrap_err()
        .to_string();
    let list = error.split("unknown key `unknown_key`").nth(1).unwrap_or_else(|| panic!("{error}"));
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn a_refusal_names_the_declared_parameters() {
    for (kind, parameters) in accepted() {
        let declared: Vec<&str> = kind.parameters.iter().map(|parameter| parameter.name).collect();
        assert_eq!(known(&kind, &parameters), declared, "{}", kind.name);
    }
}
