//! A log, whatever its format: samples of numbers by name.

use std::path::Path;

use crate::crazyflie::CrazyflieLog;
use crate::csv_log::CsvLog;
use crate::declaration::{Entry, Format};
use crate::mcap_log::McapLog;
use crate::ulog::Ulog;

/// Samples of some numbers as the log has them: any origin of time, any unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// When, in seconds; need not grow, and can be NaN where the log has no number.
    pub time_s: Vec<f64>,
    /// The numbers in the order they were asked for; NaN where the log has none.
    pub rows: Vec<Vec<f64>>,
    /// What a reader of the samples should know, such as which stamp was taken.
    pub notes: Vec<String>,
}

/// What every format can do.
pub trait Log {
    /// The samples of `names` on `topic`. An error says what is missing, what there is, and what to do.
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, String>;

    /// The line of the row whose time is nearest to `time_s`, where the format has lines.
    fn line(&self, _time_s: f64) -> Option<u64> {
        None
    }

    /// The topics that have data, with the type of each; none where the format has no types.
    fn topics(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}

/// The log with these bytes.
pub fn parse(bytes: Vec<u8>, format: Format, time: Option<&Entry>) -> Result<Box<dyn Log>, String> {
    match format {
        Format::Csv => Ok(Box::new(CsvLog::parse(&bytes, time)?)),
        Format::Crazyflie => Ok(Box::new(CrazyflieLog::parse(bytes)?)),
        Format::Mcap => Ok(Box::new(McapLog::parse(bytes)?)),
        Format::Ulog => Ok(Box::new(Ulog::parse(bytes)?)),
    }
}

/// The format of the log at `path` with these bytes: by the first of them, else by its name; CSV where neither says more.
pub fn guess(path: &Path, bytes: &[u8]) -> Format {
    match bytes {
        [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n', ..] => Format::Mcap,
        [b'U', b'L', b'o', b'g', 1, 0x12, 0x35, _, ..] => Format::Ulog,
        [0xBC, 2, 0, _, _, _, _, _, ..] => Format::Crazyflie,
        _ => match path.extension().and_then(|extension| extension.to_str()) {
            Some("mcap") => Format::Mcap,
            Some("ulg" | "ulog") => Format::Ulog,
            _ => Format::Csv,
        },
    }
}

/// The names there are, for an error; shortened where they are many.
pub fn known<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const SHOWN: usize = 60;
    let names: Vec<_> = names.collect();
    let rest = if names.len() > SHOWN { format!(" and {} more", names.len() - SHOWN) } else { String::new() };
    format!("{}{rest}", names[..names.len().min(SHOWN)].join(", "))
}
