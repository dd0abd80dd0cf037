//! Content of a manifest, as types; places stay with the values that an error may name.

use super::composition::{Composition, GroupSetting};
use crate::program::{OnExit, Readiness};
use bus::plan::{Pace, Wait};
use diagnostics::ParameterError;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use toml::Spanned;

/// Content of a manifest.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Content {
    /// Settings of the whole run.
    pub run: Run,
    /// The processes by name.
    pub(crate) process: BTreeMap<Spanned<String>, Process>,
    /// Nodes that share a process, by the name of their group.
    #[serde(default)]
    pub(crate) group: BTreeMap<Spanned<String>, GroupSetting>,
    /// Conditions on the samples of the run.
    #[serde(default)]
    pub pass: Vec<Spanned<PassCondition>>,
    /// Numbers that are reported after the run and not judged: conditions without limits.
    #[serde(default)]
    pub measure: Vec<Spanned<PassCondition>>,
    /// Simulated states compared with measured ones.
    #[serde(default)]
    pub compare: Vec<Spanned<Comparison>>,
    /// Ticks at which the run writes a checkpoint.
    #[serde(default)]
    pub(crate) checkpoint: Vec<Spanned<CheckpointSetting>>,
    /// Processes that take over from others in flight.
    #[serde(default)]
    pub(crate) swap: Vec<Spanned<SwapSetting>>,
    /// Processes that run beside others and are not listened to.
    #[serde(default)]
    pub(crate) shadow: Vec<Spanned<ShadowSetting>>,
}

impl Content {
    /// True if the run writes checkpoints.
    pub(crate) fn writes_checkpoints(&self) -> bool {
        !self.checkpoint.is_empty() || self.run.checkpoint_every_s.is_some()
    }

    /// The conditions of the run, without their places.
    #[must_use]
    pub fn conditions(&self) -> Conditions {
        fn all<T: Clone>(stated: &[Spanned<T>]) -> Vec<T> {
            stated.iter().map(|one| one.get_ref().clone()).collect()
        }
        Conditions { pass: all(&self.pass), measure: all(&self.measure), compare: all(&self.compare) }
    }
}

/// Conditions, measures and comparisons of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Conditions {
    /// Pass conditions.
    pub pass: Vec<PassCondition>,
    /// Measures.
    pub measure: Vec<PassCondition>,
    /// Comparisons with measured states.
    pub compare: Vec<Comparison>,
}

impl Conditions {
    /// The topics that they need, each once.
    #[must_use]
    pub fn topics(&self) -> BTreeSet<&str> {
        let conditions = self.pass.iter().chain(&self.measure).flat_map(PassCondition::topics);
        let compared = self.compare.iter().flat_map(|compare| [&*compare.simulated, &*compare.measured]);
        conditions.chain(compared).collect()
    }
}

/// Settings of the whole run.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Ticks per simulated second.
    #[serde(default = "default_rate_hz")]
    pub rate_hz: Spanned<u32>,
    /// Simulated length of the run.
    pub duration_s: Spanned<f64>,
    /// Seed of every node's random stream.
    #[serde(default)]
    pub seed: u64,
    /// Pacing: `free`, `realtime`, or simulated seconds per host second.
    #[serde(default)]
    pub pace: PaceSetting,
    /// Ticks that a fast node may be ahead of the slowest.
    pub window_ticks: Option<Spanned<u32>>,
    /// Composition instead of the `[group]` tables.
    pub compose: Option<Spanned<Composition>>,
    /// Core of the clock service.
    pub clock_cpu: Option<Spanned<usize>>,
    /// Starts the processes in an order shuffled by this seed.
    pub start_order_seed: Option<u64>,
    /// The recording, or `none`; beside the manifest and named like it where absent.
    pub record: Option<Spanned<String>>,
    /// Simulated time between two checkpoints, s; none are written where absent.
    pub checkpoint_every_s: Option<Spanned<f64>>,
    /// Newest checkpoints that are kept; all where absent.
    pub checkpoint_keep: Option<Spanned<usize>>,
    /// True if every process notes the host times of its ticks.
    #[serde(default)]
    pub profile: bool,
    /// True if every process keeps its memory from being paged out.
    #[serde(default)]
    pub lock_memory: bool,
}

