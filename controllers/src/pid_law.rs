//! The altitude and attitude PID of the thesis (§3.2): set point and measurement to a wrench.
//!
//! Frames: world z up; body x forward, y left, z up; roll, pitch and yaw in the aerospace ZYX sequence.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _N the newton"
)]

use crate::allocation::{Allocation, THRUST_RESERVE, Wrench};
use crate::altitude_loop::AltitudeLoop;
use crate::angle::wrap_rad;
use crate::controller::{ControllerState, within};
use crate::pid_gains::{LoopGains, PidGains};
use crate::set_points::SetPoint;
use nalgebra::Vector3;
use vehicles::Vehicle;

/// What the law is told of the vehicle's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Height in the world, m.
    pub altitude_m: f64,
    /// Rate of climb in the world, m/s.
    pub climb_rate_m_s: f64,
    /// Roll, rad.
    pub roll_rad: f64,
    /// Pitch, positive for nose down, rad.
    pub pitch_rad: f64,
    /// Yaw, counter-clockwise from above, rad.
    pub yaw_rad: f64,
    /// Angular rate of the body against the world, body axes, rad/s.
    pub angular_velocity_B_rad_s: Vector3<f64>,
}

/// The part of the vehicle that the law has to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidVehicle {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moments of inertia about body x, y and z, kg·m².
    pub inertia_B_kg_m2: Vector3<f64>,
    /// Gravity, m/s².
    pub gravity_m_s2: f64,
    /// The least thrust to demand, N; see [`crate::allocation::Allocation::thrust_range_N`].
    pub thrust_min_N: f64,
    /// The greatest thrust to demand, N.
    pub thrust_max_N: f64,
}

impl PidVehicle {
    /// What the law has to know of `vehicle`, whose rotors are reached through `allocation`. Products of
    /// inertia are left to the loops.
    #[must_use]
    pub fn new(vehicle: &Vehicle, allocation: &Allocation) -> Self {
        let (thrust_min_N, thrust_max_N) = allocation.thrust_range_N(THRUST_RESERVE);
        Self {
            mass_kg: vehicle.mass_kg,
            inertia_B_kg_m2: vehicle.inertia_kg_m2.diagonal(),
            gravity_m_s2: vehicle.gravity_m_s2,
            thrust_min_N,
            thrust_max_N,
        }
    }
}

/// The law at one period: all that does not change during a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidLaw {
    /// Gains and limits.
    pub gains: PidGains,
    /// The vehicle that is flown.
    pub vehicle: PidVehicle,
    /// Time between two steps, s.
    pub period_s: f64,
}

/// All that the law remembers: what its integrators ask for.
///
/// They are kept as accelerations, not as integrals of the error, so that a successor with other gains
/// takes over without a jump.
#[derive(Debug, Clone, Copy, PartialEq, Default, bus::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/PidState")]
pub struct PidState {
    /// Vertical acceleration that the altitude's integrator asks for, m/s².
    #[field(unit = "m/s^2", frame = "world")]
    pub altitude_m_s2: f64,
    /// Angular acceleration about body x that the roll's integrator asks for, rad/s².
    #[field(unit = "rad/s^2", frame = "body")]
    pub roll_rad_s2: f64,
    /// The same about body y for pitch, rad/s².
    #[field(unit = "rad/s^2", frame = "body")]
    pub pitch_rad_s2: f64,
    /// The same about body z for yaw, rad/s².
    #[field(unit = "rad/s^2", frame = "body")]
    pub yaw_rad_s2: f64,
}

impl PidLaw {
    /// The wrench to demand now; advances the integrators by one period.
    pub fn step(&self, state: &mut PidState, set_point: &SetPoint, measured: &Measurement) -> Wrench {
        let altitude_loop = self.altitude_loop();
        Wrench {
            thrust_N: altitude_loop.thrust_N(&mut state.altitude_m_s2, set_point.altitude_m, measured),
            torque_B_N_m: self.torque_B_N_m(state, set_point, measured),
        }
    }

    /// The memory that goes on from another law's: its integrators.
    #[must_use]
    pub fn taken_over(
        &self,
        memory: &ControllerState,
        wrench: &Wrench,
        altitude_set_m: f64,
        measured: &Measurement,
    ) -> PidState {
        // An integrator without gain would keep for ever what it was given.
        let attitude = |gains: &LoopGains, handed_rad_s2: f64| {
            let has_gain = gains.integral_1_s3 > 0.0;
            if has_gain { within(handed_rad_s2, self.gains.attitude_integral_max_rad_s2) } else { 0.0 }
        };
        let before = &memory.integrals;
        PidState {
            altitude_m_s2: self.altitude_loop().taken_over_m_s2(
                memory,
                wrench.thrust_N,
                altitude_set_m,
                measured,
            ),
            roll_rad_s2: attitude(&self.gains.roll, before.roll_rad_s2),
            pitch_rad_s2: attitude(&self.gains.pitch, before.pitch_rad_s2),
            yaw_rad_s2: attitude(&self.gains.yaw, before.yaw_rad_s2),
        }
    }

