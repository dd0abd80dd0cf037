//! Content of a flights file, as it is written.

use std::collections::BTreeMap;
use std::num::NonZero;

use serde::Deserialize;
use toml::Spanned;
use vehicles::table::Dialect;

use crate::files::Files;
use crate::flight::Role;
use crate::limits::NextFlight;
use crate::name::Name;
use crate::quantity::Quantity;

/// A flights file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declaration {
    /// The vehicle file, relative to the flights file.
    pub vehicle: Spanned<String>,
    /// Format of the logs whose flight does not say it.
    pub format: Option<Format>,
    /// Form of the CSV files whose flight does not say it.
    pub csv: Option<Dialect>,
    /// Clock of the logs whose flight does not say it.
    pub time: Option<Clock>,
    /// Channels of the logs; a flight's own come first.
    #[serde(default)]
    pub channels: ChannelMap,
    /// Limits of the flight that an identification proposes.
    pub next_flight: Option<Spanned<NextFlight>>,
    /// The flights.
    #[serde(default)]
    pub flight: Vec<Spanned<FlightEntry>>,
}

/// A flight of a flights file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightEntry {
    /// Its name in reports, or the beginning of the names for the logs of a pattern; else the log's name.
    pub name: Option<Spanned<String>>,
    /// The log, relative to the flights file, or a pattern of logs that become a flight each, or a list of a log's parts.
    pub file: Spanned<Files>,
    /// Its role.
    pub role: Role,
    /// Format of the log.
    pub format: Option<Format>,
    /// Form of the log, if it is a CSV file.
    pub csv: Option<Dialect>,
    /// Number of the recording that is used, from 1, where a CSV file holds several.
    pub recording: Option<NonZero<usize>>,
    /// Clock of the log, where it has two.
    pub time: Option<Clock>,
    /// Start of the part that is used, in seconds from the log's first sample.
    pub from_s: Option<Spanned<f64>>,
    /// End of that part.
    pub to_s: Option<Spanned<f64>>,
    /// Channels that differ from those of the whole file.
    #[serde(default)]
    pub channels: ChannelMap,
    /// Lateness of each channel, in seconds.
    #[serde(default)]
    pub delay_s: BTreeMap<Quantity, Spanned<f64>>,
    /// Assumption in place of a measurement that the log does not have.
    pub assume: Option<Spanned<Assumption>>,
    /// True if a rig holds the vehicle, false if it flies freely; else the channels show it.
    pub rig: Option<bool>,
    /// False if the log lacks commands that cause the torques, which are then not compared.
    pub torques: Option<bool>,
    /// True if values that contradict their units are only noted.
    #[serde(default)]
    pub trust_units: bool,
}

/// The format of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Comma-separated values with a header.
    Csv,
    /// MCAP with ROS 2 message definitions: recordings of this project and ROS 2 bags.
    Mcap,
    /// PX4's ULog.
    Ulog,
    /// ArduPilot's dataflash log, `.BIN`.
    Dataflash,
    /// The log that a Crazyflie writes to its card, version 2.
    Crazyflie,
    /// Parquet: a table of columns with types.
    Parquet,
}

impl Format {
    /// The name in a flights file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Mcap => "mcap",
            Self::Ulog => "ulog",
            Self::Dataflash => "dataflash",
            Self::Crazyflie => "crazyflie",
            Self::Parquet => "parquet",
        }
    }

    /// True for a table whose rows are on one clock.
    pub fn is_table(self) -> bool {
        matches!(self, Self::Csv | Self::Parquet)
    }
}

/// Clock of an MCAP file's messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The time at which the message was logged.
    Log,
    /// The stamp in the message.
    Stamp,
}

/// Assumption in place of an attitude and an angular velocity that were not logged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Assumption {
    /// The vehicle hovers: level and not turning.
    Hover,
}

/// The channels by quantity.
pub type ChannelMap = BTreeMap<Quantity, Spanned<Entry>>;

