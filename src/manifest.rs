//! The manifest: what a user writes to describe a run, read with the place of every value.

use crate::problem::{Problem, nearest};
use bus::plan::{Pace, Wait};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Keys that change how fast or where a run computes, never what: they stay out of the recording.
const HOST_ONLY_KEYS: [&str; 5] = ["clock_cpu", "pace", "record", "start_order_seed", "window_ticks"];
/// The same for keys of a process.
const HOST_ONLY_PROCESS_KEYS: [&str; 2] = ["cpu", "wait"];

/// A manifest with the text it was read from.
#[derive(Debug)]
pub struct Manifest {
    /// The file.
    pub path: PathBuf,
    /// Its text, with `--set` applied: what places in errors refer to.
    pub text: String,
    /// The text that goes into the recording: without `--set` of host-only keys.
    pub recorded_text: String,
    /// What it says.
    pub content: Content,
}

/// What a manifest says.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Content {
    /// Settings of the whole run.
    pub run: Run,
    /// The processes by name.
    pub process: BTreeMap<Spanned<String>, Process>,
    /// Conditions on the recording, evaluated after the run.
    #[serde(default)]
    pub pass: Vec<Spanned<PassCondition>>,
    /// Simulated states compared with measured ones, evaluated after the run.
    #[serde(default)]
    pub compare: Vec<Spanned<Comparison>>,
}

/// Settings of the whole run.
#[derive(Debug, Deserialize)]
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
    /// Core of the clock service.
    pub clock_cpu: Option<usize>,
    /// Starts the processes in an order shuffled by this seed.
    pub start_order_seed: Option<u64>,
    /// The recording; beside the manifest and named like it where absent.
    pub record: Option<PathBuf>,
}

fn default_rate_hz() -> Spanned<u32> {
    Spanned::new(0..0, 1000)
}

/// A process.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Process {
    /// A built-in node.
    pub kind: Option<Spanned<String>>,
    /// Any executable that links `bus`, with its arguments.
    pub command: Option<Spanned<Vec<String>>>,
    /// Vehicle file, relative to the manifest.
    pub vehicle: Option<Spanned<String>>,
    /// Data file, relative to the manifest.
    pub data: Option<Spanned<String>>,
    /// Ticks between two computations.
    pub period_ticks: Option<Spanned<u32>>,
    /// Core it runs on.
    pub cpu: Option<Spanned<usize>>,
    /// How it waits.
    #[serde(default)]
    pub wait: Option<Wait>,
    /// The node's own parameters.
    #[serde(default)]
    pub parameters: BTreeMap<Spanned<String>, serde_json::Value>,
    /// What it reads, by input port.
    #[serde(default)]
    pub inputs: BTreeMap<Spanned<String>, InputSetting>,
    /// What it sends, by output port; built-in nodes need it only to change something.
    #[serde(default)]
    pub outputs: BTreeMap<Spanned<String>, OutputSetting>,
}

/// An input: a topic, or a table with delay and initial value.
#[derive(Debug)]
pub struct InputSetting {
    /// The topic.
    pub topic: String,
    /// 0 or 1.
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
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            topic: String,
            #[serde(default)]
            delay_ticks: u32,
            initial: Option<serde_json::Value>,
        }
        let Table { topic, delay_ticks, initial } = Table::deserialize(MapAccessDeserializer::new(map))?;
        Ok(InputSetting { topic, delay_ticks, initial })
    }
}

/// An output, where its topic or rate is not the default, or the process is not built in.
#[derive(Debug, Deserialize)]
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
#[derive(Clone, Copy, Debug)]
pub struct PaceSetting(pub Pace);

impl Default for PaceSetting {
    fn default() -> Self {
        Self(Pace::Free)
    }
}

impl std::str::FromStr for PaceSetting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "free" => Ok(Self(Pace::Free)),
            "realtime" => Ok(Self(Pace::Factor(1.0))),
            _ => match text.parse::<f64>() {
                Ok(factor) if factor.is_finite() && factor > 0.0 => Ok(Self(Pace::Factor(factor))),
                _ => Err(format!(
                    "`{text}` is not a pace: expected free, realtime, or a factor above 0 such as 0.5"
                )),
            },
        }
    }
}

impl std::fmt::Display for PaceSetting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
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

/// What is computed from the samples of a pass condition.
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
}

/// A condition on a field of a topic over a span of simulated time.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassCondition {
    /// What it means, for the summary.
    pub name: String,
    /// Topic.
    pub topic: String,
    /// Field, such as `position.z`, or `attitude.roll` of a quaternion.
    pub field: String,
    /// Unit of the limits.
    pub unit: String,
    /// Start of the span; the start of the run where absent.
    #[serde(default)]
    pub from_s: f64,
    /// End of the span, itself included; the end of the run where absent.
    pub to_s: Option<f64>,
    /// What is compared with the limits.
    pub statistic: Statistic,
    /// Lower limit.
    pub min: Option<f64>,
    /// Upper limit.
    pub max: Option<f64>,
}

/// A comparison of a simulated state with a measured one at the end of windows of equal length.
#[derive(Debug, Deserialize)]
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
    /// The same for velocity.
    pub max_velocity_m_s: Option<f64>,
    /// The same for attitude.
    pub max_attitude_deg: Option<f64>,
}