    fn altitude_loop(&self) -> AltitudeLoop<'_> {
        AltitudeLoop { gains: self.gains.altitude_gains(), vehicle: &self.vehicle, period_s: self.period_s }
    }

    /// Torque = inertia · (Kp·error + integral − Kd·body rate), axis by axis. The cross product of rate
    /// and angular momentum is left to the loops: at 1 rad/s it is below 0.003 N·m on the Hummingbird.
    fn torque_B_N_m(
        &self,
        state: &mut PidState,
        set_point: &SetPoint,
        measured: &Measurement,
    ) -> Vector3<f64> {
        let tilt_max_rad = self.gains.tilt_command_max_rad;
        let roll_set_rad = set_point.roll_rad.clamp(-tilt_max_rad, tilt_max_rad);
        let pitch_set_rad = set_point.pitch_rad.clamp(-tilt_max_rad, tilt_max_rad);
        let [p, q, r]: [f64; 3] = measured.angular_velocity_B_rad_s.into();
        let roll_error_rad = wrap_rad(roll_set_rad - measured.roll_rad);
        let pitch_error_rad = pitch_set_rad - measured.pitch_rad;
        let yaw_error_rad = wrap_rad(set_point.yaw_rad - measured.yaw_rad);
        let acceleration_B_rad_s2 = Vector3::new(
            self.angle_loop_rad_s2(&self.gains.roll, &mut state.roll_rad_s2, roll_error_rad, p),
            self.angle_loop_rad_s2(&self.gains.pitch, &mut state.pitch_rad_s2, pitch_error_rad, q),
            self.angle_loop_rad_s2(&self.gains.yaw, &mut state.yaw_rad_s2, yaw_error_rad, r),
        );
        self.vehicle.inertia_B_kg_m2.component_mul(&acceleration_B_rad_s2)
    }

    fn angle_loop_rad_s2(
        &self,
        gains: &LoopGains,
        integral_rad_s2: &mut f64,
        error_rad: f64,
        rate_rad_s: f64,
    ) -> f64 {
        let max_rad_s2 = self.gains.attitude_integral_max_rad_s2;
        *integral_rad_s2 = gains.integrate(*integral_rad_s2, error_rad, self.period_s, max_rad_s2);
        gains.demand(error_rad, *integral_rad_s2, rate_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> PidLaw {
        let vehicle = PidVehicle {
            mass_kg: 0.5,
            inertia_B_kg_m2: Vector3::new(5.0e-3, 6.0e-3, 8.0e-3),
            gravity_m_s2: 9.81,
            thrust_min_N: 1.0,
            thrust_max_N: 10.0,
        };
        PidLaw { gains: PidGains::default(), vehicle, period_s: 1e-3 }
    }

    fn level() -> Measurement {
        Measurement {
            altitude_m: 1.0,
            climb_rate_m_s: 0.0,
            roll_rad: 0.0,
            pitch_rad: 0.0,
            yaw_rad: 0.0,
            angular_velocity_B_rad_s: Vector3::zeros(),
        }
    }

    fn hold() -> SetPoint {
        SetPoint { altitude_m: 1.0, ..SetPoint::default() }
    }

    fn step(set_point: &SetPoint, measured: &Measurement) -> Wrench {
        law().step(&mut PidState::default(), set_point, measured)
    }

    /// One second of holding 1 m at a measurement that stays as it is.
    fn settle(law: &PidLaw, state: &mut PidState, measured: &Measurement) {
        for _ in 0..1000 {
            law.step(state, &hold(), measured);
        }
    }

    #[test]
    fn a_successor_goes_on_from_the_integrators_that_it_has_a_gain_for() {
        let wrench = Wrench { thrust_N: 5.2, torque_B_N_m: Vector3::new(1e-3, -2e-3, 1e-3) };
        let integrals = PidState { altitude_m_s2: 9.0, roll_rad_s2: 0.1, pitch_rad_s2: 0.1, yaw_rad_s2: 0.1 };
        let before = ControllerState { law: 2, integrals, ..ControllerState::default() };
        let memory = law().taken_over(&before, &wrench, 1.0, &level());
        assert_eq!(memory, PidState { altitude_m_s2: 2.0, ..PidState::default() });
    }

    #[test]
    fn a_successor_that_knows_only_the_last_command_asks_for_its_thrust() {
        let wrench = Wrench { thrust_N: 5.2, torque_B_N_m: Vector3::zeros() };
        let measured = Measurement { roll_rad: 0.05, altitude_m: 0.99, ..level() };
        let memory = law().taken_over(&ControllerState::default(), &wrench, 1.0, &measured);
        let still = PidLaw { period_s: 0.0, ..law() };
        let asked = still.step(&mut memory.clone(), &hold(), &measured);
        assert!((asked.thrust_N - wrench.thrust_N).abs() < 1e-12);
    }

    #[test]
    fn at_the_set_point_the_wrench_is_the_weight() {
        let wrench = step(&hold(), &level());
        assert!((wrench.thrust_N - 0.5 * 9.81).abs() < 1e-12);
        assert_eq!(wrench.torque_B_N_m, Vector3::zeros());
    }

    /// Eq. 3.19 as printed would divide by cos φ·sin θ, which is zero here.
    #[test]
    fn a_tilt_is_made_up_for_up_to_sixty_degrees() {
        let tilted = |roll_deg: f64| {
            let measured = Measurement { roll_rad: roll_deg.to_radians(), pitch_rad: 0.1, ..level() };
            step(&hold(), &measured).thrust_N
        };
        let expected_N = 0.5 * 9.81 / (libm::cos(20.0_f64.to_radians()) * libm::cos(0.1));
        assert!((tilted(20.0) - expected_N).abs() < 1e-12);
        assert!((tilted(80.0) - 2.0 * 0.5 * 9.81).abs() < 1e-12);
    }

    #[test]
    fn every_error_and_rate_acts_with_its_sign_and_inertia() {
        let law = law();
        let set = SetPoint { roll_rad: 0.1, pitch_rad: -0.1, yaw_rad: 0.2, ..hold() };
        let torque = step(&set, &level()).torque_B_N_m;
        let (roll, pitch, yaw) = (law.gains.roll, law.gains.pitch, law.gains.yaw);
        assert!((torque.x - 5.0e-3 * roll.proportional_1_s2 * 0.1).abs() < 1e-12);
        assert!((torque.y + 6.0e-3 * pitch.proportional_1_s2 * 0.1).abs() < 1e-12);
        assert!((torque.z - 8.0e-3 * yaw.proportional_1_s2 * 0.2).abs() < 1e-12);
        let turning = Measurement { angular_velocity_B_rad_s: Vector3::new(1.0, 0.0, 0.0), ..level() };
        assert!((step(&hold(), &turning).torque_B_N_m.x + 5.0e-3 * roll.derivative_1_s).abs() < 1e-12);
        let climbing = Measurement { climb_rate_m_s: 0.1, ..level() };
        assert!(step(&hold(), &climbing).thrust_N < 0.5 * 9.81);
    }

    #[test]
    fn yaw_turns_the_short_way() {
        let set = SetPoint { yaw_rad: 3.1, ..hold() };
        let measured = Measurement { yaw_rad: -3.1, ..level() };
        assert!(step(&set, &measured).torque_B_N_m.z < 0.0);
    }

    #[test]
    fn tilt_commands_are_cut_to_the_range_of_the_sticks() {
        let at = |roll_deg: f64| {
            step(&SetPoint { roll_rad: roll_deg.to_radians(), ..hold() }, &level()).torque_B_N_m.x
        };
        assert_eq!(at(70.0), at(30.0));
    }

    #[test]
    fn the_altitude_integrator_takes_up_a_lasting_error_but_rests_in_a_climb() {
        let mut state = PidState::default();
        let low = Measurement { altitude_m: 0.95, ..level() };
        settle(&law(), &mut state, &low);
        let asked_m_s2 = law().gains.altitude.integral_1_s3 * 0.05;
        assert!((state.altitude_m_s2 - asked_m_s2).abs() < 1e-9);
        let before = state;
        settle(&law(), &mut state, &Measurement { climb_rate_m_s: 0.3, ..low });
        assert_eq!(state, before);
    }

    #[test]
    fn the_integrator_rests_at_the_thrust_limit_and_comes_back_from_it() {
        let mut weak = law();
        weak.vehicle.thrust_max_N = 4.0;
        let mut state = PidState { altitude_m_s2: 1.0, ..PidState::default() };
        let sunk = Measurement { altitude_m: 0.95, ..level() };
        settle(&weak, &mut state, &sunk);
        assert_eq!(state.altitude_m_s2, 1.0);
        let above = Measurement { altitude_m: 1.05, ..level() };
        settle(&weak, &mut state, &above);
        assert!(state.altitude_m_s2 < 1.0);
    }
}