fn default_rate_hz() -> Spanned<u32> {
    Spanned::new(0..0, 1000)
}

/// The value of `run.record` for a run without a recording.
pub const NO_RECORDING: &str = "none";

impl Run {
    /// True if the run is not recorded, even if the manifest has a recorder.
    #[must_use]
    pub fn is_unrecorded(&self) -> bool {
        self.record.as_ref().is_some_and(|record| record.get_ref() == NO_RECORDING)
    }
}

/// A process.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Process {
    /// A built-in node.
    pub kind: Option<Spanned<String>>,
    /// Any executable that links `bus`, with its arguments.
    pub command: Option<Spanned<Vec<String>>>,
    /// True if it takes part in the ticks; a sidecar, such as a viewer, does not.
    pub lockstep: Option<Spanned<bool>>,
    /// Vehicle file, relative to the manifest.
    pub vehicle: Option<Spanned<String>>,
    /// Scene file, relative to the manifest.
    pub scene: Option<Spanned<String>>,
    /// File of a controller's gains, relative to the manifest.
    pub gains: Option<Spanned<String>>,
    /// Data file, relative to the manifest.
    pub data: Option<Spanned<String>>,
    /// FMU, relative to the manifest.
    pub fmu: Option<Spanned<String>>,
    /// Program of an autopilot's firmware, relative to the manifest.
    pub firmware: Option<Spanned<String>>,
    /// Configuration of a firmware, relative to the manifest.
    pub configuration: Option<Spanned<String>>,
    /// Ticks between two computations.
    pub period_ticks: Option<Spanned<u32>>,
    /// Core it runs on.
    pub cpu: Option<Spanned<usize>>,
    /// Its way of waiting.
    pub wait: Option<Wait>,
    /// Environment variables beside the launcher's own.
    #[serde(default)]
    pub environment: BTreeMap<Spanned<String>, String>,
    /// Working directory, relative to the manifest.
    pub working_directory: Option<Spanned<String>>,
    /// Niceness.
    pub nice: Option<Spanned<i32>>,
    /// Priority under SCHED_FIFO.
    pub realtime_priority: Option<Spanned<i32>>,
    /// Action when it ends before the run does.
    pub on_exit: Option<Spanned<OnExit>>,
    /// The process that stands by for it, whole.
    pub standby: Option<Spanned<Box<Process>>>,
    /// Condition for a sidecar to count as ready.
    pub ready: Option<Spanned<Readiness>>,
    /// Names of sidecars that have to become ready before this one starts.
    #[serde(default)]
    pub after: Vec<Spanned<String>>,
    /// Longest time that the run may stand still because of it, in milliseconds of host time.
    pub watchdog_ms_host: Option<Spanned<u64>>,
    /// File for its standard output and error, relative to the manifest.
    pub log: Option<Spanned<String>>,
    /// Computing time of its steps on the processor that it stands for.
    pub computing_time: Option<Spanned<ComputingTimeSetting>>,
    /// The node's own parameters.
    #[serde(default)]
    pub parameters: BTreeMap<Spanned<String>, serde_json::Value>,
    /// Its inputs, by port.
    #[serde(default)]
    pub inputs: BTreeMap<Spanned<String>, InputSetting>,
    /// Its outputs, by port; built-in nodes need this only to change something.
    #[serde(default)]
    pub outputs: BTreeMap<Spanned<String>, OutputSetting>,
}

/// A field of a process that names a file.
type FileField = fn(&Process) -> Option<&Spanned<String>>;

