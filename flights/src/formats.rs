//! Formats of logs: the one that a file has, and its reader.

use std::path::Path;

use vehicles::foreign;

use crate::crazyflie::CrazyflieLog;
use crate::csv_log::CsvLog;
use crate::dataflash::{self, Dataflash};
use crate::declaration::{Clock, Format};
use crate::error::{LogError, Spot};
use crate::form::Form;
use crate::log::Log;
use crate::mcap_log::McapLog;
use crate::parquet::ParquetLog;
use crate::ulog::Ulog;

/// The log with these bytes. `form` is that of a CSV file, and `clock` chooses one of two clocks.
pub fn parse(
    bytes: Vec<u8>,
    format: Format,
    form: &Form<'_>,
    clock: Option<Clock>,
) -> Result<Box<dyn Log>, LogError> {
    if form.recording.is_some() && !format.is_table() {
        let expected = "a CSV file or a Parquet file: only in these can one of several recordings be chosen";
        return Err(LogError::unexpected(Spot::Key("recording"), expected, "another format", "remove it"));
    }
    if clock.is_some() && format != Format::Mcap {
        let (expected, found) = ("a log in MCAP, which can have two clocks", "another format");
        return Err(LogError::unexpected(Spot::Key("time"), expected, found, "remove the flight's `time`"));
    }
    if !format.is_table() && is_copied_as_text(&bytes) {
        let found = "a copy as text, in which U+FFFD stands for every byte that is no character";
        let advice = "copy the log again as it is: binary mode of FTP, no editor and no clipboard";
        return Err(LogError::unexpected(Spot::Whole, "the bytes of a log", found, advice));
    }
    match format {
        Format::Csv => Ok(Box::new(CsvLog::parse(&bytes, form)?)),
        Format::Crazyflie => Ok(Box::new(CrazyflieLog::parse(bytes)?)),
        Format::Dataflash => Ok(Box::new(Dataflash::parse(bytes)?)),
        Format::Mcap => Ok(Box::new(McapLog::parse(bytes, clock)?)),
        Format::Parquet => Ok(Box::new(ParquetLog::parse(bytes, form)?)),
        Format::Ulog => Ok(Box::new(Ulog::parse(bytes)?)),
    }
}

/// True if a binary log has gone through a program that took it for text: all of it is UTF-8, with characters that stand for what was none. Times and
/// floating-point numbers of a log are no UTF-8.
fn is_copied_as_text(bytes: &[u8]) -> bool {
    std::str::from_utf8(bytes).is_ok_and(|text| text.matches('\u{FFFD}').count() > 2)
}

/// Returns the format of the log at `path` with these bytes: by the first of them, else by its name; CSV if neither
/// shows it, and for a format that has no reader.
pub fn guess(path: &Path, bytes: &[u8]) -> Format {
    match bytes {
        [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n', ..] => Format::Mcap,
        [b'U', b'L', b'o', b'g', 1, 0x12, 0x35, _, ..] => Format::Ulog,
        // The card of an autopilot can hold a block of zeros in front of the log.
        _ if dataflash::is_behind_zeros(bytes) => Format::Dataflash,
        // Of every version: its reader names those that it does not read.
        [0xBC, _, 0, _, _, _, _, _, ..] => Format::Crazyflie,
        [b'P', b'A', b'R', b'1' | b'E', ..] if foreign::of(bytes).is_some() => Format::Parquet,
        // Its reader names what it is.
        _ if foreign::of(bytes).is_some() => Format::Csv,
        _ => match path.extension().and_then(|extension| extension.to_str()) {
            Some("mcap") => Format::Mcap,
            Some("ulg" | "ulog") => Format::Ulog,
            _ => Format::Csv,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::parse;
    use crate::declaration::Format;
    use crate::form::Form;
    use vehicles::table::Dialect;

    #[test]
    fn a_log_that_was_copied_as_text_is_told_as_such() {
        let mut log = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
        (0..100_u32).for_each(|number| log.extend((f64::from(number) / 3.0).to_le_bytes()));
        let dialect = Dialect { header_line: None, header: None, delimiter: None, decimal: None };
        let (recording, restarts, channels) = (None, "", Vec::new());
        let form = Form { dialect: &dialect, rows_min: 0, recording, restarts, time: None, channels };
        let told = |bytes: Vec<u8>| match parse(bytes, Format::Ulog, &form, None) {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        };
        let copied = String::from_utf8_lossy(&log).into_owned().into_bytes();
        assert!(told(copied).contains("a copy as text"));
        assert!(!told(log).contains("a copy as text"));
    }
}
