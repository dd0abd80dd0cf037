//! The answer to the firmware: a line of JSON with the tick's sensors.
//!
//! Most versions do not parse it as JSON: they look for each key by its text, and read the number two characters behind the key. So
//! no blank follows a colon, and a key that begins another one stands before it.

use crate::autopilot::Sensed;
use crate::axes::{attitude, forward_right_down, north_east_down};
use std::fmt::Write as _;

/// Excess of the timestamps over the run's time, as a part: the firmware cuts each step to whole microseconds, and a step that
/// is rounded to just below them would lose one. At 8 kHz it is above the rounding of a double for 30 days.
const EXCESS: f64 = 1e-6;

/// Time of the `step`th answer, counted from 1, on the firmware's clock.
pub fn timestamp_s(step: u64, period_s: f64) -> f64 {
    step as f64 * period_s * (1.0 + EXCESS)
}

/// The answer at a time of the firmware's clock.
pub fn text(time_s: f64, sensed: &Sensed<'_>) -> String {
    let Sensed { imu, estimate, .. } = sensed;
    let (gyro, force) = (forward_right_down(imu.angular_velocity), forward_right_down(imu.specific_force));
    let (position, velocity) = (north_east_down(estimate.position), north_east_down(estimate.velocity));
    let attitude = attitude(estimate.attitude);
    // The line begins and ends with an end of line: the firmware takes what lies between the last two of them.
    let mut text = format!("\n{{\"timestamp\":{time_s},\"imu\":{{");
    let _ = write!(text, "\"gyro\":{},\"accel_body\":{}}},", list(&gyro), list(&force));
    let _ = write!(text, "\"position\":{},\"velocity\":{},", list(&position), list(&velocity));
    // The firmware is not to pace itself: the run has its pace. A number, since older versions read `true` as 0.
    let _ = writeln!(text, "\"quaternion\":{},\"no_time_sync\":1}}", list(&attitude));
    text
}

/// A list of numbers, without exponents, to nine digits behind the point: positions to a nanometre.
fn list(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:.9}")).collect();
    format!("[{}]", numbers.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::messages::{Imu, Quaternion, RcChannels, StateEstimate};
    use nalgebra::{Quaternion as Product, UnitQuaternion};
    use serde_json::{Value, json};

    fn sample(attitude: UnitQuaternion<f64>) -> (Imu, StateEstimate) {
        let imu = Imu {
            angular_velocity: [0.1, 0.2, 0.3].into(),
            specific_force: [1.0, 2.0, 9.81].into(),
            ..Imu::default()
        };
        let attitude = Quaternion { x: attitude.i, y: attitude.j, z: attitude.k, w: attitude.w };
        let estimate = StateEstimate {
            attitude,
            velocity: [3.0, 4.0, 5.0].into(),
            position: [6.0, 7.0, 8.0].into(),
            ..StateEstimate::default()
        };
        (imu, estimate)
    }

    fn line(attitude: UnitQuaternion<f64>) -> String {
        let (imu, estimate) = sample(attitude);
        text(
            1.5,
            &Sensed {
                time_s: 0.0,
                imu: &imu,
                estimate: &estimate,
                rc: &RcChannels::default(),
                is_rc_new: true,
            },
        )
    }

    /// Roll, pitch and yaw that the firmware reads: to the right, nose up, clockwise from north, degrees.
    fn read_deg(attitude: UnitQuaternion<f64>) -> [f64; 3] {
        let value: Value = serde_json::from_str(&line(attitude)).unwrap();
        let part = |at: usize| value["quaternion"][at].as_f64().unwrap();
        let read = UnitQuaternion::from_quaternion(Product::new(part(0), part(1), part(2), part(3)));
        let (roll, pitch, yaw) = read.euler_angles();
        [roll, pitch, yaw].map(f64::to_degrees)
    }

    #[test]
    fn the_line_has_the_firmwares_axes() {
        let line = line(UnitQuaternion::identity());
        assert!(line.starts_with("\n{\"timestamp\":1.5,") && line.ends_with(":1}\n"), "{line}");
        assert_eq!(line.matches('\n').count(), 2);
        let value: Value = serde_json::from_str(&line).unwrap();
        assert_eq!(value["imu"]["gyro"], json!([0.1, -0.2, -0.3]), "forward, right, down");
        assert_eq!(value["imu"]["accel_body"], json!([1.0, -2.0, -9.81]));
        assert_eq!(value["position"], json!([7.0, 6.0, -8.0]), "north, east, down");
        assert_eq!(value["velocity"], json!([4.0, 3.0, -5.0]));
        assert_eq!(value["no_time_sync"], json!(1), "a number");
    }

    /// As most versions find a key: its first occurrence, then the number two characters behind its end.
    #[test]
    fn each_key_is_first_found_where_it_stands() {
        let line = line(UnitQuaternion::identity());
        for (key, begins) in [
            ("timestamp", "1.5,"),
            ("gyro", "[0.1"),
            ("accel_body", "[1.0"),
            ("position", "[7.0"),
            ("velocity", "[4.0"),
            ("quaternion", "[0.7"),
            ("no_time_sync", "1}"),
        ] {
            let at = line.find(key).unwrap() + key.len() + 2;
            assert!(line[at..].starts_with(begins), "{key}: {}", &line[at..]);
        }
    }

    #[test]
    fn attitudes_have_their_signs() {
        let near = |found: [f64; 3], expected: [f64; 3]| {
            let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6);
            assert!(is_near, "{found:?}, expected {expected:?}");
        };
        // Ours is about x forward, y left, z up: the nose goes down with a positive pitch, and to the left with a positive yaw.
        let of = |roll: f64, pitch: f64, yaw: f64| {
            UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians())
        };
        near(read_deg(of(0.0, 0.0, 0.0)), [0.0, 0.0, 90.0]);
        near(read_deg(of(10.0, 0.0, 0.0)), [10.0, 0.0, 90.0]);
        near(read_deg(of(0.0, 10.0, 0.0)), [0.0, -10.0, 90.0]);
        near(read_deg(of(0.0, 0.0, 30.0)), [0.0, 0.0, 60.0]);
        near(read_deg(of(0.0, 0.0, 90.0)), [0.0, 0.0, 0.0]);
        near(read_deg(of(5.0, -8.0, 130.0)), [5.0, 8.0, -40.0]);
    }

    /// The firmware adds the whole microseconds of each step.
    #[test]
    fn no_step_loses_a_microsecond() {
        for period_us in [125_u32, 1000, 2500, 4000] {
            let period_s = f64::from(period_us) * 1e-6;
            let read = |step| timestamp_s(step, period_s).to_string().parse::<f64>().unwrap();
            let mut last_s = 0.0;
            for step in 1..=500_000 {
                let now_s = read(step);
                let step_us = ((now_s - last_s) * 1e6).trunc();
                assert_eq!(step_us, f64::from(period_us), "step {step}");
                last_s = now_s;
            }
        }
    }
}
