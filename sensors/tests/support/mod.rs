//! A vehicle in flight whose motion is known, for the tests of estimators.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _WB a rotation between the two"
)]

use nalgebra::{UnitQuaternion, Vector3};
use sensors::imu_model::ImuReading;

pub const PERIOD_S: f64 = 1e-3;
pub const PERIOD_NS: u64 = 1_000_000;
pub const GRAVITY_M_S2: f64 = 9.81;

/// Motion of the vehicle and its IMU's exact reading at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub position_W_m: Vector3<f64>,
    pub velocity_W_m_s: Vector3<f64>,
    pub attitude_WB: UnitQuaternion<f64>,
    pub felt: ImuReading,
}

/// Manoeuvre of the pilot at a time (s): roll, pitch, yaw (rad) and upward acceleration (m/s²).
pub type Manoeuvre = fn(f64) -> [f64; 4];

/// The flight of `samples` samples from `position_W_m` at rest: rotors push along body z and nothing else
/// pushes, as in air without drag, so that the accelerometer cannot see the tilt.
pub fn fly(manoeuvre: Manoeuvre, position_W_m: [f64; 3], samples: usize) -> Vec<Truth> {
    let mut flight: Vec<Truth> = Vec::with_capacity(samples);
    let (mut position_W_m, mut velocity_W_m_s) = (Vector3::from(position_W_m), Vector3::zeros());
    for k in 0..samples {
        let time_s = k as f64 * PERIOD_S;
        let (attitude_WB, force_B) = thrust(manoeuvre, time_s);
        if let Some(last) = flight.last() {
            let last_W = acceleration_W(&last.attitude_WB, &last.felt.specific_force_B_m_s2);
            let mean_W = 0.5 * (last_W + acceleration_W(&attitude_WB, &force_B));
            position_W_m += velocity_W_m_s * PERIOD_S + 0.5 * PERIOD_S.powi(2) * mean_W;
            velocity_W_m_s += mean_W * PERIOD_S;
        }
        let angular_velocity_B_rad_s = angular_velocity_B(manoeuvre, time_s);
        let felt = ImuReading { specific_force_B_m_s2: force_B, angular_velocity_B_rad_s };
        flight.push(Truth { position_W_m, velocity_W_m_s, attitude_WB, felt });
    }
    flight
}

fn attitude(manoeuvre: Manoeuvre, time_s: f64) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw, _] = manoeuvre(time_s);
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

/// The attitude, and the specific force that lifts the vehicle as asked.
fn thrust(manoeuvre: Manoeuvre, time_s: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
    let attitude_WB = attitude(manoeuvre, time_s);
    let up = (attitude_WB * Vector3::z()).z;
    (attitude_WB, Vector3::new(0.0, 0.0, (GRAVITY_M_S2 + manoeuvre(time_s)[3]) / up))
}

fn acceleration_W(attitude_WB: &UnitQuaternion<f64>, force_B: &Vector3<f64>) -> Vector3<f64> {
    attitude_WB * force_B - Vector3::new(0.0, 0.0, GRAVITY_M_S2)
}

/// The rate at an instant, from the attitudes a little before and after it.
fn angular_velocity_B(manoeuvre: Manoeuvre, time_s: f64) -> Vector3<f64> {
    let half_s = 1e-4;
    let before = attitude(manoeuvre, time_s - half_s);
    let after = attitude(manoeuvre, time_s + half_s);
    (before.inverse() * after).scaled_axis() / (2.0 * half_s)
}
