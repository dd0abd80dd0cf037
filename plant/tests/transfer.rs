//! A plant that loads the state of another one amid a flight continues byte for byte, with either backend.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use component::context::NodeContext;
use component::messages::{MotorCommand, PlantState, Traffic};
use component::{Harness, State};
use plant::node::{Inputs, Plant};
use serde_json::{Value, json};

fn repository(file: &str) -> String {
    format!("{}/../{file}", env!("CARGO_MANIFEST_DIR"))
}

/// Raw commands around a hover that climb, sink and turn.
fn commands() -> Vec<MotorCommand> {
    let command = |tick: u32| {
        let swing = 8.0 * libm::sin(f64::from(tick) * 0.02);
        MotorCommand { command: [76.0 + swing, 76.5, 76.0 - swing, 75.5].into(), ..Default::default() }
    };
    (0..3000).map(command).collect()
}

fn plant(parameters: &Value, ports: &[&str]) -> Harness<Plant> {
    let mut all = json!({ "vehicle": repository("vehicles/hummingbird.toml") });
    all.as_object_mut().unwrap().extend(parameters.as_object().unwrap().clone());
    let context = NodeContext::new("plant", ports);
    Harness::in_context(diagnostics::read(&all).unwrap(), &context).unwrap()
}

/// Requires that a transfer leaves no trace, and returns the number of contacts that began before it and in all.
fn require_transfer(parameters: &Value) -> [u32; 2] {
    let commands = commands();
    let inputs = |tick: u32| Inputs {
        command: &commands[tick as usize],
        measured: None,
        battery: None,
        traffic: None,
    };
    Harness::require_transfer(|| plant(parameters, &["command"]), inputs);
    let mut flown = plant(parameters, &["command"]);
    let began: Vec<u32> =
        (0..2000).map(|tick| flown.step(inputs(tick)).unwrap().contact.unwrap().began).collect();
    [began[776], began[1999]]
}

#[test]
fn free_flight_continues_with_every_effect() {
    for vehicle in ["hummingbird-battery.toml", "hummingbird-drag.toml", "hummingbird-on-rig.toml"] {
        let vehicle = repository(&format!("vehicles/{vehicle}"));
        require_transfer(&json!({ "vehicle": vehicle, "initial_position_m": [0.0, 0.0, 1.0] }));
    }
    let gusts = repository("scenes/ground-disturbed.toml");
    require_transfer(&json!({ "scene": gusts, "initial_position_m": [0.0, 0.0, 0.3] }));
}

#[test]
fn a_vehicle_that_hits_the_walls_and_the_floor_continues() {
    let room = repository("scenes/room.toml");
    let start = json!({
        "scene": room, "backend": "rapier", "initial_position_m": [4.2, 0.0, 0.3],
        "initial_velocity_m_s": [1.5, 0.3, -1.0], "initial_yaw_deg": 30.0,
    });
    let [before, all] = require_transfer(&start);
    assert!(before > 0 && all > before, "{before} contacts before the transfer, {all} in all");
}

#[test]
fn free_bodies_joints_and_a_rope_continue() {
    for scene in ["workshop.toml", "slung-load.toml"] {
        let scene = repository(&format!("scenes/{scene}"));
        require_transfer(
            &json!({ "scene": scene, "backend": "rapier", "initial_position_m": [0.0, 0.0, 1.0] }),
        );
    }
}

#[test]
fn a_rig_continues() {
    for scene in ["rig-sliding.toml", "rig-fixed.toml"] {
        require_transfer(&json!({ "scene": repository(&format!("scenes/{scene}")), "backend": "rapier" }));
    }
}

#[test]
fn a_vehicle_among_others_knows_its_place_after_a_transfer() {
    let parameters = json!({ "backend": "rapier", "initial_position_m": [0.0, 0.0, 2.0] });
    let make = || plant(&parameters, &["command", "traffic"]);
    let (commands, mut first) = (commands(), make());
    let mut last = PlantState::default();
    let traffic = |state: &PlantState, tick: u32| {
        let mut traffic = Traffic { count: 2, ..Default::default() };
        (traffic.position[1], traffic.velocity[1]) = (state.position, state.velocity);
        // Another one comes down on it.
        traffic.position[0] = [0.0, 0.0, 2.6 - 0.6e-3 * f64::from(tick)].into();
        traffic.velocity[0] = [0.0, 0.0, -0.6].into();
        traffic
    };
    let fly = |harness: &mut Harness<Plant>, last: &mut PlantState| {
        let seen = traffic(last, harness.tick);
        let command = &commands[harness.tick as usize];
        let sent =
            harness.step(Inputs { command, measured: None, battery: None, traffic: Some(&seen) }).unwrap();
        *last = sent.state;
        sent.contact.unwrap()
    };
    let before = (0..200).map(|_| fly(&mut first, &mut last)).last().unwrap();
    let mut second = make();
    second.state.load(&first.saved()).unwrap();
    second.tick = first.tick;
    let (mut other, mut began) = (last, before.began);
    for tick in 200..1500 {
        let contacts = (fly(&mut first, &mut last), fly(&mut second, &mut other));
        assert!(first.saved() == second.saved(), "another state after tick {tick}: {contacts:?}");
        began = contacts.0.began;
    }
    assert!(began > before.began, "they meet after the transfer");
    assert_eq!(<[f64; 3]>::from(last.position), <[f64; 3]>::from(other.position));
}