/// Place of a quantity in a log, and its form there.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Columns of a CSV file, variables of a Crazyflie log, or fields of a topic.
    #[serde(alias = "fields")]
    pub columns: Option<Vec<Name>>,
    /// Roll, pitch and yaw instead of a quaternion's columns.
    pub euler: Option<Vec<Name>>,
    /// A rotation matrix, body to world and row by row, instead of a quaternion's columns.
    pub matrix: Option<Vec<Name>>,
    /// The yaw alone, for a level attitude that is assumed.
    pub yaw: Option<Name>,
    /// Log that holds the quantity, if not that of the flight, or a list of its parts; relative to the flights file.
    pub file: Option<Spanned<Files>>,
    /// Number of the recording that is used of that log, from 1.
    pub recording: Option<NonZero<usize>>,
    /// Column of the times in that log, if it is not that of the channel `time`.
    pub time: Option<Box<Entry>>,
    /// Topic of an MCAP file, message of a ULog, event of a Crazyflie log.
    pub topic: Option<String>,
    /// Factor of the numbers in the log, before their unit.
    pub scale: Option<EachNumber>,
    /// Summand of the numbers in the log, behind the factor and before their unit.
    pub offset: Option<EachNumber>,
    /// Unit of the numbers in the log.
    pub unit: Option<String>,
    /// Frames of the numbers in the log.
    pub frame: Option<Frame>,
    /// Kind of a `specific_force`, or axes of an `angular_velocity`.
    pub holds: Option<Holds>,
    /// True if a log writes a `command` only when it changes.
    pub on_change: Option<bool>,
    /// Divisor of electrical rotor speeds: half the number of a motor's magnets.
    pub pole_pairs: Option<u32>,
}

impl Entry {
    /// Names of all numbers, with their signs.
    pub fn names(&self) -> impl Iterator<Item = &Name> {
        let lists = [&self.columns, &self.euler, &self.matrix].into_iter().flatten();
        lists.flatten().chain(&self.yaw)
    }
}

/// A number, or one for each number of a sample.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number, or a list with one for each number of a sample")]
pub enum EachNumber {
    /// The same for all.
    All(f64),
    /// One each.
    Each(Vec<f64>),
}

/// The frames of a log's vectors and attitudes: those of the body, then those of the world.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Frame {
    /// Body x forward, y left, z up; world z up: this project's own.
    #[default]
    FluEnu,
    /// Body x forward, y right, z down; world x north, y east, z down.
    FrdNed,
}

/// Kind of the numbers of a specific force in the log, or axes of those of an angular velocity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Holds {
    /// Specific force in the body: an accelerometer's reading.
    #[default]
    SpecificForce,
    /// The acceleration along the axes of the body: 0 at rest, as gravity was taken off.
    BodyAcceleration,
    /// The acceleration along the axes of the world: 0 at rest.
    WorldAcceleration,
    /// The specific force along the axes of the world: +g up at rest.
    WorldSpecificForce,
    /// An angular velocity along the axes of the body: a gyroscope's reading.
    Body,
    /// An angular velocity along the axes of the world.
    World,
}

impl Holds {
    /// Those of a specific force.
    pub const FORCES: [Self; 4] =
        [Self::SpecificForce, Self::BodyAcceleration, Self::WorldAcceleration, Self::WorldSpecificForce];
    /// Those of an angular velocity.
    pub const RATES: [Self; 2] = [Self::Body, Self::World];

    /// The name in a flights file.
    pub fn name(self) -> &'static str {
        match self {
            Self::SpecificForce => "specific-force",
            Self::BodyAcceleration => "body-acceleration",
            Self::WorldAcceleration => "world-acceleration",
            Self::WorldSpecificForce => "world-specific-force",
            Self::Body => "body",
            Self::World => "world",
        }
    }

    /// True if the axes are those of the world.
    pub fn is_in_world(self) -> bool {
        matches!(self, Self::WorldAcceleration | Self::WorldSpecificForce | Self::World)
    }

    /// True if gravity was taken off.
    pub fn is_without_gravity(self) -> bool {
        matches!(self, Self::BodyAcceleration | Self::WorldAcceleration)
    }
}
