//! Attitude from an IMU: gyroscope in the short term, accelerometer in the long (thesis §4.3).
//!
//! The thesis's filter, once a sample: angle = 0.98·(angle + rate·dt) + 0.02·acc, where `acc` is the
//! angle that the accelerometer reads. Here it is the same filter with three things settled:
//!
//! *Time constant.* 0.98 says nothing without a sample time, which the thesis leaves out. A weight w at
//! period dt is a first-order low pass of time constant τ = dt·w/(1−w); we keep τ and compute
//! w = τ/(τ+dt), so that the filter is the same at any rate.
//!
//! *Its value.* 0.98 at 1 kHz is τ = 49 ms. In free flight that follows the accelerometer, and the
//! accelerometer cannot see tilt there: it measures all forces but gravity, which without drag are the
//! rotors' thrust along body z, so it reads "level" at any attitude. A roll of 10° held for 1 s would be
//! estimated as about 0°, and a controller would roll on. In time t the part t/τ of the angle leaks away. The
//! gyroscope's noise density n adds n·√(τ/2), and its bias b adds b·τ. The default, τ = 30 s, loses 0.33° of
//! 10° in 1 s and adds 0.04° of noise with the default IMU. No value of τ cures the cause. As long as only
//! thrust acts on the accelerometer, a controller that holds the estimate at zero lets the truth drift at the
//! bias b. Drag makes tilt visible again, with its own delay.
//!
//! *Rates.* The gyroscope gives body rates p, q, r; the angles' own rates follow from them by eq. 3.18,
//! singular at ±90° of pitch. A unit quaternion is propagated instead, which is the same to first order
//! in dt and has no singularity; the blend happens in roll and pitch and leaves yaw to the gyroscope.

use crate::imu_model::ImuReading;
use crate::wire::{attitude, attitude_message, vector, vector_message};
use component::context::{NodeContext, StepContext};
use component::messages::{AttitudeEstimate, Imu, Quaternion, Vector3 as VectorMessage};
use component::{Component, Info, InputPorts, Message, OutputPorts, Parameters as _, StepError};
use diagnostics::parameter::{ParameterError, not_negative, positive, within};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// Beyond this pitch (rad) roll and yaw are hard to tell apart, and the accelerometer is left out.
const PITCH_BLEND_MAX_RAD: f64 = 1.4;

/// Parameters of the filter: its trust in the accelerometer.
#[derive(Debug, Clone, Copy, PartialEq, component::Parameters)]
#[parameters(default)]
pub struct ComplementaryParams {
    /// Time constant with which roll and pitch follow the accelerometer.
    ///
    /// Tuned, no source, see the head of this file; the thesis's 0.98 at 1 kHz is 0.049 s.
    #[parameter(default = 30.0, check = positive)]
    pub time_constant_s: f64,
    /// In place of the time constant: the gyroscope's weight once every period; the thesis's is 0.98 (§4.3).
    ///
    /// The filter then depends on its period: see the head of this file.
    #[parameter(check = within(f64::EPSILON..1.0, "above 0 and below 1"))]
    pub gyroscope_weight: Option<f64>,
    /// The accelerometer is left out where its reading differs from gravity by more than this fraction.
    ///
    /// Tuned, no source: then it surely measures more than gravity.
    #[parameter(default = 0.2, check = not_negative)]
    pub gravity_tolerance: f64,
    /// Gravity (thesis §3.1).
    #[parameter(default = 9.81, check = positive)]
    pub gravity_m_s2: f64,
}

/// The gyroscope's weight once every `period_s` in a filter of `time_constant_s`.
fn gyroscope_weight(time_constant_s: f64, period_s: f64) -> f64 {
    time_constant_s / (time_constant_s + period_s)
}

/// Roll and pitch (rad) of a body on which gravity alone makes the specific force (body axes, any unit).
///
/// At rest the specific force is +g along world z, which in body axes is
/// g·(−sin θ, sin φ·cos θ, cos φ·cos θ).
pub(crate) fn tilt_rad(specific_force_B: &Vector3<f64>) -> (f64, f64) {
    let [x, y, z]: [f64; 3] = (*specific_force_B).into();
    (libm::atan2(y, z), libm::atan2(-x, libm::hypot(y, z)))
}

