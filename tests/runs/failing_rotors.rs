//! Rotors that fail in flight, from a checkpoint on: forces and torques at every tick, and what the vehicle does then.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]

use crate::multirotors::hexacopter_of_pairs;
use crate::recordings::{Row, rows};
use crate::support::{Ended, Place, repository};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;
use vehicles::Vehicle;

/// The first rotor loses its blades: it has no thrust, turns on, and keeps its drag torque.
const WITHOUT_BLADES: &str = "process.plant.vehicle.effects.weak-rotor.loss_1={ value = 1, unit = \"1\" }";
/// The motor of the first rotor fails.
const SWITCHED_OFF: &str = "process.plant.vehicle.rotors.0.failed={ value = true, source = \"a test\" }";
/// Time from one tick to the next.
const TICK_S: f64 = 0.001;
/// Ticks over which the momentum is compared.
const TICKS: usize = 50;

/// Flies `manifest` and writes a checkpoint after `seconds`; returns the checkpoint and the recording.
fn flown(place: &Place, manifest: &str, seconds: u32, sets: &[&str]) -> [String; 2] {
    let (record, every) = (place.path("whole.mcap"), format!("{seconds}s"));
    let duration = format!("run.duration_s={seconds}.2");
    let args = ["run", manifest, "--record", &record, "--in-process", "--checkpoint-every", &every];
    let sets = sets.iter().copied().chain([duration.as_str()]).flat_map(|set| ["--set", set]);
    place.call(&args.into_iter().chain(sets).collect::<Vec<_>>()).flown();
    [place.path(&format!("whole.{}.ckpt", 1000 * seconds)), record]
}

/// Goes on from `checkpoint` with these settings up to `end_s`.
fn go_on(place: &Place, checkpoint: &str, record: &str, end_s: f64, sets: &[&str]) -> Ended {
    let duration = format!("run.duration_s={end_s:?}");
    let args = ["run", "--from", checkpoint, "--record", record, "--in-process", "--json"];
    let sets = sets.iter().copied().chain([duration.as_str()]).flat_map(|set| ["--set", set]);
    place.call(&args.into_iter().chain(sets).collect::<Vec<_>>())
}

/// The hover of the Hummingbird with `failure` from 1 s to 2.2 s: the last state before it, and all behind it.
fn quadrotor_with(failure: &str) -> Vec<Row> {
    let place = Place::new();
    let [checkpoint, whole] = flown(&place, &repository("manifests/hover.toml"), 1, &[]);
    let fork = place.path("fork.mcap");
    go_on(&place, &checkpoint, &fork, 2.2, &[failure]).flown();
    let before = rows(&whole, "/plant/state").into_iter().find(|state| state.tick == 999).unwrap();
    let states: Vec<Row> = [before].into_iter().chain(rows(&fork, "/plant/state")).collect();
    assert!(states.iter().zip(999..).all(|(state, tick)| state.tick == tick));
    states
}

