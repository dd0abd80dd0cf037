//! Messages of a ULog one after the other, and the way back to them behind damaged bytes.
//!
//! A message is u16 length, u8 type, content. No mark shows its beginning: behind a wrong length everything is
//! read out of step. So each message is compared with the known facts of its type. Behind one that does not
//! fit, reading goes on where messages fit again: at the next sync message (S), which begins with fixed bytes,
//! or before it.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::bytes::Cursor;
use crate::ulog_format::{Formats, Shape};

/// A sync message: its length, type, and the fixed bytes of its content.
const SYNC: [u8; 11] = [8, 0, b'S', 0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12];
/// Messages in a row that fit by chance: one in some thousand places for one, so that four do nowhere.
const IN_STEP: usize = 4;
/// Messages that are looked at for these.
const LOOKED_AT: usize = 32;
/// Longest name of a format.
const NAME_BYTES_MAX: usize = 256;

/// Contents of the messages of a log.
#[derive(Default)]
pub struct Content {
    /// Formats of messages.
    pub formats: Formats,
    /// Topics in the order of their subscription.
    pub topics: Vec<Topic>,
    /// Lost time of the logger, in ms, once for each time.
    pub dropouts_ms: Vec<u16>,
    /// Bytes that are not messages, with messages behind them.
    pub damage: Damage,
    /// Number of bytes behind the last message.
    pub bytes_left: usize,
    by_name: BTreeMap<String, usize>,
    by_id: BTreeMap<u16, usize>,
    last_us: u64,
    is_behind_damage: bool,
}

/// Messages of one name and instance, under any ids that they were subscribed with.
pub struct Topic {
    /// Name, with `:1` and so on behind it for further instances.
    pub name: String,
    /// Its format.
    pub format: String,
    /// Place of each message's fields.
    pub data: Vec<Range<usize>>,
    shape: Option<Shape>,
}

/// Parts of a log that are left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Damage {
    /// Number of parts.
    pub count: usize,
    /// First byte of the first.
    pub first: usize,
    /// Bytes in all.
    pub bytes: usize,
    /// Time in s from the last stamp before each to the first one behind it, in all.
    pub seconds: f64,
}

/// Degree to which bytes fit as a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fit {
    /// As a message whose content is known.
    Known,
    /// As one of which nothing but the length is known.
    Unknown,
}

/// Fit of a message, its type, and the place of its content.
type Message = (Fit, u8, Range<usize>);

/// A log that is being read.
struct Reader<'a> {
    bytes: &'a [u8],
    /// First byte of each sync message.
    syncs: Vec<usize>,
    content: Content,
}

/// Reads the messages of `bytes` in these parts, one behind the other.
pub fn read(bytes: &[u8], parts: impl IntoIterator<Item = Range<usize>>) -> Content {
    let is_sync = |at: &usize| bytes[*at..].starts_with(&SYNC);
    let syncs = (0..bytes.len()).filter(is_sync).collect();
    let mut reader = Reader { bytes, syncs, content: Content::default() };
    parts.into_iter().for_each(|part| reader.part(part));
    reader.content
}

