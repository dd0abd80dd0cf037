//! The stand file: logs, columns, and the parts that are held out.

use std::path::{Path, PathBuf};

use diagnostics::parameter::{positive, require};
use diagnostics::unit::{Dimension, FORCE, RATIO, SPEED, TIME, TORQUE};
use diagnostics::{Diagnostic, ParameterError};
use flights::Role;
use inputs::InputFiles;
use inputs::variables::expand;
use serde::Deserialize;
use vehicles::Vehicle;
use vehicles::table::Dialect;
use vehicles::wall_clock;

use super::error::RotorError;

/// A stand file, read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stand {
    /// Name of the measured object.
    pub name: String,
    /// Diameter of the propeller in m, if the file says it.
    #[serde(rename = "propeller_diameter_m")]
    pub diameter_m: Option<f64>,
    vehicle: Option<PathBuf>,
    /// Logs of thrust and torque at steady speeds.
    #[serde(default, rename = "static")]
    pub statics: Vec<StaticLog>,
    /// Logs of steps of the command.
    #[serde(default, rename = "dynamic")]
    pub dynamics: Vec<DynamicLog>,
}

/// The vehicle file that the rest is taken over from.
pub struct VehicleFile {
    /// Its name in texts.
    pub name: String,
    /// The vehicle.
    pub vehicle: Vehicle,
}

/// A log of thrust and torque.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaticLog {
    /// The files of the fit.
    #[serde(skip)]
    pub files: InputFiles,
    /// The log; made a path by [`Stand::read`].
    pub file: PathBuf,
    /// Topic whose fields are read, if the log is a recording.
    pub topic: Option<String>,
    /// Form of a CSV file that does not show it.
    #[serde(default)]
    pub csv: Dialect,
    /// Role of the log.
    #[serde(default = "fit")]
    pub role: Role,
    /// Share of the plateaus of a log with the role `fit` that are held out.
    #[serde(default)]
    pub held_out: f64,
    /// Time for which the speed has to have been steady before a reading of thrust or torque counts, in s.
    #[serde(default = "settle_s")]
    pub settle_s: f64,
    /// Part of itself by which the speed may change within that time.
    #[serde(default = "steady")]
    pub steady: f64,
    /// Column of the time; absent for a recording, whose samples have times.
    pub time: Option<Column>,
    /// Column or field of the speed.
    pub speed: Column,
    /// Column or field of the thrust.
    pub thrust: Option<Column>,
    /// Column or field of the torque.
    pub torque: Option<Column>,
}

/// A log of steps of the command.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DynamicLog {
    /// The files of the fit.
    #[serde(skip)]
    pub files: InputFiles,
    /// The log; made a path by [`Stand::read`].
    pub file: PathBuf,
    /// Topic whose fields are read, if the log is a recording.
    pub topic: Option<String>,
    /// Form of a CSV file that does not show it.
    #[serde(default)]
    pub csv: Dialect,
    /// Role of the log.
    #[serde(default = "fit")]
    pub role: Role,
    /// Share of the steps of a log with the role `fit` that are held out.
    #[serde(default)]
    pub held_out: f64,
    /// Clock on which the steps are judged.
    #[serde(default)]
    pub clock: Clock,
    /// Time for which the command has to have been constant before a step, in s.
    #[serde(default = "before_s")]
    pub before_s: f64,
    /// Time after a step over which the speed is compared, in s; the command has to stay constant.
    #[serde(default = "after_s")]
    pub after_s: f64,
    /// Column of the time; absent for a recording, whose samples have times.
    pub time: Option<Column>,
    /// Column or field of the speed.
    pub speed: Column,
    /// Column or field of the command.
    pub command: Column,
}

/// Source of the times of rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// The log's own stamps.
    #[default]
    Stamps,
    /// Rows lie at equal distances, and stamps give only the mean distance: for logs whose stamps are the times at
    /// which rows arrived in groups.
    Rows,
}

/// A column of a log: of a table, or a field of a recording's topic.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Its name in the header of a table.
    column: Option<String>,
    /// The path of the field in the messages of a recording's topic.
    field: Option<String>,
    /// Its unit; the unit that a recording states has to be the same.
    pub unit: String,
    /// Pole pairs of the motor, for an electrical speed: the rotor's is this many times smaller.
    #[serde(default = "one")]
    pub pole_pairs: f64,
}

/// A log as it is read: its file, and the columns that are asked for.
pub struct Source<'s> {
    /// The files of the fit.
    pub files: &'s InputFiles,
    /// The log.
    pub file: &'s Path,
    /// Topic, if it is a recording.
    pub topic: Option<&'s str>,
    /// Form of a table.
    pub csv: &'s Dialect,
    /// Column of the time of a table.
    pub time: Option<&'s Column>,
    /// The columns by their keys in the stand file.
    pub columns: Vec<(&'static str, &'s Column)>,
}

