//! Sensor emulators and estimators.
//!
//! The rooms, pure cores first; no core knows the bus, the plant or the wall clock:
//! - [`noise`]: white noise from its density, bias as a random walk.
//! - [`imu_model`]: accelerometer and gyroscope.
//! - [`complementary`]: attitude from an IMU's readings.
//! - [`imu`], [`attitude`]: the same as processes of a run.
//! - [`clearance`]: true distances to the scene, for judging.
//! - [`mocap`]: motion capture.
//! - [`gps`], [`mocap`]: position from satellites, position and attitude from cameras.
//! - [`barometer`], [`atmosphere`]: air pressure, and how it falls with height.
//! - [`magnetometer`], [`earth_field`]: the earth's magnetic field, at the vehicle and in the world.
//! - [`range`], [`cone`]: five range finders, and what their beams meet.
//! - [`rpm`]: rotor speeds, and faults of their sensors.
//! - [`ekf`]: position, velocity and attitude from an IMU, GPS or motion capture, barometer, magnetometer.
//! - [`range_inertial`]: velocity, height and walls from range finders, an IMU and an attitude.
//! - [`battery`]: voltage, current and charge.
//! - `steps`: what is left of a value at a resolution.
//! - `channel`: when sensors measure, and how measurements are delayed and lost.
//! - `wire`: the vectors of messages as those of nalgebra.
//! - `testing`: what the tests of sensors share.
#![forbid(unsafe_code)]

pub mod atmosphere;
pub mod attitude;
pub mod barometer;
pub mod battery;
mod channel;
pub mod clearance;
pub mod complementary;
pub mod cone;
pub mod earth_field;
pub mod ekf;
pub mod gps;
pub mod imu;
pub mod imu_model;
pub mod magnetometer;
pub mod mocap;
pub mod noise;
pub mod range;
pub mod range_inertial;
pub mod rpm;
mod steps;
#[cfg(test)]
mod testing;
mod wire;
