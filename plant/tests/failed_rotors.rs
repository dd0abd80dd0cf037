//! A rotor that fails in hover, against closed forms of the first 50 ms on every axis. The other rotors turn on as before.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]

use crate::common;
use common::{TICK_S, hummingbird};
use nalgebra::Vector3;
use plant::effects::find;
use plant::{Airframe, NewtonEuler, RigidBody, State};
use std::ops::{Add, Mul};
use vehicles::{MotorModel, Rotor, Vehicle};

/// Ticks that are compared with the closed form.
const TICKS: u32 = 50;

#[track_caller]
fn require_near(what: &str, found: &Vector3<f64>, expected: &Vector3<f64>, error: f64) {
    assert!((found - expected).amax() < error, "{what}: {found:?}, expected {expected:?}");
}

/// The vehicle level at 1 m, all rotors turning as in hover.
fn hovering(vehicle: &Vehicle) -> State {
    NewtonEuler::new(vehicle.clone(), 1).start(RigidBody::level_at(Vector3::z()), vehicle.hover_command())
}

/// Simpson's rule from 0 to `until_s`.
fn integral<T>(value: impl Fn(f64) -> T, until_s: f64) -> T
where
    T: Add<Output = T> + Mul<f64, Output = T>,
{
    let intervals = 100;
    let step_s = until_s / f64::from(intervals);
    let weight = |point: i32| if point % 2 == 0 { 2.0 } else { 4.0 };
    let ends = value(0.0) + value(until_s);
    let inner = (1..intervals).map(|point| value(step_s * f64::from(point)) * weight(point));
    inner.fold(ends, |sum, term| sum + term) * (step_s / 3.0)
}

/// Without its blades the front rotor has no thrust, and the drag torque as before: about y alone there is a torque.
#[test]
fn a_rotor_without_thrust_turns_the_quadrotor_about_the_axis_across_its_arm_alone() {
    let vehicle = hummingbird();
    let mut lost = find("weak-rotor").unwrap().neutral();
    lost.values[0] = 1.0;
    let model = NewtonEuler::flying(Airframe::with_effects(vehicle.clone(), vec![lost]), 1);
    let mut carried = model.airframe().initial_state(1, "plant", TICK_S);
    let (mut state, commands) = (hovering(&vehicle), [vehicle.hover_command(); 4]);
    let (g, lift) = (vehicle.gravity_m_s2, 0.75 * vehicle.gravity_m_s2);
    let arm_m = vehicle.rotors[0].position_m.x;
    let alpha = 0.25 * vehicle.mass_kg * g * arm_m / vehicle.inertia_kg_m2[(1, 1)];
    assert!(alpha > 30.0, "the front rotor is in front: {alpha} rad/s^2");
    for tick in 0..=TICKS {
        let actuation = model.airframe().begin_tick(&mut carried, &state, &commands, TICK_S);
        // From the tick of the failure on.
        let felt = model.accelerations_under(actuation, &state);
        require_near("specific force", &felt.specific_force_B_m_s2, &(Vector3::z() * lift), 1e-9);
        require_near("acceleration", &felt.angular_acceleration_B_rad_s2, &(Vector3::y() * alpha), 1e-9);
        let t = f64::from(tick) * TICK_S;
        require_near(
            "angular velocity",
            &state.body.angular_velocity_B_rad_s,
            &(Vector3::y() * (alpha * t)),
            1e-9,
        );
        let turned = state.body.attitude_WB.scaled_axis();
        require_near("attitude", &turned, &(Vector3::y() * (alpha * t * t / 2.0)), 1e-9);
        // Integrals of the sine and the cosine of alpha t^2 / 2, as series.
        let sine = alpha * t.powi(3) / 6.0 - alpha.powi(3) * t.powi(7) / 336.0;
        let cosine = t - alpha.powi(2) * t.powi(5) / 40.0;
        let velocity = Vector3::new(lift * sine, 0.0, lift * cosine - g * t);
        require_near("velocity", &state.body.velocity_W_m_s, &velocity, 1e-7);
        model.advance(&mut state, actuation, TICK_S);
    }
}

/// Closed form of a vehicle in hover, of which the rotor `rotor` is switched off at 0 s.
struct SwitchedOff<'a> {
    vehicle: &'a Vehicle,
    rotor: &'a Rotor,
    time_constant_s: f64,
}

