//! A measured flight: rows of a CSV file, read by a column map that states every unit.

use component::Bounded;
use component::messages::PerRotor;
use diagnostics::ParameterError;
use diagnostics::unit::{COUNT, Dimension, LENGTH, PURE_NUMBER, SPEED, TIME, VELOCITY, VOLTAGE};
use inputs::InputFiles;
use serde::Deserialize;
use std::fmt::Display;
use std::path::Path;
use vehicles::command_log::{CommandLog, Stretch};
use vehicles::filled_commands::Filled;
use vehicles::table::{self, Dialect, Table};
use vehicles::{ROTORS_MAX, gaps, held_commands};

/// Columns of a file that hold a quantity, and their unit.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Columns<const N: usize> {
    /// Column names.
    #[serde(with = "array")]
    pub columns: [String; N],
    /// Unit of the numbers in the file.
    pub unit: String,
}

/// Columns of the motor commands and their unit.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandColumns {
    /// Names, one for each rotor.
    #[serde(deserialize_with = "rotors")]
    pub columns: Vec<String>,
    /// Unit.
    pub unit: String,
}

fn rotors<'de, D: serde::Deserializer<'de>>(d: D) -> Result<Vec<String>, D::Error> {
    let names = Vec::<String>::deserialize(d)?;
    if (1..=ROTORS_MAX).contains(&names.len()) {
        return Ok(names);
    }
    let message = format!("`columns` names {} columns, expected 1 to {ROTORS_MAX}", names.len());
    Err(serde::de::Error::custom(message))
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
#[derive(Clone, Debug, component::Parameters)]
pub struct ColumnMap {
    /// Form of a file that does not show it.
    #[parameter(default = Dialect::default(), shown = "what the file shows")]
    pub csv: Dialect,
    /// Time, any origin.
    #[parameter(unit = "`s`, `ms`, `us`")]
    pub time: Columns<1>,
    /// Motor commands, one column for each rotor in the order of the vehicle file.
    #[parameter(unit = "`count`")]
    pub command: CommandColumns,
    /// Position in the world, 3 columns.
    #[parameter(unit = "`m`, `mm`")]
    pub position: Columns<3>,
    /// Velocity in the world, 3 columns.
    #[parameter(unit = "`m/s`, `mm/s`")]
    pub velocity: Columns<3>,
    /// Attitude quaternion, body to world, 4 columns in the order x, y, z, w.
    #[parameter(unit = "`1`")]
    pub attitude: Columns<4>,
    /// Angular velocity in the body, 3 columns.
    #[parameter(unit = "`rad/s`, `deg/s`")]
    pub angular_velocity: Columns<3>,
    /// Voltage at the terminals of the battery. It is played as it stands, noise included.
    #[parameter(unit = "`V`, `mV`", shown = "not played")]
    pub battery_voltage: Option<Columns<1>>,
}

impl ColumnMap {
    fn names(&self) -> Vec<&str> {
        let vectors = [&self.position.columns, &self.velocity.columns, &self.angular_velocity.columns];
        let voltage = self.battery_voltage.iter().flat_map(|map| &map.columns);
        let rest = self.command.columns.iter().chain(&self.attitude.columns).chain(voltage);
        self.time
            .columns
            .iter()
            .chain(vectors.into_iter().flatten())
            .chain(rest)
            .map(String::as_str)
            .collect()
    }
}

/// One row of a flight, in SI units; motor commands in raw counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time since the first row.
    pub time_s: f64,
    /// Motor commands.
    pub command: PerRotor,
    /// Position in the world, in metres.
    pub position_m: [f64; 3],
    /// Velocity in the world, in metres a second.
    pub velocity_m_s: [f64; 3],
    /// Attitude quaternion x, y, z, w, body to world.
    pub attitude: [f64; 4],
    /// Angular velocity in the body, in radians a second.
    pub angular_velocity_rad_s: [f64; 3],
    /// Voltage of the battery, in volts; `None` if it is not played.
    pub battery_v: Option<f64>,
}

/// Causes of gaps besides missing rows.
const HELD: &str = "commands that repeat to the last digit while the vehicle goes on turning";
const FILLED: &str = "commands on straight lines that were filled in when the log was exported";

/// Rows of a flight at least: it lasts from one to the next.
const ROWS_MIN: usize = 2;

/// Rows so far beside the played ones are judged, too: commands beside a stretch show that it was filled in.
const BESIDE_S: f64 = 2.0;

/// Time in which the commands of a flight are unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Time of the last command before it.
    pub from_s: f64,
    /// Time of the first command behind it.
    pub to_s: f64,
    /// Reason why the commands are unknown.
    pub cause: &'static str,
}

