//! Meaning of a message's bytes: fields, units, frames, the layout hash, and the ROS 2 definition.

use crate::random::{FNV_OFFSET, fnv1a};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::ops::Range;

/// A fixed-width primitive, little-endian in memory and in recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primitive {
    /// IEEE 754 double.
    F64,
    /// IEEE 754 single.
    F32,
    /// Signed 64-bit integer.
    I64,
    /// Unsigned 64-bit integer.
    U64,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 32-bit integer.
    U32,
    /// Signed 16-bit integer.
    I16,
    /// Unsigned 16-bit integer.
    U16,
    /// Signed byte.
    I8,
    /// Unsigned byte.
    U8,
}

impl Primitive {
    /// The name ROS 2 gives this primitive.
    #[must_use]
    pub const fn ros_name(self) -> &'static str {
        match self {
            Self::F64 => "float64",
            Self::F32 => "float32",
            Self::I64 => "int64",
            Self::U64 => "uint64",
            Self::I32 => "int32",
            Self::U32 => "uint32",
            Self::I16 => "int16",
            Self::U16 => "uint16",
            Self::I8 => "int8",
            Self::U8 => "uint8",
        }
    }

    /// Bytes of a number.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 | Self::U64 => 8,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::I16 | Self::U16 => 2,
            Self::I8 | Self::U8 => 1,
        }
    }
}

/// The type of a field.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// A number.
    Primitive(Primitive),
    /// A nested message.
    Message(&'static Schema),
    /// A fixed array.
    Array(&'static Kind, usize),
    /// Numbers up to so many, as [`Bounded`](crate::Bounded) holds them: the last field of a message.
    Sequence(&'static Kind, usize),
    /// A string of constant length, stored as ROS 2 stores it (length with its NUL, then the bytes).
    Text,
    /// A string of at most so many bytes, its NUL included, and the numbers behind it: the last field of a message.
    NamedNumbers(usize, Numbers),
}

/// Numbers behind a string, placed as CDR places them.
///
/// ```
/// use component::schema::{Numbers, Primitive};
///
/// assert_eq!(Numbers::doubles(7).room(), 56);
/// let with_a_byte = Numbers { leading_bytes: 1, primitive: Primitive::F32, count: 5 };
/// assert_eq!(with_a_byte.room(), 24, "the byte stands in front of the next multiple of 4");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numbers {
    /// Bytes right behind the string, each a `uint8`.
    pub leading_bytes: usize,
    /// Type of the numbers, which begin at a multiple of their size.
    pub primitive: Primitive,
    /// Count of the numbers.
    pub count: usize,
}

impl Numbers {
    /// So many doubles, without bytes in front of them.
    #[must_use]
    pub const fn doubles(count: usize) -> Self {
        Self { leading_bytes: 0, primitive: Primitive::F64, count }
    }

    /// Bytes of the numbers.
    const fn bytes(self) -> usize {
        self.count * self.primitive.size()
    }

    /// Bytes that bytes and numbers need behind a multiple of the numbers' size.
    #[must_use]
    pub const fn room(self) -> usize {
        self.leading_bytes.next_multiple_of(self.primitive.size()) + self.bytes()
    }
}

impl Kind {
    /// Bytes of a value in memory; 0 for a string.
    #[must_use]
    pub const fn size(&self) -> usize {
        match self {
            Self::Primitive(primitive) => primitive.size(),
            Self::Message(schema) => schema.size,
            Self::Array(element, length) => *length * element.size(),
            Self::Sequence(element, most) => VALUES_START + *most * element.size(),
            Self::Text => 0,
            Self::NamedNumbers(name_bytes_max, numbers) => NAME_START + *name_bytes_max + numbers.room(),
        }
    }

    /// True if a value is as long as its count says.
    const fn is_counted(&self) -> bool {
        match self {
            Self::Sequence(..) | Self::NamedNumbers(..) => true,
            Self::Array(element, _) => element.is_counted(),
            Self::Message(schema) => holds_counted(schema.fields),
            Self::Primitive(_) | Self::Text => false,
        }
    }
}

const fn holds_counted(fields: &[Field]) -> bool {
    let mut index = 0;
    while index < fields.len() {
        if fields[index].kind.is_counted() {
            return true;
        }
        index += 1;
    }
    false
}

/// True if at most the last of `fields` is a sequence, which states a unit. `#[derive(Message)]` requires it.
#[doc(hidden)]
#[must_use]
pub const fn sequences_are_last(fields: &[Field]) -> bool {
    let mut index = 0;
    while index < fields.len() {
        let is_fine = match fields[index].kind {
            Kind::Sequence(..) | Kind::NamedNumbers(..) => {
                index + 1 == fields.len() && !fields[index].unit.is_empty()
            }
            kind => !kind.is_counted(),
        };
        if !is_fine {
            return false;
        }
        index += 1;
    }
    true
}

/// Part of a message's bytes that counts: up to the end of its sequence, or of the numbers behind its name.
///
/// ```
/// use component::Message;
/// use component::messages::SetPoint;
///
/// assert!(SetPoint::SCHEMA.extent().is_none(), "its messages are all of one length");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Extent {
    /// Offset of the count, an unsigned integer of 32 bits.
    pub count_offset: usize,
    /// Offset of the first value.
    pub values_offset: usize,
    /// Bytes of a value.
    pub value_bytes: usize,
    /// Values for which there is room.
    pub values_max: usize,
    /// Bytes of the numbers that begin behind the values; 0 where the message ends with the values.
    #[serde(default)]
    pub tail_bytes: usize,
    /// Bytes between the values and these numbers, beside those that align the numbers.
    #[serde(default)]
    pub tail_leading_bytes: usize,
    /// Bytes of each of these numbers, to whose multiples they are aligned.
    #[serde(default = "double_bytes")]
    pub tail_number_bytes: usize,
}

