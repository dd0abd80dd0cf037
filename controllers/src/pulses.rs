//! Pulses of a remote control, and numbers of its channels.

use component::messages::RC_CHANNELS_MAX;
use diagnostics::parameter::{ParameterError, require};
use std::ops::RangeInclusive;

/// Lower end of a stick, and a switch that is off, µs.
pub(crate) const LOW_US: f64 = 1000.0;
/// Upper end of a stick, and a switch that is on, µs.
pub(crate) const HIGH_US: f64 = 2000.0;
/// Pulses that receivers send, µs.
pub(crate) const PULSES_US: RangeInclusive<f64> = 800.0..=2200.0;

/// Requires a channel of the message.
pub(crate) fn check_channel(key: &str, channel: f64) -> Result<(), ParameterError> {
    let is_there = (1.0..=RC_CHANNELS_MAX as f64).contains(&channel);
    require(key, channel, is_there, format!("1 to {RC_CHANNELS_MAX}"))
}

/// Requires pulses that receivers send.
pub(crate) fn check_pulse(key: &str, pulse_us: f64) -> Result<(), ParameterError> {
    let (least, most) = (PULSES_US.start(), PULSES_US.end());
    require(key, pulse_us, PULSES_US.contains(&pulse_us), format!("{least} to {most} µs"))
}
