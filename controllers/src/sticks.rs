//! A recording of a pilot's sticks: a CSV file of commands over time.
//!
//! | column | unit | |
//! |---|---|---|
//! | `time_s` | s | rising from row to row; tick 0 of the run is at 0 |
//! | `roll_deg`, `pitch_deg` | deg | as the sticks ask for, positive for left side up and nose down |
//! | `yaw_rate_deg_s` | deg/s | may be left out; integrated to a yaw that comes round at 360° |
//! | `altitude_m` | m | may be left out |
//!
//! Between two rows a value is on the straight line between theirs. Before the first row and after the last it
//! is theirs, but the yaw rests there.

use crate::angle::wrap_rad;
use crate::set_points::SetPoint;
use diagnostics::ParameterError;
use inputs::InputFiles;
use std::fmt::Display;
use std::path::Path;
use vehicles::table::{self, Dialect, Table, names, shown};

/// A recording of sticks, at least one row.
///
/// ```
/// use controllers::{set_points::SetPoint, sticks::Sticks};
///
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../manifests/sticks/roll.csv");
/// let sticks = Sticks::load(&inputs::InputFiles::default(), path.as_ref()).unwrap();
/// let beside = SetPoint { altitude_m: 1.5, ..SetPoint::default() };
/// assert!(sticks.has("roll") && !sticks.has("altitude"));
/// assert_eq!(sticks.at(0.0, &beside).altitude_m, 1.5, "the recording does not say");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Sticks {
    rows: Vec<Row>,
    has_yaw_rate: bool,
    has_altitude: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Row {
    time_s: f64,
    roll_rad: f64,
    pitch_rad: f64,
    yaw_rate_rad_s: f64,
    /// The rate's integral up to here.
    yaw_rad: f64,
    altitude_m: f64,
}

/// Returns the error that the recording `file` has `fault`, which stands behind its name.
fn refused(file: &str, fault: impl Display) -> ParameterError {
    ParameterError::conflict("data", format_args!("{file}{fault}"))
}

const COLUMNS: [&str; 5] = ["time_s", "roll_deg", "pitch_deg", "yaw_rate_deg_s", "altitude_m"];
/// The most that each may hold, in its unit, and why; as the set points of a manifest.
const MOST: [(f64, &str); 5] = [
    (1e10, "at most 1e10 s: seconds since 1970 are 2e9"),
    (180.0, "an angle of at most 180 deg"),
    (180.0, "an angle of at most 180 deg"),
    (6000.0, "a rate of at most 6000 deg/s: no vehicle turns faster about its vertical"),
    (20_000.0, "at most 20 000 m: no rotorcraft has flown above 12 442 m"),
];
const EXPECTED: &str = "time_s, roll_deg, pitch_deg and, if recorded, yaw_rate_deg_s, altitude_m";

impl Sticks {
    /// The recording at `path` among `files`, the parameter `data`.
    ///
    /// # Errors
    /// It cannot be read, or holds values that no sticks can ask for.
    pub fn load(files: &InputFiles, path: &Path) -> Result<Self, ParameterError> {
        let file = path.display().to_string();
        let bytes = files.bytes(path).map_err(|cause| {
            refused(&file, format_args!(": cannot read these sticks: {cause}; check the path"))
        })?;
        Self::read(&file, &bytes)
    }

    fn read(file: &str, bytes: &[u8]) -> Result<Self, ParameterError> {
        let table = Table::parse(bytes, &COLUMNS, &Dialect::default())
            .map_err(|cause| refused(file, format_args!(": {cause}")))?;
        let places = COLUMNS.map(|column| table.column(column).ok());
        if places[..3].contains(&None) || places.iter().flatten().count() != table.headers.len() {
            let (line, found) = (table.header_line.unwrap_or(1), names(&table.headers));
            return Err(refused(
                file,
                format_args!(":{line}: expected the columns {EXPECTED}, found {found}"),
            ));
        }
        let source = Source { file, table: &table, places };
        let mut rows: Vec<Row> = Vec::new();
        for row in table.rows.iter() {
            rows.push(source.row(row, rows.last()).map_err(|first| source.faults(first))?);
        }
        table.check_rows(1).map_err(|cause| refused(file, format_args!(": {cause}")))?;
        Ok(Self { rows, has_yaw_rate: places[3].is_some(), has_altitude: places[4].is_some() })
    }

    /// True if the recording has the set point's `channel`.
    #[must_use]
    pub fn has(&self, channel: &str) -> bool {
        match channel {
            "roll" | "pitch" => true,
            "yaw" => self.has_yaw_rate,
            "altitude" => self.has_altitude,
            _ => false,
        }
    }