impl StaticLog {
    /// The log with all of its columns.
    pub fn source(&self) -> Source<'_> {
        let columns = [
            ("speed", Some(&self.speed)),
            ("thrust", self.thrust.as_ref()),
            ("torque", self.torque.as_ref()),
        ];
        let columns = columns.into_iter().filter_map(|(key, column)| Some((key, column?))).collect();
        Source {
            files: &self.files,
            file: &self.file,
            topic: self.topic.as_deref(),
            csv: &self.csv,
            time: self.time.as_ref(),
            columns,
        }
    }
}

impl DynamicLog {
    /// The log with all of its columns.
    pub fn source(&self) -> Source<'_> {
        let columns = vec![("speed", &self.speed), ("command", &self.command)];
        Source {
            files: &self.files,
            file: &self.file,
            topic: self.topic.as_deref(),
            csv: &self.csv,
            time: self.time.as_ref(),
            columns,
        }
    }

    /// True if the command is the speed that the rotor is asked for, and not the vehicle's own command.
    pub fn is_commanded_in_speed(&self) -> bool {
        SPEED.factor(&self.command.unit).is_some()
    }

    /// Returns the factor from a command that is a speed to rad/s; 1 for any other command.
    pub fn command_factor(&self) -> f64 {
        if self.is_commanded_in_speed() { self.command.factor(SPEED) } else { 1.0 }
    }
}

fn fit() -> Role {
    Role::Fit
}
fn settle_s() -> f64 {
    1.0
}
fn steady() -> f64 {
    0.02
}
fn before_s() -> f64 {
    0.2
}
fn after_s() -> f64 {
    0.5
}
fn one() -> f64 {
    1.0
}

impl Stand {
    /// Reads and checks the stand file at `path`.
    pub fn read(path: &Path) -> Result<Self, RotorError> {
        let name = path.display().to_string();
        let inputs = InputFiles::default();
        let text = inputs.text(path).map_err(|cause| Diagnostic::unreadable(name.as_str(), &cause))?;
        let mut stand: Self = diagnostics::read_toml(&name, &text)?;
        let in_file = |error: ParameterError| Diagnostic::in_file(name.as_str(), error);
        Diagnostic::gather(stand.checks().into_iter().map(|check| check.map_err(in_file)))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let statics = stand.statics.iter_mut().map(|log| &mut log.file).enumerate();
        let dynamics = stand.dynamics.iter_mut().map(|log| &mut log.file).enumerate();
        let files = statics.map(|(index, file)| (format!("static.{index}.file"), file));
        let files = files.chain(dynamics.map(|(index, file)| (format!("dynamic.{index}.file"), file)));
        for (key, file) in stand.vehicle.iter_mut().map(|file| ("vehicle".to_owned(), file)).chain(files) {
            *file = folder.join(expanded(&key, file).map_err(in_file)?);
        }
        stand.statics.iter_mut().for_each(|log| log.files = inputs.clone());
        stand.dynamics.iter_mut().for_each(|log| log.files = inputs.clone());
        Ok(stand)
    }

    /// The vehicle that the rest is taken over from, if the file names one.
    pub fn vehicle_file(&self) -> Result<Option<VehicleFile>, RotorError> {
        let Some(path) = &self.vehicle else { return Ok(None) };
        let name = short_name(path);
        Ok(Some(VehicleFile { name, vehicle: Vehicle::load(path)? }))
    }
}

/// Returns the name of a file in reports: without folders.
pub fn short_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

impl Column {
    /// Returns its name in the log; known to exist after [`Stand::read`].
    pub fn name(&self) -> &str {
        self.field.as_deref().or(self.column.as_deref()).unwrap_or_default()
    }

    /// True if its cells are times as `YYYY-MM-DD HH:MM:SS:mmm`.
    pub fn is_wall_clock(&self) -> bool {
        self.unit == wall_clock::UNIT
    }

    /// Returns the factor from its cells to SI, for a speed to that of the rotor; known to be valid after
    /// [`Stand::read`].
    pub fn factor(&self, dimension: Dimension) -> f64 {
        dimension.factor(&self.unit).unwrap_or(f64::NAN) / self.pole_pairs
    }
}

type Check = Result<(), ParameterError>;