/// Bytes of a double.
const fn double_bytes() -> usize {
    Primitive::F64.size()
}

/// Bytes from the start of a [`Bounded`](crate::Bounded) to its first value.
#[doc(hidden)]
pub const VALUES_START: usize = 8;
/// Bytes from the start of a string to its first character.
pub(crate) const NAME_START: usize = 4;
/// Bytes of CDR's encapsulation header.
const CDR_HEADER_BYTES: usize = 4;

impl Extent {
    /// Number of values in `message`, as it says itself.
    fn count(&self, message: &[u8]) -> usize {
        let count = message.get(self.count_offset..).and_then(<[u8]>::first_chunk);
        count.map_or(0, |bytes| u32::from_le_bytes(*bytes) as usize)
    }

    /// The bytes of `message` that count, as CDR has them: without values it ends behind its count.
    #[must_use]
    pub fn of<'a>(&self, message: &'a [u8]) -> &'a [u8] {
        let end = match (self.count(message), self.tail_bytes) {
            (0, 0) => self.count_offset + size_of::<u32>(),
            (count, _) => self.tail(count).end,
        };
        &message[..end.min(message.len())]
    }

    /// The place of the numbers behind the values of `message`.
    #[doc(hidden)]
    #[must_use]
    pub fn tail_of(&self, message: &[u8]) -> Range<usize> {
        self.tail(self.count(message))
    }

    /// The place of the numbers behind `count` values.
    fn tail(&self, count: usize) -> Range<usize> {
        let end = self.values_offset + count.min(self.values_max) * self.value_bytes;
        let start = match self.tail_bytes {
            0 => end,
            // Another process may have announced 0.
            _ => (end + self.tail_leading_bytes).next_multiple_of(self.tail_number_bytes.max(1)),
        };
        start..start + self.tail_bytes
    }

    /// The bytes of `cdr` that count; `cdr` is a message behind the header of its encapsulation.
    #[must_use]
    pub fn of_cdr<'a>(&self, cdr: &'a [u8]) -> &'a [u8] {
        match cdr.split_at_checked(CDR_HEADER_BYTES) {
            Some((header, message)) => &cdr[..header.len() + self.of(message).len()],
            None => cdr,
        }
    }

    /// Sets the count of `message`, which has room for all values.
    #[doc(hidden)]
    pub fn set_count(&self, message: &mut [u8], count: u32) {
        message[self.count_offset..][..size_of::<u32>()].copy_from_slice(&count.to_le_bytes());
    }

    /// The count of `message`, if it is more than there is room for or if a value behind it is not zero.
    #[doc(hidden)]
    #[must_use]
    pub fn wrong_count(&self, message: &[u8]) -> Option<usize> {
        let count = self.count(message);
        let is_right = || message[self.tail(count).end..].iter().all(|byte| *byte == 0);
        (count > self.values_max || !is_right()).then_some(count)
    }
}

