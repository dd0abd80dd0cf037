//! One log in CSV: its columns in SI.

use std::path::Path;

use super::error::RotorError;
use super::stand::{Scale, short_name};

/// Seconds of a day; a wall clock begins anew after them.
const DAY_S: f64 = 86_400.0;

/// The cells of a log.
pub struct Table {
    file: String,
    headers: Vec<String>,
    rows: Vec<csv::StringRecord>,
}

impl Table {
    /// Reads the log at `path`.
    pub fn read(path: &Path) -> Result<Self, RotorError> {
        let bytes = vehicles::text::read_log(path)
            .map_err(|cause| RotorError::Unreadable { file: path.display().to_string(), cause })?;
        let text = String::from_utf8_lossy(&bytes);
        // Programs for other systems put a byte order mark before the first name.
        let text = text.trim_start_matches('\u{feff}');
        let file = short_name(path);
        vehicles::quotes::check(text.as_bytes(), b',')
            .map_err(|stray| RotorError::Log { file: file.clone(), reason: stray.to_string() })?;
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(text.as_bytes());
        let broken = |error: csv::Error| RotorError::Log {
            file: file.clone(),
            reason: format!("not a CSV file: {error}; check the path"),
        };
        let headers = reader.headers().map_err(broken)?.iter().map(str::to_owned).collect();
        let rows = reader.records().collect::<Result<Vec<_>, _>>().map_err(broken)?;
        Ok(Self { file, headers, rows })
    }

    /// The numbers of the column `name` in SI; NaN where a cell has none.
    pub fn column(&self, name: &str, scale: Scale) -> Result<Vec<f64>, RotorError> {
        let index = self.headers.iter().position(|header| header == name).ok_or_else(|| RotorError::Log {
            file: self.file.clone(),
            reason: format!("no column `{name}`; it has {}; correct the name", self.headers.join(", ")),
        })?;
        let cells = self.rows.iter().map(|row| row.get(index).unwrap_or_default());
        Ok(match scale {
            Scale::Factor(factor) => cells.map(|cell| cell.parse().unwrap_or(f64::NAN) * factor).collect(),
            Scale::WallClock => unwrapped(cells.map(|cell| seconds_of_day(cell).unwrap_or(f64::NAN))),
        })
    }

    /// The numbers of a time column; every row needs one, and none may go back.
    pub fn times(&self, name: &str, scale: Scale) -> Result<Vec<f64>, RotorError> {
        let time_s = self.column(name, scale)?;
        let fault = |row: usize, what: &str| RotorError::Log {
            file: self.file.clone(),
            reason: format!("row {}: column `{name}` {what}; check its unit, or cut the log", row + 2),
        };
        if let Some(row) = time_s.iter().position(|time| !time.is_finite()) {
            return Err(fault(row, "has no time"));
        }
        match time_s.windows(2).position(|pair| pair[1] < pair[0]) {
            Some(row) => Err(fault(row + 1, "goes back")),
            None => Ok(time_s),
        }
    }
}

/// Seconds since midnight of `YYYY-MM-DD HH:MM:SS:mmm`; a point before the milliseconds will do, and more digits.
fn seconds_of_day(cell: &str) -> Option<f64> {
    let time = cell.rsplit([' ', 'T']).next()?;
    let mut parts = time.split([':', '.']);
    let mut next = || parts.next()?.parse::<f64>().ok();
    let whole = next()? * 3600.0 + next()? * 60.0 + next()?;
    let digits = parts.next().unwrap_or("0");
    Some(whole + format!("0.{digits}").parse::<f64>().ok()?)
}

/// Times that go on after midnight.
fn unwrapped(times: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut days_s = 0.0;
    let mut last = f64::NEG_INFINITY;
    times
        .map(|time| {
            if time + days_s < last - 0.5 * DAY_S {
                days_s += DAY_S;
            }
            last = time + days_s;
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wall_clocks_go_on_after_midnight() {
        let cells = ["2019-11-07 23:59:59:998", "2019-11-08 00:00:00:001"];
        let times = unwrapped(cells.iter().map(|cell| seconds_of_day(cell).unwrap()));
        assert!((times[1] - times[0] - 0.003).abs() < 1e-9, "{times:?}");
    }
}
