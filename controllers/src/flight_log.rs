//! A measured flight: rows of a CSV file, read by a column map that states every unit.

use bus::messages::Quaternion;
use diagnostics::unit::{COUNT, Dimension, LENGTH, PURE_NUMBER, SPEED, TIME, VELOCITY};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use vehicles::quotes::StrayQuote;

/// Which columns of a file hold a quantity, and in which unit.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Columns<const N: usize> {
    /// Column names.
    #[serde(with = "array")]
    pub columns: [String; N],
    /// Unit of the numbers in the file.
    pub unit: String,
}

/// Reads a fixed array, for which serde has no generic length.
mod array {
    use serde::{Deserialize, Deserializer, de::Error};

    pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(d: D) -> Result<[String; N], D::Error> {
        let names = Vec::<String>::deserialize(d)?;
        names.try_into().map_err(|names: Vec<String>| {
            D::Error::custom(format!("`columns` names {} columns, expected {N}", names.len()))
        })
    }
}

/// The column map of a flight.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnMap {
    /// Time, any origin.
    pub time: Columns<1>,
    /// Motor commands in the order of the vehicle file.
    pub command: Columns<4>,
    /// Position in the world.
    pub position: Columns<3>,
    /// Velocity in the world.
    pub velocity: Columns<3>,
    /// Attitude quaternion, body to world, in the order x, y, z, w.
    pub attitude: Columns<4>,
    /// Angular velocity in the body.
    pub angular_velocity: Columns<3>,
}

/// One row of a flight, in SI units; motor commands in raw counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time since the first row.
    pub time_s: f64,
    /// Motor commands.
    pub command: [f64; 4],
    /// Position in the world, in metres.
    pub position_m: [f64; 3],
    /// Velocity in the world, in metres a second.
    pub velocity_m_s: [f64; 3],
    /// Attitude quaternion x, y, z, w, body to world.
    pub attitude: [f64; 4],
    /// Angular velocity in the body, in radians a second.
    pub angular_velocity_rad_s: [f64; 3],
}

/// A flight.
#[derive(Clone, Debug)]
pub struct FlightLog {
    rows: Vec<Row>,
}