/// A type that can be a field of a message: plain bytes without padding.
pub trait FieldType: bytemuck::Pod {
    /// Type of the bytes.
    const KIND: Kind;
}

macro_rules! primitive_fields {
    ($($rust:ty => $primitive:ident),*) => {
        $(impl FieldType for $rust { const KIND: Kind = Kind::Primitive(Primitive::$primitive); })*
    };
}
primitive_fields!(
    f64 => F64, f32 => F32, i64 => I64, u64 => U64, i32 => I32, u32 => U32, i16 => I16, u16 => U16, i8 => I8,
    u8 => U8
);

impl<T: FieldType, const N: usize> FieldType for [T; N] {
    const KIND: Kind = Kind::Array(&T::KIND, N);
}

/// One field of a message.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Name as ROS 2 tools show it.
    pub name: &'static str,
    /// Description in one line.
    pub doc: &'static str,
    /// Unit of its numbers, `1` where they have none, empty where the enclosing field states it.
    pub unit: &'static str,
    /// Frame in which it is expressed, empty where it has none.
    pub frame: &'static str,
    /// Bytes from the start of the message.
    pub offset: usize,
    /// Type.
    pub kind: Kind,
}

/// A message's type, made by `#[derive(Message)]`.
///
/// ```
/// use component::Message;
///
/// let schema = component::messages::SetPoint::SCHEMA;
/// let altitude = schema.fields.iter().find(|field| field.name == "altitude").unwrap();
/// assert_eq!((altitude.unit, altitude.frame, altitude.offset), ("m", "world", 8));
/// ```
#[derive(Debug)]
pub struct Schema {
    /// Three-part ROS 2 name, `package/msg/Name`.
    pub type_name: &'static str,
    /// Description in one line.
    pub doc: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// The ROS 2 definition, where it is nested differently from the Rust struct.
    pub definition: Option<&'static str>,
    /// Fields in memory order.
    pub fields: &'static [Field],
}

impl Schema {
    /// A hash of everything two processes must agree on: names, types, offsets, units and frames.
    #[must_use]
    pub fn layout_hash(&self) -> u64 {
        fnv1a(self.layout().as_bytes(), FNV_OFFSET)
    }

    /// Offset of the message's time stamp in bytes: its first `builtin_interfaces/Time`.
    #[must_use]
    pub fn stamp_offset(&self) -> Option<usize> {
        self.fields.iter().find_map(|field| match field.kind {
            Kind::Message(inner) if inner.type_name == "builtin_interfaces/msg/Time" => Some(field.offset),
            Kind::Message(inner) => inner.stamp_offset().map(|offset| field.offset + offset),
            _ => None,
        })
    }

