//! Messages that a program in another language declares: a schema made at run time, held to the rules that
//! `#[derive(Message)]` enforces when it compiles.

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
        if sequences_are_last(schema.fields) {
            return Ok(schema);
        }
        Err(self.refused("has a sequence that is not its last field, or that states no unit"))
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
        match self.fields.iter().find(|field| !is_field_name(&field.name)) {
            Some(field) => Err(self.refused(&format!(
                "has a field `{}`; a field name matches ^[a-z](_?[a-z0-9]+)*$ (ROS 2 tools refuse others)",
                field.name
            ))),
            None if self.fields.is_empty() => Err(self.refused("has no fields")),
            None => Ok(()),
        }
    }

    /// Refuses padding, fields on each other, and a size that is not that of the fields.
    fn check_places(&self, fields: &[Field]) -> Result<(), String> {
        let mut end = 0;
        for field in fields {
            if field.offset != end {
                return Err(self.refused(&format!(
                    "has its field `{}` at byte {}, and the fields before it end at {end}; reorder the fields or add \
                     a field `pad0`",
                    field.name, field.offset
                )));
            }
            end += field.kind.size();
        }
        if end == self.size {
            return Ok(());
        }
        let found = format!("has {} bytes, and its fields take {end}; add a field `pad0`", self.size);
        Err(self.refused(&found))
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
    fn declare(&self) -> Result<Kind, String> {
        Ok(match self {
            Self::Primitive(primitive) => Kind::Primitive(*primitive),
            Self::Message(message) => Kind::Message(message.declare_state()?),
            Self::Array(element, length) => Kind::Array(Box::leak(Box::new(element.declare()?)), *length),
            Self::Sequence(element, most) => Kind::Sequence(Box::leak(Box::new(element.declare()?)), *most),
        })
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
        let mut command = described(MotorCommand::SCHEMA);
        command.fields.swap(0, 1);
        command.fields[0].offset = 0;
        command.fields[1].offset = command.size - 8;
        assert!(command.declare().unwrap_err().contains("not its last field"));
        assert!(command.declare_state().is_ok(), "a state may have its sequences anywhere");
    }
}