/// A flight that cannot be read; the text names file, row, column and unit.
#[derive(Debug, thiserror::Error)]
pub enum FlightLogError {
    /// The file cannot be opened.
    #[error(
        "the flight {path} cannot be read: {reason}. Give its path with --set process.<player>.data=PATH"
    )]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A quotation mark makes one cell of what are many.
    #[error("the flight {path}, {stray}")]
    Quote {
        /// The file.
        path: PathBuf,
        /// Where it stands, and what to do.
        stray: StrayQuote,
    },
    /// A column of the map is not in the file.
    #[error("the flight {path} has no column `{column}` (the map's `{quantity}`); it has {known}")]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What the map reads from it.
        quantity: &'static str,
        /// The columns there are.
        known: String,
    },
    /// The map states a unit that the quantity cannot have.
    #[error("`{quantity}` has the unit `{found}`, expected {expected}")]
    Unit {
        /// The quantity.
        quantity: &'static str,
        /// The unit stated.
        found: String,
        /// The units it can have.
        expected: String,
    },
    /// A cell is not a number.
    #[error("the flight {path}, line {line}, column `{column}`: {found:?} is not {expected}")]
    Cell {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// The column.
        column: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        expected: &'static str,
    },
    /// Time does not grow, or there is too little of it.
    #[error("the flight {path}: {reason}")]
    Time {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// The dimension of each quantity.
const DIMENSIONS: [(&str, Dimension); 6] = [
    ("time", TIME),
    ("command", COUNT),
    ("position", LENGTH),
    ("velocity", VELOCITY),
    ("attitude", PURE_NUMBER),
    ("angular_velocity", SPEED),
];

impl FlightLog {
    /// Reads the flight at `path`.
    ///
    /// # Errors
    /// If the file, a column or a unit is missing, or a cell is not a number.
    pub fn load(path: &Path, map: &ColumnMap) -> Result<Self, FlightLogError> {
        let refused = |reason: String| FlightLogError::File { path: path.into(), reason };
        let bytes = vehicles::text::read_log(path).map_err(|error| refused(error.to_string()))?;
        vehicles::quotes::check(&bytes, b',')
            .map_err(|stray| FlightLogError::Quote { path: path.into(), stray })?;
        let file_error = |error: csv::Error| refused(error.to_string());
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
        let headers = reader.headers().map_err(file_error)?.clone();
        let source = Source { path, headers };
        let picks = Picks::new(&source, map)?;
        let mut rows = Vec::new();
        for record in reader.records() {
            rows.push(picks.row(&source, &record.map_err(file_error)?)?);
        }
        let start_s = rows.first().map_or(0.0, |row: &Row| row.time_s);
        rows.iter_mut().for_each(|row| row.time_s -= start_s);
        require_growing_time(path, &rows)?;
        Ok(Self { rows })
    }

    /// Length of the flight.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.time_s)
    }

    /// The flight at `time_s` after its first row: commands as last set, measurements interpolated.
    ///
    /// `hint` is an index near the row, kept by the caller between calls at growing times.
    #[must_use]
    pub fn at(&self, time_s: f64, hint: &mut usize) -> Row {
        // Times are sums of decimal fractions: a nanosecond of slack puts a tick on its own row.
        while *hint + 1 < self.rows.len() && self.rows[*hint + 1].time_s <= time_s + 1e-9 {
            *hint += 1;
        }
        let before = &self.rows[*hint];
        let Some(after) = self.rows.get(*hint + 1) else { return *before };
        let part = ((time_s - before.time_s) / (after.time_s - before.time_s)).clamp(0.0, 1.0);
        Row {
            time_s,
            command: before.command,
            position_m: blend(&before.position_m, &after.position_m, part),
            velocity_m_s: blend(&before.velocity_m_s, &after.velocity_m_s, part),
            attitude: blend_attitude(&before.attitude, &after.attitude, part),
            angular_velocity_rad_s: blend(
                &before.angular_velocity_rad_s,
                &after.angular_velocity_rad_s,
                part,
            ),
        }
    }
}

impl Row {
    /// The attitude as a message.
    #[must_use]
    pub fn quaternion(&self) -> Quaternion {
        let [x, y, z, w] = self.attitude;
        Quaternion { x, y, z, w }
    }
}

fn require_growing_time(path: &Path, rows: &[Row]) -> Result<(), FlightLogError> {
    let time_error = |reason| FlightLogError::Time { path: path.into(), reason };
    if rows.len() < 2 {
        return Err(time_error(format!("it has {} rows of data, expected at least 2", rows.len())));
    }
    match rows.windows(2).position(|pair| pair[1].time_s <= pair[0].time_s) {
        // The header is line 1 and the first row line 2.
        Some(index) => Err(time_error(format!("time does not grow from line {} to the next", index + 2))),
        None => Ok(()),
    }
}

fn blend<const N: usize>(a: &[f64; N], b: &[f64; N], part: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * part)
}

/// Linear interpolation of neighbouring quaternions along the shorter way, normalised.
fn blend_attitude(a: &[f64; 4], b: &[f64; 4], part: f64) -> [f64; 4] {
    let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    let b = if dot < 0.0 { b.map(|x| -x) } else { *b };
    let mixed = blend(a, &b, part);
    let norm = mixed.iter().map(|x| x * x).sum::<f64>().sqrt();
    mixed.map(|x| x / norm)
}

struct Source<'a> {
    path: &'a Path,
    headers: csv::StringRecord,
}

/// Columns found in the header, with the factor to SI.
struct Pick<const N: usize> {
    indices: [usize; N],
    factor: f64,
}

