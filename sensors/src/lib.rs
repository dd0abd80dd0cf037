//! Sensor emulators and estimators.
//!
//! The rooms, pure cores first; no core knows the bus, the plant or the wall clock:
//! - [`units`]: a data sheet's noise figures in SI units.
//! - [`noise`]: white noise from its density, bias as a random walk.
//! - [`imu_model`]: accelerometer and gyroscope.
//! - [`complementary`]: attitude from an IMU's readings.
//! - [`imu`], [`attitude`]: the same as processes of a run.
//! - [`range_inertial`]: velocity, height and walls from range finders, an IMU and an attitude.
//! - [`parameter`]: the error for a parameter outside its range.
#![forbid(unsafe_code)]

pub mod attitude;
pub mod complementary;
pub mod imu;
pub mod imu_model;
pub mod noise;
pub mod parameter;
pub mod range_inertial;
pub mod units;
