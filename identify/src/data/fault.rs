//! A fault and its consequence.

use flights::{Channel, Flight};
use serde::Serialize;

/// A wrong channel of one flight, or a motor that does not follow its command.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fault {
    /// The flight.
    pub flight: String,
    /// The channel, with the rotor counted from 1 or the axis.
    pub channel: String,
    /// Kind: `stuck-sensor`, `scaled-sensor`, `rotor-off-command`, `frozen`, `scaled`, `mirrored`, `unrelated`, `swapped`, `reversed-spins`,
    /// `other-clock`, `jumping` or `impossible-trim`.
    pub kind: &'static str,
    /// Expectation, with numbers.
    pub expected: String,
    /// Finding, with numbers.
    pub found: String,
    /// Consequence for the identification.
    pub consequence: &'static str,
    /// Advice.
    pub advice: &'static str,
}

impl Fault {
    /// Expectation and finding as text.
    #[must_use]
    pub fn finding(&self) -> String {
        format!("expected {}, found {}", self.expected, self.found)
    }
}

/// Part of a flight that is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The gyroscope.
    Gyroscope,
    /// The accelerometer.
    Accelerometer,
    /// Position and velocity, which come from one source.
    Translation,
    /// The motor commands.
    Command,
    /// The rotor speeds.
    RotorSpeed,
    /// The samples about jumps of the position.
    Jumps,
}

impl Part {
    /// Removes the part from `flight`, and adds a note.
    pub fn leave_out(self, flight: &mut Flight) {
        match self {
            Part::Gyroscope => flight.angular_velocity = Channel::default(),
            Part::Accelerometer => flight.specific_force = Channel::default(),
            Part::Translation => {
                flight.position = Channel::default();
                flight.velocity = Channel::default();
            }
            Part::Command => flight.command = Channel::default(),
            Part::RotorSpeed => flight.rotor_speed = Channel::default(),
            // This adds its own note.
            Part::Jumps => return flights::leave_out_jumps(flight),
        }
        flight.notes.push(format!("{}: not used, see its fault", self.name()));
    }

    fn name(self) -> &'static str {
        match self {
            Part::Gyroscope => "angular_velocity",
            Part::Accelerometer => "specific_force",
            Part::Translation | Part::Jumps => "position",
            Part::Command => "command",
            Part::RotorSpeed => "rotor_speed",
        }
    }

    /// Consequence as text.
    pub fn consequence(self) -> &'static str {
        match self {
            Part::Gyroscope => "the gyroscope of this flight is not used",
            Part::Accelerometer => "the accelerometer of this flight is not used",
            Part::Translation => "position and velocity of this flight are not used",
            Part::Command => {
                "the commands of this flight are not used; without rotor speeds, nothing of it is"
            }
            Part::RotorSpeed => {
                "the rotor speeds of this flight are not used; without commands, nothing of it is"
            }
            Part::Jumps => "the samples about the jumps are not used",
        }
    }
}

/// Name of axis 0, 1 or 2.
pub fn axis_name(axis: usize) -> &'static str {
    ["x", "y", "z"][axis]
}