/// Keys of a process that name a file, which becomes a parameter.
static FILES: [(&str, FileField); 7] = [
    ("vehicle", |process| process.vehicle.as_ref()),
    ("scene", |process| process.scene.as_ref()),
    ("gains", |process| process.gains.as_ref()),
    ("data", |process| process.data.as_ref()),
    ("fmu", |process| process.fmu.as_ref()),
    ("firmware", |process| process.firmware.as_ref()),
    ("configuration", |process| process.configuration.as_ref()),
];

impl Process {
    /// The keys that name a file, which becomes a parameter.
    pub fn file_keys() -> impl Iterator<Item = &'static str> {
        FILES.iter().map(|(key, _)| *key)
    }

    /// The files that it names, by their keys.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &Spanned<String>)> {
        FILES.iter().filter_map(move |(key, field)| Some((*key, field(self)?)))
    }

    /// The file that it names at `key`.
    pub fn file(&self, key: &str) -> Option<&Spanned<String>> {
        self.files().find(|(name, _)| *name == key).map(|(_, file)| file)
    }
}

/// The computing time of a process's steps, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "distribution", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ComputingTimeSetting {
    /// Always the same.
    Constant {
        /// The time, ms.
        ms: f64,
    },
    /// Evenly between two times.
    Uniform {
        /// The shortest, ms.
        min_ms: f64,
        /// The longest, ms.
        max_ms: f64,
    },
    /// Lognormal.
    Lognormal {
        /// The median, ms.
        median_ms: f64,
        /// Standard deviation of the natural logarithm.
        sigma: f64,
    },
    /// The distribution in a file: the output of `profile --json`, or times in µs.
    Measured {
        /// The file, relative to the manifest.
        file: String,
        /// The process of the profile; the one of this name where absent.
        process: Option<String>,
        /// Factor of the times.
        scale: Option<f64>,
    },
}

/// An input: a topic, or a table with delay and initial value.
#[derive(Clone, Debug, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields)]
pub struct InputSetting {
    /// The topic.
    pub topic: String,
    /// 0 or 1.
    #[serde(default)]
    pub delay_ticks: u32,
    /// Field values before the first sample.
    pub initial: Option<serde_json::Value>,
}

impl<'de> Deserialize<'de> for InputSetting {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InputVisitor)
    }
}

/// Reads `"/topic"` or `{ topic = "/topic", delay_ticks = 1, initial = { … } }`.
struct InputVisitor;

impl<'de> Visitor<'de> for InputVisitor {
    type Value = InputSetting;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a topic such as \"/plant/state\", or { topic = …, delay_ticks = …, initial = … }")
    }

    fn visit_str<E: de::Error>(self, topic: &str) -> Result<InputSetting, E> {
        Ok(InputSetting { topic: topic.to_owned(), delay_ticks: 0, initial: None })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<InputSetting, A::Error> {
        // The derived one, of a table.
        InputSetting::deserialize(MapAccessDeserializer::new(map))
    }
}

/// An output, where its topic or rate is not the default, or the process is not built in.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSetting {
    /// Topic instead of `/<process>/<output>`.
    pub topic: Option<String>,
    /// Ticks between two samples, a multiple of the process's period.
    pub every_ticks: Option<u32>,
    /// Message type, needed for a `command`.
    #[serde(rename = "type")]
    pub type_name: Option<String>,
}

/// Pacing as written: `free`, `realtime`, or a factor.
///
/// ```
/// use runtime::manifest::PaceSetting;
/// assert_eq!("1.0".parse::<PaceSetting>()?.to_string(), "realtime");
/// assert!("fast".parse::<PaceSetting>().unwrap_err().to_string().contains("expected free, realtime, or a factor"));
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PaceSetting(pub Pace);

/// Simulated seconds per second of a paced run. A tick of 1 ms then takes 10 s at most, half of the watchdog's limit,
/// and 0.1 µs at least, less than any process needs for it.
const FACTOR_MIN: f64 = 1e-4;
const FACTOR_MAX: f64 = 1e4;