/// The filter at one sample period, with everything that does not change during a run.
///
/// ```
/// use nalgebra::Vector3;
/// use sensors::complementary::{Complementary, ComplementaryParams, ComplementaryState};
/// use sensors::imu_model::ImuReading;
///
/// let filter = Complementary::with_period(ComplementaryParams::default(), 1e-3).unwrap();
/// let mut state = ComplementaryState::default();
/// let rolling = ImuReading {
///     specific_force_B_m_s2: Vector3::new(0.0, 0.0, 9.81),
///     angular_velocity_B_rad_s: Vector3::new(0.5, 0.0, 0.0),
/// };
/// let roll_rad = (0..=100).map(|_| filter.update(&mut state, &rolling).roll).last().unwrap();
/// assert!((roll_rad - 0.05).abs() < 1e-3, "0.5 rad/s for 0.1 s: {roll_rad} rad");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complementary {
    params: ComplementaryParams,
    accelerometer_weight: f64,
    period_s: f64,
}

/// State of the filter between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ComplementaryState")]
pub struct ComplementaryState {
    /// The estimated attitude at the last sample, body to world.
    #[field(frame = "world")]
    pub attitude: Quaternion,
    /// The last sample's angular rate; not a number before the first.
    #[field(unit = "rad/s", frame = "body")]
    pub last_angular_velocity: VectorMessage,
}

/// Before the first sample, level.
impl Default for ComplementaryState {
    fn default() -> Self {
        Self { attitude: Quaternion::default(), last_angular_velocity: [f64::NAN; 3].into() }
    }
}

impl Complementary {
    /// A filter that is given a reading every `period_s`.
    ///
    /// # Errors
    /// A parameter or the period is outside its range.
    pub fn with_period(params: ComplementaryParams, period_s: f64) -> Result<Self, ParameterError> {
        params.validate()?;
        positive("period_s", period_s)?;
        let of_time_constant = || gyroscope_weight(params.time_constant_s, period_s);
        let accelerometer_weight = 1.0 - params.gyroscope_weight.unwrap_or_else(of_time_constant);
        Ok(Self { params, accelerometer_weight, period_s })
    }

    /// The estimate at the time of `reading`, one period after the last one.
    ///
    /// The first reading does not turn the attitude: the state already holds that sample's attitude.
    pub fn update(&self, state: &mut ComplementaryState, reading: &ImuReading) -> AttitudeEstimate {
        let turned_WB = self.propagate(state, reading.angular_velocity_B_rad_s);
        let attitude_WB = self.blend(turned_WB, &reading.specific_force_B_m_s2);
        let angular_velocity = vector_message(reading.angular_velocity_B_rad_s);
        let attitude = attitude_message(attitude_WB);
        *state = ComplementaryState { attitude, last_angular_velocity: angular_velocity };
        let (roll, pitch, yaw) = attitude_WB.euler_angles();
        AttitudeEstimate { attitude, roll, pitch, yaw, angular_velocity, ..Default::default() }
    }

    /// The last attitude turned by the mean of the last and the present rate for one period.
    fn propagate(&self, state: &ComplementaryState, rate_B_rad_s: Vector3<f64>) -> UnitQuaternion<f64> {
        let (before_WB, last_B_rad_s) = (attitude(state.attitude), vector(state.last_angular_velocity));
        if last_B_rad_s.x.is_nan() {
            return before_WB;
        }
        let turn_B_rad = 0.5 * (last_B_rad_s + rate_B_rad_s) * self.period_s;
        let turned = before_WB * UnitQuaternion::from_scaled_axis(turn_B_rad);
        // Rounding would let the norm wander over a long run.
        UnitQuaternion::new_normalize(turned.into_inner())
    }

    /// `attitude` with roll and pitch drawn to the accelerometer's, if it can be trusted.
    fn blend(
        &self,
        attitude: UnitQuaternion<f64>,
        specific_force_B_m_s2: &Vector3<f64>,
    ) -> UnitQuaternion<f64> {
        let (roll_rad, pitch_rad, yaw_rad) = attitude.euler_angles();
        if pitch_rad.abs() > PITCH_BLEND_MAX_RAD || !self.is_gravity(specific_force_B_m_s2) {
            return attitude;
        }
        let (roll_read_rad, pitch_read_rad) = tilt_rad(specific_force_B_m_s2);
        UnitQuaternion::from_euler_angles(
            roll_rad + self.accelerometer_weight * wrap_rad(roll_read_rad - roll_rad),
            pitch_rad + self.accelerometer_weight * (pitch_read_rad - pitch_rad),
            yaw_rad,
        )
    }

    fn is_gravity(&self, specific_force_B_m_s2: &Vector3<f64>) -> bool {
        let gravity_m_s2 = self.params.gravity_m_s2;
        let excess_m_s2 = (specific_force_B_m_s2.norm() - gravity_m_s2).abs();
        excess_m_s2 <= self.params.gravity_tolerance * gravity_m_s2
    }
}

/// Inputs of the filter.
#[derive(Debug, InputPorts)]
pub struct ImuInputs<'a> {
    /// Readings of the inertial measurement unit.
    pub imu: &'a Imu,
}

