//! Effects of an IMU's mounting and mechanics on its readings before noise: position, vibration by the rotors,
//! bandwidth, alignment of the axes, and drift as it warms up; and its resolution, after noise.
//!
//! In the order of the signal: lever arm, vibration, bandwidth, then alignment and scale, then the biases due to
//! acceleration and temperature. All are off by default.

use crate::imu_model::{ImuParams, ImuReading};
use crate::steps::in_steps;
use component::messages::{PerRotor, ROTORS_MAX};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Angles of the rotors at the first reading: a golden angle apart, so that no two shake alike.
const START_ANGLES_RAD: [f64; ROTORS_MAX] =
    [0.0, 2.4, 4.8, 0.917, 3.317, 5.717, 1.834, 4.234, 0.35, 2.75, 5.15, 1.267];

/// The part at one sample rate.
///
/// ```
/// use nalgebra::Vector3;
/// use sensors::imu_model::{ImuParams, ImuReading};
/// use sensors::imu_part::{ImuMotion, ImuPart, ImuPartState};
///
/// let params = ImuParams { position_m: [0.1, 0.0, 0.0], ..ImuParams::default() };
/// let part = ImuPart::new(params, 1000.0);
/// let motion = ImuReading { angular_velocity_B_rad_s: Vector3::z() * 2.0, ..ImuReading::default() };
/// let truth = ImuMotion { motion, rotor_speeds_rad_s: [400.0; 4].into(), time_s: 0.0 };
/// let felt = part.feel(&mut ImuPartState::default(), &truth).specific_force_B_m_s2;
/// assert!((felt.x + 0.4).abs() < 1e-12, "10 cm off a turn of 2 rad/s, in m/s^2: {felt:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuPart {
    params: ImuParams,
    period_s: f64,
    /// Rotation of vectors in body axes to the readings of the axes of each triad.
    force_axes: Matrix3<f64>,
    rate_axes: Matrix3<f64>,
    /// Share of a new value that the filters take over in a period; 1 without a filter.
    force_share: f64,
    rate_share: f64,
}

/// State of the part from one reading to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuPartState {
    /// Readings so far.
    pub readings: u64,
    /// The angle of each rotor, 0 to 2π, from where it started.
    pub rotor_angles_rad: [f64; ROTORS_MAX],
    /// The true angular velocity at the last reading.
    pub last_B_rad_s: Vector3<f64>,
    /// Outputs of the filters.
    pub filtered: ImuReading,
}

/// The truth at a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuMotion {
    /// At the centre of mass, in body axes.
    pub motion: ImuReading,
    /// Rotor speeds.
    pub rotor_speeds_rad_s: PerRotor,
    /// Since the part was switched on.
    pub time_s: f64,
}

impl ImuPart {
    /// The part of `params`, which are valid, read `rate_hz` times a second.
    #[must_use]
    pub fn new(params: ImuParams, rate_hz: f64) -> Self {
        let turn =
            UnitQuaternion::from_scaled_axis(Vector3::from(params.misalignment_deg.map(f64::to_radians)));
        // From body axes to those of the part.
        let turned = turn.inverse().to_rotation_matrix().into_inner();
        let axes = |scale_errors: [f64; 3], [xy, xz, yx, yz, zx, zy]: [f64; 6]| {
            let scale = Matrix3::from_diagonal(&Vector3::from(scale_errors).add_scalar(1.0));
            scale * Matrix3::new(1.0, xy, xz, yx, 1.0, yz, zx, zy, 1.0) * turned
        };
        let share = |bandwidth_hz: f64| match bandwidth_hz {
            0.0 => 1.0,
            corner_hz => -libm::expm1(-TAU * corner_hz / rate_hz),
        };
        Self {
            params,
            period_s: rate_hz.recip(),
            force_axes: axes(params.accelerometer_scale_error, params.accelerometer_cross_axis),
            rate_axes: axes(params.gyroscope_scale_error, params.gyroscope_cross_axis),
            force_share: share(params.accelerometer_bandwidth_hz),
            rate_share: share(params.gyroscope_bandwidth_hz),
        }
    }

