//! A measured flight: channels that were sampled each at its own times.
//!
//! World W: z up. Body B: x forward, y left, z up. Times are seconds from the flight's start, one clock for all
//! channels; they grow strictly within a channel. A gap is a time without samples, never a filler.

use std::path::{Path, PathBuf};

use vehicles::ROTORS_MAX;
use vehicles::gaps::of_held;

use crate::quantity::Quantity;

/// Role of a flight.
///
/// ```
/// assert_eq!(flights::Role::Select.name(), "select");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Parameters are fitted on it.
    Fit,
    /// Effects are chosen on it: none of their parameters is fitted on it.
    Select,
    /// Errors are reported on it, once: nothing is fitted or chosen on it.
    Test,
}

impl Role {
    /// The role as flights files spell it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Role::Fit => "fit",
            Role::Select => "select",
            Role::Test => "test",
        }
    }
}

/// Samples of one quantity.
///
/// ```
/// use flights::Channel;
///
/// let voltage = Channel { time_s: vec![0.0, 0.5, 1.5], values: vec![[11.9], [11.8], [11.8]] };
/// assert_eq!((voltage.span_s(), voltage.period_s()), (Some((0.0, 1.5)), Some(1.0)));
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Channel<const N: usize> {
    /// When each sample was taken, in seconds; strictly growing.
    pub time_s: Vec<f64>,
    /// The samples.
    pub values: Vec<[f64; N]>,
}

/// A flight. A channel that was not logged has no samples.
#[derive(Debug, Clone)]
pub struct Flight {
    /// Its name in reports.
    pub name: String,
    /// The file it was read from.
    pub file: PathBuf,
    /// Further files it was read from: later parts of its log, and the logs of single channels.
    pub other_files: Vec<PathBuf>,
    /// Its role.
    pub role: Role,
    /// Number of rotors of its vehicle: behind so many, commands and speeds are zero.
    pub rotors: usize,
    /// Raw motor commands, in the unit of the vehicle file's command map and in its order of rotors. A command
    /// holds until the next.
    pub command: Channel<ROTORS_MAX>,
    /// True if the log writes commands only on change: then a time without commands is not a gap.
    pub commands_on_change: bool,
    /// Times between the files of such a log, in which it is unknown if a command changed.
    pub command_breaks_s: Vec<(f64, f64)>,
    /// Speeds of the rotors in rad/s, in the order of the commands.
    pub rotor_speed: Channel<ROTORS_MAX>,
    /// Position in W, in m.
    pub position: Channel<3>,
    /// Velocity in W, in m/s.
    pub velocity: Channel<3>,
    /// Attitude quaternion that takes vectors from B to W (Hamilton), in the order w, x, y, z, of length one and
    /// without jumps of sign.
    pub attitude: Channel<4>,
    /// Angular velocity of B relative to W, in B, in rad/s: a gyroscope's reading.
    pub angular_velocity: Channel<3>,
    /// Specific force in B, in m/s^2: an accelerometer's reading, +g along z at rest.
    pub specific_force: Channel<3>,
    /// Voltage of the battery in V.
    pub battery_voltage: Channel<1>,
    /// True if a rig holds the vehicle at a point, false if it flies freely; `None` if that is not stated.
    pub on_rig: Option<bool>,
    /// True if its torques are not to be compared, since the commands do not determine them:
    /// `torques = false`.
    pub without_torques: bool,
    /// Assumptions of the flights file in place of measurements, such as a level attitude.
    pub assumed: Vec<String>,
    /// Notes of the reader: repeated samples left out, gaps, values that look like another unit.
    pub notes: Vec<String>,
}

impl<const N: usize> Channel<N> {
    /// True if the quantity was not logged.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Times of the first and the last sample.
    #[must_use]
    pub fn span_s(&self) -> Option<(f64, f64)> {
        Some((*self.time_s.first()?, *self.time_s.last()?))
    }

    /// The median time between two samples; `None` with fewer than two.
    #[must_use]
    pub fn period_s(&self) -> Option<f64> {
        period_s(&self.time_s)
    }

    /// The samples that were taken in `pieces_s`: times from first to last, in rising order.
    fn within(&self, pieces_s: &[(f64, f64)]) -> Self {
        self.kept(|index| {
            let at_s = self.time_s[index];
            let next = pieces_s.partition_point(|piece| piece.1 < at_s);
            pieces_s.get(next).is_some_and(|piece| piece.0 <= at_s)
        })
    }

    /// The samples for which `is_kept` holds of their index.
    pub(crate) fn kept(&self, is_kept: impl Fn(usize) -> bool) -> Self {
        let kept = || (0..self.time_s.len()).filter(|index| is_kept(*index));
        Self {
            time_s: kept().map(|index| self.time_s[index]).collect(),
            values: kept().map(|index| self.values[index]).collect(),
        }
    }
}

/// A channel with samples of any size.
pub(crate) trait AnyChannel {
    fn time_s(&mut self) -> &mut Vec<f64>;
    /// Leaves the samples for which `is_kept` holds of their index.
    fn keep(&mut self, is_kept: &dyn Fn(usize) -> bool);
}

impl<const N: usize> AnyChannel for Channel<N> {
    fn time_s(&mut self) -> &mut Vec<f64> {
        &mut self.time_s
    }

    fn keep(&mut self, is_kept: &dyn Fn(usize) -> bool) {
        *self = self.kept(is_kept);
    }
}

