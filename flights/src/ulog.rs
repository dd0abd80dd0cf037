//! PX4's ULog (docs.px4.io, "ULog File Format"): the messages that were logged, by name and field.
//!
//! A message is u16 length, u8 type, content. Read are formats (F), subscriptions (A), data (D), dropouts (O) and
//! the flags (B), which tell where data was appended after a crash; the rest is skipped by its length.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::bytes::{Cursor, Number};
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};

/// The bytes before the first message.
const HEADER_BYTES: usize = 16;
/// No message is longer: its length is a u16.
const MESSAGE_BYTES_MAX: usize = 1 << 16;
/// How deep formats may stand in formats; PX4's own stay below three.
const DEPTH_MAX: usize = 8;
/// How long the name of a field may be: it stands in the path of each of up to 65536 numbers. PX4's own stay below thirty.
const NAME_BYTES_MAX: usize = 128;

/// A log, with the places of its messages.
pub struct Ulog {
    bytes: Vec<u8>,
    formats: BTreeMap<String, Vec<Field>>,
    topics: BTreeMap<u16, Topic>,
    notes: Vec<String>,
}

struct Field {
    kind: String,
    length: Option<usize>,
    name: String,
}

struct Topic {
    /// Name, with `:1` and so on behind it for further instances.
    name: String,
    format: String,
    data: Vec<Range<usize>>,
}

/// A number in a message.
struct Leaf {
    path: String,
    number: Number,
    offset: usize,
}

impl Ulog {
    /// Reads a log's bytes.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, LogError> {
        if !bytes.starts_with(b"ULog\x01\x12\x35") || bytes.len() < HEADER_BYTES {
            let expected = "`ULog` and the bytes 01 12 35 at its begin";
            return Err(LogError::unexpected(Spot::Whole, expected, "no ULog", "check `format`"));
        }
        let mut log = Self { bytes, formats: BTreeMap::new(), topics: BTreeMap::new(), notes: Vec::new() };
        let mut dropouts_ms = Vec::new();
        let mut start = HEADER_BYTES;
        let mut ends = log.appended();
        ends.push(log.bytes.len());
        for end in ends {
            let left = log.messages(start..end, &mut dropouts_ms);
            if left > 0 && end == log.bytes.len() {
                log.notes
                    .push(format!("the log is cut: its last {left} bytes are no whole message; left out"));
            }
            start = end.max(start);
        }
        if !dropouts_ms.is_empty() {
            let sum_s = dropouts_ms.iter().map(|ms| f64::from(*ms)).sum::<f64>() * 1e-3;
            log.notes
                .push(format!("the logger dropped out {} times, {sum_s:.3} s in all", dropouts_ms.len()));
        }
        Ok(log)
    }

    /// Where data was appended; the message before each is cut.
    fn appended(&self) -> Vec<usize> {
        let mut cursor = Cursor { bytes: &self.bytes, at: HEADER_BYTES };
        let flags = cursor.u16().zip(cursor.u8()).filter(|(length, kind)| *kind == b'B' && *length >= 40);
        let is_appended = self.bytes.get(HEADER_BYTES + 3 + 8).is_some_and(|byte| byte & 1 == 1);
        if flags.is_none() || !is_appended {
            return Vec::new();
        }
        cursor.at += 16;
        let offsets = (0..3).filter_map(|_| cursor.u64().and_then(|offset| usize::try_from(offset).ok()));
        offsets.filter(|offset| (HEADER_BYTES..self.bytes.len()).contains(offset)).collect()
    }

    /// Reads the messages in `part`; returns how many bytes are left behind the last whole one.
    fn messages(&mut self, part: Range<usize>, dropouts_ms: &mut Vec<u16>) -> usize {
        let mut at = part.start;
        while at < part.end {
            let mut cursor = Cursor { bytes: &self.bytes[..part.end], at };
            let head = cursor.u16().zip(cursor.u8());
            let Some((kind, place)) =
                head.and_then(|(length, kind)| Some((kind, cursor.skip(length.into())?)))
            else {
                return part.end - at;
            };
            at = place.end;
            self.message(kind, place, dropouts_ms);
        }
        0
    }

    fn message(&mut self, kind: u8, place: Range<usize>, dropouts_ms: &mut Vec<u16>) {
        let mut cursor = Cursor { bytes: &self.bytes[..place.end], at: place.start };
        match kind {
            b'F' => {
                let text = String::from_utf8_lossy(&self.bytes[place]).into_owned();
                if let Some((name, fields)) = text.split_once(':') {
                    self.formats.insert(name.to_owned(), fields.split(';').filter_map(field).collect());
                }
            }
            b'A' => {
                let Some((instance, id)) = cursor.u8().zip(cursor.u16()) else { return };
                let format = String::from_utf8_lossy(&self.bytes[cursor.at..place.end]).into_owned();
                let name = if instance == 0 { format.clone() } else { format!("{format}:{instance}") };
                self.topics.insert(id, Topic { name, format, data: Vec::new() });
            }
            b'D' => {
                let topic = cursor.u16().and_then(|id| self.topics.get_mut(&id));
                if let Some(topic) = topic {
                    topic.data.push(cursor.at..place.end);
                }
            }
            b'O' => dropouts_ms.extend(cursor.u16()),
            _ => {}
        }
    }

    fn topic(&self, topic: Option<&str>) -> Result<&Topic, LogError> {
        let logged = || self.topics.values().filter(|topic| !topic.data.is_empty());
        let name = topic.ok_or_else(|| {
            LogError::unexpected(Spot::Key("topic"), "the name of a message of the ULog", "none", "add it")
        })?;
        logged()
            .find(|topic| topic.name == name)
            .ok_or_else(|| LogError::missing("topic", name, logged().map(|topic| &topic.name), "`topic`"))
    }

    /// Adds the numbers of `format` from the byte `offset` on, those of formats in it by their path; returns the byte behind
    /// them.
    fn add_leaves(
        &self,
        format: &str,
        prefix: &str,
        mut offset: usize,
        leaves: &mut Vec<Leaf>,
        depth: usize,
    ) -> Result<usize, LogError> {
        let broken = |found: &str| {
            let (at, expected) = (Spot::Named("format", format.to_owned()), "fields of a message");
            LogError::unexpected(at, expected, found, "the log is damaged: copy it again")
        };
        let fields = self.formats.get(format).filter(|_| depth > 0);
        let fields = fields.ok_or_else(|| broken("none, or the format in itself"))?;
        for field in fields {
            if field.name.len() > NAME_BYTES_MAX {
                return Err(broken(&format!("a field name of {} bytes", field.name.len())));
            }
            for index in 0..field.length.unwrap_or(1) {
                let index = if field.length.is_some() { format!("[{index}]") } else { String::new() };
                let path = format!("{prefix}{}{index}", field.name);
                let before = offset;
                offset = match Number::of_ulog(&field.kind) {
                    Some(number) => {
                        leaves.push(Leaf { path, number, offset });
                        offset + number.size()
                    }
                    None => self.add_leaves(&field.kind, &format!("{path}."), offset, leaves, depth - 1)?,
                };
                if offset > MESSAGE_BYTES_MAX || offset == before {
                    return Err(broken("a field that is empty, or fields longer than any message"));
                }
            }
        }
        Ok(offset)
    }
}

