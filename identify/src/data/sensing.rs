//! Errors of a flight's sensors, and the flight as sensors without them would have logged it.

use crate::data::clock::Lateness;
use flights::{Channel, Flight};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Lateness and biases of sensors.
///
/// ```
/// use flights::{Channel, Flight, Role};
/// use identify::{Lateness, SensorErrors};
///
/// let mut flight = Flight::new("late", "log.csv", Role::Fit);
/// flight.position = Channel { time_s: vec![1.0, 1.5], values: vec![[0.0; 3]; 2] };
/// let errors = SensorErrors { pose_delay_s: 0.25, ..SensorErrors::default() };
/// assert_eq!(errors.taken_off(&flight, &Lateness::default()).position.time_s, [0.75, 1.25]);
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SensorErrors {
    /// Lateness of position, velocity and attitude in s that all flights share.
    pub pose_delay_s: f64,
    /// Lateness of gyroscope and accelerometer in s.
    pub inertial_delay_s: f64,
    /// Bias of the accelerometer in B, in m/s^2.
    pub accelerometer_bias_m_s2: [f64; 3],
    /// Bias of the gyroscope in B, in rad/s.
    pub gyroscope_bias_rad_s: [f64; 3],
    /// Rotation of the attitude sensor in its mount about x and y of B, in rad.
    pub attitude_bias_rad: [f64; 2],
}

impl SensorErrors {
    /// Returns the rotation from the vehicle's B to the frame that the attitude sensor takes for B.
    pub fn mounting(&self) -> UnitQuaternion<f64> {
        let [x, y] = self.attitude_bias_rad;
        UnitQuaternion::from_scaled_axis(-Vector3::new(x, y, 0.0))
    }

    /// Returns `flight` without these errors and without the lateness `late`.
    pub fn taken_off(&self, flight: &Flight, late: &Lateness) -> Flight {
        let mut flight = flight.clone();
        earlier(&mut flight.position, self.pose_delay_s + late.position_s);
        earlier(&mut flight.velocity, self.pose_delay_s + late.velocity_s);
        earlier(&mut flight.attitude, self.pose_delay_s + late.attitude_s);
        earlier(&mut flight.rotor_speed, late.rotor_speed_s);
        earlier(&mut flight.angular_velocity, self.inertial_delay_s);
        earlier(&mut flight.specific_force, self.inertial_delay_s);
        less(&mut flight.angular_velocity, self.gyroscope_bias_rad_s);
        less(&mut flight.specific_force, self.accelerometer_bias_m_s2);
        let mounting = self.mounting();
        for value in &mut flight.attitude.values {
            let [w, x, y, z] = *value;
            let turned = Quaternion::new(w, x, y, z) * mounting.into_inner();
            *value = [turned.w, turned.i, turned.j, turned.k];
        }
        flight
    }

    /// Returns `flight` as sensors with these errors would have logged it.
    ///
    /// ```
    /// use flights::{Channel, Flight, Role};
    /// use identify::SensorErrors;
    ///
    /// let mut flight = Flight::new("true", "", Role::Fit);
    /// flight.specific_force = Channel { time_s: vec![1.0], values: vec![[0.0, 0.0, 9.81]] };
    /// let errors = SensorErrors { accelerometer_bias_m_s2: [0.5, 0.0, 0.0], ..SensorErrors::default() };
    /// assert_eq!(errors.put_on(&flight).specific_force.values[0][0], 0.5);
    /// ```
    #[must_use]
    pub fn put_on(&self, flight: &Flight) -> Flight {
        let negated = Self {
            pose_delay_s: -self.pose_delay_s,
            inertial_delay_s: -self.inertial_delay_s,
            accelerometer_bias_m_s2: self.accelerometer_bias_m_s2.map(|bias| -bias),
            gyroscope_bias_rad_s: self.gyroscope_bias_rad_s.map(|bias| -bias),
            attitude_bias_rad: self.attitude_bias_rad.map(|turn| -turn),
        };
        negated.taken_off(flight, &Lateness::default())
    }
}

fn earlier<const N: usize>(channel: &mut Channel<N>, by_s: f64) {
    channel.time_s.iter_mut().for_each(|time_s| *time_s -= by_s);
}

fn less(channel: &mut Channel<3>, bias: [f64; 3]) {
    for value in &mut channel.values {
        value.iter_mut().zip(bias).for_each(|(value, bias)| *value -= bias);
    }
}
