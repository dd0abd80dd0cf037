//! Messages that a program in another language declares: a schema made at run time, held to the rules that
//! `#[derive(Message)]` and the compiler enforce for messages in Rust.

use crate::schema::{Field, Kind, Primitive, Schema, sequences_are_last};

/// A message as a program declares it: fields in memory order, without padding.
///
/// ```
/// use bus::dynamic::{FieldDescription, KindDescription, MessageDescription};
/// use bus::schema::Primitive;
///
/// let voltage = FieldDescription {
///     name: "voltage".to_owned(),
///     unit: "V".to_owned(),
///     kind: KindDescription::Primitive(Primitive::F64),
///     ..FieldDescription::default()
/// };
/// let battery =
///     MessageDescription { type_name: "my_msgs/msg/Battery".to_owned(), size: 8, fields: vec![voltage], ..Default::default() };
/// let schema = battery.declare().unwrap();
/// assert!(schema.layout().contains("0  float64      voltage                      V"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct MessageDescription {
    /// Three-part ROS 2 name, `package/msg/Name`.
    pub type_name: String,
    /// Meaning, in one line.
    pub doc: String,
    /// Size in bytes.
    pub size: usize,
    /// Fields in memory order.
    pub fields: Vec<FieldDescription>,
}

/// A field of a [`MessageDescription`].
#[derive(Clone, Debug, Default)]
pub struct FieldDescription {
    /// Name as ROS 2 tools show it: `^[a-z](_?[a-z0-9]+)*$`.
    pub name: String,
    /// Meaning, in one line.
    pub doc: String,
    /// Unit of its numbers, `1` where they have none, empty where the enclosing field states it.
    pub unit: String,
    /// Frame in which it is expressed, empty where it has none.
    pub frame: String,
    /// Bytes from the start of the message.
    pub offset: usize,
    /// Type.
    pub kind: KindDescription,
}

/// Type of a field of a [`MessageDescription`].
#[derive(Clone, Debug)]
pub enum KindDescription {
    /// A number.
    Primitive(Primitive),
    /// A nested message.
    Message(Box<MessageDescription>),
    /// A fixed array.
    Array(Box<KindDescription>, usize),
    /// Values up to so many: a count of 32 bits, four bytes of zeros, then room for all.
    Sequence(Box<KindDescription>, usize),
}

impl Default for KindDescription {
    fn default() -> Self {
        Self::Primitive(Primitive::F64)
    }
}

impl MessageDescription {
    /// The schema of a message that topics carry. It lives as long as the process, as those of compiled messages do.
    ///
    /// # Errors
    /// Its type or field names are not ROS 2's, it has padding, or a sequence is not its last field.
    pub fn declare(&self) -> Result<&'static Schema, String> {
        let schema = self.declare_state()?;
        // A nested message's unit may be that of the field which holds it.
        if let Some(field) = self.fields.iter().find(|field| field.unit.is_empty() && field.kind.is_float()) {
            return Err(self.refused(&format!(
                "states no unit of its field `{}`; numbers without a unit have the unit `1`",
                field.name
            )));
        }
        if sequences_are_last(schema.fields) {
            return Ok(schema);
        }
        let sequence = self.fields.iter().find(|field| matches!(field.kind, KindDescription::Sequence(..)));
        let name = sequence.map_or("", |field| field.name.as_str());
        Err(self
            .refused(&format!("has a sequence `{name}` that is not its last field, or that states no unit")))
    }

    /// The schema of a state, which no topic carries: sequences may stand anywhere in it.
    ///
    /// # Errors
    /// As [`MessageDescription::declare`].
    pub fn declare_state(&self) -> Result<&'static Schema, String> {
        self.check_names()?;
        let fields: Vec<Field> =
            self.fields.iter().map(FieldDescription::declare).collect::<Result<_, _>>()?;
        self.check_places(&fields)?;
        Ok(Box::leak(Box::new(Schema {
            type_name: kept(&self.type_name),
            doc: kept(&self.doc),
            size: self.size,
            definition: None,
            fields: fields.leak(),
        })))
    }

    fn check_names(&self) -> Result<(), String> {
        let parts: Vec<&str> = self.type_name.split('/').collect();
        let is_ros_name = matches!(parts.as_slice(), [package, "msg", name]
            if is_field_name(package) && name.starts_with(|c: char| c.is_ascii_uppercase()));
        if !is_ros_name {
            return Err(self.refused("needs a name of three parts: `package/msg/Name`"));
        }
        if self.fields.is_empty() {
            return Err(self.refused("has no fields"));
        }
        for (index, field) in self.fields.iter().enumerate() {
            let name = &field.name;
            if !is_field_name(name) {
                return Err(self.refused(&format!(
                    "has a field `{name}`; a field name matches ^[a-z](_?[a-z0-9]+)*$ (ROS 2 tools refuse others)"
                )));
            }
            if self.fields[..index].iter().any(|other| other.name == *name) {
                return Err(self.refused(&format!("has two fields `{name}`")));
            }
        }
        Ok(())
    }

    /// Refuses padding, fields on each other, fields that CDR would place elsewhere, and a size that is not that of the fields.
    fn check_places(&self, fields: &[Field]) -> Result<(), String> {
        let mut end = 0;
        for field in fields {
            let alignment = alignment(&field.kind);
            if field.offset != end || !end.is_multiple_of(alignment) {
                return Err(self.refused(&format!(
                    "has its field `{}` at byte {}, and the fields before it end at {end}; its offset has to be a multiple of \
                     {alignment}; reorder the fields or add a field `pad0`",
                    field.name, field.offset
                )));
            }
            if let Some(reason) = misfit(&field.kind) {
                return Err(self.refused(&format!("has a field `{}` with {reason}", field.name)));
            }
            end += field.kind.size();
        }
        let whole = fields.iter().map(|field| alignment(&field.kind)).max().unwrap_or(1);
        if end == self.size && end.is_multiple_of(whole) {
            return Ok(());
        }
        Err(self.refused(&format!(
            "has {} bytes, and its fields take {end}; its size has to be a multiple of {whole}; add a field `pad0`",
            self.size
        )))
    }

    fn refused(&self, reason: &str) -> String {
        format!("the message {} {reason}", self.type_name)
    }
}