impl Default for PaceSetting {
    fn default() -> Self {
        Self(Pace::Free)
    }
}

impl std::str::FromStr for PaceSetting {
    type Err = ParameterError;

    fn from_str(text: &str) -> Result<Self, ParameterError> {
        match text {
            "free" => Ok(Self(Pace::Free)),
            "realtime" => Ok(Self(Pace::Factor(1.0))),
            _ => match text.parse::<f64>() {
                Ok(factor) if (FACTOR_MIN..=FACTOR_MAX).contains(&factor) => Ok(Self(Pace::Factor(factor))),
                _ => Err(format!(
                    "`{text}` is not a pace: expected free, realtime, or a factor from {FACTOR_MIN} to {FACTOR_MAX}, \
                     such as 0.5"
                )
                .into()),
            },
        }
    }
}

impl fmt::Display for PaceSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Pace::Free => write!(f, "free"),
            Pace::Factor(1.0) => write!(f, "realtime"),
            Pace::Factor(factor) => write!(f, "{factor}"),
        }
    }
}

impl Serialize for PaceSetting {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for PaceSetting {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = match serde_json::Value::deserialize(deserializer)? {
            serde_json::Value::String(text) => text,
            other => other.to_string(),
        };
        text.parse().map_err(de::Error::custom)
    }
}

/// Statistic of the samples of a pass condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Statistic {
    /// Every sample must lie within the limits.
    Every,
    /// The smallest sample.
    Min,
    /// The largest sample.
    Max,
    /// The mean.
    Mean,
    /// The root of the mean square.
    Rms,
    /// The last sample.
    Last,
    /// The largest sample less the smallest: how far a vehicle slid.
    Span,
    /// Delay of the field behind a reference: the lag at which their normalized cross-correlation is largest.
    Lag,
    /// Slope of the line of least squares of the field over the reference, shifted by that lag.
    Gain,
}

impl Statistic {
    /// True if it compares the field with a reference.
    #[must_use]
    pub fn is_of_response(self) -> bool {
        matches!(self, Self::Lag | Self::Gain)
    }

    /// The unit of its values, of a field in `field_unit`.
    ///
    /// ```
    /// use runtime::manifest::Statistic;
    /// assert_eq!([Statistic::Rms, Statistic::Lag, Statistic::Gain].map(|it| it.unit("rad")), ["rad", "s", "1"]);
    /// ```
    #[must_use]
    pub fn unit(self, field_unit: &str) -> &str {
        match self {
            Self::Lag => "s",
            Self::Gain => "1",
            _ => field_unit,
        }
    }
}

/// A condition on a field of a topic over a span of simulated time.
///
/// ```
/// use runtime::manifest::{PassCondition, Statistic};
/// let text = "name = 'steady'\ntopic = '/plant/state'\nfield = 'position.z'\nunit = 'm'\nstatistic = 'rms'\nmax = 0.1";
/// let pass: PassCondition = toml::from_str(text)?;
/// assert_eq!((pass.statistic, pass.from_s, pass.max), (Statistic::Rms, 0.0, Some(0.1)));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PassCondition {
    /// Description, for the summary.
    pub name: String,
    /// Topic.
    pub topic: String,
    /// Field, such as `position.z`, or `attitude.roll` of a quaternion; `position`, a vector, is judged by its length.
    pub field: String,
    /// Signal that is subtracted first, sample by sample.
    pub minus: Option<Signal>,
    /// Reference of a lag or a gain.
    pub reference: Option<Reference>,
    /// Unit of the limits.
    pub unit: String,
    /// Start of the span; the start of the run where absent.
    #[serde(default)]
    pub from_s: f64,
    /// End of the span, itself included; the end of the run where absent.
    pub to_s: Option<f64>,
    /// Condition on another signal: only samples while it is within limits count.
    #[serde(rename = "while")]
    pub gate: Option<Gate>,
    /// Statistic that is compared with the limits.
    pub statistic: Statistic,
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
}

