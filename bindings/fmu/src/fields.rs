//! Places of numbers in a message.

use crate::values::Number;
use bus::schema::{Kind, Primitive, Schema};

/// Bytes before the values of a sequence: a count of 32 bits and four bytes of zeros.
const VALUES_START: usize = 8;

/// A number in a message.
#[derive(Clone, Debug)]
pub struct Field {
    /// Its path, such as `position.z` or `command[0]`.
    pub path: String,
    /// Its unit.
    pub unit: &'static str,
    /// Bytes from the start of the message.
    pub offset: usize,
    /// Its type.
    pub primitive: Primitive,
    /// Place of the sequence that it belongs to, and its number in it.
    pub sequence: Option<(usize, usize)>,
}

/// Returns all numbers of the messages of `schema`, in memory order. Texts are left out.
pub fn all(schema: &'static Schema) -> Vec<Field> {
    let mut fields = Vec::new();
    add_message(schema, "", "", 0, &mut fields);
    fields
}

/// Those of `fields` that `path` means: one number, or all of an array, a sequence or a nested message.
pub fn named<'a>(fields: &'a [Field], path: &str) -> Vec<&'a Field> {
    let is_inside = |field: &&Field| {
        let rest = field.path.strip_prefix(path);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    fields.iter().filter(is_inside).collect()
}

impl Field {
    /// The number in `message`; `None` if its sequence is shorter.
    pub fn read(&self, message: &[u8]) -> Option<Number> {
        if let Some((sequence, index)) = self.sequence
            && index >= count(message, sequence)
        {
            return None;
        }
        Some(match self.primitive {
            Primitive::F64 => Number::Float(f64::from_le_bytes(self.bytes(message)?)),
            Primitive::F32 => Number::Float(f32::from_le_bytes(self.bytes(message)?).into()),
            Primitive::I64 => Number::Integer(i64::from_le_bytes(self.bytes(message)?).into()),
            Primitive::U64 => Number::Integer(u64::from_le_bytes(self.bytes(message)?).into()),
            Primitive::I32 => Number::Integer(i32::from_le_bytes(self.bytes(message)?).into()),
            Primitive::U32 => Number::Integer(u32::from_le_bytes(self.bytes(message)?).into()),
            Primitive::I16 => Number::Integer(i16::from_le_bytes(self.bytes(message)?).into()),
            Primitive::U16 => Number::Integer(u16::from_le_bytes(self.bytes(message)?).into()),
            Primitive::I8 => Number::Integer(i8::from_le_bytes(self.bytes(message)?).into()),
            Primitive::U8 => Number::Integer(u8::from_le_bytes(self.bytes(message)?).into()),
        })
    }

    /// Writes `number` into `message`, whose sequence becomes long enough; `None` if the field's type does not hold it.
    pub fn write(&self, message: &mut [u8], number: Number) -> Option<()> {
        match self.primitive {
            Primitive::F64 => self.put(message, number.float().to_le_bytes()),
            Primitive::F32 => self.put(message, (number.float() as f32).to_le_bytes()),
            Primitive::I64 => self.put(message, number.integer::<i64>()?.to_le_bytes()),
            Primitive::U64 => self.put(message, number.integer::<u64>()?.to_le_bytes()),
            Primitive::I32 => self.put(message, number.integer::<i32>()?.to_le_bytes()),
            Primitive::U32 => self.put(message, number.integer::<u32>()?.to_le_bytes()),
            Primitive::I16 => self.put(message, number.integer::<i16>()?.to_le_bytes()),
            Primitive::U16 => self.put(message, number.integer::<u16>()?.to_le_bytes()),
            Primitive::I8 => self.put(message, number.integer::<i8>()?.to_le_bytes()),
            Primitive::U8 => self.put(message, number.integer::<u8>()?.to_le_bytes()),
        }?;
        if let Some((sequence, index)) = self.sequence {
            let longer = count(message, sequence).max(index + 1);
            message
                .get_mut(sequence..sequence + 4)?
                .copy_from_slice(&u32::try_from(longer).ok()?.to_le_bytes());
        }
        Some(())
    }

    fn bytes<const N: usize>(&self, message: &[u8]) -> Option<[u8; N]> {
        message.get(self.offset..self.offset + N)?.try_into().ok()
    }

    fn put<const N: usize>(&self, message: &mut [u8], bytes: [u8; N]) -> Option<()> {
        message.get_mut(self.offset..self.offset + N)?.copy_from_slice(&bytes);
        Some(())
    }
}

/// Number of values in the sequence at `place`.
fn count(message: &[u8], place: usize) -> usize {
    let bytes = message.get(place..place + 4).and_then(|bytes| bytes.try_into().ok());
    bytes.map_or(0, |bytes| u32::from_le_bytes(bytes) as usize)
}

fn add_message(schema: &Schema, path: &str, unit: &'static str, base: usize, fields: &mut Vec<Field>) {
    for field in schema.fields {
        let path = if path.is_empty() { field.name.to_owned() } else { format!("{path}.{}", field.name) };
        // A nested message's unit may be that of the field which holds it.
        let unit = if field.unit.is_empty() { unit } else { field.unit };
        add(&field.kind, &path, unit, base + field.offset, None, fields);
    }
}

fn add(
    kind: &Kind,
    path: &str,
    unit: &'static str,
    offset: usize,
    sequence: Option<(usize, usize)>,
    fields: &mut Vec<Field>,
) {
    match kind {
        Kind::Primitive(primitive) => {
            fields.push(Field { path: path.to_owned(), unit, offset, primitive: *primitive, sequence });
        }
        Kind::Message(schema) => add_message(schema, path, unit, offset, fields),
        Kind::Array(element, length) => {
            for index in 0..*length {
                let place = offset + index * element.size();
                add(element, &format!("{path}[{index}]"), unit, place, sequence, fields);
            }
        }
        Kind::Sequence(element, most) => {
            for index in 0..*most {
                let place = offset + VALUES_START + index * element.size();
                add(element, &format!("{path}[{index}]"), unit, place, Some((offset, index)), fields);
            }
        }
        Kind::Text | Kind::NamedNumbers(..) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::{all, named};
    use crate::values::Number;
    use bus::Message;
    use bus::messages::{MotorCommand, PlantState};

    #[test]
    fn numbers_are_read_and_written_where_the_message_has_them() {
        let state = PlantState { position: [1.0, 2.0, 3.0].into(), ..Default::default() };
        let fields = all(PlantState::SCHEMA);
        let z = named(&fields, "position.z")[0];
        assert_eq!((z.read(bytemuck::bytes_of(&state)), z.unit), (Some(Number::Float(3.0)), "m"));
        assert_eq!(named(&fields, "position").len(), 3);
        assert!(named(&fields, "positio").is_empty());
    }

    #[test]
    fn a_sequence_has_as_many_values_as_are_written() {
        let (mut command, fields) = (MotorCommand::default(), all(MotorCommand::SCHEMA));
        let bytes = bytemuck::bytes_of_mut(&mut command);
        assert_eq!(named(&fields, "command[1]")[0].read(bytes), None);
        for (index, field) in named(&fields, "command").into_iter().take(2).enumerate() {
            field.write(bytes, Number::Integer(index as i128 + 5)).unwrap();
        }
        assert_eq!(command.command[..], [5.0, 6.0]);
        assert_eq!(named(&fields, "stamp.nanosec")[0].write(&mut [0; 112], Number::Float(-1.0)), None);
    }
}