impl Flight {
    /// A flight without samples, of a vehicle with four rotors.
    #[must_use]
    pub fn new(name: impl Into<String>, file: impl Into<PathBuf>, role: Role) -> Self {
        Self {
            name: name.into(),
            file: file.into(),
            other_files: Vec::new(),
            role,
            rotors: 4,
            command: Channel::default(),
            commands_on_change: false,
            command_breaks_s: Vec::new(),
            rotor_speed: Channel::default(),
            position: Channel::default(),
            velocity: Channel::default(),
            attitude: Channel::default(),
            angular_velocity: Channel::default(),
            specific_force: Channel::default(),
            battery_voltage: Channel::default(),
            on_rig: None,
            without_torques: false,
            assumed: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Channels with the times of their first and last samples, as text.
    #[must_use]
    pub fn spans(&self) -> String {
        let of = |(quantity, time_s): (Quantity, &[f64])| {
            let (first_s, last_s) = (time_s.first()?, time_s.last()?);
            Some(format!("{quantity} from {first_s:.3} s to {last_s:.3} s"))
        };
        let all: Vec<String> = self.times().into_iter().filter_map(of).collect();
        if all.is_empty() { "no channel".to_owned() } else { all.join(", ") }
    }

    /// The flight with the samples alone that were taken in `pieces_s`: times from first to last, in s. Commands that were logged on change are kept, since
    /// each holds until the next.
    ///
    /// ```
    /// use flights::{Channel, Flight, Role};
    ///
    /// let mut flight = Flight::new("f", "log.csv", Role::Fit);
    /// flight.battery_voltage = Channel { time_s: vec![0.0, 1.0, 2.0, 3.0], values: vec![[11.9]; 4] };
    /// assert_eq!(flight.within(&[(0.0, 0.5), (2.0, 3.0)]).battery_voltage.time_s, [0.0, 2.0, 3.0]);
    /// ```
    #[must_use]
    pub fn within(&self, pieces_s: &[(f64, f64)]) -> Self {
        let command =
            if self.commands_on_change { self.command.clone() } else { self.command.within(pieces_s) };
        Self {
            command,
            rotor_speed: self.rotor_speed.within(pieces_s),
            position: self.position.within(pieces_s),
            velocity: self.velocity.within(pieces_s),
            attitude: self.attitude.within(pieces_s),
            angular_velocity: self.angular_velocity.within(pieces_s),
            specific_force: self.specific_force.within(pieces_s),
            battery_voltage: self.battery_voltage.within(pieces_s),
            name: self.name.clone(),
            file: self.file.clone(),
            other_files: self.other_files.clone(),
            role: self.role,
            rotors: self.rotors,
            commands_on_change: self.commands_on_change,
            command_breaks_s: self.command_breaks_s.clone(),
            on_rig: self.on_rig,
            without_torques: self.without_torques,
            assumed: self.assumed.clone(),
            notes: self.notes.clone(),
        }
    }

    /// Iterates over the files that it was read from.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(&self.file).chain(&self.other_files).map(PathBuf::as_path)
    }

    /// Gaps of the commands, each as the times of the last command before and the first behind it; infinite behind the
    /// last. In a log that writes commands only on change, they are the times between its files.
    pub(crate) fn command_gaps_s(&self) -> Vec<(f64, f64)> {
        let time_s = &self.command.time_s;
        if !self.commands_on_change {
            return of_held(time_s);
        }
        let next_s = |to_s: f64| time_s.get(time_s.partition_point(|time_s| *time_s < to_s)).copied();
        let breaks = self.command_breaks_s.iter();
        breaks.map(|(from_s, to_s)| (*from_s, next_s(*to_s).unwrap_or(f64::INFINITY))).collect()
    }

    /// The times of the samples of all channels, in the order of [`Quantity::CHANNELS`].
    pub(crate) fn times(&self) -> [(Quantity, &[f64]); 8] {
        [
            (Quantity::Command, &self.command.time_s),
            (Quantity::RotorSpeed, &self.rotor_speed.time_s),
            (Quantity::Position, &self.position.time_s),
            (Quantity::Velocity, &self.velocity.time_s),
            (Quantity::Attitude, &self.attitude.time_s),
            (Quantity::AngularVelocity, &self.angular_velocity.time_s),
            (Quantity::SpecificForce, &self.specific_force.time_s),
            (Quantity::BatteryVoltage, &self.battery_voltage.time_s),
        ]
    }

    /// The same channels to be changed.
    pub(crate) fn channels_mut(&mut self) -> [(Quantity, &mut dyn AnyChannel); 8] {
        [
            (Quantity::Command, &mut self.command),
            (Quantity::RotorSpeed, &mut self.rotor_speed),
            (Quantity::Position, &mut self.position),
            (Quantity::Velocity, &mut self.velocity),
            (Quantity::Attitude, &mut self.attitude),
            (Quantity::AngularVelocity, &mut self.angular_velocity),
            (Quantity::SpecificForce, &mut self.specific_force),
            (Quantity::BatteryVoltage, &mut self.battery_voltage),
        ]
    }
}

/// The median step of times; `None` with fewer than two.
pub(crate) fn period_s(time_s: &[f64]) -> Option<f64> {
    median(time_s.windows(2).map(|pair| pair[1] - pair[0]))
}

/// The median, of two in the middle the greater one, so that it is one of the numbers; `None` of nothing.
pub(crate) fn median(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}