impl PassCondition {
    /// The topics that it needs.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.placed_topics().map(|(_, topic)| topic)
    }

    /// The topics that it needs, with the keys of the tables that name them; empty for its own.
    pub fn placed_topics(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let others = [
            self.minus.as_ref().map(|minus| ("minus", &minus.topic)),
            self.reference.as_ref().map(|reference| ("reference", &reference.topic)),
            self.gate.as_ref().map(|gate| ("while", &gate.topic)),
        ];
        let all = std::iter::once(("", &self.topic)).chain(others.into_iter().flatten());
        all.map(|(table, topic)| (table, topic.as_str()))
    }
}

/// A field of a topic.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Topic.
    pub topic: String,
    /// Field.
    pub field: String,
}

/// A signal that another follows, or leads.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Topic.
    pub topic: String,
    /// Field.
    pub field: String,
    /// The lag is looked for from this much ahead of the reference to this much behind it, s.
    #[serde(default = "default_within_s")]
    pub within_s: f64,
}

fn default_within_s() -> f64 {
    1.0
}

/// Limits of a signal, in its own unit, within which a condition judges.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// Topic.
    pub topic: String,
    /// Field.
    pub field: String,
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
}

/// A comparison of a simulated state with a measured one at the end of windows of equal length.
///
/// ```
/// use runtime::manifest::Comparison;
/// let text = "simulated = '/plant/state'\nmeasured = '/player/state'\nwindow_s = 0.5\nmax_position_m = 0.1";
/// let comparison: Comparison = toml::from_str(text)?;
/// assert_eq!((comparison.max_position_m, comparison.max_attitude_deg), (Some(0.1), None));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// Topic of the simulated state.
    pub simulated: String,
    /// Topic of the measured state.
    pub measured: String,
    /// Length of the windows at whose start the plant is set to the measured state.
    pub window_s: f64,
    /// Upper limit of the RMS position error; no limit where absent.
    pub max_position_m: Option<f64>,
    /// Upper limit of the RMS velocity error; no limit where absent.
    pub max_velocity_m_s: Option<f64>,
    /// Upper limit of the RMS attitude error; no limit where absent.
    pub max_attitude_deg: Option<f64>,
    /// False if the errors are reported and not judged.
    #[serde(default = "default_judged")]
    pub judged: bool,
}

fn default_judged() -> bool {
    true
}

/// A process that takes over from another in flight.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwapSetting {
    /// The process it succeeds.
    pub process: Spanned<String>,
    /// The tick at which it takes over.
    pub at_tick: Option<Spanned<u32>>,
    /// The tick as simulated time.
    pub at_s: Option<Spanned<f64>>,
    /// Number of ticks that it computes beside the process before.
    #[serde(default = "default_shadow_ticks")]
    pub shadow_ticks: u32,
    /// Number of times that this happens.
    pub repeat: Option<Spanned<u32>>,
    /// Ticks between two times.
    pub every_ticks: Option<Spanned<u32>>,
    /// The backup, whole.
    pub with: Process,
}

fn default_shadow_ticks() -> u32 {
    100
}

/// A tick at which the run writes a checkpoint.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointSetting {
    /// The first tick that a run computes which goes on from it.
    pub at_tick: Spanned<u32>,
}

/// A process that computes beside another from the first tick to the last, and never takes over.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShadowSetting {
    /// The process it shadows.
    pub process: Spanned<String>,
    /// The shadow, whole.
    pub with: Process,
}

#[cfg(test)]
mod tests {
    use super::PaceSetting;
    use bus::plan::Pace;

    #[test]
    fn a_pace_is_free_realtime_or_a_factor() {
        assert_eq!("realtime".parse::<PaceSetting>().unwrap().0, Pace::Factor(1.0));
        assert_eq!("0.5".parse::<PaceSetting>().unwrap().0, Pace::Factor(0.5));
        assert!("-1".parse::<PaceSetting>().is_err());
    }
}