/// A flight.
#[derive(Clone, Debug)]
pub struct FlightLog {
    rows: Vec<Row>,
}

impl FlightLog {
    /// Reads the flight at `path` among `files`, the parameter `data`.
    ///
    /// # Errors
    /// If the file, columns or units are missing, or cells are not numbers: all faults, and of each column the first faulty cell.
    pub fn load(files: &InputFiles, path: &Path, map: &ColumnMap) -> Result<Self, ParameterError> {
        let bytes = files.bytes(path).map_err(|cause| {
            let hint = "Give its path with --set process.<player>.data=PATH";
            refused(path, format_args!(" cannot be read: {cause}. {hint}"))
        })?;
        let table = Table::parse(&bytes, &map.names(), &map.csv);
        let table = table.map_err(|cause| refused(path, format_args!(": {cause}")))?;
        let source = Source { path, table };
        source.check_rows()?;
        let time_s = source.times(&map.time);
        let CommandColumns { columns, unit } = &map.command;
        let command = source.values("command", COUNT, columns, unit);
        let position_m = source.arrays("position", LENGTH, &map.position);
        let velocity_m_s = source.arrays("velocity", VELOCITY, &map.velocity);
        let attitude = source.arrays("attitude", PURE_NUMBER, &map.attitude);
        let attitude = attitude.and_then(|attitude| source.directed(attitude, &map.attitude.columns[3]));
        let rates_rad_s = source.arrays("angular_velocity", SPEED, &map.angular_velocity);
        let turning = ParameterError::both(attitude, rates_rad_s);
        let motion = ParameterError::both(ParameterError::both(position_m, velocity_m_s), turning);
        let voltage = map.battery_voltage.as_ref();
        let battery_v = voltage.map(|map| source.arrays("battery_voltage", VOLTAGE, map)).transpose();
        let motion = ParameterError::both(motion, battery_v);
        let ((time_s, command), (((position_m, velocity_m_s), (attitude, rates_rad_s)), battery_v)) =
            ParameterError::both(ParameterError::both(time_s, command), motion)?;
        let row = |index: usize| Row {
            time_s: time_s[index],
            command: command[index],
            position_m: position_m[index],
            velocity_m_s: velocity_m_s[index],
            attitude: attitude[index],
            angular_velocity_rad_s: rates_rad_s[index],
            battery_v: battery_v.as_ref().map(|values| values[index][0]),
        };
        Ok(Self { rows: (0..time_s.len()).map(row).collect() })
    }

    /// Length of the flight.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.time_s)
    }

    /// The gaps of the commands between two times, in order. A gap has no rows, or its commands were held by a logger or filled in with straight
    /// lines by an exporter. Each gap begins at the last command before it and ends at the first command behind it.
    #[must_use]
    pub fn gaps_within(&self, from_s: f64, to_s: f64) -> Vec<Gap> {
        let before = |time_s: f64| self.rows.partition_point(|row| row.time_s < time_s);
        let rows = &self.rows[before(from_s - BESIDE_S)..before(to_s + BESIDE_S)];
        // A stretch may end the rows.
        let time_s = |at: usize| rows[at.min(rows.len() - 1)].time_s;
        let of = |(from_s, to_s), cause| Gap { from_s, to_s, cause };
        // The usual period is that of the whole log.
        let times: Vec<f64> = self.rows.iter().map(|row| row.time_s).collect();
        let mut all: Vec<Gap> = gaps::of_held(&times).into_iter().map(|gap| of(gap, "no rows")).collect();
        let (held, filled) = Self::held_or_filled(rows);
        all.extend(held.iter().map(|(from, to)| of((time_s(*from), time_s(to + 1)), HELD)));
        all.extend(
            filled.iter().map(|(from, to)| of((time_s(from.saturating_sub(1)), time_s(to + 1)), FILLED)),
        );
        all.retain(|gap| gap.from_s < to_s && from_s < gap.to_s);
        all.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        all
    }

    /// Stretches of these rows whose commands a logger held, and those on straight lines. The limits of the commands are not known here.
    fn held_or_filled(rows: &[Row]) -> (Vec<Stretch>, Vec<Stretch>) {
        let times: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
        let rates: Vec<[f64; 3]> = rows.iter().map(|row| row.angular_velocity_rad_s).collect();
        let rotors = rows.first().map_or(0, |row| row.command.len());
        let column = |rotor: usize| rows.iter().map(|row| row.command[rotor]).collect();
        let log = CommandLog {
            time_s: &times,
            rotors: (0..rotors).map(column).collect(),
            range: (f64::NEG_INFINITY, f64::INFINITY),
            rate_time_s: &times,
            rates: &rates,
        };
        // True for all times: no stretch of zeros is taken for filled. A throttle may be cut, and the vehicle's weight is not known here.
        let filled = Filled::of(&log, &|_, _| true);
        (held_commands::of(&log), filled.lines)
    }

    /// The flight at `time_s` after its first row: commands as last set, measurements interpolated.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Row {
        // Times are sums of decimal fractions: a nanosecond of slack puts a tick on its own row.
        let next = self.rows.partition_point(|row| row.time_s <= time_s + 1e-9).max(1);
        let before = &self.rows[next - 1];
        let Some(after) = self.rows.get(next) else { return *before };
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
            battery_v: before.battery_v.zip(after.battery_v).map(|(from, to)| from + (to - from) * part),
        }
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