impl Log for Ulog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        let topic = self.topic(topic)?;
        let mut leaves = Vec::new();
        self.add_leaves(&topic.format, "", 0, &mut leaves, DEPTH_MAX)?;
        let leaf = |name: &str| leaves.iter().find(|leaf| leaf.path == name);
        let find = |name: &String| {
            leaf(name).ok_or_else(|| {
                LogError::missing("field", name, leaves.iter().map(|leaf| &leaf.path), "`fields`")
            })
        };
        let wanted = names.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let stamps = [leaf("timestamp_sample"), leaf("timestamp")];
        let number = |place: &Range<usize>, leaf: &Leaf| {
            let bytes = self.bytes.get(place.start + leaf.offset..place.end);
            bytes.map_or(f64::NAN, |bytes| leaf.number.read(bytes))
        };
        let time_s = |place| {
            let mut stamps = stamps.iter().flatten().map(|leaf| number(place, leaf));
            stamps.find(|stamp_us| *stamp_us > 0.0).map_or(f64::NAN, |stamp_us| stamp_us * 1e-6)
        };
        let row = |place| wanted.iter().map(|leaf| number(place, leaf)).collect();
        let mut notes = self.notes.clone();
        if stamps[0].is_some() {
            notes.push("time is `timestamp_sample`, when it was measured".to_owned());
        }
        let time_s = topic.data.iter().map(time_s).collect();
        Ok(Samples { time_s, rows: topic.data.iter().map(row).collect(), notes })
    }

    fn topics(&self) -> Vec<(String, String)> {
        let logged = self.topics.values().filter(|topic| !topic.data.is_empty());
        logged.map(|topic| (topic.name.clone(), topic.format.clone())).collect()
    }
}

/// A field declared as `kind name` or `kind[length] name`.
fn field(declared: &str) -> Option<Field> {
    let (kind, name) = declared.trim().split_once(' ')?;
    let (kind, length) = match kind.strip_suffix(']').and_then(|kind| kind.split_once('[')) {
        Some((kind, length)) => (kind, Some(length.parse().ok()?)),
        None => (kind, None),
    };
    Some(Field { kind: kind.to_owned(), length, name: name.to_owned() })
}
