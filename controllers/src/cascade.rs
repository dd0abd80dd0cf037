//! The cascade of the AscTec's onboard computer (thesis §5.3, Figs 5.16–5.19): command filter, attitude loop
//! around rate loop, and the altitude loop beside them; from set point and measurement to a wrench.
//!
//! - Command filter: roll and pitch are cut to ±30° and filtered, x'' = ω²(c − x) − 2ζω x'. Where half a turn is allowed,
//!   nothing is cut, and the command comes round as the vehicle does: a ramp of 360° is a flip. The yaw
//!   command turns towards the yaw set point no faster than a yaw stick at full deflection would integrate it.
//!   It comes round at 360°. As long as no thrust is asked for, it is set to the measured yaw.
//! - Attitude loop: the rates of change of roll, pitch and yaw are the error times a gain, and a part of the
//!   filtered commands' own rates. The kinematics of the z-y-x sequence turn them to body rates (the inverse
//!   of thesis eq. 3.18). Command filter and attitude loop may compute on every n-th step only,
//!   `attitude_every_steps`: the rates stay between.
//! - Rate loop: α = Kp·e + ∫Ki·e dt − Kd·dω/dt with e the error of a body rate; torque = inertia · α. The
//!   cross product of rate and angular momentum is left to the loops.

use crate::airframe::HoverModel;
use crate::allocation::RotorWrench;
use crate::altitude_loop::AltitudeLoop;
use crate::angle::wrap_rad;
use crate::cascade_gains::{CascadeGains, CommandFilter};
use crate::control::{ControlOutput, HoverMotion, Integrals};
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::SetPointInputs;
use crate::set_points::SetPoint;
use component::Info;
use diagnostics::ParameterError;
use diagnostics::parameter::within;
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// The most steps between two of the attitude loop.
const ATTITUDE_EVERY_MAX: f64 = 1000.0;

/// Parameters.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/cascade.toml", file = crate::gains_file::FILE)]
    gains: Option<PathBuf>,
    /// The command filter and the attitude loop compute on every n-th step, the rate loop and the altitude loop on each.
    #[parameter(default = 1, check = within(1.0..=ATTITUDE_EVERY_MAX, "1 to 1000 steps"))]
    attitude_every_steps: u32,
}

/// The law at one period, with everything that does not change during a run.
///
/// ```
/// use component::messages::{SetPoint, StateEstimate};
/// use controllers::{cascade::CascadeLaw, controller::Controller, law_inputs::SetPointInputs};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle });
/// let mut cascade = component::Harness::<Controller<CascadeLaw>>::from_json(&parameters).unwrap();
/// let (set_point, estimate) = (SetPoint { roll: 0.1, ..Default::default() }, StateEstimate::default());
/// let inputs = || SetPointInputs { set_point: &set_point, estimate: &estimate, attitude: None };
/// let status = (0..50).map(|_| cascade.step(inputs()).unwrap().status.unwrap()).last().unwrap();
/// assert!(status.torque.x > 0.0, "N*m about body x, towards the roll that is asked for: {status:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CascadeLaw {
    /// Gains and limits.
    pub gains: CascadeGains,
    /// The vehicle that is flown.
    pub vehicle: HoverModel,
    /// Time between two steps, s.
    pub period_s: f64,
    /// Steps between two of the command filter and the attitude loop.
    pub attitude_every_steps: u32,
}

/// State of the law.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/CascadeState")]
pub struct CascadeState {
    /// Outputs of the integrators of altitude and rates.
    pub integrals: Integrals,
    /// The command filter's roll, pitch and yaw.
    #[field(unit = "rad", frame = "world")]
    pub attitude_command: [f64; 3],
    /// Their rates of change.
    #[field(unit = "rad/s", frame = "world")]
    pub attitude_command_rate: [f64; 3],
    /// Body rates behind the filter of the rate loop's derivative.
    #[field(unit = "rad/s", frame = "body")]
    pub rate_filtered: [f64; 3],
    /// Body rates that the attitude loop asked for last.
    #[field(unit = "rad/s", frame = "body")]
    pub rate_command: [f64; 3],
    /// Steps before the attitude loop computes again.
    #[field(unit = "1")]
    pub attitude_in_steps: u32,
    /// Zero.
    #[field(unit = "")]
    pad0: u32,
}