impl Stand {
    /// Returns the result of the check of each value.
    fn checks(&self) -> Vec<Check> {
        let logs = self.statics.len() + self.dynamics.len();
        let mut checks = vec![require("static, dynamic", "none", logs > 0, "at least one log")];
        checks.extend(self.diameter_m.map(|diameter| positive("propeller_diameter_m", diameter)));
        for (index, log) in self.statics.iter().enumerate() {
            let key = |name: &str| format!("static.{index}.{name}");
            let has_one = log.thrust.is_some() || log.torque.is_some();
            checks.extend([
                share(&key("held_out"), log.held_out),
                positive(&key("settle_s"), log.settle_s),
                positive(&key("steady"), log.steady),
                require(&format!("static.{index}"), "neither", has_one, "a `thrust` or a `torque`"),
            ]);
            checks.extend(names(&format!("static.{index}"), &log.source()));
            checks.extend(unit(&key("speed"), &log.speed, SPEED));
            checks.extend(log.thrust.iter().flat_map(|column| unit(&key("thrust"), column, FORCE)));
            checks.extend(log.torque.iter().flat_map(|column| unit(&key("torque"), column, TORQUE)));
        }
        for (index, log) in self.dynamics.iter().enumerate() {
            let key = |name: &str| format!("dynamic.{index}.{name}");
            checks.extend([
                share(&key("held_out"), log.held_out),
                positive(&key("before_s"), log.before_s),
                positive(&key("after_s"), log.after_s),
            ]);
            checks.extend(names(&format!("dynamic.{index}"), &log.source()));
            checks.extend(unit(&key("speed"), &log.speed, SPEED));
            checks.extend(command_unit(&key("command"), log));
        }
        checks
    }
}

/// Checks that time and columns are named as the log has them: the columns of a table, the fields of a recording.
fn names(log: &str, source: &Source) -> Vec<Check> {
    let time = match (source.topic, source.time) {
        (None, Some(time)) => named(&format!("{log}.time"), time, None).and_then(|()| time_unit(log, time)),
        (None, None) => {
            Err(ParameterError::missing(format!("{log}.time"), "the column of the time, and its unit"))
        }
        (Some(_), None) => Ok(()),
        (Some(_), Some(_)) => Err(ParameterError::conflict(
            format!("{log}.time"),
            format!("`{log}.time`: the samples of a recording have their times; leave it out"),
        )),
    };
    let columns = source.columns.iter();
    let columns = columns.map(|(key, column)| named(&format!("{log}.{key}"), column, source.topic));
    std::iter::once(time).chain(columns).collect()
}

fn named(key: &str, column: &Column, topic: Option<&str>) -> Check {
    let missing = |name: &str, what: String| Err(ParameterError::missing(format!("{key}.{name}"), what));
    let misplaced = |name: &str, advice: &str| {
        Err(ParameterError::conflict(format!("{key}.{name}"), format!("`{key}.{name}`: {advice}")))
    };
    match (topic, &column.column, &column.field) {
        (Some(_), None, Some(_)) | (None, Some(_), None) => Ok(()),
        (Some(_), Some(_), _) => misplaced("column", "a `topic` has fields: give `field` in its place"),
        (None, _, Some(_)) => misplaced(
            "field",
            "a table has columns: give `column` in its place, or the `topic` of a recording",
        ),
        (Some(topic), None, None) => missing("field", format!("the name of a field of {topic}")),
        (None, None, None) => missing("column", "the name of a column".to_owned()),
    }
}

fn time_unit(log: &str, column: &Column) -> Check {
    let expected = format!("\"wall clock\" (YYYY-MM-DD HH:MM:SS:mmm) or {}", TIME.describe());
    let is_known = column.is_wall_clock() || TIME.factor(&column.unit).is_some();
    require(&format!("{log}.time.unit"), &column.unit, is_known, expected)
}

fn command_unit(key: &str, log: &DynamicLog) -> [Check; 2] {
    let expected = format!("{}, or {}", RATIO.names(", "), SPEED.describe());
    let is_known = log.is_commanded_in_speed() || RATIO.factor(&log.command.unit).is_some();
    [
        positive(&format!("{key}.pole_pairs"), log.command.pole_pairs),
        require(&format!("{key}.unit"), &log.command.unit, is_known, expected),
    ]
}

fn unit(key: &str, column: &Column, dimension: Dimension) -> [Check; 2] {
    let is_known = dimension.factor(&column.unit).is_some();
    [
        positive(&format!("{key}.pole_pairs"), column.pole_pairs),
        require(&format!("{key}.unit"), &column.unit, is_known, dimension.describe()),
    ]
}

fn share(key: &str, share: f64) -> Check {
    require(key, share, (0.0..1.0).contains(&share), "a share from 0 to below 1")
}

/// The path with `${NAME}` and `${NAME:-default}` replaced by the environment's, as in manifests.
fn expanded(key: &str, written: &Path) -> Result<String, ParameterError> {
    expand(&written.to_string_lossy(), |name| std::env::var(name).ok()).map_err(|found| {
        let expected = "a path whose variables are set or have a default, as in ${NAME:-path}";
        ParameterError::value(key, expected, found)
    })
}

/// Tells for each of `count` segments whether it is held out. Of a log to fit on, `share` of them are, spread
/// evenly, and the first is not. Of a log to test on, all are.
pub fn held_out(count: usize, role: Role, share: f64) -> Vec<bool> {
    let passed = |index: usize| (index as f64 * share + 1e-9).floor();
    (0..count).map(|index| role == Role::Test || passed(index + 1) > passed(index)).collect()
}
