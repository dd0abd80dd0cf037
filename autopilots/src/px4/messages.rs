//! Messages between a simulator and PX4 (dialect `common` of MAVLink), with their units. Fields stand in the order in which they are
//! sent: those of larger types first.

use super::mavlink::Kind;
use crate::atmosphere;
use crate::autopilot::Sensed;
use crate::axes::{attitude, forward_right_down, north_east_down};
use crate::rest::pulse_us;

/// Sensors; the one with number 0 sets PX4's clock.
pub const HIL_SENSOR: Kind = Kind { id: 107, extra: 108, length: 65 };
/// Satellite navigation.
pub const HIL_GPS: Kind = Kind { id: 113, extra: 124, length: 39 };
/// Remote control. PX4 takes this one from a simulator, and not `HIL_RC_INPUTS_RAW`.
pub const RC_CHANNELS: Kind = Kind { id: 65, extra: 118, length: 42 };
/// State of the vehicle, which PX4 writes into its log.
pub const HIL_STATE_QUATERNION: Kind = Kind { id: 115, extra: 4, length: 64 };
/// Outputs of the motors.
pub const HIL_ACTUATOR_CONTROLS: Kind = Kind { id: 93, extra: 47, length: 81 };

/// Channels of its remote control.
pub const CHANNELS: usize = 18;
/// Fields of the accelerometer and the gyroscope in `fields_updated`.
pub const INERTIAL_FIELDS: u32 = 0b11_1111;
/// Fields of the magnetometer.
pub const MAGNETIC_FIELDS: u32 = 0b1_1100_0000;
/// Fields of the barometer, with the temperature.
pub const PRESSURE_FIELDS: u32 = 0b1_1010_0000_0000;

/// Gauss in a tesla, and pascals in a hectopascal.
const GAUSS_T: f64 = 1e4;
const PA_HPA: f64 = 100.0;
/// Thousandths of the standard gravity in 1 m/s^2.
const MILLIGRAVITY: f64 = 1000.0 / 9.806_65;
/// Satellites, the kind of a three-dimensional fix, and errors of a good receiver, cm.
const SATELLITES: u8 = 12;
const FIX: u8 = 3;
const ERROR_CM: [u16; 2] = [30, 40];
/// Strength of the radio's signal, percent.
const SIGNAL: u8 = 100;
/// Course of a vehicle that is slower than this, cm/s, is not known; and the number that says so.
const COURSE_FROM_CM_S: f64 = 10.0;
const NO_COURSE: u16 = u16::MAX;
/// Largest noise of the accelerometer, m/s^2, and of the gyroscope, rad/s: 1.5 of the steps in which PX4's simulated sensors count, so that
/// a constant is never the same number for long. PX4 takes a sensor with a hundred equal values for broken (`DataValidator`).
const ACCELEROMETER_NOISE_M_S2: f64 = 1.5 * 9.806_65 / 2048.0;
const GYROSCOPE_NOISE_RAD_S: f64 = 1.5 * 2000.0 / 32768.0 * RAD_DEG;
/// Largest noise of the compass, gauss, and of the barometer, Pa, against the same.
const COMPASS_NOISE_G: f64 = 2e-4;
const BAROMETER_NOISE_PA: f64 = 0.1;
/// Radians in a degree.
const RAD_DEG: f64 = std::f64::consts::PI / 180.0;
/// Motors of a message.
pub const MOTORS: usize = 16;
/// Bit of the flags of a firmware in lockstep, and of the mode of one that is armed.
const LOCKSTEP: u8 = 1;
const ARMED: u8 = 128;

/// A tick's sensors at a time of the firmware's clock.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Time of the firmware's clock, us.
    pub time_us: u64,
    /// Number of the message of the sensors, for their noise.
    pub count: u64,
    /// Inputs of the tick.
    pub sensed: &'a Sensed<'a>,
    /// Longitude and latitude, degrees, and altitude, m.
    pub place: [f64; 3],
    /// Magnetic field in the body: x forward, y left, z up, T.
    pub field_B_T: [f64; 3],
}

