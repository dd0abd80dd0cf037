//! A measured flight: rows of a CSV file, read by a column map that states every unit.

use bus::messages::Quaternion;
use diagnostics::unit::{COUNT, Dimension, LENGTH, PURE_NUMBER, SPEED, TIME, VELOCITY};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use vehicles::table::{self, Table, TableError};

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
    #[error("the flight {path} cannot be read: {cause}. Give its path with --set process.<player>.data=PATH")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        cause: std::io::Error,
    },
    /// It is no table.
    #[error("the flight {path}: {cause}")]
    Table {
        /// The file.
        path: PathBuf,
        /// Where, and what to do.
        #[source]
        cause: TableError,
    },
    /// A column of the map is not in the file.
    #[error("the flight {path} has no column `{column}` (the map's `{quantity}`); it has {}", known.join(", "))]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What the map reads from it.
        quantity: &'static str,
        /// The columns there are.
        known: Vec<String>,
    },
    /// The map states a unit that the quantity cannot have.
    #[error("`{quantity}` has the unit `{found}`, expected {}", expected.names(" or "))]
    Unit {
        /// The quantity.
        quantity: &'static str,
        /// The unit stated.
        found: String,
        /// The dimension whose units it can have.
        expected: Dimension,
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
    /// A row has another number of cells than the header, as with decimal commas.
    #[error("the flight {path}, line {line}: expected {expected} cells as in the header, found {found}")]
    Cells {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// How many the header has.
        expected: usize,
        /// How many the row has.
        found: usize,
    },
    /// There is no time that passes.
    #[error("the flight {path}: it has {rows} rows of data, expected at least 2")]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Rows below the header.
        rows: usize,
    },
    /// Time does not grow.
    #[error("the flight {path}: time does not grow from line {line} to the next")]
    Time {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
    },
}

impl FlightLog {
    /// Reads the flight at `path`.
    ///
    /// # Errors
    /// If the file, a column or a unit is missing, or a cell is not a number.
    pub fn load(path: &Path, map: &ColumnMap) -> Result<Self, FlightLogError> {
        let bytes = vehicles::text::read_log(path)
            .map_err(|cause| FlightLogError::File { path: path.into(), cause })?;
        let table =
            Table::parse(&bytes).map_err(|cause| FlightLogError::Table { path: path.into(), cause })?;
        let source = Source { path, table };
        source.check_rows()?;
        let mut time_s = source.values("time", TIME, &map.time)?;
        let start_s = time_s.first().map_or(0.0, |first| first[0]);
        time_s.iter_mut().for_each(|time_s| time_s[0] -= start_s);
        let command = source.values("command", COUNT, &map.command)?;
        let position_m = source.values("position", LENGTH, &map.position)?;
        let velocity_m_s = source.values("velocity", VELOCITY, &map.velocity)?;
        let attitude = source.values("attitude", PURE_NUMBER, &map.attitude)?;
        let rates_rad_s = source.values("angular_velocity", SPEED, &map.angular_velocity)?;
        source.check_values(&time_s, &attitude, &map.attitude.columns[3])?;
        let row = |index: usize| Row {
            time_s: time_s[index][0],
            command: command[index],
            position_m: position_m[index],
            velocity_m_s: velocity_m_s[index],
            attitude: attitude[index],
            angular_velocity_rad_s: rates_rad_s[index],
        };
        Ok(Self { rows: (0..time_s.len()).map(row).collect() })
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

/// No flight has more of anything, in SI: seconds since 1970 are 2e9, counts go to 4.3e9.
const CELL_MAX: f64 = 1e12;

/// A quaternion this short has no direction left; logs write 1, or 0 where there is none.
const NORM_MIN: f64 = 1e-3;

struct Source<'a> {
    path: &'a Path,
    table: Table,
}

impl Source<'_> {
    /// The samples of a quantity in SI, row by row.
    fn values<const N: usize>(
        &self,
        quantity: &'static str,
        dimension: Dimension,
        map: &Columns<N>,
    ) -> Result<Vec<[f64; N]>, FlightLogError> {
        let mut indices = [0; N];
        for (index, column) in indices.iter_mut().zip(&map.columns) {
            *index = self.table.column(column).ok_or_else(|| FlightLogError::MissingColumn {
                path: self.path.into(),
                column: column.clone(),
                quantity,
                known: self.table.headers.clone(),
            })?;
        }
        let factor = dimension.factor(&map.unit).ok_or_else(|| FlightLogError::Unit {
            quantity,
            found: map.unit.clone(),
            expected: dimension,
        })?;
        let sample = |row: &table::Row| -> Result<[f64; N], FlightLogError> {
            let mut values = [0.0; N];
            for ((value, index), column) in values.iter_mut().zip(indices).zip(&map.columns) {
                *value = number(row.cell(index), factor)
                    .map_err(|expected| self.cell(row, column, row.cell(index), expected))?;
            }
            Ok(values)
        };
        self.table.rows.iter().map(sample).collect()
    }

    /// Refuses a file with too few rows, or with rows of another length than the header's.
    fn check_rows(&self) -> Result<(), FlightLogError> {
        let (path, rows) = (self.path.to_owned(), &self.table.rows);
        if rows.len() < 2 {
            return Err(FlightLogError::TooShort { path, rows: rows.len() });
        }
        let expected = self.table.headers.len();
        if let Some(row) = rows.iter().find(|row| row.cells.len() != expected) {
            return Err(FlightLogError::Cells { path, line: row.line, expected, found: row.cells.len() });
        }
        Ok(())
    }

    /// Refuses times that do not grow, and quaternions without a direction.
    fn check_values(
        &self,
        time_s: &[[f64; 1]],
        attitude: &[[f64; 4]],
        last_part: &str,
    ) -> Result<(), FlightLogError> {
        let (path, rows) = (self.path.to_owned(), &self.table.rows);
        let is_zero = |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>() < NORM_MIN * NORM_MIN;
        if let Some(index) = attitude.iter().position(is_zero) {
            let (found, expected) =
                (attitude[index][3].to_string(), "part of an attitude: the quaternion is 0");
            return Err(self.cell(&rows[index], last_part, &found, expected));
        }
        match time_s.windows(2).position(|pair| pair[1] <= pair[0]) {
            Some(index) => Err(FlightLogError::Time { path, line: rows[index].line }),
            None => Ok(()),
        }
    }

    fn cell(&self, row: &table::Row, column: &str, found: &str, expected: &'static str) -> FlightLogError {
        let (path, column, found) = (self.path.to_owned(), column.to_owned(), found.to_owned());
        FlightLogError::Cell { path, line: row.line, column, found, expected }
    }
}

/// The number in a cell times `factor`, or what was expected there.
fn number(cell: &str, factor: f64) -> Result<f64, &'static str> {
    match cell.parse::<f64>() {
        Ok(number) if number.is_finite() && (number * factor).abs() <= CELL_MAX => Ok(number * factor),
        Ok(number) if number.is_finite() => Err("at most 1e12 in SI, which no flight exceeds"),
        _ => Err("a finite number"),
    }
}