#[test]
fn the_state_of_another_backend_scene_or_effect_is_refused() {
    let rapier =
        |scene: &str| json!({ "backend": "rapier", "scene": repository(&format!("scenes/{scene}")) });
    // As many things, and therefore as many bytes.
    let (near, mut far) =
        (plant(&rapier("rig-fixed-near.toml"), &[]).saved(), plant(&rapier("rig-fixed.toml"), &[]));
    assert_eq!(near.len(), far.saved().len());
    let error = far.state.load(&near).unwrap_err().to_string();
    assert!(error.contains("PlantMemory") && error.contains("another scene"), "{error}");
    let with = |vehicle: &str| plant(&json!({ "vehicle": repository(&format!("vehicles/{vehicle}")) }), &[]);
    // Two effects each.
    let gusts = json!({ "scene": repository("scenes/ground-disturbed.toml") });
    let (gusts, mut drag) = (plant(&gusts, &[]).saved(), with("hummingbird-drag.toml"));
    assert_eq!(gusts.len(), drag.saved().len());
    let error = drag.state.load(&gusts).unwrap_err().to_string();
    assert!(error.contains("other effects"), "{error}");
    let error = with("hummingbird.toml").state.load(&gusts).unwrap_err().to_string();
    assert!(error.contains("bytes, expected"), "{error}");
}

/// All that is not an effect's own goes through a vehicle with other effects and back.
#[test]
fn a_vehicle_with_other_effects_adopts_a_state() {
    let commands = commands();
    for backend in ["newton-euler", "rapier"] {
        let with = |vehicle: &str| {
            let vehicle = repository(&format!("vehicles/{vehicle}"));
            let start = [0.0, 0.0, 1.0];
            plant(&json!({ "vehicle": vehicle, "backend": backend, "initial_position_m": start }), &[])
        };
        let (mut flown, mut drag) = (with("hummingbird.toml"), with("hummingbird-drag.toml"));
        for command in &commands[..500] {
            flown.step(Inputs { command, measured: None, battery: None, traffic: None }).unwrap();
        }
        let state = flown.saved();
        assert!(drag.state.load(&state).is_err());
        assert_eq!(drag.state.adopt(&state), Ok(true), "{backend}");
        let adopted = |bytes: &[u8]| {
            let mut plant = with("hummingbird.toml");
            assert_eq!(plant.state.adopt(bytes), Ok(true), "{backend}");
            plant.saved()
        };
        assert!(adopted(&drag.saved()) == adopted(&state), "{backend}: something was lost");
        assert!(drag.state.adopt(&state[..state.len() - 1]).is_err());
        let other = if backend == "rapier" { "newton-euler" } else { "rapier" };
        let error = plant(&json!({ "backend": other }), &[]).state.adopt(&state).unwrap_err().to_string();
        assert!(error.contains("another backend"), "{error}");
    }
}

#[test]
fn a_configuration_has_a_number_of_its_own() {
    let parameters = [
        json!({}),
        json!({ "backend": "rapier" }),
        json!({ "backend": "rapier", "scene": repository("scenes/rig-fixed.toml") }),
        json!({ "backend": "rapier", "scene": repository("scenes/rig-fixed-near.toml") }),
        json!({ "vehicle": repository("vehicles/hummingbird-battery.toml") }),
        json!({ "vehicle": repository("vehicles/hummingbird-drag.toml") }),
    ];
    let numbers: std::collections::BTreeSet<u64> =
        parameters.iter().map(|parameters| plant(parameters, &[]).state.configuration()).collect();
    assert_eq!(numbers.len(), parameters.len());
    // Another mass, place and speed are no other configuration.
    let start = json!({ "initial_position_m": [0.0, 0.0, 1.0], "substeps": 2 });
    assert_eq!(plant(&start, &[]).state.configuration(), plant(&json!({}), &[]).state.configuration());
}

#[test]
fn a_plant_that_cannot_load_the_state_does_not_take_over() {
    let commands = commands();
    let inputs = |tick: u32| Inputs {
        command: &commands[tick as usize],
        measured: None,
        battery: None,
        traffic: None,
    };
    let mut first = plant(&json!({ "initial_position_m": [0.0, 0.0, 1.0] }), &[]);
    let last = (0..500).map(|tick| first.step(inputs(tick)).unwrap()).last();
    let mut second = plant(&json!({ "backend": "rapier" }), &[]);
    second.tick = first.tick;
    second.replaces(last.unwrap());
    let error = second.step(inputs(500)).err().unwrap().to_string();
    assert!(error.contains("another backend"), "{error}");
}