    /// The part of a message's bytes that counts; `None` where it is all of them.
    #[must_use]
    pub fn extent(&self) -> Option<Extent> {
        let last = self.fields.last()?;
        let (start, value_bytes, values_max, tail) = match last.kind {
            Kind::Sequence(element, values_max) => {
                (VALUES_START, element.size(), values_max, Numbers::doubles(0))
            }
            Kind::NamedNumbers(name_bytes_max, numbers) => (NAME_START, 1, name_bytes_max, numbers),
            _ => return None,
        };
        Some(Extent {
            count_offset: last.offset,
            values_offset: last.offset + start,
            value_bytes,
            values_max,
            tail_bytes: tail.bytes(),
            tail_leading_bytes: tail.leading_bytes,
            tail_number_bytes: tail.primitive.size(),
        })
    }

    /// A message of zeros, with as many values in its sequence as there is room for.
    #[must_use]
    pub fn zeros(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.size];
        if let Some(extent) = self.extent() {
            extent.set_count(&mut bytes, extent.values_max as u32);
        }
        bytes
    }

    /// True if the message, or one nested in it, has a string or a definition of its own.
    #[must_use]
    pub fn has_text(&self) -> bool {
        let is_text = |field: &Field| match field.kind {
            Kind::Text | Kind::NamedNumbers(..) => true,
            kind => nested(&kind).is_some_and(Schema::has_text),
        };
        self.definition.is_some() || self.fields.iter().any(is_text)
    }

    /// The layout as a table: a line per number, with offset, type, name, unit and frame.
    #[must_use]
    pub fn layout(&self) -> String {
        let mut text = format!("{} ({} bytes)\n", self.type_name, self.size);
        self.write_rows(&mut text, "", 0, "", "");
        text
    }

    fn write_rows(&self, text: &mut String, prefix: &str, base: usize, unit: &str, frame: &str) {
        for field in self.fields {
            let unit = if field.unit.is_empty() { unit } else { field.unit };
            let frame = if field.frame.is_empty() { frame } else { field.frame };
            let name = format!("{prefix}{}", field.name);
            match field.kind {
                Kind::Message(inner) => {
                    inner.write_rows(text, &format!("{name}."), base + field.offset, unit, frame);
                }
                // One row per field of the element: a change inside it must show.
                Kind::Array(Kind::Message(inner), length) => {
                    inner.write_rows(text, &format!("{name}[{length}]."), base + field.offset, unit, frame);
                }
                kind => {
                    let row = format!(
                        "  {:>5}  {:<12} {name:<28} {unit:<8} {frame}",
                        base + field.offset,
                        ros_type(&kind)
                    );
                    let _ = writeln!(text, "{}", row.trim_end());
                }
            }
        }
    }

    /// The ROS 2 definition (`ros2msg`): this message, then each nested type once.
    #[must_use]
    pub fn ros2_definition(&self) -> String {
        if let Some(text) = self.definition {
            return text.to_owned();
        }
        let mut text = self.body();
        let mut done = vec![self.type_name];
        self.append_dependencies(&mut text, &mut done);
        text
    }

    fn append_dependencies(&self, text: &mut String, done: &mut Vec<&'static str>) {
        for field in self.fields {
            let Some(inner) = nested(&field.kind) else { continue };
            if done.contains(&inner.type_name) {
                continue;
            }
            done.push(inner.type_name);
            let _ = write!(text, "{}\nMSG: {}\n{}", "=".repeat(80), two_part(inner.type_name), inner.body());
            inner.append_dependencies(text, done);
        }
    }

    /// The fields as lines of a ROS 2 definition; unit and frame stand in the comment.
    fn body(&self) -> String {
        self.fields.iter().fold(String::new(), |mut text, field| {
            let _ = write!(text, "{} {}", ros_type(&field.kind), field.name);
            let comment = comment(field);
            let _ = if comment.is_empty() { writeln!(text) } else { writeln!(text, "  # {comment}") };
            text
        })
    }
}

