//! Formats of ULog messages: their numbers by path, and the bytes that a message of each has.

use std::collections::BTreeMap;

use crate::bytes::Number;
use crate::error::{LogError, Spot};

/// Length of the longest message, which is a u16.
pub const MESSAGE_BYTES_MAX: usize = 1 << 16;
/// Greatest depth of formats in formats; PX4's own stay below three.
const DEPTH_MAX: usize = 8;
/// Length of the longest field name, which stands in the path of each of up to 65536 numbers. PX4's own stay below thirty.
const NAME_BYTES_MAX: usize = 128;
/// Fields that fill a message up; those at its end are not written.
const PADDING: &str = "_padding";

/// The formats of a log by their names.
#[derive(Default)]
pub struct Formats {
    fields: BTreeMap<String, Vec<Field>>,
    shapes: BTreeMap<String, Option<Shape>>,
}

struct Field {
    kind: String,
    length: Option<usize>,
    name: String,
}

/// The bytes of a message.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Shape {
    /// Length with the padding at the end.
    pub bytes: usize,
    /// Length without it.
    pub bytes_min: usize,
    /// Place of the time stamp in microseconds, a u64.
    pub stamp: Option<usize>,
}

/// A number in a message.
pub struct Leaf {
    /// Its path, such as `cell[1].volts`.
    pub path: String,
    /// Its type.
    pub number: Number,
    /// Its first byte in the message.
    pub offset: usize,
}

impl Formats {
    /// Adds the format that `declared` declares as `name:kind field;…`. The first of a name counts.
    pub fn add(&mut self, declared: &str) {
        if let Some((name, fields)) = declared.split_once(':') {
            let parsed = || fields.split(';').filter_map(field).collect();
            self.fields.entry(name.to_owned()).or_insert_with(parsed);
        }
    }

    /// True if the format `name` is declared.
    pub fn has(&self, name: &[u8]) -> bool {
        std::str::from_utf8(name).is_ok_and(|name| self.fields.contains_key(name))
    }

    /// The shape of messages of the format `name`; `None` if the log does not declare it, or in itself.
    pub fn shape(&mut self, name: &str) -> Option<Shape> {
        shape(&self.fields, &mut self.shapes, name, DEPTH_MAX)
    }

    /// The numbers of the format `name`, those of formats in it by their path.
    pub fn leaves(&self, name: &str) -> Result<Vec<Leaf>, LogError> {
        let mut leaves = Vec::new();
        self.add_leaves(name, "", 0, &mut leaves, DEPTH_MAX)?;
        Ok(leaves)
    }

    /// Adds the numbers of `format` from the byte `offset` on; returns the byte behind them.
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
        let fields = self.fields.get(format).filter(|_| depth > 0);
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

/// The shape of `format`. Each format is computed once, even if several formats contain it.
fn shape(
    fields: &BTreeMap<String, Vec<Field>>,
    shapes: &mut BTreeMap<String, Option<Shape>>,
    format: &str,
    depth: usize,
) -> Option<Shape> {
    if let Some(known) = shapes.get(format) {
        return *known;
    }
    let declared = fields.get(format).filter(|_| depth > 0)?;
    // A format that stands in itself finds this.
    shapes.insert(format.to_owned(), None);
    let mut found = Shape::default();
    for field in declared {
        let number = Number::of_ulog(&field.kind);
        if (&*field.name, number, field.length) == ("timestamp", Some(Number::Unsigned(8)), None) {
            found.stamp = Some(found.bytes);
        }
        let size = match number {
            Some(number) => number.size(),
            None => shape(fields, shapes, &field.kind, depth - 1)?.bytes,
        };
        let end = size.checked_mul(field.length.unwrap_or(1))?.checked_add(found.bytes)?;
        found.bytes = Some(end).filter(|end| *end <= MESSAGE_BYTES_MAX)?;
        if !field.name.starts_with(PADDING) {
            found.bytes_min = end;
        }
    }
    shapes.insert(format.to_owned(), Some(found));
    Some(found)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_at_the_end_need_not_be_written() {
        let mut formats = Formats::default();
        formats.add("cell:float volts;uint8_t[4] _padding0;");
        formats.add("battery:uint16_t id;uint64_t timestamp;cell[2] cell;uint8_t[6] _padding0;");
        let expected = Shape { bytes: 32, bytes_min: 26, stamp: Some(2) };
        assert_eq!(formats.shape("battery"), Some(expected));
        assert_eq!(formats.shape("cell"), Some(Shape { bytes: 8, bytes_min: 4, stamp: None }));
    }

    #[test]
    fn formats_in_themselves_and_beyond_any_message_have_no_shape() {
        let mut formats = Formats::default();
        formats.add("a:b x;b y;");
        formats.add("b:a x;a y;");
        formats.add("long:uint8_t[18446744073709551615] x;uint64_t[18446744073709551615] y;");
        for name in ["a", "b", "long", "undeclared"] {
            assert_eq!(formats.shape(name), None, "{name}");
        }
    }
}