impl FieldDescription {
    fn declare(&self) -> Result<Field, String> {
        Ok(Field {
            name: kept(&self.name),
            doc: kept(&self.doc),
            unit: kept(&self.unit),
            frame: kept(&self.frame),
            offset: self.offset,
            kind: self.kind.declare()?,
        })
    }
}

impl KindDescription {
    /// True for numbers with a point, and arrays and sequences of them.
    fn is_float(&self) -> bool {
        match self {
            Self::Primitive(primitive) => matches!(primitive, Primitive::F64 | Primitive::F32),
            Self::Array(element, _) | Self::Sequence(element, _) => element.is_float(),
            Self::Message(_) => false,
        }
    }

    fn declare(&self) -> Result<Kind, String> {
        Ok(match self {
            Self::Primitive(primitive) => Kind::Primitive(*primitive),
            Self::Message(message) => Kind::Message(message.declare_state()?),
            Self::Array(element, length) => Kind::Array(Box::leak(Box::new(element.declare()?)), *length),
            Self::Sequence(element, most) => Kind::Sequence(Box::leak(Box::new(element.declare()?)), *most),
        })
    }
}

/// Bytes to whose multiples a value is aligned, in memory as in CDR.
fn alignment(kind: &Kind) -> usize {
    match kind {
        Kind::Primitive(primitive) => primitive.size(),
        Kind::Message(schema) => schema.fields.iter().map(|field| alignment(&field.kind)).max().unwrap_or(1),
        Kind::Array(element, _) => alignment(element),
        Kind::Sequence(..) | Kind::Text | Kind::NamedNumbers(..) => 8,
    }
}

/// Reason why no message holds a value of this kind.
fn misfit(kind: &Kind) -> Option<&'static str> {
    match kind {
        Kind::Array(_, 0) | Kind::Sequence(_, 0) => Some("room for no value"),
        Kind::Array(element, _) => misfit(element),
        // CDR places smaller ones right behind the count.
        Kind::Sequence(element, _) if alignment(element) != 8 => {
            Some("a sequence of values that are not of 8 bytes")
        }
        Kind::Sequence(..) | Kind::Primitive(_) | Kind::Message(_) | Kind::Text | Kind::NamedNumbers(..) => {
            None
        }
    }
}

/// `text` for as long as the process lives.
fn kept(text: &str) -> &'static str {
    text.to_owned().leak()
}