impl Sample<'_> {
    /// Payload of [`HIL_SENSOR`], of which `fields` are new.
    pub fn sensor(&self, fields: u32, payload: &mut Vec<u8>) {
        let imu = self.sensed.imu;
        let field_G = forward_right_down(self.field_B_T.into()).map(|part| part * GAUSS_T);
        let altitude_m = self.place[2];
        let pressure_Pa = atmosphere::pressure_Pa(altitude_m);
        payload.extend(self.time_us.to_le_bytes());
        let vectors = [
            (forward_right_down(imu.specific_force), ACCELEROMETER_NOISE_M_S2),
            (forward_right_down(imu.angular_velocity), GYROSCOPE_NOISE_RAD_S),
            (field_G, COMPASS_NOISE_G),
        ];
        for (sensor, (vector, largest)) in (0..).zip(vectors) {
            let part = |axis: usize| vector[axis] + largest * noise(self.count, 3 * sensor + axis as u64);
            add_floats(payload, &[part(0), part(1), part(2)]);
        }
        let pressure_hPa = (pressure_Pa + BAROMETER_NOISE_PA * noise(self.count, 9)) / PA_HPA;
        // No airspeed.
        add_floats(payload, &[pressure_hPa, 0.0, altitude_m, atmosphere::temperature_degC(altitude_m)]);
        payload.extend(fields.to_le_bytes());
        // The number of the sensor.
        payload.push(0);
    }

    /// Payload of [`HIL_GPS`].
    pub fn gps(&self, payload: &mut Vec<u8>) {
        let velocity_cm_s = north_east_down(self.sensed.estimate.velocity).map(|part| part * 100.0);
        let [north_cm_s, east_cm_s, _] = velocity_cm_s;
        let speed_cm_s = libm::hypot(north_cm_s, east_cm_s);
        let course_deg = libm::atan2(east_cm_s, north_cm_s).to_degrees().rem_euclid(360.0);
        let course = if speed_cm_s < COURSE_FROM_CM_S { NO_COURSE } else { u16_of(course_deg * 100.0) };
        payload.extend(self.time_us.to_le_bytes());
        add_place(payload, self.place);
        for number in ERROR_CM.into_iter().chain([u16_of(speed_cm_s)]) {
            payload.extend(number.to_le_bytes());
        }
        add_shorts(payload, &velocity_cm_s);
        payload.extend(course.to_le_bytes());
        payload.extend([FIX, SATELLITES]);
        // The number of the receiver, and no heading.
        payload.extend([0, 0, 0]);
    }

    /// Payload of [`RC_CHANNELS`].
    #[allow(clippy::cast_possible_truncation, reason = "the field counts milliseconds round; 18 channels")]
    pub fn channels(&self, payload: &mut Vec<u8>) {
        payload.extend(((self.time_us / 1000) as u32).to_le_bytes());
        for channel in 0..CHANNELS {
            payload.extend(pulse_us(self.sensed.rc, channel).to_le_bytes());
        }
        payload.extend([CHANNELS as u8, SIGNAL]);
    }

    /// Payload of [`HIL_STATE_QUATERNION`].
    pub fn state(&self, payload: &mut Vec<u8>) {
        let (imu, estimate) = (self.sensed.imu, self.sensed.estimate);
        let velocity_cm_s = north_east_down(estimate.velocity).map(|part| part * 100.0);
        payload.extend(self.time_us.to_le_bytes());
        add_floats(payload, &attitude(estimate.attitude));
        add_floats(payload, &forward_right_down(imu.angular_velocity));
        add_place(payload, self.place);
        add_shorts(payload, &velocity_cm_s);
        // No airspeeds.
        add_shorts(payload, &[0.0, 0.0]);
        add_shorts(payload, &forward_right_down(imu.specific_force).map(|part| part * MILLIGRAVITY));
    }
}

