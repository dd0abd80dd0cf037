//! Dataflash logs of ArduPilot, `.BIN` (ardupilot.org, "Adding a new Log Message"; AP_Logger/LogStructure.h).
//!
//! A message is the bytes A3 95, u8 type, and fields without padding. Messages of the type 128 (FMT) describe the others: u8 type,
//! u8 length with the head, char\[4] name, char\[16] a character for the type of each field, char\[64] their names. FMTU gives for
//! each field the letter of a unit and of a multiplier, and MULT the multipliers.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::bytes::Number;
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};
use crate::number_rows::NumberRows;

/// In front of each message, with its type behind.
const HEAD: [u8; 2] = [0xA3, 0x95];
const HEAD_BYTES: usize = 3;
/// The type of FMT, and its length.
const FMT: (u8, usize) = (128, 89);
/// The unit that marks the field with the number of a sensor.
const INSTANCE: u8 = b'#';
/// Messages in a row that show where messages begin again behind damage.
const IN_STEP: usize = 3;

/// A log, with the places of its messages.
pub struct Dataflash {
    bytes: Vec<u8>,
    topics: BTreeMap<String, Topic>,
    notes: Vec<String>,
}

/// Messages of one type, and of one sensor where they say which.
struct Topic {
    kind: String,
    fields: Vec<Field>,
    messages: Vec<Range<usize>>,
}

#[derive(Clone, PartialEq)]
struct Field {
    name: String,
    /// `None` for texts and arrays.
    number: Option<Number>,
    scale: f64,
    offset: usize,
    /// True for the number of a sensor.
    is_instance: bool,
}

/// A type of message, as FMT describes it.
struct Format {
    name: String,
    fields: Vec<Field>,
    length: usize,
    messages: Vec<Range<usize>>,
}

impl Dataflash {
    /// Reads a log's bytes. Damaged parts are left out, which its notes say.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, LogError> {
        if !bytes[zeros(&bytes)..].starts_with(&HEAD) {
            let expected = "the bytes A3 95 at its begin";
            return Err(LogError::unexpected(Spot::Whole, expected, "no dataflash log", "check `format`"));
        }
        let mut reader = Reader { bytes: &bytes, formats: BTreeMap::new() };
        let notes = reader.read();
        let mut formats = reader.formats;
        scale(&mut formats, &bytes);
        let topics = topics(formats, &bytes);
        Ok(Self { bytes, topics, notes })
    }
}

/// Number of zeros in front of everything else.
fn zeros(bytes: &[u8]) -> usize {
    bytes.iter().take_while(|byte| **byte == 0).count()
}

/// True for a log that begins with the description of messages, or with zeros in front of it.
pub fn is_behind_zeros(bytes: &[u8]) -> bool {
    bytes[zeros(bytes)..].starts_with(&[HEAD[0], HEAD[1], FMT.0])
}

struct Reader<'a> {
    bytes: &'a [u8],
    formats: BTreeMap<u8, Format>,
}

impl Reader<'_> {
    /// Reads all messages; returns notes on bytes that were left out.
    fn read(&mut self) -> Vec<String> {
        let (mut at, mut places, mut first, mut lost) = (0, 0_usize, 0, 0);
        let end = self.bytes.len();
        while at < end {
            let message = self.message(at);
            if let Some(place) = message.clone().filter(|place| self.follows(place.end)) {
                at = place.end;
                self.take(place);
                continue;
            }
            let next = (at + 1..end).find(|next| self.is_in_step(*next)).unwrap_or(end);
            match message {
                // Were it none, the next would begin within it.
                Some(place) if next >= place.end => {
                    at = place.end;
                    self.take(place);
                }
                _ if next == end => return said(places, first, lost, end - at),
                _ => {
                    (places, first, lost) =
                        (places + 1, if places == 0 { at } else { first }, lost + next - at);
                    at = next;
                }
            }
        }
        said(places, first, lost, 0)
    }

    /// The message at `at`, if one of a described type fits there.
    fn message(&self, at: usize) -> Option<Range<usize>> {
        let head = self.bytes.get(at..at + HEAD_BYTES)?;
        if !head.starts_with(&HEAD) {
            return None;
        }
        let length = if head[2] == FMT.0 { FMT.1 } else { self.formats.get(&head[2])?.length };
        (at + length <= self.bytes.len()).then_some(at..at + length)
    }

    /// True if a message follows at `at`, or the log ends.
    fn follows(&self, at: usize) -> bool {
        at == self.bytes.len() || self.message(at).is_some()
    }

    fn is_in_step(&self, mut at: usize) -> bool {
        (0..IN_STEP).all(|count| {
            let message = self.message(at);
            at = message.as_ref().map_or(at, |place| place.end);
            message.is_some() || count > 0 && at == self.bytes.len()
        })
    }

    fn take(&mut self, place: Range<usize>) {
        let kind = self.bytes[place.start + 2];
        let body = &self.bytes[place.start + HEAD_BYTES..place.end];
        if kind != FMT.0 {
            if let Some(format) = self.formats.get_mut(&kind) {
                format.messages.push(place.start + HEAD_BYTES..place.end);
            }
        } else if let Some(format) = Format::parse(body) {
            // The first of a type counts: it is written again where a log goes on.
            self.formats.entry(body[0]).or_insert(format);
        }
    }
}