impl SwitchedOff<'_> {
    fn speed_rad_s(&self, t: f64) -> f64 {
        self.vehicle.hover_speed_rad_s() * libm::exp(-t / self.time_constant_s)
    }

    fn hover_thrust_N(&self) -> f64 {
        self.vehicle.thrust_coefficient * self.vehicle.hover_speed_rad_s().powi(2)
    }

    /// The part of its thrust and of its drag torque that is lost: 1 - exp(-2 t / T).
    fn lost(&self, t: f64) -> f64 {
        1.0 - libm::exp(-2.0 * t / self.time_constant_s)
    }

    /// The integral of this part.
    fn lost_s(&self, t: f64) -> f64 {
        t - self.time_constant_s / 2.0 * self.lost(t)
    }

    /// The integral of the integral.
    fn lost_s2(&self, t: f64) -> f64 {
        t * t / 2.0 - self.time_constant_s / 2.0 * self.lost_s(t)
    }

    fn inverse_inertia(&self) -> nalgebra::Matrix3<f64> {
        self.vehicle.inertia_kg_m2.try_inverse().unwrap()
    }

    /// The torque once all of its thrust is lost.
    fn tilting_N_m(&self) -> Vector3<f64> {
        self.rotor.position_m.cross(&(Vector3::z() * -self.hover_thrust_N()))
    }

    /// The angular velocity without coupling of the axes. About z, the drag torque of the rotor no longer balances that of the
    /// others, and the rotor hands its momentum over as it stops. Both turn the body in the sense of the rotor.
    fn uncoupled_B_rad_s(&self, t: f64) -> Vector3<f64> {
        let hover_rad_s = self.vehicle.hover_speed_rad_s();
        let drag_N_m = self.vehicle.torque_coefficient * hover_rad_s.powi(2);
        let handed_over = self.vehicle.rotor_inertia_kg_m2 * (hover_rad_s - self.speed_rad_s(t));
        let about_z = Vector3::z() * (self.rotor.spin * (drag_N_m * self.lost_s(t) + handed_over));
        self.inverse_inertia() * (self.tilting_N_m() * self.lost_s(t) + about_z)
    }

    /// J^-1 (-w x L), with the momentum L of body and rotors: in hover that of the rotors is 0.
    fn coupling_B_rad_s2(&self, t: f64) -> Vector3<f64> {
        let missing_rad_s = self.speed_rad_s(t) - self.vehicle.hover_speed_rad_s();
        let rotors = Vector3::z() * (self.rotor.spin * self.vehicle.rotor_inertia_kg_m2 * missing_rad_s);
        let w = self.uncoupled_B_rad_s(t);
        self.inverse_inertia() * -w.cross(&(self.vehicle.inertia_kg_m2 * w + rotors))
    }

    fn angular_velocity_B_rad_s(&self, t: f64) -> Vector3<f64> {
        self.uncoupled_B_rad_s(t) + integral(|t| self.coupling_B_rad_s2(t), t)
    }

    fn specific_force_m_s2(&self, t: f64) -> f64 {
        self.vehicle.gravity_m_s2 - self.hover_thrust_N() * self.lost(t) / self.vehicle.mass_kg
    }

    /// The velocity as far as the tilt is small.
    fn velocity_W_m_s(&self, t: f64) -> Vector3<f64> {
        let acceleration = |t: f64| {
            let tilt = self.inverse_inertia() * self.tilting_N_m() * self.lost_s2(t);
            let f = self.specific_force_m_s2(t);
            Vector3::new(f * tilt.y, -f * tilt.x, f - self.vehicle.gravity_m_s2)
        };
        integral(acceleration, t)
    }
}

/// Each rotor of the hexacopter, so that all signs of arms and of spins occur.
#[test]
fn a_rotor_that_is_switched_off_sinks_turns_and_tilts_the_hexacopter() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/dji-f550.toml");
    let vehicle = Vehicle::load(path.as_ref()).unwrap();
    let MotorModel::FirstOrder { time_constant_s } = vehicle.motor else {
        panic!("the F550's motor is of first order")
    };
    for (number, rotor) in vehicle.rotors.iter().enumerate() {
        let exact = SwitchedOff { vehicle: &vehicle, rotor, time_constant_s };
        let mut failed = vehicle.clone();
        failed.rotors[number].has_failed = true;
        let (model, mut state) = (NewtonEuler::new(failed, 1), hovering(&vehicle));
        let commands = [vehicle.hover_command(); 6];
        for tick in 1..=TICKS {
            model.step(&mut state, &commands, TICK_S);
            let (t, body) = (f64::from(tick) * TICK_S, &state.body);
            let speeds = state.rotors.map(|rotor| rotor.speed_rad_s);
            assert!((speeds[number] - exact.speed_rad_s(t)).abs() < 1e-5, "{number}: {speeds:?}");
            let felt = model.accelerations(&state).specific_force_B_m_s2;
            require_near("specific force", &felt, &(Vector3::z() * exact.specific_force_m_s2(t)), 1e-6);
            let (found, expected) = (&body.angular_velocity_B_rad_s, exact.angular_velocity_B_rad_s(t));
            require_near(&format!("angular velocity, rotor {number}"), found, &expected, 1e-5);
            // No coupling reaches z, since the moments about x and y are equal.
            assert!((found.z - expected.z).abs() < 1e-8, "{number}: {found:?}, expected {expected:?}");
            let turned = integral(|t| exact.uncoupled_B_rad_s(t), t);
            require_near(
                &format!("attitude, rotor {number}"),
                &body.attitude_WB.scaled_axis(),
                &turned,
                3e-5,
            );
            let velocity = exact.velocity_W_m_s(t);
            require_near(&format!("velocity, rotor {number}"), &body.velocity_W_m_s, &velocity, 2e-5);
        }
        // In rad/s: it tilts, and yaws in the rotor's own sense.
        let w = &state.body.angular_velocity_B_rad_s;
        assert!(w.xy().norm() > 0.8 && w.z * rotor.spin > 0.35, "{number}: {w:?}");
    }
}
