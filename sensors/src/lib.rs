//! Sensor emulators and estimators.
//!
//! A sensor is a type that implements [`sensing::Sensor`]; [`sensing::Sensing`] makes a component of it. The rooms:
//! - [`sensing`]: sensors as components; `channel`: when they measure, and how measurements are delayed and lost.
//! - `parameters`: tables of parameters, each with its default and bounds.
//! - [`noise`]: white noise from its density, bias as a random walk.
//! - [`imu`]: accelerometer and gyroscope; [`imu_model`]: their noise; [`imu_part`]: their mechanics.
//! - [`gps`], [`mocap`]: position from satellites, position and attitude from cameras.
//! - [`barometer`], `atmosphere`: air pressure, and how it falls with height.
//! - [`magnetometer`], `earth_field`: the earth's magnetic field, at the vehicle and in the world.
//! - [`range`], `cone`: five range finders, and what their beams meet.
//! - [`rpm`]: rotor speeds, and faults of their sensors; [`battery`]: voltage, current and charge.
//! - [`clearance`]: true distances to the scene, for judging.
//! - [`complementary`]: attitude from an IMU's readings.
//! - [`ideal`]: the truth as an estimate, for comparisons.
//! - [`ekf`]: position, velocity and attitude from an IMU, GPS or motion capture, barometer, magnetometer.
//! - [`range_inertial`]: velocity, height and walls from range finders, an IMU and an attitude.
//! - [`link`], `line`: a data link, and the line that its streams share.
//! - `steps`: what is left of a value at a resolution; `wire`: the vectors of messages as those of nalgebra.
//! - `frame`: frames of standard messages.
//! - `testing`: what the tests of sensors share.
#![forbid(unsafe_code)]
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame that a vector is written in, _WB a rotation between the two, _T or _Pa a unit"
)]

// First: modules behind them see their macros without importing them.
#[macro_use]
mod parameters;
#[macro_use]
pub mod sensing;

mod atmosphere;
pub mod barometer;
pub mod battery;
mod channel;
pub mod clearance;
pub mod complementary;
mod cone;
mod earth_field;
pub mod ekf;
mod frame;
pub mod gps;
pub mod ideal;
pub mod imu;
pub mod imu_model;
pub mod imu_part;
mod line;
pub mod link;
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
