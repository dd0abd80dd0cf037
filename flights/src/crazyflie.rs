//! The log that a Crazyflie writes to its µSD card, version 2 (crazyflie-firmware, `deck/drivers/src/usddeck.c`).
//!
//! Little-endian: the byte 0xBC, u16 version, u16 number of events; per event u16 id, name with NUL, u16 number of
//! variables, per variable `name(c)` with NUL, c its type as Python's `struct` has it. Then records: u16 id, u64
//! microseconds, the variables. The last four bytes are the CRC-32 of all before.

use std::collections::BTreeMap;

use crate::bytes::{Cursor, Number};
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};
use crate::number_rows::NumberRows;

/// Advice for a log whose header is cut or damaged.
const COPY_AGAIN: &str = "it is damaged or was not closed: copy the log from the card again";
/// Records in a row that show where records begin again behind damage.
const IN_STEP: usize = 4;
/// Longest time between two records of a log, and back, in microseconds: beyond it there is none, but other bytes.
const STEP_US: std::ops::RangeInclusive<i128> = -1_000_000..=600_000_000;

/// A log, with the places of its records.
pub struct CrazyflieLog {
    bytes: Vec<u8>,
    events: BTreeMap<u16, Event>,
    notes: Vec<String>,
}

struct Event {
    name: String,
    variables: Vec<Variable>,
    /// Bytes of a record's variables.
    size: usize,
    /// Time in microseconds and place of each record's variables.
    records: Vec<(u64, usize)>,
}

/// A record, as it stands in the log.
struct Record {
    event: u16,
    time_us: u64,
    /// First byte of the variables.
    values: usize,
    /// The byte behind them.
    end: usize,
}

struct Variable {
    name: String,
    number: Number,
    offset: usize,
}

impl CrazyflieLog {
    /// Reads a log's bytes. One that is cut or damaged is read as far as records fit, which its notes say.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, LogError> {
        if bytes.first() != Some(&0xBC) {
            let expected = "the byte 0xBC at its begin";
            return Err(LogError::unexpected(Spot::Whole, expected, "no Crazyflie log", "check `format`"));
        }
        let checked = bytes.split_last_chunk::<4>();
        let is_whole =
            checked.is_some_and(|(content, stored)| crc32fast::hash(content) == u32::from_le_bytes(*stored));
        let end = if is_whole { bytes.len() - 4 } else { bytes.len() };
        let mut cursor = Cursor { bytes: &bytes[..end], at: 1 };
        let events = header(&mut cursor)?;
        let start = cursor.at;
        let mut log = Self { bytes, events, notes: Vec::new() };
        log.read_records(start, end, is_whole);
        Ok(log)
    }

    fn read_records(&mut self, start: usize, end: usize, is_whole: bool) {
        let (mut at, mut last_us, mut count, mut left_out) = (start, None, 0_usize, 0);
        while at < end {
            if let Some(record) = self.record(at, end, last_us) {
                at = record.end;
                (last_us, count) = (Some(record.time_us), count + 1);
                if let Some(event) = self.events.get_mut(&record.event) {
                    event.records.push((record.time_us, record.values));
                }
                continue;
            }
            let next = (at + 1..end).find(|next| self.is_in_step(*next, end, last_us)).unwrap_or(end);
            left_out += next - at;
            at = next;
        }
        // Of a log that is damaged and not cut, the last four are the checksum.
        let others = left_out - usize::from(!is_whole && left_out == 4) * 4;
        if !is_whole {
            self.notes.push(format!(
                "the checksum at its end is missing or wrong: the log is cut or damaged; {count} records were read, \
                 {others} bytes outside of records were left out"
            ));
        } else if left_out > 0 {
            self.notes.push(format!("{left_out} bytes of the log belong to no record; left out"));
        }
    }

    /// The record at `at`, if one of a declared event fits there in front of `end`, in time behind the one before.
    fn record(&self, at: usize, end: usize, last_us: Option<u64>) -> Option<Record> {
        let mut cursor = Cursor { bytes: &self.bytes[..end], at };
        let event = cursor.u16()?;
        let size = self.events.get(&event)?.size;
        let time_us = cursor.u64()?;
        let values = cursor.skip(size)?.start;
        let step = i128::from(time_us) - i128::from(last_us.unwrap_or(time_us));
        STEP_US.contains(&step).then_some(Record { event, time_us, values, end: cursor.at })
    }

    /// True if records follow from `at` on.
    fn is_in_step(&self, mut at: usize, end: usize, mut last_us: Option<u64>) -> bool {
        (0..IN_STEP).all(|_| {
            let record = self.record(at, end, last_us);
            if let Some(record) = &record {
                (at, last_us) = (record.end, Some(record.time_us));
            }
            record.is_some()
        })
    }

    /// The event named `topic`, or the first that has all `names`.
    fn event(&self, topic: Option<&str>, names: &[String]) -> Result<&Event, LogError> {
        let has_all = |event: &&Event| names.iter().all(|name| event.offset_of(name).is_some());
        let found = match topic {
            Some(topic) => self.events.values().find(|event| event.name == topic),
            None => self.events.values().find(has_all),
        };
        found.filter(has_all).ok_or_else(|| {
            let names_of = |event: &Event| {
                let names = event.variables.iter().map(|variable| variable.name.as_str());
                format!("{} of {}", names.collect::<Vec<_>>().join(" "), event.name)
            };
            let known = self.events.values().map(names_of);
            LogError::missing("event with all of", &names.join(" "), known, "the names in `channels`")
        })
    }
}

