//! Reasons why a flight cannot be compared with a model.

use crate::numbers::statistics::deviation;
use flights::{Flight, SETTLE_S};

/// Least number of samples of a channel.
const LEAST_SAMPLES: usize = 3;

/// A reason why a flight cannot be compared.
///
/// ```
/// use flights::{Flight, Role};
/// use identify::Unusable;
///
/// let reason = Unusable::of_channels(&Flight::new("empty", "log.csv", Role::Fit)).unwrap();
/// assert!(reason.to_string().starts_with("it has no command channel"));
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// Neither commands nor rotor speeds.
    #[error("it has no command channel; declare `command`, or else `rotor_speed`, in `channels`")]
    NoDrive,
    /// No channel of the motion.
    #[error("it has no motion; declare `attitude`, `angular_velocity` or `specific_force` in `channels`")]
    NoMotion,
    /// Torques that are not compared, and nothing to compare forces with.
    #[error(
        "`torques = false` leaves nothing to compare, since no channel shows forces; remove the key, or declare `position`, \
         `velocity` or `specific_force`"
    )]
    NothingCompared,
    /// Commands slower than the motors, and nothing to compare forces with.
    #[error(
        "its commands are logged every {period_s:.3} s, slower than the motors follow ({motor_s:.3} s), so that torques cannot \
         be compared, and no channel shows forces; log commands or rotor speeds faster, or declare `position`, `velocity` or \
         `specific_force`"
    )]
    SlowCommands {
        /// Usual time between two commands.
        period_s: f64,
        /// Time constant of the motors.
        motor_s: f64,
    },
    /// Commands so far apart that the rotors followed others between them.
    #[error(
        "its commands were logged every {period_s:.3} s, expected at most {most:.3} s, twice the motors' time constant of {motor_s:.3} s: the rotors followed \
         commands between them that nobody knows; log commands or rotor speeds faster, or set `on_change = true` if each command held until the next",
        most = 2.0 * motor_s
    )]
    UnknownBetween {
        /// Usual time between two commands.
        period_s: f64,
        /// Time constant of the motors.
        motor_s: f64,
    },
    /// A channel with too few samples.
    #[error("its `{channel}` has {samples} samples, expected at least 3")]
    FewSamples {
        /// The channel.
        channel: String,
        /// Number of its samples.
        samples: usize,
    },
    /// Channels at different times.
    #[error(
        "its channels lie at different times, expected some in common: {spans}; correct the unit or the clock of a channel, \
         or shift it by `delay_s`"
    )]
    Apart {
        /// Channels with their times.
        spans: String,
    },
    /// Commands with gaps wherever the motion was measured.
    #[error(
        "its commands and its motion were never logged together, besides gaps of the commands: the rotor speeds are known \
         {known}, the motion was measured from {from_s:.3} s to {to_s:.3} s; if the log writes commands only on change, set `on_change = true` in the channel `command`"
    )]
    UnknownRotors {
        /// Stretches with known rotor speeds.
        known: String,
        /// Begin of the time that all channels have in common.
        from_s: f64,
        /// Its end.
        to_s: f64,
    },
    /// Rotors too slow to fly, of a vehicle that does not move.
    #[error(
        "it stays on the ground: its rotors turn at {fastest:.0} rad/s at most, expected more than {least:.0} rad/s, half of \
         the hover speed, and it does not move; choose the part in flight by `from_s` and `to_s`"
    )]
    OnGround {
        /// Greatest mean speed of the rotors.
        fastest: f64,
        /// Least mean speed in flight.
        least: f64,
    },
    /// Rotors too slow to fly, of a vehicle that moves.
    #[error(
        "its rotors turn at {fastest:.0} rad/s at most{by_map}, expected more than {least:.0} rad/s, half of the hover speed, \
         though it moves; correct {correct}"
    )]
    SlowRotors {
        /// Greatest mean speed of the rotors.
        fastest: f64,
        /// Least mean speed in flight.
        least: f64,
        /// Origin of the speeds, where they are not measured.
        by_map: String,
        /// Keys to correct.
        correct: &'static str,
    },
    /// Too little time in common.
    #[error(
        "only {left_s:.2} s of it can be compared, expected three windows of {window_s:.2} s: all channels have {common_s:.2} s \
         in common, of which the first {SETTLE_S} s, the surroundings of gaps and the ends are left out; use a longer part"
    )]
    Short {
        /// Time that can be compared.
        left_s: f64,
        /// Length of a window.
        window_s: f64,
        /// Time that all channels have in common.
        common_s: f64,
    },
}

impl Unusable {
    /// The reason that the channels of `flight` give by themselves.
    #[must_use]
    pub fn of_channels(flight: &Flight) -> Option<Self> {
        if flight.command.is_empty() && flight.rotor_speed.is_empty() {
            return Some(Self::NoDrive);
        }
        let has_motion = [
            flight.attitude.is_empty(),
            flight.angular_velocity.is_empty(),
            flight.specific_force.is_empty(),
        ];
        if has_motion.into_iter().all(|is_empty| is_empty) {
            return Some(Self::NoMotion);
        }
        let counts = [
            ("attitude", flight.attitude.time_s.len()),
            ("angular_velocity", flight.angular_velocity.time_s.len()),
            ("specific_force", flight.specific_force.time_s.len()),
            ("position", flight.position.time_s.len()),
            ("rotor_speed", flight.rotor_speed.time_s.len()),
        ];
        let few = counts.into_iter().find(|(_, samples)| (1..LEAST_SAMPLES).contains(samples))?;
        Some(Self::FewSamples { channel: few.0.to_owned(), samples: few.1 })
    }

    /// The reason for rotors that turn at `fastest` rad/s at most and would have to turn at `least`.
    pub(crate) fn of_speeds(flight: &Flight, fastest: f64, least: f64) -> Self {
        if !moves(flight) {
            return Self::OnGround { fastest, least };
        }
        let (by_map, correct) = if flight.command.is_empty() {
            ("", "unit, columns or `pole_pairs` of `rotor_speed`")
        } else {
            (" by the vehicle file's `command`", "that map, or unit and columns of the channel `command`")
        };
        Self::SlowRotors { fastest, least, by_map: by_map.to_owned(), correct }
    }
}

/// True if the vehicle changes its place or turns as none on the ground does.
fn moves(flight: &Flight) -> bool {
    const AWAY_M: f64 = 0.3;
    const TURNING_RAD_S: f64 = 0.3;
    let range = |values: &[[f64; 3]], axis: usize| {
        let of_axis = || values.iter().map(|value| value[axis]);
        of_axis().fold(f64::NEG_INFINITY, f64::max) - of_axis().fold(f64::INFINITY, f64::min)
    };
    let spread = |axis: usize| {
        let turning: Vec<f64> = flight.angular_velocity.values.iter().map(|rate| rate[axis]).collect();
        deviation(&turning)
    };
    let is_away =
        !flight.position.is_empty() && (0..3).any(|axis| range(&flight.position.values, axis) > AWAY_M);
    is_away || (!flight.angular_velocity.is_empty() && (0..3).any(|axis| spread(axis) > TURNING_RAD_S))
}
