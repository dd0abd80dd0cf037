//! Rows of a table on one clock: the column of their times, its unit, and the recordings that they are.

use std::ops::Range;

use diagnostics::nine_decimals;
use vehicles::table::shown;

use crate::clock::{self, NotForward};
use crate::declaration::Entry;
use crate::error::{LogError, Spot};
use crate::form::Form;
use crate::name::Name;
use crate::quantity::Quantity;
use crate::scaling;

/// Places of rows in their file.
pub struct Places<'a> {
    /// Name of a place: line or row.
    pub name: &'static str,
    /// Number of a row's place, from 1.
    pub number: &'a dyn Fn(usize) -> u64,
}

/// The channel `time` and its one column.
pub fn time_column<'e>(time: Option<&'e Entry>, file: &str) -> Result<(&'e Entry, &'e Name), LogError> {
    let column = time.and_then(|time| time.columns.as_deref());
    let (Some(time), Some([column])) = (time, column) else {
        let expected = format!("a channel with one column, which {file} needs");
        let found = if time.is_some() { "no single column" } else { "no channel `time`" };
        let advice = "add `time = { columns = [\"t\"], unit = \"s\" }` to `channels`";
        return Err(LogError::unexpected(Spot::Key("time"), expected, found, advice));
    };
    Ok((time, column))
}

/// The factor of times to s; `others` names other accepted units.
pub fn time_factor(unit: Option<&str>, others: &str) -> Result<f64, LogError> {
    let (dimension, unit) = (Quantity::Time.dimension(), unit.unwrap_or("(none)"));
    dimension.factor(unit).ok_or_else(|| {
        let expected = format!("{}{others}", dimension.names(" or "));
        let advice = "write one of these; `scale` converts times of another unit";
        LogError::unexpected(Spot::Key("time.unit"), expected, unit, advice)
    })
}

/// The declared `scale` and `offset` of times.
pub fn time_scaling(time: &Entry) -> Result<[f64; 2], LogError> {
    let scale = scaling::each(Spot::Key("time.scale"), time.scale.as_ref(), 1.0, 1)?[0];
    let offset = scaling::each(Spot::Key("time.offset"), time.offset.as_ref(), 0.0, 1)?[0];
    Ok([scale, offset])
}

/// Refuses a column of times that fall or stay the same.
pub fn check_forward(time_s: &[f64], time: Option<&Entry>, places: &Places<'_>) -> Result<(), LogError> {
    let Some(fault) = clock::not_forward(time_s) else { return Ok(()) };
    let name = time.and_then(|time| time.columns.as_deref()?.first()).map_or("", |name| name.plain.as_str());
    let at =
        |row: usize| format!("{} s in {} {}", nine_decimals(time_s[row]), places.name, (places.number)(row));
    let (found, advice) = match fault {
        NotForward::Stands => {
            let first_s = time_s.iter().find(|time_s| time_s.is_finite()).unwrap_or(&f64::NAN);
            let found = format!("the same time, {} s, in all {} rows", nine_decimals(*first_s), time_s.len());
            (found, "name the column that holds the times")
        }
        NotForward::Falls { falling, steps, first: [from, to] } => {
            let steps = format!("times that fall in {falling} of {steps} steps");
            let found = format!("{steps}, first from {} to {}", at(from), at(to));
            (found, "sort the rows by time, or name another column; of one that counts down, negate the name")
        }
    };
    let found = format!("{found}, column `{}`", shown(name));
    Err(LogError::unexpected(Spot::Key("time"), "times that increase", found, advice))
}

/// The rows of the recording with this number; those of the only one where none is asked for.
pub fn recording(time_s: &[f64], form: &Form<'_>, places: &Places<'_>) -> Result<Range<usize>, LogError> {
    let restarts = clock::restarts(time_s);
    let count = restarts.len() + 1;
    let bounds = |index: usize| {
        let from = index.checked_sub(1).map_or(0, |before| restarts[before]);
        from..restarts.get(index).copied().unwrap_or(time_s.len())
    };
    match (form.recording, restarts.first()) {
        (None, None) => Ok(0..time_s.len()),
        (Some(number), _) if number.get() <= count => Ok(bounds(number.get() - 1)),
        (Some(number), _) => {
            let found = format!("{number} of {count}");
            let advice = "recordings are counted from 1: name one that the file has";
            Err(LogError::unexpected(Spot::Key("recording"), "a recording of the file", found, advice))
        }
        (None, Some(first)) => {
            let before_s =
                time_s[..*first].iter().rfind(|time_s| time_s.is_finite()).copied().unwrap_or(f64::NAN);
            let numbers: Vec<String> =
                restarts.iter().take(10).map(|index| (places.number)(*index).to_string()).collect();
            let found = format!(
                "{count} recordings: the clock starts again in {} {} (first from {} s to {} s)",
                places.name,
                numbers.join(", "),
                nine_decimals(before_s),
                nine_decimals(time_s[*first])
            );
            Err(LogError::unexpected(Spot::Key("time"), "one clock", found, form.restarts))
        }
    }
}
