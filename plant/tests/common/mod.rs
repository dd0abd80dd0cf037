//! Vehicles for the tests: the real files, and the Hummingbird with single numbers replaced.
#![allow(dead_code, reason = "every test file uses its own part of these helpers")]
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

pub mod parts;

use nalgebra::Vector3;
use plant::{Backend, FreeFlight, NewtonEuler, Rapier, RigidBody, State};
use scenes::Scene;
use vehicles::Vehicle;

/// The tick of the whole project, 1 kHz.
pub const TICK_S: f64 = 1e-3;
/// Gravity of the vehicle files and of scenes without their own.
pub const G_M_S2: f64 = 9.81;

pub use vehicles::reference::{CRAZYFLIE, HUMMINGBIRD};

const C_T: &str = "value = 7.6184e-8";
const C_Q: &str = "value = 2.6839e-9";
const I_M: &str = "value = 3.1e-5";

/// The Hummingbird with texts replaced; a text that is not in the file is a fault of the test.
pub fn hummingbird_with(changes: &[(&str, &str)]) -> Vehicle {
    let mut text = HUMMINGBIRD.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "the vehicle file no longer holds {from:?}");
        text = text.replace(from, to);
    }
    Vehicle::parse(&text, "hummingbird.toml").unwrap()
}

pub fn hummingbird() -> Vehicle {
    hummingbird_with(&[])
}

pub fn crazyflie() -> Vehicle {
    Vehicle::parse(CRAZYFLIE, "crazyflie-2.1.toml").unwrap()
}

/// Parameters of an effect that begin with these.
pub fn values<const N: usize>(first: [f64; N]) -> plant::effects::Values {
    std::array::from_fn(|index| first.get(index).copied().unwrap_or_default())
}

/// A Hummingbird whose air does nothing; its rotors keep their inertia.
pub fn airless() -> Vehicle {
    hummingbird_with(&[(C_T, "value = 0"), (C_Q, "value = 0")])
}

/// A Hummingbird without thrust, drag torque or rotor inertia, and with three different moments of inertia.
pub fn free_body() -> Vehicle {
    hummingbird_with(&[
        (C_T, "value = 0"),
        (C_Q, "value = 0"),
        (I_M, "value = 0"),
        ("inertia_yy = { value = 5.6e-3", "inertia_yy = { value = 7.0e-3"),
    ])
}

/// A Hummingbird on which left and right differ in nothing: no torque depends on a sense of rotation.
pub fn spinless() -> Vehicle {
    hummingbird_with(&[(C_Q, "value = 0"), (I_M, "value = 0")])
}

/// The model at 1 m with all rotors settled at hover.
pub fn hovering(vehicle: Vehicle) -> (NewtonEuler, State, f64) {
    let command = vehicle.hover_command();
    let model = NewtonEuler::new(vehicle, 1);
    let state = model.start(RigidBody::level_at(Vector3::z()), command);
    (model, state, command)
}

/// Flies `ticks` ticks under constant commands.
pub fn fly(model: &NewtonEuler, state: &mut State, commands: &[f64; 4], ticks: usize) {
    for _ in 0..ticks {
        model.step(state, commands, TICK_S);
    }
}

/// Angular momentum of body and rotors together, in the world frame, in N m s.
pub fn momentum_W(vehicle: &Vehicle, state: &State) -> Vector3<f64> {
    let rotors = vehicle.rotors.iter().zip(&state.rotors);
    let spin: f64 = rotors.map(|(place, rotor)| place.spin * rotor.speed_rad_s).sum();
    let body_B = vehicle.inertia_kg_m2 * state.body.angular_velocity_B_rad_s;
    state.body.attitude_WB * (body_B + Vector3::z() * (vehicle.rotor_inertia_kg_m2 * spin))
}

/// A vehicle without effects in a scene of the rapier backend.
pub fn rapier(model: NewtonEuler, scene: &Scene, body: &RigidBody, crash_speed_m_s: f64) -> Rapier {
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    Rapier::new(model, effects, scene, body, crash_speed_m_s)
}

/// Kinetic and potential energy of the free bodies of a scene, in J; zero at rest at the height of the world's origin.
pub fn bodies_energy_J(scene: &Scene, plant: &Rapier) -> f64 {
    let bodies = scene.bodies().zip(plant.bodies()).map(|((_, built), body)| {
        let w = body.angular_velocity_B_rad_s;
        0.5 * built.mass_kg * body.velocity_W_m_s.norm_squared()
            + 0.5 * w.dot(&(built.inertia_kg_m2 * w))
            + built.mass_kg * G_M_S2 * body.position_W_m.z
    });
    bodies.sum()
}

/// A vehicle without effects in free flight.
pub fn free_flight(vehicle: Vehicle, body: RigidBody) -> FreeFlight {
    let model = NewtonEuler::new(vehicle, 1);
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    FreeFlight::new(model, body, effects)
}