fn comment(field: &Field) -> String {
    let unit = if field.unit.is_empty() { String::new() } else { format!("[{}]", field.unit) };
    let frame = if field.frame.is_empty() { String::new() } else { format!("in {}:", field.frame) };
    [unit, frame, field.doc.to_owned()]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// The type as a ROS 2 definition writes it; nested types with their two-part name.
fn ros_type(kind: &Kind) -> String {
    match kind {
        Kind::Primitive(primitive) => primitive.ros_name().to_owned(),
        Kind::Message(schema) => two_part(schema.type_name),
        Kind::Array(element, length) => format!("{}[{length}]", ros_type(element)),
        Kind::Sequence(element, most) => format!("{}[<={most}]", ros_type(element)),
        Kind::Text => "string".to_owned(),
        Kind::NamedNumbers(name_bytes_max, Numbers { leading_bytes, primitive, count }) => {
            let leading =
                if *leading_bytes == 0 { String::new() } else { format!("uint8[{leading_bytes}] ") };
            format!("string[<={name_bytes_max}] {leading}{}[{count}]", primitive.ros_name())
        }
    }
}

/// `package/msg/Name` as `package/Name`.
fn two_part(type_name: &str) -> String {
    type_name.replace("/msg/", "/")
}

fn nested(kind: &Kind) -> Option<&'static Schema> {
    match kind {
        Kind::Message(schema) => Some(schema),
        Kind::Array(element, _) | Kind::Sequence(element, _) => nested(element),
        Kind::Primitive(_) | Kind::Text | Kind::NamedNumbers(..) => None,
    }
}

#[cfg(test)]
mod tests {
    use crate::Message;
    use crate::messages::{MotorCommand, PlantState};

    #[test]
    fn the_definition_names_each_nested_type_once() {
        let text = PlantState::SCHEMA.ros2_definition();
        assert!(text.starts_with("builtin_interfaces/Time stamp"), "{text}");
        assert_eq!(text.matches("MSG: hummingbus_msgs/Vector3\n").count(), 1);
        assert_eq!(text.matches("MSG: builtin_interfaces/Time\n").count(), 1);
        assert!(text.ends_with('\n'));
        assert!(!text.contains("/msg/"));
    }

    #[test]
    fn the_layout_shows_the_fields_of_an_array_of_messages() {
        use crate::messages::Vector3;
        #[derive(Clone, Copy, crate::Message)]
        #[repr(C)]
        #[message(type_name = "test_msgs/msg/Path")]
        struct Path {
            #[field(unit = "m", frame = "world")]
            points: [Vector3; 3],
        }
        let layout = Path::SCHEMA.layout();
        assert!(layout.contains("points[3].y") && layout.contains("m        world"), "{layout}");
    }

    #[test]
    fn a_sequence_is_bounded_in_the_definition_and_the_message_ends_with_it() {
        use crate::Bounded;
        #[derive(Clone, Copy, crate::Message)]
        #[repr(C)]
        #[message(type_name = "test_msgs/msg/Counted")]
        struct Counted {
            flag: u64,
            #[field(unit = "V")]
            cells: Bounded<f64, 5>,
        }
        let counted = |cells: Bounded<f64, 5>| Counted { flag: 1, cells };
        let schema = Counted::SCHEMA;
        assert!(
            schema.ros2_definition().ends_with("float64[<=5] cells  # [V]\n"),
            "{}",
            schema.ros2_definition()
        );
        assert!(schema.layout().contains("float64[<=5]") && schema.size == 8 + 8 + 40);
        let extent = schema.extent().unwrap();
        let bytes = |cells: Bounded<f64, 5>| extent.of(bytemuck::bytes_of(&counted(cells))).len();
        assert_eq!((bytes([].into()), bytes([1.0].into()), bytes([1.0; 5].into())), (12, 24, 56));
        assert_eq!(extent.of(&schema.zeros()).len(), schema.size);
        assert_eq!(extent.wrong_count(bytemuck::bytes_of(&counted([1.0; 5].into()))), None);
        assert_eq!(extent.of(&[0; 3]), [0; 3], "no message, and no panic");
    }

    #[test]
    fn the_hash_sees_every_message_apart() {
        assert_ne!(PlantState::SCHEMA.layout_hash(), MotorCommand::SCHEMA.layout_hash());
    }
}