fn is_field_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.contains("__")
        && !name.ends_with('_')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Message;
    use crate::messages::{MotorCommand, PlantState, Time};

    /// `schema` as a program would declare it.
    fn described(schema: &Schema) -> MessageDescription {
        MessageDescription {
            type_name: schema.type_name.to_owned(),
            doc: schema.doc.to_owned(),
            size: schema.size,
            fields: schema
                .fields
                .iter()
                .map(|field| FieldDescription {
                    name: field.name.to_owned(),
                    doc: field.doc.to_owned(),
                    unit: field.unit.to_owned(),
                    frame: field.frame.to_owned(),
                    offset: field.offset,
                    kind: kind(&field.kind),
                })
                .collect(),
        }
    }

    fn kind(kind: &Kind) -> KindDescription {
        match kind {
            Kind::Primitive(primitive) => KindDescription::Primitive(*primitive),
            Kind::Message(schema) => KindDescription::Message(Box::new(described(schema))),
            Kind::Array(element, length) => KindDescription::Array(Box::new(self::kind(element)), *length),
            Kind::Sequence(element, most) => KindDescription::Sequence(Box::new(self::kind(element)), *most),
            Kind::Text | Kind::NamedNumbers(..) => panic!("no program declares a text"),
        }
    }

    #[test]
    fn a_declared_message_is_the_compiled_one_in_layout_and_definition() {
        for schema in [PlantState::SCHEMA, MotorCommand::SCHEMA] {
            let declared = described(schema).declare().unwrap();
            assert_eq!(declared.layout_hash(), schema.layout_hash());
            assert_eq!(declared.ros2_definition(), schema.ros2_definition());
            assert_eq!(declared.extent(), schema.extent());
            assert_eq!(declared.stamp_offset(), schema.stamp_offset());
        }
    }

    #[test]
    fn padding_names_and_sequences_are_refused_in_words() {
        let time = described(Time::SCHEMA);
        let refused = |change: fn(&mut MessageDescription)| {
            let mut message = time.clone();
            change(&mut message);
            message.declare().unwrap_err()
        };
        assert!(refused(|message| message.fields[1].offset = 8).contains("`nanosec` at byte 8"));
        assert!(refused(|message| message.size = 16).contains("has 16 bytes, and its fields take 8"));
        assert!(refused(|message| message.type_name = "Time".to_owned()).contains("three parts"));
        assert!(refused(|message| message.fields[0].name = "Sec".to_owned()).contains("a field `Sec`"));
        assert!(refused(|message| message.fields.clear()).contains("no fields"));
        assert!(refused(|message| message.fields[1].name = "sec".to_owned()).contains("two fields `sec`"));
        // A double behind four bytes, and four bytes behind a double: CDR would place it, and the next message, elsewhere.
        let double = |message: &mut MessageDescription, field: usize| {
            message.fields[field].kind = KindDescription::Primitive(Primitive::F64);
            message.fields[1].offset = if field == 0 { 8 } else { 4 };
            message.size = 12;
        };
        let mut message = time.clone();
        double(&mut message, 1);
        assert!(message.declare_state().unwrap_err().contains("a multiple of 8; reorder"));
        let mut message = time.clone();
        double(&mut message, 0);
        assert!(message.declare_state().unwrap_err().contains("its size has to be a multiple of 8"));
        assert!(
            refused(|message| message.fields[0].kind = KindDescription::Array(Box::default(), 0))
                .contains("no value")
        );
        let cells = |message: &mut MessageDescription| {
            message.fields[1].kind =
                KindDescription::Sequence(Box::new(KindDescription::Primitive(Primitive::U32)), 4);
            message.fields[0].kind = KindDescription::Primitive(Primitive::U64);
            (message.fields[1].offset, message.size) = (8, 8 + 8 + 16);
        };
        assert!(refused(cells).contains("not of 8 bytes"));
        assert!(
            refused(|message| {
                message.fields[0].kind = KindDescription::default();
                (message.fields[0].unit, message.fields[1].offset, message.size) = (String::new(), 8, 16);
                message.fields[1].kind = KindDescription::Primitive(Primitive::U64);
            })
            .contains("states no unit of its field `sec`")
        );
        let mut command = described(MotorCommand::SCHEMA);
        command.fields.swap(0, 1);
        command.fields[0].offset = 0;
        command.fields[1].offset = command.size - 8;
        assert!(command.declare().unwrap_err().contains("not its last field"));
        assert!(command.declare_state().is_ok(), "a state may have its sequences anywhere");
    }
}
