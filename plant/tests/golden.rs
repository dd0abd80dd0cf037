//! The declared model flies as it always did, to the last bit: additions to the plant must not disturb it.
//!
//! If the physics is changed on purpose, mint the digest anew and say why.

use crate::common;
use common::{TICK_S, crazyflie, hummingbird};
use nalgebra::{UnitQuaternion, Vector3};
use plant::{NewtonEuler, RigidBody, State};
use vehicles::Vehicle;

/// FNV-1a over the bits of every number of the state.
fn digest(hash: u64, state: &State) -> u64 {
    let body = &state.body;
    let vectors = [body.position_W_m, body.velocity_W_m_s, body.angular_velocity_B_rad_s];
    let numbers = vectors.iter().flat_map(|vector| vector.iter()).chain(body.attitude_WB.coords.iter());
    let rotors = state.rotors.iter().flat_map(|rotor| [rotor.speed_rad_s, rotor.acceleration_rad_s2]);
    let bytes = numbers.copied().chain(rotors).flat_map(|number| number.to_bits().to_le_bytes());
    bytes.fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// Two seconds of commands that swing on all axes, from a tilted and turning start.
fn flown(vehicle: Vehicle, swing: f64) -> u64 {
    let hover = vehicle.hover_command();
    let model = NewtonEuler::new(vehicle, 2);
    let mut state = model.start(RigidBody::level_at(Vector3::new(0.1, -0.2, 1.0)), hover);
    state.body.attitude_WB = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(0.96, 0.1, -0.2, 0.15));
    state.body.angular_velocity_B_rad_s = Vector3::new(0.5, -0.7, 0.3);
    (0..2000).fold(0xcbf2_9ce4_8422_2325, |hash, tick| {
        let part = |period: i32| swing * (f64::from((tick % period) * 2 - period) / f64::from(period));
        let commands = [part(400), part(310), part(270), part(150)].map(|part| hover + part);
        model.step(&mut state, &commands, TICK_S);
        digest(hash, &state)
    })
}

#[test]
fn the_declared_vehicles_fly_as_ever_bit_for_bit() {
    let found = [flown(hummingbird(), 20.0), flown(crazyflie(), 6000.0)].map(|hash| format!("{hash:016x}"));
    assert_eq!(found, ["24572eb9c704fe6b", "f12b4cd4f4b432b8"]);
}