impl Law for CascadeLaw {
    const INFO: Info = Info::new(
        "cascade",
        "command filter, attitude loop around rate loop, altitude PID, control allocation",
    );
    type Parameters = Parameters;
    type Inputs<'a> = SetPointInputs<'a>;
    type State = CascadeState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = CascadeGains::load(&context.node.files, parameters.gains.as_deref())?;
        let attitude_every_steps = parameters.attitude_every_steps;
        let (vehicle, period_s) = (context.craft.hover_model(), context.node.period_s());
        Ok(Self { gains, vehicle, period_s, attitude_every_steps })
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.gains.rate.iter().fold(0.0, |most, axis| axis.proportional_1_s.max(most))
    }

    fn start(
        &self,
        from: Option<&Predecessor<'_, CascadeState>>,
        inputs: &SetPointInputs<'_>,
    ) -> CascadeState {
        self.begun(from, inputs.set_point.altitude, &HoverMotion::of(&inputs.motion()))
    }

    fn step(
        &self,
        state: &mut CascadeState,
        last: &RotorWrench,
        inputs: &SetPointInputs<'_>,
    ) -> ControlOutput {
        self.demand(state, last, &inputs.asked(), &HoverMotion::of(&inputs.motion()))
    }
}

impl CascadeLaw {
    /// The demand for `set_point`; advances the state of the inner loops by one period.
    pub fn demand(
        &self,
        state: &mut CascadeState,
        last: &RotorWrench,
        set_point: &SetPoint,
        measured: &HoverMotion,
    ) -> ControlOutput {
        // Before thrust is asked for, the vehicle may be turned by hand.
        if last.thrust_N <= self.vehicle.thrust_min_N {
            state.attitude_command[2] = measured.yaw_rad;
        }
        if state.attitude_in_steps == 0 {
            state.attitude_in_steps = self.attitude_every_steps;
            self.filter_commands(state, set_point);
            state.rate_command = self.rate_command_B_rad_s(state, measured).into();
        }
        state.attitude_in_steps -= 1;
        let [roll_rad, pitch_rad, yaw_rad] = state.attitude_command;
        let torque_B_N_m = self.torque_B_N_m(state, measured);
        let altitude_m = set_point.altitude_m;
        let thrust_N = self.altitude_loop().thrust_N(&mut state.integrals.lift, altitude_m, measured);
        ControlOutput {
            wrench: RotorWrench { thrust_N, torque_B_N_m },
            integrals: state.integrals,
            set_point: SetPoint { altitude_m, roll_rad, pitch_rad, yaw_rad },
            ..ControlOutput::default()
        }
    }

    /// The state to begin with: the integrators of the law before, commands as the vehicle lies, filters as it turns.
    #[must_use]
    pub fn begun<S>(
        &self,
        from: Option<&Predecessor<'_, S>>,
        altitude_set_m: f64,
        measured: &HoverMotion,
    ) -> CascadeState {
        let (gains, max_rad_s2) =
            (self.gains.rate.map(|axis| axis.integral_1_s2), self.gains.integral_max_rad_s2);
        let continued =
            |from| self.altitude_loop().continued(from, gains, max_rad_s2, altitude_set_m, measured);
        let tilt_max_rad = self.gains.filter.tilt_max_rad;
        let [roll_rad, pitch_rad] = [measured.roll_rad, measured.pitch_rad]
            .map(|angle_rad| angle_rad.clamp(-tilt_max_rad, tilt_max_rad));
        CascadeState {
            integrals: from.map(continued).unwrap_or_default(),
            attitude_command: [roll_rad, pitch_rad, measured.yaw_rad],
            rate_filtered: measured.angular_velocity_B_rad_s.into(),
            ..CascadeState::default()
        }
    }