impl<const N: usize> Pick<N> {
    fn new(source: &Source<'_>, quantity: &'static str, map: &Columns<N>) -> Result<Self, FlightLogError> {
        let mut indices = [0; N];
        for (index, column) in indices.iter_mut().zip(&map.columns) {
            *index = source.headers.iter().position(|header| header == column).ok_or_else(|| {
                FlightLogError::MissingColumn {
                    path: source.path.into(),
                    column: column.clone(),
                    quantity,
                    known: source.headers.iter().collect::<Vec<_>>().join(", "),
                }
            })?;
        }
        Ok(Self { indices, factor: factor(quantity, &map.unit)? })
    }

    fn values(&self, source: &Source<'_>, record: &csv::StringRecord) -> Result<[f64; N], FlightLogError> {
        let mut values = [0.0; N];
        for (value, &index) in values.iter_mut().zip(&self.indices) {
            let text = record.get(index).unwrap_or_default();
            *value = match text.parse::<f64>() {
                Ok(number) if !number.is_finite() => {
                    return Err(source.cell(record, index, "a finite number"));
                }
                Ok(number) if (number * self.factor).abs() <= CELL_MAX => number * self.factor,
                Ok(_) => {
                    return Err(source.cell(record, index, "at most 1e12 in SI, which no flight exceeds"));
                }
                Err(_) => return Err(source.cell(record, index, "a finite number")),
            };
        }
        Ok(values)
    }
}

/// No flight has more of anything, in SI: seconds since 1970 are 2e9, counts go to 4.3e9.
const CELL_MAX: f64 = 1e12;

/// A quaternion this short has no direction left; logs write 1, or 0 where there is none.
const NORM_MIN: f64 = 1e-3;

impl Source<'_> {
    fn cell(&self, record: &csv::StringRecord, index: usize, expected: &'static str) -> FlightLogError {
        FlightLogError::Cell {
            path: self.path.into(),
            line: record.position().map_or(0, csv::Position::line),
            column: self.headers.get(index).unwrap_or_default().to_owned(),
            found: record.get(index).unwrap_or_default().to_owned(),
            expected,
        }
    }
}

fn factor(quantity: &'static str, unit: &str) -> Result<f64, FlightLogError> {
    let found = DIMENSIONS.iter().find(|(name, _)| *name == quantity);
    found.and_then(|(_, dimension)| dimension.factor(unit)).ok_or_else(|| FlightLogError::Unit {
        quantity,
        found: unit.to_owned(),
        expected: found.map(|(_, dimension)| dimension.names(" or ")).unwrap_or_default(),
    })
}

struct Picks {
    time: Pick<1>,
    command: Pick<4>,
    position: Pick<3>,
    velocity: Pick<3>,
    attitude: Pick<4>,
    angular_velocity: Pick<3>,
}

impl Picks {
    fn new(source: &Source<'_>, map: &ColumnMap) -> Result<Self, FlightLogError> {
        Ok(Self {
            time: Pick::new(source, "time", &map.time)?,
            command: Pick::new(source, "command", &map.command)?,
            position: Pick::new(source, "position", &map.position)?,
            velocity: Pick::new(source, "velocity", &map.velocity)?,
            attitude: Pick::new(source, "attitude", &map.attitude)?,
            angular_velocity: Pick::new(source, "angular_velocity", &map.angular_velocity)?,
        })
    }

    fn row(&self, source: &Source<'_>, record: &csv::StringRecord) -> Result<Row, FlightLogError> {
        let [time_s] = self.time.values(source, record)?;
        let attitude = self.attitude.values(source, record)?;
        if attitude.iter().map(|x| x * x).sum::<f64>() < NORM_MIN * NORM_MIN {
            let expected = "part of an attitude: the quaternion is 0";
            return Err(source.cell(record, self.attitude.indices[3], expected));
        }
        Ok(Row {
            time_s,
            command: self.command.values(source, record)?,
            position_m: self.position.values(source, record)?,
            velocity_m_s: self.velocity.values(source, record)?,
            attitude,
            angular_velocity_rad_s: self.angular_velocity.values(source, record)?,
        })
    }
}