    /// Returns the quantities that the triads feel, in their own axes, without noise.
    pub fn feel(&self, state: &mut ImuPartState, truth: &ImuMotion) -> ImuReading {
        let shaken = self.shaken(state, truth, &self.at_its_place(state, &truth.motion));
        let is_first = state.readings == 0;
        let follow = |share: f64, old: Vector3<f64>, new: Vector3<f64>| {
            if is_first || share == 1.0 { new } else { old + (new - old) * share }
        };
        state.filtered = ImuReading {
            specific_force_B_m_s2: follow(
                self.force_share,
                state.filtered.specific_force_B_m_s2,
                shaken.specific_force_B_m_s2,
            ),
            angular_velocity_B_rad_s: follow(
                self.rate_share,
                state.filtered.angular_velocity_B_rad_s,
                shaken.angular_velocity_B_rad_s,
            ),
        };
        state.last_B_rad_s = truth.motion.angular_velocity_B_rad_s;
        state.readings += 1;
        self.in_its_axes(&state.filtered, truth.time_s)
    }

    /// The specific force at the part's place: f + α × r + ω × (ω × r). α is the change of ω since the reading
    /// before, so it is half a period late.
    fn at_its_place(&self, state: &ImuPartState, motion: &ImuReading) -> ImuReading {
        let (arm_B_m, spin_B_rad_s) =
            (Vector3::from(self.params.position_m), motion.angular_velocity_B_rad_s);
        let last_B_rad_s = if state.readings == 0 { spin_B_rad_s } else { state.last_B_rad_s };
        let turning_B_rad_s2 = (spin_B_rad_s - last_B_rad_s) / self.period_s;
        let more_B_m_s2 =
            turning_B_rad_s2.cross(&arm_B_m) + spin_B_rad_s.cross(&spin_B_rad_s.cross(&arm_B_m));
        ImuReading { specific_force_B_m_s2: motion.specific_force_B_m_s2 + more_B_m_s2, ..*motion }
    }

    /// Rotors turn in turns one way and the other. Each rotor's unbalance shakes the part in a circle in the
    /// plane of the rotors, once a turn. Its two blades shake it along the axis, twice a turn. With an
    /// amplitude d the acceleration is d Ω², and of an angle φ the rate φ Ω.
    fn shaken(&self, state: &mut ImuPartState, truth: &ImuMotion, motion: &ImuReading) -> ImuReading {
        let mut shaken = *motion;
        if state.readings == 0 {
            state.rotor_angles_rad = START_ANGLES_RAD;
        }
        let shakes =
            self.params.accelerometer_vibration_m != 0.0 || self.params.gyroscope_vibration_rad != 0.0;
        let senses = [1.0, -1.0].into_iter().cycle();
        let rotors = state.rotor_angles_rad.iter_mut().zip(truth.rotor_speeds_rad_s).zip(senses);
        for ((angle_rad, speed_rad_s), sense) in rotors {
            if state.readings > 0 {
                let turned = (*angle_rad + speed_rad_s * self.period_s) / TAU;
                *angle_rad = (turned - turned.floor()) * TAU;
            }
            if !shakes {
                continue;
            }
            let (sine, cosine) = libm::sincos(*angle_rad);
            let along = Vector3::new(cosine, sense * sine, cosine * cosine - sine * sine);
            shaken.specific_force_B_m_s2 +=
                along * (self.params.accelerometer_vibration_m * speed_rad_s * speed_rad_s);
            shaken.angular_velocity_B_rad_s += along * (self.params.gyroscope_vibration_rad * speed_rad_s);
        }
        shaken
    }

    fn in_its_axes(&self, felt: &ImuReading, time_s: f64) -> ImuReading {
        let params = &self.params;
        let warmed_k = params.warming_k * -libm::expm1(-time_s / params.warming_time_s);
        let drift = |per_k: [f64; 3]| Vector3::from(per_k) * warmed_k;
        let force = self.force_axes * felt.specific_force_B_m_s2;
        let pulled = Vector3::from(params.gyroscope_g_sensitivity).component_mul(&force);
        ImuReading {
            specific_force_B_m_s2: force + drift(params.accelerometer_bias_drift_m_s2_k),
            angular_velocity_B_rad_s: self.rate_axes * felt.angular_velocity_B_rad_s
                + pulled
                + drift(params.gyroscope_bias_drift_rad_s_k),
        }
    }

