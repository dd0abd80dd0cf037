//! What a message's bytes mean: fields, units, frames, the layout hash, and the ROS 2 definition.

use crate::random::{FNV_OFFSET, fnv1a};
use std::fmt::Write as _;

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
    /// A string of constant length, stored as ROS 2 stores it (length with its NUL, then the bytes).
    Text,
}

/// A type that can be a field of a message: plain bytes without padding.
pub trait FieldType: bytemuck::Pod {
    /// What the bytes are.
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
    /// What it is, in one line.
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
/// use bus::Message;
///
/// let schema = bus::messages::SetPoint::SCHEMA;
/// let altitude = schema.fields.iter().find(|field| field.name == "altitude").unwrap();
/// assert_eq!((altitude.unit, altitude.frame, altitude.offset), ("m", "world", 8));
/// ```
#[derive(Debug)]
pub struct Schema {
    /// Three-part ROS 2 name, `package/msg/Name`.
    pub type_name: &'static str,
    /// What it is, in one line.
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

    /// Where the message holds its time stamp: its first `builtin_interfaces/Time`.
    #[must_use]
    pub fn stamp_offset(&self) -> Option<usize> {
        self.fields.iter().find_map(|field| match field.kind {
            Kind::Message(inner) if inner.type_name == "builtin_interfaces/msg/Time" => Some(field.offset),
            Kind::Message(inner) => inner.stamp_offset().map(|offset| field.offset + offset),
            _ => None,
        })
    }

    /// Whether the message, or one nested in it, has a string or a definition of its own.
    #[must_use]
    pub fn has_text(&self) -> bool {
        let is_text = |field: &Field| match field.kind {
            Kind::Text => true,
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

/// The type as it stands in a ROS 2 definition; nested types with their two-part name.
fn ros_type(kind: &Kind) -> String {
    match kind {
        Kind::Primitive(primitive) => primitive.ros_name().to_owned(),
        Kind::Message(schema) => two_part(schema.type_name),
        Kind::Array(element, length) => format!("{}[{length}]", ros_type(element)),
        Kind::Text => "string".to_owned(),
    }
}

/// `package/msg/Name` as `package/Name`.
fn two_part(type_name: &str) -> String {
    type_name.replace("/msg/", "/")
}

fn nested(kind: &Kind) -> Option<&'static Schema> {
    match kind {
        Kind::Message(schema) => Some(schema),
        Kind::Array(element, _) => nested(element),
        Kind::Primitive(_) | Kind::Text => None,
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
    fn the_hash_sees_every_message_apart() {
        assert_ne!(PlantState::SCHEMA.layout_hash(), MotorCommand::SCHEMA.layout_hash());
    }
}