fn attitude_WB(state: &Row) -> UnitQuaternion<f64> {
    let [w, x, y, z] = ["w", "x", "y", "z"].map(|part| state.get(&format!("attitude.{part}")));
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Angle between the body's z and the world's.
fn tilt_deg(state: &Row) -> f64 {
    (attitude_WB(state) * Vector3::z()).angle(&Vector3::z()).to_degrees()
}

/// Thrust and drag torque of a rotor at its recorded speed.
fn thrust_and_drag(vehicle: &Vehicle, state: &Row, rotor: usize) -> (f64, f64) {
    let speed_rad_s = state.get(&format!("rotor_speed[{rotor}]"));
    let square = speed_rad_s * speed_rad_s.abs();
    (vehicle.thrust_coefficient * square, vehicle.torque_coefficient * square)
}

/// The wrench of the rotors at their recorded speeds if those of `without` have no thrust: thrust along z, and torque.
fn thrust_and_torque(vehicle: &Vehicle, state: &Row, without: &[usize]) -> (f64, Vector3<f64>) {
    let (mut lift_N, mut torque_B_N_m) = (0.0, Vector3::zeros());
    for (number, rotor) in vehicle.rotors.iter().enumerate() {
        let (thrust_N, drag_N_m) = thrust_and_drag(vehicle, state, number);
        let thrust_N = if without.contains(&number) { 0.0 } else { thrust_N };
        lift_N += thrust_N;
        torque_B_N_m += Vector3::new(rotor.position_m.y, -rotor.position_m.x, 0.0) * thrust_N;
        torque_B_N_m.z -= rotor.spin * drag_N_m;
    }
    (lift_N, torque_B_N_m)
}

/// Angular momentum of body and rotors in the body frame.
fn momentum_B(vehicle: &Vehicle, state: &Row) -> Vector3<f64> {
    let of_rotor = |(number, rotor): (usize, &vehicles::Rotor)| {
        rotor.spin * vehicle.rotor_inertia_kg_m2 * state.get(&format!("rotor_speed[{number}]"))
    };
    let about_z: f64 = vehicle.rotors.iter().enumerate().map(of_rotor).sum();
    vehicle.inertia_kg_m2 * Vector3::from(state.vector("angular_velocity")) + Vector3::z() * about_z
}

/// The rate of this momentum by Euler's equation: L' = M - w x L.
fn momentum_rate_B(vehicle: &Vehicle, state: &Row, without: &[usize]) -> Vector3<f64> {
    let w = Vector3::from(state.vector("angular_velocity"));
    thrust_and_torque(vehicle, state, without).1 - w.cross(&momentum_B(vehicle, state))
}

/// The momentum that the torques of the recorded rotor speeds make over 50 ms is that of the recorded motion, on every axis. This
/// holds whatever the controller does: with the thrust of the failed rotor the momentum about y would be off by 0.01 N·m·s.
#[test]
fn a_quadrotor_whose_rotor_fails_turns_by_the_torques_of_the_others() {
    let vehicle = Vehicle::load(Path::new(&repository("vehicles/hummingbird.toml"))).unwrap();
    // About y, and about z: with the drag torque of the first rotor, which turns clockwise, and without.
    for (failure, without, least_N_m_s, about_z_N_m_s) in
        [(WITHOUT_BLADES, &[0][..], 9e-3, [-1e-5, 1e-5]), (SWITCHED_OFF, &[][..], 1e-3, [-4e-4, -2e-4])]
    {
        let states = quadrotor_with(failure);
        // From the first tick of the failure to the end of the flight.
        for state in &states[1..] {
            let (lift_N, _) = thrust_and_torque(&vehicle, state, without);
            let expected = Vector3::z() * (lift_N / vehicle.mass_kg);
            let found = Vector3::from(state.vector("specific_force"));
            assert!((found - expected).amax() < 1e-9, "{failure}: {expected:?}, {state:?}");
        }
        let (before, mut made) = (momentum_B(&vehicle, &states[0]), Vector3::zeros());
        for pair in states[..=TICKS].windows(2) {
            let [from, to] = [0, 1].map(|at| momentum_rate_B(&vehicle, &pair[at], without));
            made += (from + to) * (TICK_S / 2.0);
            let found = momentum_B(&vehicle, &pair[1]) - before;
            assert!((found - made).amax() < 1e-6, "{failure}: {made:?}, {found:?} in {:?}", pair[1]);
        }
        let [low, high] = about_z_N_m_s;
        assert!(made.y > least_N_m_s && made.x.abs() < 1e-5, "{failure}: {made:?}");
        assert!((low..high).contains(&made.z), "{failure}: {made:?}");
    }
}

/// In 50 ms the slow motors do nothing against it: the nose drops by alpha t^2 / 2, and nothing else turns. The torque of alpha is that
/// of a quarter of the weight at the end of the arm.
#[test]
fn a_quadrotor_without_the_blades_in_front_drops_its_nose_by_the_closed_form() {
    let vehicle = Vehicle::load(Path::new(&repository("vehicles/hummingbird.toml"))).unwrap();
    let states = quadrotor_with(WITHOUT_BLADES);
    let quarter_N = vehicle.mass_kg * vehicle.gravity_m_s2 / 4.0;
    let alpha_rad_s2 = quarter_N * vehicle.rotors[0].position_m.x / vehicle.inertia_kg_m2[(1, 1)];
    let start = attitude_WB(&states[0]).inverse();
    for (tick, state) in states.iter().enumerate().take(TICKS + 1) {
        let time_s = tick as f64 * TICK_S;
        let turned = (start * attitude_WB(state)).scaled_axis();
        let expected = Vector3::y() * (alpha_rad_s2 * time_s * time_s / 2.0);
        assert!((turned - expected).amax() < 2e-4, "tick {tick}: {turned:?}, expected {expected:?}");
    }
}

/// No law is told: within half a second it tilts beyond 90°, and falls. A rotor that stands still
/// has no drag torque: the vehicle begins to spin in the sense of this rotor, clockwise.
#[test]
fn a_quadrotor_whose_rotor_fails_turns_over_and_falls() {
    for (failure, spins_rad_s) in [(WITHOUT_BLADES, [-0.3, 0.3]), (SWITCHED_OFF, [-4.0, -1.5])] {
        let states = quadrotor_with(failure);
        let at = |tick: u32| states.iter().find(|state| state.tick == tick).unwrap();
        let [low, high] = spins_rad_s;
        assert!((low..high).contains(&at(1249).get("angular_velocity.z")), "{failure}: {:?}", at(1249));
        assert!(tilt_deg(at(1499)) > 90.0, "{failure}: {:?}", at(1499));
        let heights_m = [999, 1249, 1499, 1999].map(|tick| at(tick).get("position.z"));
        assert!(heights_m.is_sorted_by(|before, after| before > after), "{failure}: {heights_m:?}");
        // Free fall would lose 4.9 m in this second. This manifest has no ground that carries.
        assert!(heights_m[3] < heights_m[0] - 2.5, "{failure}: {heights_m:?}");
    }
}

/// The setting by which the rotor `left` of the hexacopter fails, for the plant or for the controller.
fn left_fails(process: &str) -> String {
    format!("process.{process}.vehicle.rotors.1.failed={{ value = true, source = \"a test\" }}")
}

/// A hexacopter with paired spins goes on with its doublet if the allocation is told at once; otherwise it is lost.
#[test]
fn a_hexacopter_that_loses_a_rotor_in_flight_flies_on_if_its_controller_is_told() {
    let place = Place::new();
    let vehicle = hexacopter_of_pairs(&place, "");
    let sets = ["plant", "controller"].map(|process| format!("process.{process}.vehicle={vehicle}"));
    let manifest = repository("manifests/hexa-hover.toml");
    let [checkpoint, _] = flown(&place, &manifest, 4, &sets.each_ref().map(String::as_str));
    let (record, plant, controller) =
        (place.path("fork.mcap"), left_fails("plant"), left_fails("controller"));

    let summary = go_on(&place, &checkpoint, &record, 12.0, &[&plant, &controller]).with_code(1).json();
    let passes = summary["pass"].as_array().unwrap();
    let failed: Vec<&str> = passes
        .iter()
        .filter(|pass| pass["passed"] == false)
        .map(|pass| pass["name"].as_str().unwrap())
        .collect();
    // The rotor hands its momentum over as it stops, and the motors take a moment: 2.8° of yaw.
    assert_eq!((passes.len(), failed), (8, vec!["yaw within 1° throughout"]));
    let states = rows(&record, "/plant/state");
    assert!(states.iter().all(|state| (state.get("position.z") - 1.5).abs() < 0.03));
    let yaw_deg = |state: &Row| attitude_WB(state).euler_angles().2.to_degrees();
    assert!(states.iter().all(|state| yaw_deg(state).abs() < 4.0), "{:?}", states.last());
    let last = states.last().unwrap();
    assert!(yaw_deg(last).abs() < 0.2 && tilt_deg(last) < 0.2, "{last:?}");
    assert!(last.get("rotor_speed[1]").abs() < 1e-6, "{last:?}");

    go_on(&place, &checkpoint, &record, 6.0, &[&plant]).with_code(1);
    let states = rows(&record, "/plant/state");
    assert!(states.iter().any(|state| tilt_deg(state) > 120.0));
    let fallen = states.iter().find(|state| state.tick == 5000).unwrap();
    assert!(fallen.get("position.z") < 0.0, "{fallen:?}");
}

/// The F550 cannot lose a rotor: a controller that is told so at a checkpoint is refused as one at the start is.
#[test]
fn a_hexacopter_that_cannot_lose_a_rotor_is_refused_at_the_checkpoint_too() {
    let place = Place::new();
    let [checkpoint, _] = flown(&place, &repository("manifests/hexa-hover.toml"), 1, &[]);
    let sets = ["plant", "controller"].map(left_fails);
    let ended = go_on(&place, &checkpoint, "none", 2.0, &sets.each_ref().map(String::as_str)).with_code(2);
    ended.prints(&["its 5 working rotors of 6 cannot hover", "yaw is not controllable both ways"]);
}