    /// A reading in whole steps of the part's resolution, within its range.
    #[must_use]
    pub fn in_steps(&self, reading: &ImuReading) -> ImuReading {
        let rounded = |vector: Vector3<f64>, step: f64, range: f64| {
            vector.map(|axis| in_steps(axis, step).clamp(-range, range))
        };
        ImuReading {
            specific_force_B_m_s2: rounded(
                reading.specific_force_B_m_s2,
                self.params.accelerometer_resolution_m_s2,
                self.params.accelerometer_range_m_s2,
            ),
            angular_velocity_B_rad_s: rounded(
                reading.angular_velocity_B_rad_s,
                self.params.gyroscope_resolution_rad_s,
                self.params.gyroscope_range_rad_s,
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 1000.0;

    fn part(params: ImuParams) -> ImuPart {
        ImuPart::new(params, RATE_HZ)
    }

    fn moving() -> ImuMotion {
        ImuMotion {
            motion: ImuReading {
                specific_force_B_m_s2: Vector3::new(0.3, -0.2, 9.81),
                angular_velocity_B_rad_s: Vector3::new(0.1, -0.7, 0.02),
            },
            rotor_speeds_rad_s: [400.0, 410.0, 420.0, 430.0].into(),
            time_s: 0.0,
        }
    }

    /// Returns the quantities that are felt in one reading of `truth`.
    fn felt(params: ImuParams, truth: &ImuMotion) -> ImuReading {
        part(params).feel(&mut ImuPartState::default(), truth)
    }

    #[test]
    fn by_default_it_feels_the_truth_bit_for_bit() {
        let (part, mut state) = (part(ImuParams::default()), ImuPartState::default());
        for tick in 0..100 {
            let mut truth = moving();
            truth.motion.angular_velocity_B_rad_s.x = 0.01 * f64::from(tick);
            let felt = part.feel(&mut state, &truth);
            assert_eq!((felt, part.in_steps(&felt)), (truth.motion, truth.motion));
        }
    }

    #[test]
    fn beside_the_centre_of_mass_it_feels_a_turn() {
        let params = ImuParams { position_m: [0.1, 0.0, 0.02], ..ImuParams::default() };
        let (part, mut state) = (part(params), ImuPartState::default());
        let turning = |rate_rad_s: f64| ImuMotion {
            motion: ImuReading {
                angular_velocity_B_rad_s: Vector3::z() * rate_rad_s,
                ..ImuReading::default()
            },
            ..moving()
        };
        // A steady turn pulls inwards with w^2 r, along x; a turn that grows by 5 rad/s^2 pushes along y with 5 r.
        assert!(
            (part.feel(&mut state, &turning(2.0)).specific_force_B_m_s2 + Vector3::x() * 0.4).norm() < 1e-12
        );
        let felt = part.feel(&mut state, &turning(2.005)).specific_force_B_m_s2;
        assert!((felt - Vector3::new(-0.1 * 2.005 * 2.005, 0.5, 0.0)).norm() < 1e-9, "{felt:?}");
    }

    #[test]
    fn rotors_shake_it_at_their_own_speeds() {
        let params = ImuParams {
            accelerometer_vibration_m: 2e-6,
            gyroscope_vibration_rad: 1e-5,
            ..ImuParams::default()
        };
        let (part, mut state) = (part(params), ImuPartState::default());
        let truth = ImuMotion { rotor_speeds_rad_s: [400.0, 0.0, 0.0, 0.0].into(), ..moving() };
        let (mut at_speed, mut elsewhere) = ([0.0; 2], [0.0; 2]);
        for tick in 0..10_000 {
            let felt = part.feel(&mut state, &truth);
            let x = felt.specific_force_B_m_s2.x - 0.3;
            for (sums, speed_rad_s) in [(&mut at_speed, 400.0), (&mut elsewhere, 300.0)] {
                let (sine, cosine) = libm::sincos(speed_rad_s * f64::from(tick) / RATE_HZ);
                sums[0] += x * cosine / 5_000.0;
                sums[1] += x * sine / 5_000.0;
            }
            let rate = felt.angular_velocity_B_rad_s - truth.motion.angular_velocity_B_rad_s;
            assert!((rate.xy().norm() - 1e-5 * 400.0).abs() < 1e-12, "a circle of its own: {rate:?}");
        }
        // d w^2 = 0.32 m/s^2.
        assert!((libm::hypot(at_speed[0], at_speed[1]) - 0.32).abs() < 1e-3, "{at_speed:?}");
        assert!(libm::hypot(elsewhere[0], elsewhere[1]) < 1e-3, "{elsewhere:?}");
    }

    #[test]
    fn it_follows_a_step_with_the_time_constant_of_its_bandwidth() {
        let params = ImuParams { gyroscope_bandwidth_hz: 20.0, ..ImuParams::default() };
        let (part, mut state) = (part(params), ImuPartState::default());
        let at = |rate_rad_s: f64| ImuMotion {
            motion: ImuReading { angular_velocity_B_rad_s: Vector3::y() * rate_rad_s, ..moving().motion },
            ..moving()
        };
        assert_eq!(part.feel(&mut state, &at(0.0)).angular_velocity_B_rad_s.y, 0.0);
        for tick in 1..100 {
            let felt = part.feel(&mut state, &at(1.0));
            let expected = 1.0 - libm::exp(-TAU * 20.0 * f64::from(tick) / RATE_HZ);
            assert!((felt.angular_velocity_B_rad_s.y - expected).abs() < 1e-12, "tick {tick}");
            assert_eq!(
                felt.specific_force_B_m_s2,
                moving().motion.specific_force_B_m_s2,
                "the other has none"
            );
        }
    }

    #[test]
    fn axes_lie_where_they_are_said_to_and_scale() {
        let params = ImuParams {
            accelerometer_scale_error: [0.01, 0.0, -0.02],
            accelerometer_cross_axis: [0.0, 0.001, 0.0, 0.0, 0.0, 0.002],
            ..ImuParams::default()
        };
        let felt = felt(params, &moving()).specific_force_B_m_s2;
        let expected = Vector3::new(1.01 * (0.3 + 0.001 * 9.81), -0.2, 0.98 * (9.81 - 0.002 * 0.2));
        assert!((felt - expected).norm() < 1e-12, "{felt:?}");
        // Turned about x by a degree, y of the part sees some of what is along z.
        let params = ImuParams { misalignment_deg: [1.0, 0.0, 0.0], ..ImuParams::default() };
        let felt = self::felt(params, &moving());
        let (sine, cosine) = libm::sincos(1.0_f64.to_radians());
        assert!((felt.specific_force_B_m_s2.y - (-0.2 * cosine + 9.81 * sine)).abs() < 1e-12);
        assert!((felt.angular_velocity_B_rad_s.y - (-0.7 * cosine + 0.02 * sine)).abs() < 1e-12);
    }

    #[test]
    fn acceleration_and_warmth_move_the_biases() {
        let params = ImuParams {
            gyroscope_g_sensitivity: [0.0, 0.0, 1e-3],
            gyroscope_bias_drift_rad_s_k: [2e-3, 0.0, 0.0],
            accelerometer_bias_drift_m_s2_k: [0.0, 1e-2, 0.0],
            warming_k: 10.0,
            warming_time_s: 100.0,
            ..ImuParams::default()
        };
        let cold = felt(params, &moving());
        assert!((cold.angular_velocity_B_rad_s - Vector3::new(0.1, -0.7, 0.02 + 9.81e-3)).norm() < 1e-12);
        let warm = felt(params, &ImuMotion { time_s: 100.0, ..moving() });
        let warmed_k = 10.0 * (1.0 - libm::exp(-1.0));
        assert!((warm.angular_velocity_B_rad_s.x - 0.1 - 2e-3 * warmed_k).abs() < 1e-12);
        assert!((warm.specific_force_B_m_s2.y + 0.2 - 1e-2 * warmed_k).abs() < 1e-12);
    }

    #[test]
    fn a_reading_is_a_whole_number_of_steps() {
        let params = ImuParams {
            accelerometer_resolution_m_s2: 0.25,
            gyroscope_resolution_rad_s: 0.125,
            ..ImuParams::default()
        };
        let small = ImuParams { accelerometer_range_m_s2: 9.6, ..params };
        let reading = part(small).in_steps(&moving().motion);
        assert_eq!(reading.specific_force_B_m_s2.z, 9.6, "no more than its range");
        let reading = part(params).in_steps(&moving().motion);
        assert_eq!(reading.specific_force_B_m_s2, Vector3::new(0.25, -0.25, 9.75));
        assert_eq!(reading.angular_velocity_B_rad_s, Vector3::new(0.125, -0.75, 0.0));
    }
}
