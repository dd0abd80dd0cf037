//! The interface of an autopilot: one implementation for each firmware.

use crate::origin::Origin;
use bus::Bounded;
use bus::component::Info;
use bus::context::NodeContext;
use bus::messages::{Imu, ROTORS_MAX, RcChannels, StateEstimate};
use diagnostics::ParameterError;
use vehicles::Vehicle;

/// Inputs of a firmware at a tick: body x forward, y left, z up; world east, north, up; SI units.
#[derive(Clone, Copy, Debug)]
pub struct Sensed<'a> {
    /// Simulation time since tick 0, s; below 0 while the firmware starts.
    pub time_s: f64,
    /// Its accelerometer and gyroscope.
    pub imu: &'a Imu,
    /// Place, motion and attitude, of which its other sensors are made.
    pub estimate: &'a StateEstimate,
    /// Its remote control.
    pub rc: &'a RcChannels,
    /// True if the channels have arrived since the exchange before. Older ones are not sent, so that the firmware sees a lost radio.
    pub is_rc_new: bool,
}

/// Outputs of the motors, 0 (off) to 1 (all), in the order of the vehicle file's rotors.
pub type Throttles = Bounded<f64, ROTORS_MAX>;

/// A firmware that can be flown. Its value is what the manifest says of it; the process that runs is its link.
pub trait Autopilot: Sized + Send {
    /// Its name in manifests, and what it is.
    const INFO: Info;
    /// Its parameters, with those of the files that it needs.
    type Parameters: bus::Parameters;
    /// The firmware's process, and what is known of it.
    type Link: Send + 'static;

    /// The autopilot as the manifest has it; starts nothing.
    ///
    /// # Errors
    /// A parameter or a file that cannot be meant.
    fn new(parameters: Self::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError>;

    /// The vehicle that it flies.
    fn vehicle(&self) -> &Vehicle;

    /// Place and axes of the world on the earth.
    fn origin(&self) -> &Origin;

    /// Starts the firmware, and waits until it is ready for tick 0.
    ///
    /// # Errors
    /// It does not start, in words, with the end of its log.
    fn boot(&self) -> Result<Self::Link, String>;

    /// Lets the firmware sense a tick, and waits for its motors.
    ///
    /// # Errors
    /// It has ended, or does not answer, in words, with the end of its log.
    fn exchange(&self, link: &mut Self::Link, sensed: &Sensed<'_>) -> Result<Throttles, String>;
}
