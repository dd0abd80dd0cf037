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
/// Fields of the accelerometer and the gyroscope in `fields_updated`, those of the magnetometer, and those of the barometer with
/// the temperature.
pub const INERTIAL_FIELDS: u32 = 0b11_1111;
pub const MAGNETIC_FIELDS: u32 = 0b1_1100_0000;
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
/// Motors of a message.
pub const MOTORS: usize = 16;
/// Bit of the flags of a firmware in lockstep, and of the mode of one that is armed.
const LOCKSTEP: u64 = 1;
const ARMED: u8 = 128;

/// A tick's sensors at a time of the firmware's clock.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Time of the firmware's clock, us.
    pub time_us: u64,
    /// Inputs of the tick.
    pub sensed: &'a Sensed<'a>,
    /// Longitude and latitude, degrees, and altitude, m.
    pub place: [f64; 3],
    /// Magnetic field in the body: x forward, y left, z up, T.
    pub field_B_T: [f64; 3],
}

impl Sample<'_> {
    /// Payload of [`HIL_SENSOR`], of which `fields` are new.
    pub fn sensor(&self, fields: u32) -> Vec<u8> {
        let imu = self.sensed.imu;
        let field_G = forward_right_down(self.field_B_T.into()).map(|part| part * GAUSS_T);
        let altitude_m = self.place[2];
        let pressure_hPa = atmosphere::pressure_Pa(altitude_m) / PA_HPA;
        let mut payload = Vec::with_capacity(HIL_SENSOR.length);
        payload.extend(self.time_us.to_le_bytes());
        for vector in
            [forward_right_down(imu.specific_force), forward_right_down(imu.angular_velocity), field_G]
        {
            add_floats(&mut payload, &vector);
        }
        // No airspeed.
        add_floats(&mut payload, &[pressure_hPa, 0.0, altitude_m, atmosphere::temperature_degC(altitude_m)]);
        payload.extend(fields.to_le_bytes());
        // The number of the sensor.
        payload.push(0);
        payload
    }

    /// Payload of [`HIL_GPS`].
    pub fn gps(&self) -> Vec<u8> {
        let velocity_cm_s = north_east_down(self.sensed.estimate.velocity).map(|part| part * 100.0);
        let [north_cm_s, east_cm_s, _] = velocity_cm_s;
        let speed_cm_s = libm::hypot(north_cm_s, east_cm_s);
        let course_deg = libm::atan2(east_cm_s, north_cm_s).to_degrees().rem_euclid(360.0);
        let course = if speed_cm_s < COURSE_FROM_CM_S { NO_COURSE } else { u16_of(course_deg * 100.0) };
        let mut payload = Vec::with_capacity(HIL_GPS.length);
        payload.extend(self.time_us.to_le_bytes());
        add_place(&mut payload, self.place);
        for number in ERROR_CM.into_iter().chain([u16_of(speed_cm_s)]) {
            payload.extend(number.to_le_bytes());
        }
        add_shorts(&mut payload, &velocity_cm_s);
        payload.extend(course.to_le_bytes());
        payload.extend([FIX, SATELLITES]);
        // The number of the receiver, and no heading.
        payload.extend([0, 0, 0]);
        payload
    }

    /// Payload of [`RC_CHANNELS`].
    #[allow(clippy::cast_possible_truncation, reason = "the field counts milliseconds round; 18 channels")]
    pub fn channels(&self) -> Vec<u8> {
        let mut payload = Vec::with_capacity(RC_CHANNELS.length);
        payload.extend(((self.time_us / 1000) as u32).to_le_bytes());
        for channel in 0..CHANNELS {
            payload.extend(pulse_us(self.sensed.rc, channel).to_le_bytes());
        }
        payload.extend([CHANNELS as u8, SIGNAL]);
        payload
    }

    /// Payload of [`HIL_STATE_QUATERNION`].
    pub fn state(&self) -> Vec<u8> {
        let (imu, estimate) = (self.sensed.imu, self.sensed.estimate);
        let velocity_cm_s = north_east_down(estimate.velocity).map(|part| part * 100.0);
        let mut payload = Vec::with_capacity(HIL_STATE_QUATERNION.length);
        payload.extend(self.time_us.to_le_bytes());
        add_floats(&mut payload, &attitude(estimate.attitude));
        add_floats(&mut payload, &forward_right_down(imu.angular_velocity));
        add_place(&mut payload, self.place);
        add_shorts(&mut payload, &velocity_cm_s);
        // No airspeeds.
        add_shorts(&mut payload, &[0.0, 0.0]);
        add_shorts(&mut payload, &forward_right_down(imu.specific_force).map(|part| part * MILLIGRAVITY));
        payload
    }
}

