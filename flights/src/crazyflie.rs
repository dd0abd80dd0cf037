//! The log that a Crazyflie writes to its µSD card, version 2 (crazyflie-firmware, `deck/drivers/src/usddeck.c`).
//!
//! Little-endian: the byte 0xBC, u16 version, u16 number of events; per event u16 id, name with NUL, u16 number of
//! variables, per variable `name(c)` with NUL, c its type as Python's `struct` has it. Then records: u16 id, u64
//! microseconds, the variables. The last four bytes are the CRC-32 of all before.

use std::collections::BTreeMap;

use crate::bytes::{Cursor, Number};
use crate::log::{Log, Samples, known};

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
    pub fn parse(bytes: Vec<u8>) -> Result<Self, String> {
        check_crc(&bytes)?;
        let end = bytes.len() - 4;
        let mut cursor = Cursor { bytes: &bytes[..end], at: 1 };
        let mut events = header(&mut cursor)?;
        while cursor.at < end {
            let from = cursor.at;
            let cut = || format!("the record at byte {from} is cut; copy the log from the card again");
            let id = cursor.u16().ok_or_else(cut)?;
            let event = events.get_mut(&id).ok_or_else(|| {
                format!("the record at byte {from} has the event {id}, which the header does not declare")
            })?;
            let time_us = cursor.u64().ok_or_else(cut)?;
            event.records.push((time_us, cursor.skip(event.size).ok_or_else(cut)?.start));
        }
        Ok(Self { bytes, events })
    }

    /// The event named `topic`, or the first that has all `names`.
    fn event(&self, topic: Option<&str>, names: &[String]) -> Result<&Event, String> {
        let has_all = |event: &&Event| names.iter().all(|name| event.offset_of(name).is_some());
        let found = match topic {
            Some(topic) => self.events.values().find(|event| event.name == topic),
            None => self.events.values().find(has_all),
        };
        found.filter(has_all).ok_or_else(|| {
            let events = self.events.values().map(|event| {
                format!("event {}: {}", event.name, known(event.variables.iter().map(|v| v.name.as_str())))
            });
            let events = events.collect::<Vec<_>>().join("; ");
            format!(
                "no event has all of {}; it has {events}; correct the names in `channels`",
                names.join(", ")
            )
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
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, String> {
        let event = self.event(topic, names)?;
        let places: Vec<_> = names.iter().filter_map(|name| event.offset_of(name)).collect();
        let row = |at: usize| {
            places.iter().map(|(number, offset)| number.read(&self.bytes[at + offset..])).collect()
        };
        #[allow(clippy::cast_precision_loss, reason = "microseconds since the vehicle was switched on")]
        let time_s = event.records.iter().map(|(time_us, _)| *time_us as f64 * 1e-6).collect();
        Ok(Samples {
            time_s,
            rows: event.records.iter().map(|(_, at)| row(*at)).collect(),
            notes: Vec::new(),
        })
    }
}

fn check_crc(bytes: &[u8]) -> Result<(), String> {
    if bytes.first() != Some(&0xBC) {
        return Err("it is no Crazyflie log, which begins with the byte 0xBC; check `format`".to_owned());
    }
    let Some((content, &stored)) = bytes.split_last_chunk::<4>() else {
        return Err("it is shorter than its checksum; copy the log from the card again".to_owned());
    };
    let (stored, found) = (u32::from_le_bytes(stored), crc32(content));
    if stored == found {
        return Ok(());
    }
    Err(format!(
        "its checksum is {stored:08x}, that of its content {found:08x}: it is damaged or was not closed; copy the log \
         from the card again"
    ))
}

/// CRC-32 as in Ethernet and zip.
fn crc32(bytes: &[u8]) -> u32 {
    let bit = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), bit))
}

fn header(cursor: &mut Cursor<'_>) -> Result<BTreeMap<u16, Event>, String> {
    let cut = || "its header is cut; copy the log from the card again".to_owned();
    let version = cursor.u16().ok_or_else(cut)?;
    if version != 2 {
        return Err(format!(
            "it is a Crazyflie log of version {version}, expected 2; log with newer firmware"
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
    fn add(&mut self, declared: &str) -> Result<(), String> {
        let parts = declared.strip_suffix(')').and_then(|declared| declared.rsplit_once('('));
        let known = parts.and_then(|(name, kind)| Some((name, number(kind)?)));
        let (name, number) = known.ok_or_else(|| {
            format!(
                "its header declares the variable {declared:?}, expected `name(c)` with c one of bBhHiIlLqQfd"
            )
        })?;
        self.variables.push(Variable { name: name.to_owned(), number, offset: self.size });
        self.size += number.size();
        Ok(())
    }
}

/// The type of a character of Python's `struct`.
fn number(kind: &str) -> Option<Number> {
    Some(match kind {
        "b" => Number::Signed(1),
        "B" | "?" => Number::Unsigned(1),
        "h" => Number::Signed(2),
        "H" => Number::Unsigned(2),
        "i" | "l" => Number::Signed(4),
        "I" | "L" => Number::Unsigned(4),
        "q" => Number::Signed(8),
        "Q" => Number::Unsigned(8),
        "f" => Number::Float,
        "d" => Number::Double,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_checksum_is_that_of_zip() {
        assert_eq!(super::crc32(b"123456789"), 0xCBF4_3926);
    }
}
