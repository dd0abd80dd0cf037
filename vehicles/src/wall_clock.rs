//! Times of day, as loggers of measurements write them.

/// The unit under which files declare such times.
pub const UNIT: &str = "wall clock";
/// Seconds of a day; a wall clock begins anew after them.
const DAY_S: f64 = 86_400.0;

/// Returns the seconds since midnight of `HH:MM:SS`, behind a date and in front of a time zone if there are any. A point, a
/// comma or a colon stands before fractions of a second.
///
/// ```
/// use vehicles::wall_clock::seconds_of_day;
///
/// assert_eq!(seconds_of_day("2031-01-02 10:00:04.250"), Some(36_004.25));
/// assert_eq!(seconds_of_day("2031-01-02T10:00:04,25+01:00"), Some(36_004.25));
/// assert_eq!((seconds_of_day("4.25"), seconds_of_day("25:00:00")), (None, None));
/// ```
#[must_use]
pub fn seconds_of_day(cell: &str) -> Option<f64> {
    let time = cell.trim().rsplit([' ', 'T']).next()?;
    let time = time.split(['Z', '+', '-']).next()?;
    let parts: Vec<&str> = time.split([':', '.', ',']).collect();
    let [hours, minutes, seconds, fraction @ ..] = &parts[..] else { return None };
    let digits = match fraction {
        [] => "0",
        [digits] => digits,
        _ => return None,
    };
    let number = |text: &str, below: f64| {
        let is_plain = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse::<f64>().ok().filter(|number| is_plain && *number < below)
    };
    // A leap second is the 60th.
    let whole = number(hours, 24.0)? * 3600.0 + number(minutes, 60.0)? * 60.0 + number(seconds, 61.0)?;
    number(digits, f64::INFINITY)?;
    Some(whole + format!("0.{digits}").parse::<f64>().ok()?)
}

/// Returns the times of a log that go on after midnight; NaN where a cell holds none.
pub fn times<'a>(cells: impl Iterator<Item = &'a str>) -> Vec<f64> {
    let mut days_s = 0.0;
    let mut last = f64::NEG_INFINITY;
    cells
        .map(|cell| {
            let Some(time) = seconds_of_day(cell) else { return f64::NAN };
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
        let cells = ["2019-11-07 23:59:59:998", "x", "2019-11-08 00:00:00:001", "2019-11-08 00:00:01"];
        let times = times(cells.into_iter());
        assert!((times[2] - times[0] - 0.003).abs() < 1e-9 && times[1].is_nan(), "{times:?}");
        assert!((times[3] - times[0] - 1.002).abs() < 1e-9, "{times:?}");
    }

    #[test]
    fn other_cells_hold_no_time_of_day() {
        for cell in [
            "",
            "4",
            "4.01",
            "10:00",
            "2031-01-02",
            "10:60:00",
            "a:b:c",
            "10:00:00.1.2",
            "10:00:00.x",
            "-1:00:00",
        ] {
            assert_eq!(seconds_of_day(cell), None, "{cell}");
        }
        for cell in ["10:00:04", "2031-01-02T10:00:04Z", "02.01.2031 10:00:04", " 10:00:04.0 "] {
            assert_eq!(seconds_of_day(cell), Some(36_004.0), "{cell}");
        }
    }
}