fn said(places: usize, first: usize, lost: usize, left: usize) -> Vec<String> {
    let mut notes = Vec::new();
    if places > 0 {
        notes.push(format!(
            "the log is damaged in {places} places, the first at byte {first}: {lost} bytes belong to no message; left out"
        ));
    }
    if left > 0 {
        notes.push(format!("the log is cut: its last {left} bytes are an incomplete message; left out"));
    }
    notes
}

impl Format {
    /// The format that the fields of an FMT message describe.
    fn parse(body: &[u8]) -> Option<Self> {
        let (head, rest) = body.split_at_checked(2)?;
        let (name, rest) = rest.split_at_checked(4)?;
        let (characters, names) = rest.split_at_checked(16)?;
        let length = usize::from(head[1]);
        let (mut fields, mut offset) = (Vec::new(), 0);
        for (character, name) in text(characters).chars().zip(text(names).split(',')) {
            let (size, number, scale) = field_type(character)?;
            let name = name.trim().to_owned();
            // Where no FMTU says so.
            let is_instance = name == "I" && character == 'B';
            fields.push(Field { name, number, scale, offset, is_instance });
            offset += size;
        }
        let name = text(name);
        let fits = length >= HEAD_BYTES + offset && !name.is_empty();
        fits.then_some(Self { name, fields, length, messages: Vec::new() })
    }

    fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.name == name)
    }
}

impl Field {
    /// The number in a message, scaled; NaN where it holds none.
    fn read(&self, bytes: &[u8], message: &Range<usize>) -> f64 {
        let place = bytes.get(message.start + self.offset..message.end);
        self.number.zip(place).map_or(f64::NAN, |(number, bytes)| number.read(bytes) * self.scale)
    }
}

/// The size of a field, its number, and its factor if FMTU does not give one.
fn field_type(character: char) -> Option<(usize, Option<Number>, f64)> {
    let number = |number: Number, scale| Some((number.size(), Some(number), scale));
    match character {
        'b' => number(Number::Signed(1), 1.0),
        'B' | 'M' => number(Number::Unsigned(1), 1.0),
        'h' => number(Number::Signed(2), 1.0),
        'H' => number(Number::Unsigned(2), 1.0),
        'i' => number(Number::Signed(4), 1.0),
        'I' => number(Number::Unsigned(4), 1.0),
        'q' => number(Number::Signed(8), 1.0),
        'Q' => number(Number::Unsigned(8), 1.0),
        'f' => number(Number::Float, 1.0),
        'd' => number(Number::Double, 1.0),
        'c' => number(Number::Signed(2), 1e-2),
        'C' => number(Number::Unsigned(2), 1e-2),
        'e' => number(Number::Signed(4), 1e-2),
        'E' => number(Number::Unsigned(4), 1e-2),
        'L' => number(Number::Signed(4), 1e-7),
        'g' => Some((2, None, 1.0)),
        'n' => Some((4, None, 1.0)),
        'N' => Some((16, None, 1.0)),
        'Z' | 'a' => Some((64, None, 1.0)),
        _ => None,
    }
}