/// Outputs of the firmware.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// Time of its clock, us.
    pub time_us: u64,
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
        let eight = |at: usize| u64::from_le_bytes(std::array::from_fn(|byte| payload[at + byte]));
        let four = |at: usize| f32::from_le_bytes(std::array::from_fn(|byte| payload[at + byte]));
        Self {
            time_us: eight(0),
            is_lockstep: eight(8) & LOCKSTEP != 0,
            is_armed: payload[80] & ARMED != 0,
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
    use super::super::mavlink::{Reader, add_frame};
    use super::*;
    use bus::messages::{Imu, Quaternion, RcChannels, StateEstimate};

    /// Bytes of hexadecimal digits.
    fn bytes(digits: &str) -> Vec<u8> {
        (0..digits.len() / 2).map(|at| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).unwrap()).collect()
    }

    /// Payloads of a sample, in the order of the arguments of `payload`.
    fn payload(of: impl Fn(&Sample<'_>) -> Vec<u8>) -> Vec<u8> {
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
        let sensed = Sensed { time_s: 0.0, imu: &imu, estimate: &estimate, rc: &rc };
        let place = [8.545_594, 47.397_742, 488.0];
        of(&Sample { time_us: 1000, sensed: &sensed, place, field_B_T: [0.0, -0.25e-4, -0.375e-4] })
    }

    fn float(payload: &[u8], at: usize) -> f32 {
        f32::from_le_bytes(payload[at..at + 4].try_into().unwrap())
    }

    /// Bytes that pymavlink 2.4.50 makes of the same numbers.
    #[test]
    fn frames_are_those_of_pymavlink() {
        let mut gps = Vec::new();
        add_frame(&mut gps, HIL_GPS, 1, &payload(|sample| sample.gps()));
        let expected = "fd2400000101c8710000e8030000000000004c52401c44f41705407207001e002800f4012c0190010cfec114030cb2c0";
        assert_eq!(gps, bytes(expected));
        let outputs = bytes(
            "fd5100000701015d0000a00f00000000000001000000000000000000803e0000003f0000403f0000803f000000\
             00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000081be58",
        );
        let mut reader = Reader::new(HIL_ACTUATOR_CONTROLS);
        let read = Outputs::read(&reader.next(&mut outputs.clone()).unwrap());
        assert_eq!(read.motors[..5], [0.25, 0.5, 0.75, 1.0, 0.0]);
        assert_eq!((read.time_us, read.is_lockstep, read.is_armed), (4000, true, true));
    }

    #[test]
    fn sensors_have_the_firmwares_axes_and_units() {
        let payload = payload(|sample| sample.sensor(INERTIAL_FIELDS | MAGNETIC_FIELDS));
        let floats: Vec<f32> = (0..13).map(|at| float(&payload, 8 + 4 * at)).collect();
        assert_eq!(floats[..3], [0.5, -1.5, -9.75], "forward, right, down, m/s^2");
        assert_eq!(floats[3..6], [0.125, -0.25, 0.5], "rad/s");
        assert_eq!(floats[6..9], [-0.0, 0.25, 0.375], "gauss");
        // ISO 2533: 956.0 hPa and 11.83 degrees at 488 m.
        assert!((floats[9] - 956.0).abs() < 0.5 && (floats[12] - 11.83).abs() < 0.01, "{floats:?}");
        assert_eq!(floats[10..12], [0.0, 488.0]);
        assert_eq!(payload[60..], [0xFF, 1, 0, 0, 0]);
    }

    #[test]
    fn the_state_and_the_channels_have_the_firmwares_axes_and_units() {
        let state = payload(|sample| sample.state());
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
        let channels = payload(|sample| sample.channels());
        let pulse =
            |channel: usize| u16::from_le_bytes([channels[4 + 2 * channel], channels[5 + 2 * channel]]);
        assert_eq!([0, 1, 2, 3, 4, 17].map(pulse), [1500, 1100, 900, 1500, 1000, 1000]);
        assert_eq!((channels[0], &channels[40..]), (1, &[18, 100][..]));
    }
}
