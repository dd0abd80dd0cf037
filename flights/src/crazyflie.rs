//! The log that a Crazyflie writes to its µSD card, version 2 (crazyflie-firmware, `deck/drivers/src/usddeck.c`).
//!
//! Little-endian: the byte 0xBC, u16 version, u16 number of events; per event u16 id, name with NUL, u16 number of
//! variables, per variable `name(c)` with NUL, c its type as Python's `struct` has it. Then records: u16 id, u64
//! microseconds, the variables. The last four bytes are the CRC-32 of all before.

use std::collections::BTreeMap;

use crate::bytes::{Cursor, Number};
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};

/// What to do about a log that is cut or damaged.
const COPY_AGAIN: &str = "it is damaged or was not closed: copy the log from the card again";

/// A log, with the places of its records.
pub struct CrazyflieLog {
    bytes: Vec<u8>,
    events: BTreeMap<u16, Event>,
}

struct Event {
    name: String,
    variables: Vec<Variable>,
    /// Bytes of a record's variables.
    size: usize,
    /// Time in microseconds and place of each record's variables.
    records: Vec<(u64, usize)>,
}

struct Variable {
    name: String,
    number: Number,
    offset: usize,
}

impl CrazyflieLog {
    /// Checks and reads a log's bytes.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, LogError> {
        check_crc(&bytes)?;
        let end = bytes.len() - 4;
        let mut cursor = Cursor { bytes: &bytes[..end], at: 1 };
        let mut events = header(&mut cursor)?;
        while cursor.at < end {
            let from = cursor.at;
            let cut = || LogError::unexpected(Spot::Byte(from), "a record", "one that is cut", COPY_AGAIN);
            let id = cursor.u16().ok_or_else(cut)?;
            let event = events.get_mut(&id).ok_or_else(|| {
                let (expected, found) = ("an event that the header declares", format!("the event {id}"));
                LogError::unexpected(Spot::Byte(from), expected, found, COPY_AGAIN)
            })?;
            let time_us = cursor.u64().ok_or_else(cut)?;
            event.records.push((time_us, cursor.skip(event.size).ok_or_else(cut)?.start));
        }
        Ok(Self { bytes, events })
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
        let row = |at: usize| {
            places.iter().map(|(number, offset)| number.read(&self.bytes[at + offset..])).collect()
        };
        Ok(Samples {
            time_s: event.records.iter().map(|(time_us, _)| *time_us as f64 * 1e-6).collect(),
            rows: event.records.iter().map(|(_, at)| row(*at)).collect(),
            notes: Vec::new(),
        })
    }
}

fn check_crc(bytes: &[u8]) -> Result<(), LogError> {
    if bytes.first() != Some(&0xBC) {
        let expected = "the byte 0xBC at its begin";
        return Err(LogError::unexpected(Spot::Whole, expected, "no Crazyflie log", "check `format`"));
    }
    let damaged = |expected: &str, found| LogError::unexpected(Spot::Whole, expected, found, COPY_AGAIN);
    let Some((content, &stored)) = bytes.split_last_chunk::<4>() else {
        return Err(damaged("a checksum at its end", format!("{} bytes", bytes.len())));
    };
    let (stored, computed) = (u32::from_le_bytes(stored), crc32fast::hash(content));
    if stored == computed {
        return Ok(());
    }
    Err(damaged(&format!("the checksum {stored:08x} that is stored"), format!("content of {computed:08x}")))
}

fn header(cursor: &mut Cursor<'_>) -> Result<BTreeMap<u16, Event>, LogError> {
    let cut = || LogError::unexpected(Spot::Whole, "a whole header", "one that is cut", COPY_AGAIN);
    let version = cursor.u16().ok_or_else(cut)?;
    if version != 2 {
        let (expected, found) = ("a log of version 2", format!("version {version}"));
        return Err(LogError::unexpected(Spot::Whole, expected, found, "log with newer firmware"));
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