impl Event {
    fn offset_of(&self, name: &str) -> Option<(Number, usize)> {
        let variable = self.variables.iter().find(|variable| variable.name == name)?;
        Some((variable.number, variable.offset))
    }
}

impl Log for CrazyflieLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        let event = self.event(topic, names)?;
        let places: Vec<_> = names.iter().filter_map(|name| event.offset_of(name)).collect();
        let mut rows = NumberRows::of_width(places.len());
        for (_, at) in &event.records {
            rows.push(places.iter().map(|(number, offset)| number.read(&self.bytes[at + offset..])));
        }
        let time_s = event.records.iter().map(|(time_us, _)| *time_us as f64 * 1e-6).collect();
        Ok(Samples { time_s, rows, notes: self.notes.clone(), ..Samples::default() })
    }
}

fn header(cursor: &mut Cursor<'_>) -> Result<BTreeMap<u16, Event>, LogError> {
    let cut = || LogError::unexpected(Spot::Whole, "a whole header", "one that is cut", COPY_AGAIN);
    let version = cursor.u16().ok_or_else(cut)?;
    if version != 2 {
        let (expected, found) = ("a log of version 2", format!("version {version}"));
        return Err(LogError::unexpected(
            Spot::Whole,
            expected,
            found,
            "log with newer firmware, or convert it to CSV with the `cfusdlog.py` of its firmware",
        ));
    }
    let count = cursor.u16().ok_or_else(cut)?;
    let mut events = BTreeMap::new();
    for _ in 0..count {
        let id = cursor.u16().ok_or_else(cut)?;
        let name = cursor.text().ok_or_else(cut)?;
        let mut event = Event { name, variables: Vec::new(), size: 0, records: Vec::new() };
        for _ in 0..cursor.u16().ok_or_else(cut)? {
            event.add(&cursor.text().ok_or_else(cut)?)?;
        }
        events.insert(id, event);
    }
    Ok(events)
}

impl Event {
    /// Adds a variable declared as `name(c)`.
    fn add(&mut self, declared: &str) -> Result<(), LogError> {
        let parts = declared.strip_suffix(')').and_then(|declared| declared.rsplit_once('('));
        let known = parts.and_then(|(name, kind)| Some((name, Number::of_struct(kind)?)));
        let (name, number) = known.ok_or_else(|| {
            let expected = "variables as `name(c)` with c one of bBhHiIlLqQfd";
            LogError::unexpected(Spot::Named("event", self.name.clone()), expected, declared, COPY_AGAIN)
        })?;
        self.variables.push(Variable { name: name.to_owned(), number, offset: self.size });
        self.size += number.size();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_checksum_is_that_of_zip() {
        assert_eq!(crc32fast::hash(b"123456789"), 0xCBF4_3926);
    }
}