    fn altitude_loop(&self) -> AltitudeLoop<'_> {
        AltitudeLoop { gains: self.gains.altitude, vehicle: &self.vehicle, period_s: self.period_s }
    }

    fn filter_commands(&self, state: &mut CascadeState, set_point: &SetPoint) {
        let (filter, period_s) = (&self.gains.filter, self.period_s * f64::from(self.attitude_every_steps));
        for (axis, asked_rad) in [set_point.roll_rad, set_point.pitch_rad].into_iter().enumerate() {
            let (angle, rate) = (state.attitude_command[axis], state.attitude_command_rate[axis]);
            let (angle, rate) = filter.moved(angle, rate, asked_rad, period_s);
            (state.attitude_command[axis], state.attitude_command_rate[axis]) = (angle, rate);
        }
        let turn_max_rad = filter.yaw_rate_max_rad_s * period_s;
        let yaw_rad = state.attitude_command[2];
        let turn_rad = wrap_rad(set_point.yaw_rad - yaw_rad).clamp(-turn_max_rad, turn_max_rad);
        state.attitude_command[2] = wrap_rad(yaw_rad + turn_rad);
    }

    /// Body rates that lead roll, pitch and yaw to `command`.
    fn rate_command_B_rad_s(&self, state: &CascadeState, measured: &HoverMotion) -> Vector3<f64> {
        let command = &state.attitude_command;
        let errors_rad = [
            wrap_rad(command[0] - measured.roll_rad),
            command[1] - measured.pitch_rad,
            wrap_rad(command[2] - measured.yaw_rad),
        ];
        let [roll_rate, pitch_rate, yaw_rate]: [f64; 3] = std::array::from_fn(|axis| {
            let max_rad_s = self.gains.rate_max_rad_s[axis];
            // The yaw command's own rate stays zero: yaw is slow.
            let fed_rad_s = self.gains.rate_feed_forward * state.attitude_command_rate[axis];
            (self.gains.attitude_1_s[axis] * errors_rad[axis] + fed_rad_s).clamp(-max_rad_s, max_rad_s)
        });
        let (sin_roll, cos_roll) = libm::sincos(measured.roll_rad);
        let (sin_pitch, cos_pitch) = libm::sincos(measured.pitch_rad);
        Vector3::new(
            roll_rate - yaw_rate * sin_pitch,
            pitch_rate * cos_roll + yaw_rate * sin_roll * cos_pitch,
            yaw_rate * cos_roll * cos_pitch - pitch_rate * sin_roll,
        )
    }

    fn torque_B_N_m(&self, state: &mut CascadeState, measured: &HoverMotion) -> Vector3<f64> {
        let mut acceleration_B_rad_s2 = Vector3::zeros();
        for (axis, integral) in state.integrals.turn.iter_mut().enumerate() {
            let rate_rad_s = measured.angular_velocity_B_rad_s[axis];
            let error_rad_s = state.rate_command[axis] - rate_rad_s;
            let change_rad_s2 = self.rate_change_rad_s2(&mut state.rate_filtered[axis], rate_rad_s);
            let (gains, max) = (&self.gains.rate[axis], self.gains.integral_max_rad_s2);
            *integral = (*integral + gains.integral_1_s2 * error_rad_s * self.period_s).clamp(-max, max);
            acceleration_B_rad_s2[axis] =
                gains.proportional_1_s * error_rad_s + *integral - gains.derivative * change_rad_s2;
        }
        self.vehicle.inertia_B_kg_m2.component_mul(&acceleration_B_rad_s2)
    }

    /// The measured rate's rate of change, behind a first-order filter whose state follows the rate.
    fn rate_change_rad_s2(&self, filtered_rad_s: &mut f64, rate_rad_s: f64) -> f64 {
        let time_s = self.gains.derivative_filter_s + self.period_s;
        let change_rad_s2 = (rate_rad_s - *filtered_rad_s) / time_s;
        *filtered_rad_s += change_rad_s2 * self.period_s;
        change_rad_s2
    }
}