/// Returns the error that the flight at `path` has `fault`, which stands behind its name.
fn refused(path: &Path, fault: impl Display) -> ParameterError {
    ParameterError::conflict("data", format_args!("the flight {}{fault}", path.display()))
}

struct Source<'a> {
    path: &'a Path,
    table: Table,
}

impl Source<'_> {
    /// The samples of a quantity of `N` numbers in SI, row by row.
    fn arrays<const N: usize>(
        &self,
        quantity: &'static str,
        dimension: Dimension,
        map: &Columns<N>,
    ) -> Result<Vec<[f64; N]>, ParameterError> {
        let values = self.values::<N>(quantity, dimension, &map.columns, &map.unit)?;
        Ok(values.iter().map(|values| std::array::from_fn(|index| values[index])).collect())
    }

    /// The samples of a quantity in SI, row by row: a number for each of `columns`, at most `N`.
    fn values<const N: usize>(
        &self,
        quantity: &'static str,
        dimension: Dimension,
        columns: &[String],
        unit: &str,
    ) -> Result<Vec<Bounded<f64, N>>, ParameterError> {
        let place = |column: &String| {
            let place = self.table.column(column);
            place.map_err(|cause| refused(self.path, format_args!(", the map's `{quantity}`: {cause}")))
        };
        let factor = dimension.factor(unit).ok_or_else(|| {
            let expected = dimension.names(" or ");
            let message = format!("`{quantity}` has the unit `{unit}`, expected {expected}");
            ParameterError::conflict("data", message)
        });
        let indices = ParameterError::gather(columns.iter().map(place));
        let (indices, factor) = ParameterError::both(indices, factor)?;
        let cell = |row: table::Row<'_>, (index, column): (&usize, &String)| {
            number(self.table.number(row.cell(*index)), factor)
                .map_err(|expected| self.cell(row.line, column, row.cell(*index), expected))
        };
        let sample = |row: table::Row<'_>| -> Result<Bounded<f64, N>, ParameterError> {
            indices.iter().zip(columns).map(|column| cell(row, column)).collect()
        };
        let samples: Result<Vec<_>, ParameterError> = self.table.rows.iter().map(sample).collect();
        samples.map_err(|first| {
            // All cells of a column may be faulty: the first one is told.
            let fault = |column| self.table.rows.iter().find_map(|row| cell(row, column).err());
            let mut faults = indices.iter().zip(columns).filter_map(fault);
            faults.next().map_or(first, |one| one.and(faults))
        })
    }

    /// Refuses a file with too few rows, or with rows of another length than the header's, as with decimal commas.
    fn check_rows(&self) -> Result<(), ParameterError> {
        let is_whole = self.table.check_lengths().and_then(|()| self.table.check_rows(ROWS_MIN));
        is_whole.map_err(|cause| refused(self.path, format_args!(": {cause}")))?;
        let rows = &self.table.rows;
        let of_row = |row: table::Row<'_>| self.table.fault_of_length(row).map(|fault| (row.line, fault));
        let Some((line, fault)) = rows.iter().find_map(of_row) else { return Ok(()) };
        Err(refused(self.path, format_args!(", line {line}: {fault}")))
    }

    /// The times since the first row, which have to grow.
    fn times(&self, map: &Columns<1>) -> Result<Vec<f64>, ParameterError> {
        let rows = self.arrays("time", TIME, map)?;
        let start_s = rows.first().map_or(0.0, |[first_s]| *first_s);
        let time_s: Vec<f64> = rows.iter().map(|[time_s]| time_s - start_s).collect();
        let Some(index) = time_s.windows(2).position(|pair| pair[1] <= pair[0]) else { return Ok(time_s) };
        let line = self.table.rows.line(index);
        Err(refused(self.path, format_args!(": time does not grow from line {line} to the next")))
    }

    /// Passes quaternions that have a direction; `last_part` is the column of their last numbers.
    fn directed(&self, attitude: Vec<[f64; 4]>, last_part: &str) -> Result<Vec<[f64; 4]>, ParameterError> {
        let is_zero = |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>() < NORM_MIN * NORM_MIN;
        let Some(index) = attitude.iter().position(is_zero) else { return Ok(attitude) };
        let (found, expected) = (attitude[index][3].to_string(), "part of an attitude: the quaternion is 0");
        Err(self.cell(self.table.rows.line(index), last_part, &found, expected))
    }

    fn cell(&self, line: u64, column: &str, found: &str, expected: &str) -> ParameterError {
        refused(self.path, format_args!(", line {line}, column `{column}`: {found:?} is not {expected}"))
    }
}

