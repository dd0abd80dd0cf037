//! What is found where values are compared with physics.

use crate::quantity::Quantity;

/// Values that contradict what the flights file declares.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The channel.
    pub channel: Quantity,
    /// The unit, frame or order that would fit, if the mismatch is clear; otherwise it is only worth a note.
    pub fits: Option<String>,
    /// All this as text, with numbers.
    pub message: String,
}