impl CommandFilter {
    /// Angle and rate `period_s` on. Implicit in the rate, so that it is stable at any period.
    fn moved(&self, angle_rad: f64, rate_rad_s: f64, asked_rad: f64, period_s: f64) -> (f64, f64) {
        let error_rad = if self.tilt_max_rad < PI {
            asked_rad.clamp(-self.tilt_max_rad, self.tilt_max_rad) - angle_rad
        } else {
            wrap_rad(asked_rad - angle_rad)
        };
        let step = self.natural_frequency_rad_s * period_s;
        let pull_rad_s = self.natural_frequency_rad_s * step * error_rad;
        let rate_rad_s = (rate_rad_s + pull_rad_s) / (1.0 + 2.0 * self.damping_ratio * step + step * step);
        (angle_rad + rate_rad_s * period_s, rate_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> CascadeLaw {
        let vehicle = HoverModel {
            mass_kg: 0.5,
            inertia_B_kg_m2: Vector3::new(5.0e-3, 6.0e-3, 8.0e-3),
            gravity_m_s2: 9.81,
            thrust_min_N: 1.0,
            thrust_max_N: 10.0,
        };
        CascadeLaw { gains: CascadeGains::default(), vehicle, period_s: 1e-3, attitude_every_steps: 1 }
    }

    fn level() -> HoverMotion {
        HoverMotion {
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

    /// Wrench that was asked for in flight, so that the yaw command is not reset.
    const IN_FLIGHT: RotorWrench = RotorWrench { thrust_N: 5.0, torque_B_N_m: Vector3::new(0.0, 0.0, 0.0) };

    fn flying(measured: &HoverMotion) -> CascadeState {
        law().begun::<CascadeState>(None, 1.0, measured)
    }

    /// `seconds` of asking for `set_point` at a measurement that stays as it is.
    fn held(set_point: &SetPoint, measured: &HoverMotion, seconds: usize) -> (CascadeState, ControlOutput) {
        let mut state = flying(measured);
        let mut output = ControlOutput::default();
        for _ in 0..1000 * seconds {
            output = law().demand(&mut state, &IN_FLIGHT, set_point, measured);
        }
        (state, output)
    }

    #[test]
    fn where_half_a_turn_is_allowed_the_command_comes_round_and_nothing_pushes_down() {
        let mut law = law();
        law.gains.filter.tilt_max_rad = PI;
        let asked = |roll_rad: f64| SetPoint { roll_rad, ..hold() };
        let mut state = flying(&level());
        for step in 0..=1000 {
            law.demand(&mut state, &IN_FLIGHT, &asked(f64::from(step) * 1e-3 * 2.0 * PI), &level());
        }
        assert!(
            state.attitude_command[0] > 5.5,
            "it follows a ramp of a whole turn: {:?}",
            state.attitude_command
        );
        for _ in 0..1000 {
            law.demand(&mut state, &IN_FLIGHT, &hold(), &level());
        }
        assert!((state.attitude_command[0] - 2.0 * PI).abs() < 1e-3, "level is one turn on, not back");
        let upside_down = HoverMotion { roll_rad: PI, ..level() };
        let wrench = law.demand(&mut state, &IN_FLIGHT, &hold(), &upside_down).wrench;
        assert_eq!(wrench.thrust_N, law.vehicle.thrust_min_N);
    }

    #[test]
    fn the_attitude_loop_computes_on_every_nth_step_and_the_rate_loop_on_all() {
        let law = CascadeLaw { attitude_every_steps: 4, ..law() };
        let asked = SetPoint { roll_rad: 0.2, yaw_rad: 1.0, ..hold() };
        let (mut state, mut slow) = (flying(&level()), flying(&level()));
        let slower = CascadeLaw { period_s: 4e-3, attitude_every_steps: 1, ..law };
        for step in 0..40 {
            let turning = HoverMotion {
                angular_velocity_B_rad_s: Vector3::new(f64::from(step) * 1e-3, 0.0, 0.0),
                ..level()
            };
            let before = state;
            law.demand(&mut state, &IN_FLIGHT, &asked, &turning);
            let is_due = step % 4 == 0;
            assert_eq!(state.attitude_command != before.attitude_command, is_due, "step {step}");
            assert_eq!(state.rate_command != before.rate_command, is_due, "step {step}");
            assert_ne!(state.integrals.turn, before.integrals.turn, "step {step}");
            if is_due {
                slower.filter_commands(&mut slow, &asked);
                assert_eq!(state.attitude_command, slow.attitude_command, "as one of four times the period");
            }
        }
    }

    #[test]
    fn at_the_set_point_the_wrench_is_the_weight() {
        let wrench = law().demand(&mut flying(&level()), &IN_FLIGHT, &hold(), &level()).wrench;
        assert!((wrench.thrust_N - 0.5 * 9.81).abs() < 1e-12);
        assert_eq!(wrench.torque_B_N_m, Vector3::zeros());
    }

    #[test]
    fn a_step_of_the_stick_is_filtered_without_overshoot_and_cut_to_thirty_degrees() {
        let far = SetPoint { roll_rad: 1.2, pitch_rad: -1.2, ..hold() };
        let mut state = flying(&level());
        let mut rolls = Vec::new();
        for _ in 0..1000 {
            rolls.push(law().demand(&mut state, &IN_FLIGHT, &far, &level()).set_point.roll_rad);
        }
        assert!(rolls[0] < 0.01 && rolls.windows(2).all(|pair| pair[0] <= pair[1]));
        assert!((rolls[999] - 30.0_f64.to_radians()).abs() < 1e-6);
        assert!((state.attitude_command[1] + 30.0_f64.to_radians()).abs() < 1e-6);
    }

    #[test]
    fn every_error_and_rate_acts_with_its_sign() {
        let set = SetPoint { roll_rad: 0.1, pitch_rad: -0.1, yaw_rad: 0.2, ..hold() };
        let torque = held(&set, &level(), 1).1.wrench.torque_B_N_m;
        assert!(torque.x > 0.0 && torque.y < 0.0 && torque.z > 0.0, "{torque}");
        let turning = HoverMotion { angular_velocity_B_rad_s: Vector3::new(1.0, 0.0, 0.0), ..level() };
        let torque = law().demand(&mut flying(&turning), &IN_FLIGHT, &hold(), &turning).wrench.torque_B_N_m;
        let rate = law().gains.rate[0];
        let expected_N_m = -5.0e-3 * (rate.proportional_1_s + rate.integral_1_s2 * 1e-3);
        assert!((torque.x - expected_N_m).abs() < 1e-12, "{torque}");
    }

    #[test]
    fn the_derivative_opposes_a_growing_rate() {
        let turning = HoverMotion { angular_velocity_B_rad_s: Vector3::new(0.1, 0.0, 0.0), ..level() };
        let mut at_rest = flying(&level());
        let growing = law().demand(&mut at_rest, &IN_FLIGHT, &hold(), &turning).wrench.torque_B_N_m.x;
        let steady = law().demand(&mut flying(&turning), &IN_FLIGHT, &hold(), &turning).wrench.torque_B_N_m.x;
        assert!(growing < steady && steady < 0.0);
    }

    #[test]
    fn the_yaw_command_turns_the_short_way_at_the_sticks_rate_and_comes_round() {
        let at = |yaw_rad| HoverMotion { yaw_rad, ..level() };
        let asked = SetPoint { yaw_rad: -3.0, ..hold() };
        let mut state = flying(&at(3.0));
        law().demand(&mut state, &IN_FLIGHT, &asked, &at(3.0));
        let turned_rad = state.attitude_command[2] - 3.0;
        assert!((turned_rad - 90.0_f64.to_radians() * 1e-3).abs() < 1e-9, "{turned_rad}");
        let (state, _) = held(&asked, &at(3.0), 1);
        assert!((state.attitude_command[2] + 3.0).abs() < 1e-9);
    }

    #[test]
    fn without_thrust_the_yaw_command_is_the_measured_yaw() {
        let turned = HoverMotion { yaw_rad: 2.0, ..level() };
        let none = RotorWrench::default();
        let output =
            law().demand(&mut flying(&level()), &none, &SetPoint { yaw_rad: 2.0, ..hold() }, &turned);
        assert_eq!(output.set_point.yaw_rad, 2.0);
    }

    #[test]
    fn a_yaw_rate_in_a_bank_needs_body_pitch_rate() {
        let banked = HoverMotion { roll_rad: 0.4, ..level() };
        let state = CascadeState { attitude_command: [0.4, 0.0, 0.5], ..CascadeState::default() };
        let rates = law().rate_command_B_rad_s(&state, &banked);
        let yaw_rate = law().gains.attitude_1_s[2] * 0.5;
        assert!((rates.y - yaw_rate * libm::sin(0.4)).abs() < 1e-12);
        assert!((rates.z - yaw_rate * libm::cos(0.4)).abs() < 1e-12);
    }

    fn after(wrench: RotorWrench, integrals: Option<Integrals>) -> Predecessor<'static, CascadeState> {
        Predecessor { wrench, integrals, state: None }
    }

    #[test]
    fn a_backup_goes_on_from_the_integrators_and_from_where_the_vehicle_is() {
        let wrench = RotorWrench { thrust_N: 5.2, torque_B_N_m: Vector3::new(1e-3, -2e-3, 1e-3) };
        let measured = HoverMotion { roll_rad: 0.05, yaw_rad: 1.0, ..level() };
        let before = Integrals { lift: 0.3, turn: [0.1, f64::NAN, 9.0] };
        let state = law().begun(Some(&after(wrench, Some(before))), 1.0, &measured);
        assert_eq!(state.integrals, Integrals { lift: 0.3, turn: [0.1, 0.0, 2.0] });
        assert_eq!(state.attitude_command, [0.05, 0.0, 1.0]);
    }

    #[test]
    fn a_backup_that_knows_only_the_last_command_asks_for_its_thrust() {
        let wrench = RotorWrench { thrust_N: 5.2, torque_B_N_m: Vector3::zeros() };
        let mut state = law().begun(Some(&after(wrench, None)), 1.0, &level());
        let asked = law().demand(&mut state, &wrench, &hold(), &level()).wrench;
        assert!((asked.thrust_N - wrench.thrust_N).abs() < 1e-12, "{asked:?}");
    }
}