    /// Returns the set point of the sticks at `time_s`; `beside` on the channels that the recording does not have.
    #[must_use]
    pub fn at(&self, time_s: f64, beside: &SetPoint) -> SetPoint {
        let row = self.row_at(time_s);
        SetPoint {
            altitude_m: if self.has_altitude { row.altitude_m } else { beside.altitude_m },
            roll_rad: row.roll_rad,
            pitch_rad: row.pitch_rad,
            yaw_rad: if self.has_yaw_rate { wrap_rad(row.yaw_rad) } else { beside.yaw_rad },
        }
    }

    fn row_at(&self, time_s: f64) -> Row {
        let next = self.rows.partition_point(|row| row.time_s <= time_s);
        match (next.checked_sub(1).map(|last| self.rows[last]), self.rows.get(next)) {
            (Some(last), Some(next)) => last.towards(next, time_s),
            (Some(last), None) => last,
            (None, _) => self.rows[0],
        }
    }
}

impl Row {
    fn towards(&self, next: &Row, time_s: f64) -> Row {
        let part = (time_s - self.time_s) / (next.time_s - self.time_s);
        let between = |from: f64, to: f64| from + (to - from) * part;
        let yaw_rate_rad_s = between(self.yaw_rate_rad_s, next.yaw_rate_rad_s);
        Row {
            time_s,
            roll_rad: between(self.roll_rad, next.roll_rad),
            pitch_rad: between(self.pitch_rad, next.pitch_rad),
            yaw_rate_rad_s,
            yaw_rad: self.turned_rad(yaw_rate_rad_s, time_s),
            altitude_m: between(self.altitude_m, next.altitude_m),
        }
    }

    /// The yaw at `time_s`, to which the rate has changed evenly: the trapezium under it is exact.
    fn turned_rad(&self, yaw_rate_rad_s: f64, time_s: f64) -> f64 {
        self.yaw_rad + 0.5 * (self.yaw_rate_rad_s + yaw_rate_rad_s) * (time_s - self.time_s)
    }
}

/// The file, its table, and where in a row each of [`COLUMNS`] stands.
struct Source<'a> {
    file: &'a str,
    table: &'a Table,
    places: [Option<usize>; 5],
}