/// The number of a cell times `factor`, or a description of the expected one.
fn number(cell: Option<f64>, factor: f64) -> Result<f64, &'static str> {
    match cell.filter(|number| number.is_finite()) {
        Some(number) if (number * factor).abs() <= CELL_MAX => Ok(number * factor),
        Some(_) => Err("at most 1e12 in SI, which no flight exceeds"),
        None => Err("a finite number"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 s at 100 Hz of a vehicle that turns to and fro under `command`, by time and rotor.
    fn flight(command: impl Fn(f64, usize) -> f64) -> FlightLog {
        let row = |k: i32| {
            let time_s = 0.01 * f64::from(k);
            let rate = 0.5 * libm::sin(5.0 * time_s);
            Row {
                time_s,
                command: PerRotor::from_fn(4, |rotor| command(time_s, rotor)),
                position_m: [0.0; 3],
                velocity_m_s: [0.0; 3],
                attitude: [0.0, 0.0, 0.0, 1.0],
                angular_velocity_rad_s: [rate, 0.6 * rate, 0.0],
                battery_v: None,
            }
        };
        FlightLog { rows: (0..1000).map(row).collect() }
    }

    /// A command that a controller makes of a noisy measurement.
    fn noisy(time_s: f64, rotor: usize) -> f64 {
        let at = (100.0 * time_s).round() as usize;
        76.0 + ((at * at * 613 + at * 7919 + rotor * 131) % 9973) as f64 / 2000.0
    }

    #[test]
    fn commands_that_nobody_measured_are_gaps() {
        let is_within = |t: f64| (2.995..3.495).contains(&t);
        let gaps = |flight: &FlightLog| {
            let gaps = flight.gaps_within(0.0, 9.0).into_iter();
            gaps.map(|Gap { from_s, to_s, cause }| ([from_s, to_s].map(|t| (100.0 * t).round()), cause))
                .collect::<Vec<_>>()
        };
        let held = flight(|t, rotor| noisy(if is_within(t) { 3.0 } else { t }, rotor));
        assert_eq!(gaps(&held), [([300.0, 350.0], HELD)]);
        let straight = |t: f64, rotor| {
            let [first, last] = [2.99, 3.5].map(|t| noisy(t, rotor));
            first + (last - first) * (t - 2.99) / 0.51
        };
        let filled = flight(|t, rotor| if is_within(t) { straight(t, rotor) } else { noisy(t, rotor) });
        assert_eq!(gaps(&filled), [([299.0, 350.0], FILLED)]);
        assert_eq!(filled.gaps_within(3.6, 9.0), [], "the gap is not played");
        assert_eq!(filled.gaps_within(3.3, 9.0).len(), 1, "a part of the gap is played");
        let mut without_rows = flight(noisy);
        without_rows.rows.retain(|row| !is_within(row.time_s));
        assert_eq!(gaps(&without_rows), [([299.0, 350.0], "no rows")]);
    }

    /// The throttle is cut for 0.4 s: a true command.
    #[test]
    fn zeros_are_played() {
        let cut = flight(|t, rotor| if (3.0..3.4).contains(&t) { 0.0 } else { noisy(t, rotor) });
        assert_eq!(cut.gaps_within(0.0, 9.0), []);
    }

    #[test]
    fn commands_of_simple_pilots_are_no_gaps() {
        for pilot in
            [noisy, |_, _| 76.0, |t, _| if t < 5.0 { 70.0 } else { 80.0 }, |t: f64, _| 60.0 + t.min(4.0)]
        {
            assert_eq!(flight(pilot).gaps_within(0.0, 9.0), []);
        }
    }
}
