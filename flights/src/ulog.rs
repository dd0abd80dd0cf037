//! PX4's ULog (docs.px4.io, "ULog File Format"): the messages that were logged, by name and field.
//!
//! Formats (F), subscriptions (A), data (D), dropouts (O), sync messages (S) and flags (B) are read. The
//! flags say where data was appended after a crash. The rest is skipped by its length.

use std::ops::Range;

use crate::bytes::Cursor;
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};
use crate::number_rows::NumberRows;
use crate::ulog_format::Leaf;
use crate::ulog_messages::{self, Content, Topic};

/// The bytes before the first message.
const HEADER_BYTES: usize = 16;

/// A log, with the places of its messages.
pub struct Ulog {
    bytes: Vec<u8>,
    content: Content,
    notes: Vec<String>,
}

impl Ulog {
    /// Reads a log's bytes. Damaged parts are left out, which its notes say.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, LogError> {
        if !bytes.starts_with(b"ULog\x01\x12\x35") || bytes.len() < HEADER_BYTES {
            let expected = "`ULog` and the bytes 01 12 35 at its begin";
            return Err(LogError::unexpected(Spot::Whole, expected, "no ULog", "check `format`"));
        }
        let content = ulog_messages::read(&bytes, parts(&bytes));
        let notes = notes(&content);
        Ok(Self { bytes, content, notes })
    }

    fn topic(&self, topic: Option<&str>) -> Result<&Topic, LogError> {
        let logged = || self.content.topics.iter().filter(|topic| !topic.data.is_empty());
        let name = topic.ok_or_else(|| {
            LogError::unexpected(Spot::Key("topic"), "the name of a message of the ULog", "none", "add it")
        })?;
        logged()
            .find(|topic| topic.name == name)
            .ok_or_else(|| LogError::missing("topic", name, logged().map(|topic| &topic.name), "`topic`"))
    }
}

/// The log, and parts that were appended to it, such as at a crash; the last message of each but the last is cut.
fn parts(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut starts = vec![HEADER_BYTES];
    starts.extend(appended(bytes));
    starts.sort_unstable();
    let ends = starts.iter().skip(1).copied().chain([bytes.len()]);
    starts.iter().zip(ends).map(|(start, end)| *start..end).collect()
}

/// First bytes of the parts that were appended.
fn appended(bytes: &[u8]) -> Vec<usize> {
    let mut cursor = Cursor { bytes, at: HEADER_BYTES };
    let flags = cursor.u16().zip(cursor.u8()).filter(|(length, kind)| *kind == b'B' && *length >= 40);
    let is_appended = bytes.get(HEADER_BYTES + 3 + 8).is_some_and(|byte| byte & 1 == 1);
    if flags.is_none() || !is_appended {
        return Vec::new();
    }
    cursor.at += 16;
    let offsets = (0..3).filter_map(|_| cursor.u64().and_then(|offset| usize::try_from(offset).ok()));
    offsets.filter(|offset| (HEADER_BYTES..bytes.len()).contains(offset)).collect()
}

/// Notes about the log as a whole.
fn notes(content: &Content) -> Vec<String> {
    let (mut notes, damage) = (Vec::new(), content.damage);
    if damage.count > 0 {
        notes.push(format!(
            "the log is damaged in {} places, the first at byte {}: {} bytes belong to no message, {:.3} s by the stamps before \
             and after them; left out",
            damage.count, damage.first, damage.bytes, damage.seconds
        ));
    }
    if content.bytes_left > 0 {
        let left = content.bytes_left;
        notes.push(format!("the log is cut: its last {left} bytes are an incomplete message; left out"));
    }
    if !content.dropouts_ms.is_empty() {
        let sum_s = content.dropouts_ms.iter().map(|ms| f64::from(*ms)).sum::<f64>() * 1e-3;
        notes
            .push(format!("the logger dropped out {} times, {sum_s:.3} s in all", content.dropouts_ms.len()));
    }
    notes
}

impl Log for Ulog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        let topic = self.topic(topic)?;
        let leaves = self.content.formats.leaves(&topic.format)?;
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
        let mut rows = NumberRows::of_width(wanted.len());
        topic.data.iter().for_each(|place| rows.push(wanted.iter().map(|leaf| number(place, leaf))));
        let mut notes = self.notes.clone();
        if stamps[0].is_some() {
            notes.push("time is `timestamp_sample`, when it was measured".to_owned());
        }
        let time_s = topic.data.iter().map(time_s).collect();
        Ok(Samples { time_s, rows, notes, ..Samples::default() })
    }

    fn topics(&self) -> Vec<(String, String)> {
        let logged = self.content.topics.iter().filter(|topic| !topic.data.is_empty());
        logged.map(|topic| (topic.name.clone(), topic.format.clone())).collect()
    }
}