impl Reader<'_> {
    fn part(&mut self, part: Range<usize>) {
        let mut at = part.start;
        self.content.bytes_left = 0;
        while at < part.end {
            let fit = self.fit(at, part.end);
            if let Some((_, kind, place)) = fit.clone().filter(|fit| self.is_followed(fit, part.end)) {
                at = place.end;
                self.take(kind, place);
                continue;
            }
            let next = self.next_in_step(at + 1, part.end);
            match fit {
                // Were its length wrong, the next would begin within it.
                Some((Fit::Known, kind, place)) if next >= place.end => {
                    at = place.end;
                    // Its stamp may be damaged as well as what is behind it.
                    let last_us = self.content.last_us;
                    self.take(kind, place);
                    self.content.last_us = last_us;
                }
                _ if next == part.end => {
                    self.content.bytes_left = part.end - at;
                    at = next;
                }
                _ => {
                    self.content.lose(at..next);
                    at = next;
                }
            }
        }
    }

    /// True if a message follows: behind one with a wrong length there is none.
    fn is_followed(&self, (fit, _, place): &Message, end: usize) -> bool {
        match fit {
            Fit::Known => place.end == end || self.fit(place.end, end).is_some(),
            Fit::Unknown => self.is_in_step(place.end, end),
        }
    }

    /// The message at `at` with its type and the place of its content, if it fits in front of `end`.
    fn fit(&self, at: usize, end: usize) -> Option<Message> {
        let mut cursor = Cursor { bytes: &self.bytes[..end], at };
        let (length, kind) = cursor.u16().zip(cursor.u8())?;
        if !kind.is_ascii_alphabetic() {
            return None;
        }
        let place = cursor.skip(length.into())?;
        let next_sync = self.syncs.partition_point(|sync| *sync <= at);
        let covers_sync = self.syncs.get(next_sync).is_some_and(|sync| *sync < place.end);
        let fit = self.fit_of(kind, &self.bytes[place.clone()]).filter(|_| !covers_sync)?;
        Some((fit, kind, place))
    }

    /// Degree to which `body` fits as the content of a message of the type `kind`.
    fn fit_of(&self, kind: u8, body: &[u8]) -> Option<Fit> {
        let length = body.len();
        let known = |is_known: bool| is_known.then_some(Fit::Known);
        match kind {
            b'F' => {
                let name = body.iter().take(NAME_BYTES_MAX).position(|byte| *byte == b':')?;
                let fit = if body.ends_with(b";") { Fit::Known } else { Fit::Unknown };
                is_text(&body[..name]).then_some(fit)
            }
            b'A' => {
                let name = body.get(3..).filter(|name| name.len() < NAME_BYTES_MAX && is_text(name))?;
                Some(if self.content.formats.has(name) { Fit::Known } else { Fit::Unknown })
            }
            b'D' => {
                let id = u16::from_le_bytes(*body.first_chunk()?);
                match self.content.topic(id).and_then(|topic| topic.shape) {
                    Some(shape) => known((shape.bytes_min..=shape.bytes).contains(&(length - 2))),
                    None => Some(Fit::Unknown),
                }
            }
            b'I' | b'P' => known(has_key(body)),
            b'M' | b'Q' => known(has_key(body.get(1..)?)),
            b'L' => known(length >= 9 && is_level(body[0])),
            b'C' => known(length >= 11 && is_level(body[0])),
            b'O' | b'R' => known(length == 2),
            b'S' => known(body == &SYNC[3..]),
            b'B' => known(length >= 40),
            _ => Some(Fit::Unknown),
        }
    }

    /// True if messages follow from `at` on, or the part ends there.
    fn is_in_step(&self, mut at: usize, end: usize) -> bool {
        let mut known = 0;
        for _ in 0..LOOKED_AT {
            if at == end || known == IN_STEP {
                return true;
            }
            let Some((fit, _, place)) = self.fit(at, end) else { return false };
            known += usize::from(fit == Fit::Known);
            at = place.end;
        }
        false
    }

    /// The first place from `from` on with messages behind it; `end` if there is none.
    fn next_in_step(&self, from: usize, end: usize) -> usize {
        let is_sync = |at: usize| self.syncs.binary_search(&at).is_ok() && at + SYNC.len() <= end;
        (from..end).find(|at| is_sync(*at) || self.is_in_step(*at, end)).unwrap_or(end)
    }

    fn take(&mut self, kind: u8, place: Range<usize>) {
        let mut cursor = Cursor { bytes: &self.bytes[..place.end], at: place.start };
        match kind {
            b'F' => self.content.formats.add(&String::from_utf8_lossy(&self.bytes[place])),
            b'A' => {
                if let Some((instance, id)) = cursor.u8().zip(cursor.u16()) {
                    let format = String::from_utf8_lossy(&self.bytes[cursor.at..place.end]).into_owned();
                    self.content.subscribe(id, instance, format);
                }
            }
            b'D' => {
                if let Some(id) = cursor.u16() {
                    self.content.add_data(id, cursor.at..place.end, self.bytes);
                }
            }
            b'O' => self.content.dropouts_ms.extend(cursor.u16()),
            _ => {}
        }
    }
}

impl Content {
    fn topic(&self, id: u16) -> Option<&Topic> {
        self.by_id.get(&id).map(|index| &self.topics[*index])
    }

    /// A name and instance that are subscribed again, under any id, stay the same topic.
    fn subscribe(&mut self, id: u16, instance: u8, format: String) {
        let name = if instance == 0 { format.clone() } else { format!("{format}:{instance}") };
        let index = *self.by_name.entry(name.clone()).or_insert(self.topics.len());
        if index == self.topics.len() {
            let shape = self.formats.shape(&format);
            self.topics.push(Topic { name, format, data: Vec::new(), shape });
        }
        self.by_id.insert(id, index);
    }

    fn add_data(&mut self, id: u16, place: Range<usize>, bytes: &[u8]) {
        let Some(topic) = self.by_id.get(&id).map(|index| &mut self.topics[*index]) else { return };
        let stamp = topic.shape.and_then(|shape| shape.stamp);
        let stamp_us = stamp.and_then(|stamp| Cursor { bytes, at: place.start + stamp }.u64());
        topic.data.push(place);
        if let Some(stamp_us) = stamp_us.filter(|stamp_us| *stamp_us > 0) {
            if std::mem::take(&mut self.is_behind_damage) && self.last_us > 0 {
                self.damage.seconds += stamp_us.saturating_sub(self.last_us) as f64 * 1e-6;
            }
            self.last_us = stamp_us;
        }
    }

    fn lose(&mut self, part: Range<usize>) {
        if self.damage.count == 0 {
            self.damage.first = part.start;
        }
        self.damage.count += 1;
        self.damage.bytes += part.len();
        self.is_behind_damage = true;
    }
}

/// True for a key with its length in front.
fn has_key(body: &[u8]) -> bool {
    let key = body.split_first().and_then(|(length, rest)| rest.get(..usize::from(*length)));
    key.is_some_and(|key| !key.is_empty() && is_text(key))
}

fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().all(|byte| (b' '..=b'~').contains(byte))
}

/// True for a level of the log messages, 0 to 7 as a digit or as a number.
fn is_level(byte: u8) -> bool {
    byte < 8 || (b'0'..=b'7').contains(&byte)
}
