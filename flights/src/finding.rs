//! Findings of a comparison of values with physics.

use crate::quantity::Quantity;

/// Values that contradict the declarations of the flights file.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The channel.
    pub channel: Quantity,
    /// The unit, frame or order that would fit, if the mismatch is clear; otherwise it is only worth a note.
    pub fits: Option<String>,
    /// The whole finding as text, with numbers.
    pub message: String,
}