impl Manifest {
    /// Reads the manifest at `path` and applies `overrides` (`key.path=value`).
    ///
    /// # Errors
    /// A [`Problem`] that names the place.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, Problem> {
        let original = std::fs::read_to_string(path).map_err(|error| {
            Problem::in_file(path, format!("cannot be read: {error}"), "give the path of a manifest")
        })?;
        let (host, simulated): (Vec<_>, Vec<_>) = overrides.iter().partition(|text| is_host_only(text));
        let recorded_text = apply(path, &original, &simulated)?;
        let text = apply(path, &recorded_text, &host)?;
        let content = toml::from_str(&text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            Problem::at(path, &text, &span, error.message().trim(), help_for(error.message()))
        })?;
        Ok(Self { path: path.to_owned(), text, recorded_text, content })
    }

    /// The manifest's name: its file name without `.toml`.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// A problem at `span` of this manifest.
    pub fn problem(
        &self,
        span: &std::ops::Range<usize>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Problem {
        Problem::at(&self.path, &self.text, span, message, help)
    }

    /// A path written in the manifest: `${NAME:-default}` is the environment's NAME, and a relative path
    /// starts at the manifest's folder.
    pub fn resolve(&self, written: &Spanned<String>) -> Result<PathBuf, Problem> {
        let expanded = expand(written.get_ref(), |name| std::env::var(name).ok()).map_err(|message| {
            self.problem(&written.span(), message, "set it, or give a default: ${NAME:-path}")
        })?;
        let folder = self.path.parent().unwrap_or(Path::new(""));
        Ok(std::path::absolute(folder.join(expanded)).unwrap_or_else(|_| PathBuf::from(written.get_ref())))
    }
}

fn help_for(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let found = quoted.next().unwrap_or_default();
    match message.starts_with("unknown field").then(|| nearest(found, quoted)).flatten() {
        Some(known) => format!("did you mean `{known}`?"),
        None => "docs/manifest.md lists every key".to_owned(),
    }
}

/// Whether an override touches only where and how fast a run computes.
fn is_host_only(text: &str) -> bool {
    let key = text.split('=').next().unwrap_or_default().trim();
    match key.split('.').collect::<Vec<_>>().as_slice() {
        ["run", key] => HOST_ONLY_KEYS.contains(key),
        ["process", _, key] => HOST_ONLY_PROCESS_KEYS.contains(key),
        _ => false,
    }
}

fn apply(path: &Path, text: &str, overrides: &[&String]) -> Result<String, Problem> {
    if overrides.is_empty() {
        return Ok(text.to_owned());
    }
    let mut document: toml_edit::DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
        Problem::at(path, text, &error.span().unwrap_or(0..0), error.message().trim(), "this is not TOML")
    })?;
    for text in overrides {
        set(&mut document, text).map_err(|message| {
            Problem::in_file(path, format!("--set {text}: {message}"), "write --set run.seed=3, for example")
        })?;
    }
    Ok(document.to_string())
}

fn set(document: &mut toml_edit::DocumentMut, text: &str) -> Result<(), String> {
    let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE")?;
    // What is not a TOML value is a string: a path needs no quotes on the command line.
    let value = value.parse::<toml_edit::Value>().unwrap_or_else(|_| value.into());
    let keys: Vec<&str> = key.trim().split('.').collect();
    let (last, parents) = keys.split_last().ok_or("the key is empty")?;
    let mut table: &mut dyn toml_edit::TableLike = document.as_table_mut();
    for parent in parents {
        table = table
            .entry(parent)
            .or_insert_with(|| toml_edit::Item::Table(toml_edit::Table::new()))
            .as_table_like_mut()
            .ok_or_else(|| format!("`{parent}` is not a table"))?;
    }
    table.insert(last, toml_edit::Item::Value(value));
    Ok(())
}

fn expand(text: &str, variable: impl Fn(&str) -> Option<String>) -> Result<String, String> {
    let mut expanded = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("${") {
        let (inside, after) =
            after.split_once('}').ok_or_else(|| format!("`{text}` has `${{` without `}}`"))?;
        let (name, default) = inside.split_once(":-").map_or((inside, None), |(name, d)| (name, Some(d)));
        let value = variable(name).or(default.map(str::to_owned));
        expanded += before;
        expanded += &value.ok_or_else(|| format!("the environment variable {name} is not set"))?;
        rest = after;
    }
    Ok(expanded + rest)
}

#[cfg(test)]
mod tests {
    use super::{PaceSetting, expand, is_host_only, set};
    use bus::plan::Pace;

    #[test]
    fn variables_are_expanded_with_defaults() {
        let variable = |name: &str| (name == "DATA").then(|| "/data".to_owned());
        assert_eq!(expand("${DATA:-../x}/a.csv", variable).unwrap(), "/data/a.csv");
        assert_eq!(expand("${NONE:-../x}/a.csv", variable).unwrap(), "../x/a.csv");
        assert!(expand("${NONE}/a.csv", variable).unwrap_err().contains("NONE is not set"));
    }

    #[test]
    fn an_override_replaces_or_adds_a_key() {
        let mut document = "[run]\nseed = 1 # why\n".parse().unwrap();
        set(&mut document, "run.seed=2").unwrap();
        set(&mut document, "process.player.data=/a/b.csv").unwrap();
        let text = document.to_string();
        assert!(text.contains("seed = 2"), "{text}");
        assert!(text.contains("data = \"/a/b.csv\""), "{text}");
        assert!(set(&mut document, "run").unwrap_err().contains("KEY=VALUE"));
    }

    #[test]
    fn host_only_overrides_are_known() {
        assert!(is_host_only("run.pace=free") && is_host_only("process.imu.wait=spin"));
        assert!(!is_host_only("run.seed=1") && !is_host_only("process.imu.parameters.wait=1"));
    }

    #[test]
    fn a_pace_is_free_realtime_or_a_factor() {
        assert_eq!("realtime".parse::<PaceSetting>().unwrap().0, Pace::Factor(1.0));
        assert_eq!("0.5".parse::<PaceSetting>().unwrap().0, Pace::Factor(0.5));
        assert!("-1".parse::<PaceSetting>().is_err());
    }
}