/// A text up to its NUL.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// Takes over the facts of the fields in FMTU and MULT: multipliers, and the field with the number of a sensor.
fn scale(formats: &mut BTreeMap<u8, Format>, bytes: &[u8]) {
    let by_name = |name: &str| formats.values().find(|format| format.name == name);
    let each = |name| {
        let format = by_name(name);
        format.into_iter().flat_map(|format| format.messages.iter().map(move |message| (format, message)))
    };
    let mut multipliers = BTreeMap::new();
    for (mult, message) in each("MULT") {
        if let Some((id, factor)) = mult.field("Id").zip(mult.field("Mult")) {
            multipliers.insert(id.read(bytes, message) as u8, factor.read(bytes, message));
        }
    }
    let mut units = Vec::new();
    for (fmtu, message) in each("FMTU") {
        let letters = |name| Some(message.start + fmtu.field(name)?.offset);
        let kind = fmtu.field("FmtType").map(|field| field.read(bytes, message) as u8);
        if let Some((kind, (unit, multiplier))) = kind.zip(letters("UnitIds").zip(letters("MultIds"))) {
            units.push((kind, unit, multiplier));
        }
    }
    let letter =
        |at: usize, index: usize| bytes.get(at..at + 16).and_then(|letters| letters.get(index)).copied();
    for (kind, unit, multiplier) in units {
        let Some(format) = formats.get_mut(&kind) else { continue };
        for (index, field) in format.fields.iter_mut().enumerate() {
            field.is_instance = letter(unit, index) == Some(INSTANCE);
            // Of no multiplier the factor is 0; an unknown one is `?`.
            let known = letter(multiplier, index).filter(|letter| *letter != b'?');
            let factor = known.and_then(|letter| multipliers.get(&letter)).copied();
            field.scale = factor.filter(|factor| *factor > 0.0 && factor.is_finite()).unwrap_or(field.scale);
        }
    }
}

/// The messages by name, those of further sensors with `:1` and so on behind it.
fn topics(formats: BTreeMap<u8, Format>, bytes: &[u8]) -> BTreeMap<String, Topic> {
    let mut topics = BTreeMap::new();
    for (kind, format) in formats {
        let instance = format.fields.iter().find(|field| field.is_instance).cloned();
        for message in format.messages {
            let number = instance.as_ref().map_or(0.0, |field| field.read(bytes, &message) / field.scale);
            let name = if number > 0.0 { format!("{}:{number}", format.name) } else { format.name.clone() };
            // Another type may have the same name and other fields.
            let is_other = |topic: &Topic| topic.fields != format.fields;
            let name =
                if topics.get(&name).is_some_and(is_other) { format!("{name} of type {kind}") } else { name };
            let topic = topics.entry(name).or_insert_with(|| Topic {
                kind: format.name.clone(),
                fields: format.fields.clone(),
                messages: Vec::new(),
            });
            topic.messages.push(message);
        }
    }
    topics
}

impl Log for Dataflash {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        let none = || {
            let (expected, found) = ("the name of a message of the log, such as `IMU`", "none");
            LogError::unexpected(Spot::Key("topic"), expected, found, "add it")
        };
        let name = topic.ok_or_else(none)?;
        let topic = self
            .topics
            .get(name)
            .ok_or_else(|| LogError::missing("topic", name, self.topics.keys(), "`topic`"))?;
        let field =
            |name: &str| topic.fields.iter().find(|field| field.name == name && field.number.is_some());
        let find = |name: &String| {
            let known = topic.fields.iter().map(|field| &field.name);
            field(name).ok_or_else(|| LogError::missing("number", name, known, "`fields`"))
        };
        let wanted = names.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let stamp = field("TimeUS").map(|field| (field, 1e-6)).or_else(|| Some((field("TimeMS")?, 1e-3)));
        let (stamp, unit_s) = stamp.ok_or_else(|| {
            let (at, expected) = (Spot::Named("topic", name.to_owned()), "a field `TimeUS` or `TimeMS`");
            LogError::unexpected(at, expected, "none", "name another topic")
        })?;
        let time_s =
            topic.messages.iter().map(|message| stamp.read(&self.bytes, message) / stamp.scale * unit_s);
        let mut rows = NumberRows::of_width(wanted.len());
        for message in &topic.messages {
            rows.push(wanted.iter().map(|field| field.read(&self.bytes, message)));
        }
        Ok(Samples { time_s: time_s.collect(), rows, notes: self.notes.clone(), ..Samples::default() })
    }

    fn topics(&self) -> Vec<(String, String)> {
        self.topics.iter().map(|(name, topic)| (name.clone(), topic.kind.clone())).collect()
    }
}