impl Source<'_> {
    /// The faults of all rows, of which `first` is one. They are the first row of another length than the
    /// header's, the first time that does not increase, and each column's first faulty cell.
    fn faults(&self, first: ParameterError) -> ParameterError {
        let rows = self.table.rows.iter();
        let whole = || rows.clone().filter(|cells| self.require_length(*cells).is_ok());
        let length = rows.clone().find_map(|cells| self.require_length(cells).err());
        let mut before_s = f64::NEG_INFINITY;
        let time = whole().find_map(|cells| {
            let time_s = self.number(cells, 0).ok()?;
            let is_later = time_s > std::mem::replace(&mut before_s, time_s);
            (!is_later).then(|| self.value(cells, 0, "a time after the row before", time_s))
        });
        let cell = |column| whole().find_map(|cells| self.number(cells, column).err());
        let mut faults = length.into_iter().chain(time).chain((0..COLUMNS.len()).filter_map(cell));
        faults.next().map_or(first, |one| one.and(faults))
    }

    fn require_length(&self, cells: table::Row<'_>) -> Result<(), ParameterError> {
        let Some(fault) = self.table.fault_of_length(cells) else { return Ok(()) };
        Err(refused(self.file, format_args!(":{}: {fault}", cells.line)))
    }

    fn row(&self, cells: table::Row<'_>, before: Option<&Row>) -> Result<Row, ParameterError> {
        self.require_length(cells)?;
        let number = |column: usize| self.number(cells, column);
        let time_s = number(0)?;
        if before.is_some_and(|before| before.time_s >= time_s) {
            return Err(self.value(cells, 0, "a time after the row before", time_s));
        }
        let yaw_rate_rad_s = number(3)?.to_radians();
        Ok(Row {
            time_s,
            roll_rad: number(1)?.to_radians(),
            pitch_rad: number(2)?.to_radians(),
            yaw_rate_rad_s,
            yaw_rad: before.map_or(0.0, |before| before.turned_rad(yaw_rate_rad_s, time_s)),
            altitude_m: number(4)?,
        })
    }

    /// The number in a column, 0 where the recording does not have it.
    fn number(&self, cells: table::Row<'_>, column: usize) -> Result<f64, ParameterError> {
        let Some(place) = self.places[column] else { return Ok(0.0) };
        let text = cells.cell(place);
        let (most, expected) = MOST[column];
        let expected = match self.table.number(text) {
            Some(number) if f64::abs(number) <= most => return Ok(number),
            Some(number) if number.is_finite() => expected,
            _ => "a finite number",
        };
        Err(self.value(cells, column, expected, format_args!("\"{}\"", shown(text))))
    }

    fn value(
        &self,
        cells: table::Row<'_>,
        column: usize,
        expected: &str,
        found: impl Display,
    ) -> ParameterError {
        let (line, column) = (cells.line, COLUMNS[column]);
        let fault = format_args!(":{line}: column `{column}`: expected {expected}, found {found}");
        refused(self.file, fault)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sticks(text: &str) -> Result<Sticks, ParameterError> {
        Sticks::read("s.csv", text.as_bytes())
    }

    fn beside() -> SetPoint {
        SetPoint { altitude_m: 1.5, yaw_rad: 0.4, ..SetPoint::default() }
    }

    #[test]
    fn values_lie_on_the_line_between_rows_and_stay_at_the_ends() {
        let sticks = sticks("time_s, roll_deg, pitch_deg\n1, 0, 3\n2, 10, 3\n").unwrap();
        let roll_deg = |time_s| sticks.at(time_s, &beside()).roll_rad.to_degrees();
        for (time_s, expected_deg) in [(0.0, 0.0), (1.0, 0.0), (1.25, 2.5), (2.0, 10.0), (9.0, 10.0)] {
            assert!((roll_deg(time_s) - expected_deg).abs() < 1e-12, "at {time_s}");
        }
        let held = sticks.at(1.5, &beside());
        assert_eq!((held.altitude_m, held.yaw_rad), (1.5, 0.4));
        assert!(sticks.has("pitch") && !sticks.has("yaw") && !sticks.has("altitude"));
    }

    #[test]
    fn a_yaw_rate_is_integrated_and_comes_round() {
        let text =
            "time_s,roll_deg,pitch_deg,yaw_rate_deg_s,altitude_m\n0,0,0,0,1\n2,0,0,100,2\n4,0,0,100,2\n";
        let sticks = sticks(text).unwrap();
        let yaw_deg = |time_s| sticks.at(time_s, &beside()).yaw_rad.to_degrees();
        for (time_s, expected_deg) in [(1.0, 25.0), (2.0, 100.0), (3.0, -160.0), (4.0, -60.0), (9.0, -60.0)] {
            assert!((yaw_deg(time_s) - expected_deg).abs() < 1e-9, "{} at {time_s}", yaw_deg(time_s));
        }
        assert_eq!(sticks.at(1.0, &beside()).altitude_m, 1.5);
    }

    #[test]
    fn errors_name_file_line_column_and_what_was_found() {
        let header = "time_s,roll_deg,pitch_deg\n";
        let cases = [
            (format!("{header}0,1,2\n0,1,2\n"), "s.csv:3: column `time_s`: expected a time after"),
            (format!("{header}0,x,2\n"), "s.csv:2: column `roll_deg`: expected a finite number, found \"x\""),
            (format!("{header}0,1,nan\n"), "column `pitch_deg`"),
            (format!("{header}0,1e308,2\n"), "s.csv:2: column `roll_deg`: expected an angle of at most 180"),
            ("time_s,roll_deg\n".to_owned(), "expected the columns time_s, roll_deg, pitch_deg"),
            (
                "time_s,roll_deg,pitch_deg,throttle\n".to_owned(),
                "found time_s, roll_deg, pitch_deg, throttle",
            ),
            (header.to_owned(), "expected a row of numbers below the header, found none"),
            (format!("{header}0,1\n"), "s.csv:2: expected 3 cells as in the header, found 2"),
            (format!("{header}0,x,2\n1,1\n1,1,nan\n"), "s.csv:3: expected 3 cells as in the header, found 2"),
            (format!("{header}0,x,2\n1,1\n1,1,nan\n"), "s.csv:2: column `roll_deg`"),
            (format!("{header}0,x,2\n1,1\n1,1,nan\n"), "s.csv:4: column `pitch_deg`"),
            ("0,1,2\n1,1,2\n".to_owned(), "line 1: expected a header"),
            (
                "\u{feff}# mine\ntime_s;roll_deg;pitch_deg\n0,5;1;x\n".to_owned(),
                "s.csv:3: column `pitch_deg`",
            ),
            (
                format!("{header}0,1,2\n1,\"1,2\n2,1,2\n"),
                "s.csv: line 3, cell 2: expected a cell on one line",
            ),
        ];
        for (text, expected) in cases {
            let error = sticks(&text).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        let error = Sticks::load(&InputFiles::default(), Path::new("no-such.csv")).unwrap_err().to_string();
        assert!(error.contains("no-such.csv") && error.contains("check the path"), "{error}");
    }
}