/// Outputs of the filter.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The attitude.
    pub estimate: AttitudeEstimate,
}

impl Component for Complementary {
    const INFO: Info = Info::new("attitude", "complementary filter: roll, pitch and yaw from an IMU");
    type Parameters = ComplementaryParams;
    type Inputs<'a> = ImuInputs<'a>;
    type Outputs = Outputs;
    type State = ComplementaryState;

    fn new(params: ComplementaryParams, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Self::with_period(params, context.period_s())
    }

    fn initial(&self) -> ComplementaryState {
        ComplementaryState::default()
    }

    fn step(
        &self,
        _: &StepContext<'_>,
        inputs: ImuInputs<'_>,
        state: &mut ComplementaryState,
    ) -> Result<Outputs, StepError> {
        Ok(Outputs { estimate: self.update(state, &ImuReading::from(inputs.imu)) })
    }
}

/// `angle_rad` less whole turns, −π to π.
fn wrap_rad(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    /// The thesis's weight of the gyroscope, once a sample (§4.3).
    const THESIS_GYROSCOPE_WEIGHT: f64 = 0.98;

    /// The time constant (s) of a filter that weighs the gyroscope so once every `period_s`.
    fn time_constant_s(gyroscope_weight: f64, period_s: f64) -> f64 {
        period_s * gyroscope_weight / (1.0 - gyroscope_weight)
    }

    /// Before the first sample of a body at these angles.
    fn at_attitude(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> ComplementaryState {
        let attitude_WB = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, yaw_rad);
        ComplementaryState { attitude: attitude_message(attitude_WB), ..Default::default() }
    }

    fn filter(time_constant_s: f64) -> Complementary {
        let params = ComplementaryParams { time_constant_s, ..ComplementaryParams::default() };
        Complementary::with_period(params, PERIOD_S).unwrap()
    }

    fn reading(force_B: Vector3<f64>, rate_B: Vector3<f64>) -> ImuReading {
        ImuReading { specific_force_B_m_s2: force_B, angular_velocity_B_rad_s: rate_B }
    }

    /// Returns the reading of an IMU at rest at these angles.
    fn at_rest(roll_rad: f64, pitch_rad: f64) -> ImuReading {
        let attitude_WB = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.4);
        reading(attitude_WB.inverse() * Vector3::new(0.0, 0.0, 9.81), Vector3::zeros())
    }

    #[test]
    fn the_thesis_weight_at_a_kilohertz_is_49_ms_and_back() {
        let tau_s = time_constant_s(THESIS_GYROSCOPE_WEIGHT, PERIOD_S);
        assert!((tau_s - 0.049).abs() < 1e-12);
        assert!((gyroscope_weight(tau_s, PERIOD_S) - THESIS_GYROSCOPE_WEIGHT).abs() < 1e-12);
    }

    #[test]
    fn one_sample_is_the_formula_of_the_thesis() {
        let filter = filter(time_constant_s(THESIS_GYROSCOPE_WEIGHT, PERIOD_S));
        let mut state = at_attitude(0.1, 0.0, 0.0);
        let rate_B = Vector3::new(0.5, 0.0, 0.0);
        state.last_angular_velocity = vector_message(rate_B);
        let force_B = at_rest(0.2, 0.0).specific_force_B_m_s2;
        let estimate = filter.update(&mut state, &reading(force_B, rate_B));
        let expected = 0.98 * (0.1 + 0.5 * PERIOD_S) + 0.02 * 0.2;
        assert!((estimate.roll - expected).abs() < 1e-12);
    }

    #[test]
    fn a_weight_is_taken_as_it_is_whatever_the_period() {
        let weighed = |gyroscope_weight| ComplementaryParams { gyroscope_weight, ..Default::default() };
        for period_s in [1e-3, 0.05] {
            let printed =
                Complementary::with_period(weighed(Some(THESIS_GYROSCOPE_WEIGHT)), period_s).unwrap();
            let tau_s = time_constant_s(THESIS_GYROSCOPE_WEIGHT, period_s);
            let params = ComplementaryParams { time_constant_s: tau_s, ..Default::default() };
            let ours = Complementary::with_period(params, period_s).unwrap();
            assert!((printed.accelerometer_weight - ours.accelerometer_weight).abs() < 1e-12, "{period_s} s");
        }
        for weight in [0.0, 1.0, -0.1, f64::NAN] {
            let error = Complementary::with_period(weighed(Some(weight)), 1e-3).unwrap_err().to_string();
            assert!(error.contains("`gyroscope_weight`") && error.contains("below 1"), "{error}");
        }
    }

    #[test]
    fn the_accelerometer_reads_tilt_with_the_sign_of_the_angle() {
        for (roll, pitch) in [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.1, -0.2), (2.5, 0.4)] {
            let (roll_read, pitch_read) = tilt_rad(&at_rest(roll, pitch).specific_force_B_m_s2);
            assert!((roll_read - roll).abs() < 1e-12 && (pitch_read - pitch).abs() < 1e-12);
        }
    }

    #[test]
    fn at_rest_the_estimate_settles_on_the_accelerometer_within_the_time_constant() {
        let filter = filter(0.5);
        let mut state = ComplementaryState::default();
        let mut estimate = filter.update(&mut state, &at_rest(0.2, -0.1));
        (0..500).for_each(|_| estimate = filter.update(&mut state, &at_rest(0.2, -0.1)));
        let left = libm::exp(-1.0);
        assert!((estimate.roll - 0.2 * (1.0 - left)).abs() < 1e-3);
        assert!((estimate.pitch + 0.1 * (1.0 - left)).abs() < 1e-3);
        (0..5000).for_each(|_| estimate = filter.update(&mut state, &at_rest(0.2, -0.1)));
        assert!((estimate.roll - 0.2).abs() < 1e-4 && (estimate.pitch + 0.1).abs() < 1e-4);
        assert!(estimate.yaw.abs() < 1e-9);
    }

    /// Eq. 3.18: the rates of the angles against the body rates, at an attitude where all terms count.
    #[test]
    fn the_angles_turn_by_the_euler_rates() {
        let (roll, pitch, yaw) = (0.5_f64, 0.6_f64, -1.0_f64);
        let [p, q, r] = [0.7, -0.4, 0.9];
        let mut state = at_attitude(roll, pitch, yaw);
        state.last_angular_velocity = [p, q, r].into();
        let fall = reading(Vector3::zeros(), Vector3::new(p, q, r));
        let estimate = filter(30.0).update(&mut state, &fall);
        let roll_rate = p + libm::tan(pitch) * (q * libm::sin(roll) + r * libm::cos(roll));
        let pitch_rate = q * libm::cos(roll) - r * libm::sin(roll);
        let yaw_rate = (q * libm::sin(roll) + r * libm::cos(roll)) / libm::cos(pitch);
        // The rates change within the step, by its square.
        assert!((estimate.roll - roll - roll_rate * PERIOD_S).abs() < 2e-6);
        assert!((estimate.pitch - pitch - pitch_rate * PERIOD_S).abs() < 2e-6);
        assert!((estimate.yaw - yaw - yaw_rate * PERIOD_S).abs() < 2e-6);
    }

    #[test]
    fn a_loop_through_ninety_degrees_of_pitch_comes_back() {
        let filter = filter(30.0);
        let mut state = ComplementaryState::default();
        let rate_B = Vector3::new(0.0, TAU, 0.0);
        let mut estimate = filter.update(&mut state, &reading(Vector3::zeros(), rate_B));
        (0..1000).for_each(|_| estimate = filter.update(&mut state, &reading(Vector3::zeros(), rate_B)));
        let attitude_WB = attitude(estimate.attitude);
        assert!(attitude_WB.angle() < 1e-9);
        assert!((attitude_WB.norm() - 1.0).abs() < 1e-12);
    }

    /// The reason for the default: powered flight without drag, 10° of roll held for 1 s.
    #[test]
    fn a_roll_held_in_flight_survives_our_time_constant_but_not_that_of_the_thesis() {
        let thrust_only = reading(Vector3::new(0.0, 0.0, 9.96), Vector3::zeros());
        let held_deg = |time_constant_s| {
            let mut state = at_attitude(10.0_f64.to_radians(), 0.0, 0.0);
            (0..1000).for_each(|_| {
                filter(time_constant_s).update(&mut state, &thrust_only);
            });
            attitude(state.attitude).euler_angles().0.to_degrees()
        };
        assert!(held_deg(ComplementaryParams::default().time_constant_s) > 9.6);
        assert!(held_deg(0.049) < 0.01);
    }

    #[test]
    fn a_hard_push_is_not_taken_for_gravity() {
        let mut state = ComplementaryState::default();
        let push = reading(Vector3::new(15.0, 0.0, 9.81), Vector3::zeros());
        let estimate = filter(0.1).update(&mut state, &push);
        assert_eq!(estimate.pitch, 0.0);
    }

    #[test]
    fn impossible_parameters_are_named() {
        let params = ComplementaryParams { time_constant_s: -1.0, ..ComplementaryParams::default() };
        let error = Complementary::with_period(params, PERIOD_S).unwrap_err().to_string();
        assert!(error.contains("time_constant_s") && error.contains("-1"), "{error}");
    }
}