/// Noise of a value, the `at`th of the message `count`: between -1 and 1, a function of both alone (the mixing of SplitMix64).
fn noise(count: u64, at: u64) -> f64 {
    let seed = (count * 16 + at + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (seed ^ (seed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Outputs of the firmware.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// True if it waits for the simulator's time.
    pub is_lockstep: bool,
    /// True if it is armed.
    pub is_armed: bool,
    /// Outputs by motor, 0 (off) to 1 (all).
    pub motors: [f32; MOTORS],
}

impl Outputs {
    /// Reads a payload of [`HIL_ACTUATOR_CONTROLS`].
    pub fn read(payload: &[u8]) -> Self {
        // Zeros at the end are not sent.
        let byte = |at: usize| payload.get(at).copied().unwrap_or_default();
        let four = |at: usize| f32::from_le_bytes(std::array::from_fn(|offset| byte(at + offset)));
        Self {
            is_lockstep: byte(8) & LOCKSTEP != 0,
            is_armed: byte(80) & ARMED != 0,
            motors: std::array::from_fn(|motor| four(16 + 4 * motor)),
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "the message has single precision")]
fn add_floats(payload: &mut Vec<u8>, numbers: &[f64]) {
    payload.extend(numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()));
}

#[allow(clippy::cast_possible_truncation, reason = "beyond its range a number is sent as the nearest")]
fn add_shorts(payload: &mut Vec<u8>, numbers: &[f64]) {
    payload.extend(numbers.iter().flat_map(|number| (number.round() as i16).to_le_bytes()));
}

/// Latitude and longitude, 1e-7 degrees, and altitude, mm.
#[allow(clippy::cast_possible_truncation, reason = "beyond its range a number is sent as the nearest")]
fn add_place(payload: &mut Vec<u8>, [longitude_deg, latitude_deg, altitude_m]: [f64; 3]) {
    let numbers = [latitude_deg * 1e7, longitude_deg * 1e7, altitude_m * 1e3];
    payload.extend(numbers.iter().flat_map(|number| (number.round() as i32).to_le_bytes()));
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number")]
fn u16_of(number: f64) -> u16 {
    number.round() as u16
}

#[cfg(test)]
mod tests {
    use super::super::mavlink::{add_frame, frames};
    use super::*;
    use bus::messages::{Imu, Quaternion, RcChannels, StateEstimate};

    /// Bytes of hexadecimal digits.
    fn bytes(digits: &str) -> Vec<u8> {
        (0..digits.len() / 2).map(|at| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).unwrap()).collect()
    }

    /// The payload that `add` adds of a sample.
    fn payload(add: impl Fn(&Sample<'_>, &mut Vec<u8>)) -> Vec<u8> {
        let imu = Imu {
            angular_velocity: [0.125, 0.25, -0.5].into(),
            specific_force: [0.5, 1.5, 9.75].into(),
            ..Imu::default()
        };
        let estimate = StateEstimate {
            attitude: Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
            velocity: [4.0, 3.0, 5.0].into(),
            ..StateEstimate::default()
        };
        let rc = RcChannels { pulse: [1500.4, 1100.0, 900.0].into(), ..RcChannels::default() };
        let sensed = Sensed { time_s: 0.0, imu: &imu, estimate: &estimate, rc: &rc, is_rc_new: true };
        let place = [8.545_594, 47.397_742, 488.0];
        let sample =
            Sample { time_us: 1000, count: 0, sensed: &sensed, place, field_B_T: [0.0, -0.25e-4, -0.375e-4] };
        let mut payload = Vec::new();
        add(&sample, &mut payload);
        payload
    }

    fn float(payload: &[u8], at: usize) -> f32 {
        f32::from_le_bytes(payload[at..at + 4].try_into().unwrap())
    }

    /// Bytes that pymavlink 2.4.50 makes of the same numbers.
    #[test]
    fn frames_are_those_of_pymavlink() {
        let mut gps = Vec::new();
        add_frame(&mut gps, HIL_GPS, 1, |bytes| bytes.extend(payload(|sample, payload| sample.gps(payload))));
        let expected = "fd2400000101c8710000e8030000000000004c52401c44f41705407207001e002800f4012c0190010cfec114030cb2c0";
        assert_eq!(gps, bytes(expected));
        let outputs = bytes(
            "fd5100000701015d0000a00f00000000000001000000000000000000803e0000003f0000403f0000803f000000\
             00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000081be58",
        );
        let read = Outputs::read(frames(HIL_ACTUATOR_CONTROLS, &outputs).next().unwrap().unwrap());
        assert_eq!(read.motors[..5], [0.25, 0.5, 0.75, 1.0, 0.0]);
        assert_eq!((read.is_lockstep, read.is_armed), (true, true));
    }

    #[test]
    fn sensors_have_the_firmwares_axes_and_units() {
        let payload = payload(|sample, payload| sample.sensor(INERTIAL_FIELDS | MAGNETIC_FIELDS, payload));
        let floats: Vec<f32> = (0..13).map(|at| float(&payload, 8 + 4 * at)).collect();
        let near = |from: usize, expected: [f32; 3], noise: f64| {
            let differs = |(found, expected): (&f32, f32)| f64::from((found - expected).abs()) > noise + 1e-6;
            assert!(!floats[from..].iter().zip(expected).any(differs), "{floats:?}, expected {expected:?}");
        };
        near(0, [0.5, -1.5, -9.75], ACCELEROMETER_NOISE_M_S2);
        near(3, [0.125, -0.25, 0.5], GYROSCOPE_NOISE_RAD_S);
        near(6, [0.0, 0.25, 0.375], COMPASS_NOISE_G);
        // ISO 2533: 956.0 hPa and 11.83 degrees at 488 m.
        assert!((floats[9] - 956.0).abs() < 0.5 && (floats[12] - 11.83).abs() < 0.01, "{floats:?}");
        assert_eq!(floats[10..12], [0.0, 488.0]);
        assert_eq!(payload[60..], [0xFF, 1, 0, 0, 0]);
    }

    #[test]
    fn the_state_and_the_channels_have_the_firmwares_axes_and_units() {
        let state = payload(|sample, payload| sample.state(payload));
        let attitude: Vec<f32> = (0..4).map(|at| float(&state, 8 + 4 * at)).collect();
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert!(
            attitude
                .iter()
                .zip([half, 0.0, 0.0, half])
                .all(|(found, expected)| (found - expected).abs() < 1e-6),
            "{attitude:?}: the nose points east"
        );
        let short = |at: usize| i16::from_le_bytes([state[at], state[at + 1]]);
        assert_eq!([48, 50, 52].map(short), [300, 400, -500], "north, east, down, cm/s");
        assert_eq!([58, 60, 62].map(short), [51, -153, -994], "thousandths of the gravity");
        assert_eq!(state.len(), HIL_STATE_QUATERNION.length);
        let channels = payload(|sample, payload| sample.channels(payload));
        let pulse =
            |channel: usize| u16::from_le_bytes([channels[4 + 2 * channel], channels[5 + 2 * channel]]);
        assert_eq!([0, 1, 2, 3, 4, 17].map(pulse), [1500, 1100, 900, 1500, 1000, 1000]);
        assert_eq!((channels[0], &channels[40..]), (1, &[18, 100][..]));
    }

    /// A sensor that is still has other numbers in each message, in the steps of PX4's simulated sensors, and the right mean.
    #[test]
    fn noise_is_wider_than_the_steps_of_the_sensors_and_has_no_mean() {
        let steps = |count: u64| (1.5 * noise(count, 4)).trunc();
        let equal = (0..10_000).map(|count| i32::from(steps(count) == steps(count + 1)));
        let longest = equal.fold((0, 0), |(most, now), equal| (most.max(now + equal), (now + equal) * equal));
        assert!(longest.0 < 34, "{longest:?}: each of three axes counts");
        let mean = (0..10_000).map(|count| noise(count, 4)).sum::<f64>() / 1e4;
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((0..10_000).all(|count| (-1.0..=1.0).contains(&noise(count, 9))));
    }
}
