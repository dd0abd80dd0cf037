//! The value that a delayed input has before its first sample: a message made from named fields.

use crate::message::{BODY_START, message_bytes};
use crate::sample_memory::empty_sample;
use crate::schema::{Kind, Primitive, Schema, VALUES_START};
use serde_json::Value;

/// Fault of an initial value, with the path of the field.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InitialError {
    /// A value of another kind.
    #[error("`{path}` is {found}, expected {expected}")]
    Value {
        /// The field, such as `position.z` or `command[2]`; empty for the whole message.
        path: String,
        /// Value found.
        found: Value,
        /// Values accepted.
        expected: String,
    },
    /// A field that the message does not have.
    #[error("there is no field `{path}`; the fields are {}", .known.join(", "))]
    Unknown {
        /// The field.
        path: String,
        /// The known fields in its place.
        known: Vec<&'static str>,
    },
    /// A field that has one value, always.
    #[error("`{0}` is a constant")]
    Constant(String),
}

impl InitialError {
    fn value(path: &str, found: &Value, expected: impl Into<String>) -> Self {
        Self::Value { path: path.to_owned(), found: found.clone(), expected: expected.into() }
    }
}

/// A sample of `schema` whose fields have the values of `value` (a table) and are zero elsewhere.
///
/// # Errors
/// The value that does not fit: an unknown field, a value of another kind, an array of another length.
pub fn sample(schema: &Schema, value: &Value) -> Result<Box<[u64]>, InitialError> {
    let mut words = empty_sample(schema.size);
    write_message(schema, value, &mut bytemuck::cast_slice_mut(&mut words)[BODY_START..], "")?;
    Ok(words)
}

/// The bytes of the message alone, with the values of `value`.
///
/// ```
/// use bus::Message;
/// use bus::messages::SetPoint;
///
/// let bytes = bus::initial::message(SetPoint::SCHEMA, &serde_json::json!({ "altitude": 1.5 }))?;
/// assert_eq!(bytemuck::pod_read_unaligned::<SetPoint>(&bytes).altitude, 1.5);
/// # Ok::<(), bus::initial::InitialError>(())
/// ```
///
/// # Errors
/// As [`sample`].
pub fn message(schema: &Schema, value: &Value) -> Result<Vec<u8>, InitialError> {
    Ok(message_bytes(&sample(schema, value)?, schema.size).to_vec())
}

fn write_message(schema: &Schema, value: &Value, bytes: &mut [u8], path: &str) -> Result<(), InitialError> {
    let Value::Object(fields) = value else {
        return Err(InitialError::value(path, value, "a table of fields"));
    };
    for (name, value) in fields {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        let field = schema.fields.iter().find(|field| field.name == name).ok_or_else(|| {
            let known = schema.fields.iter().map(|field| field.name).collect();
            InitialError::Unknown { path: path.clone(), known }
        })?;
        write_value(&field.kind, value, &mut bytes[field.offset..], &path)?;
    }
    Ok(())
}

fn write_value(kind: &Kind, value: &Value, bytes: &mut [u8], path: &str) -> Result<(), InitialError> {
    match kind {
        Kind::Primitive(primitive) => write_number(*primitive, value, bytes, path),
        Kind::Message(schema) => write_message(schema, value, bytes, path),
        Kind::Array(element, length) => write_array(element, *length, value, bytes, path),
        Kind::Sequence(element, most) => write_sequence(element, *most, value, bytes, path),
        Kind::Text | Kind::NamedNumbers(..) => Err(InitialError::Constant(path.to_owned())),
    }
}

fn write_array(
    element: &Kind,
    length: usize,
    value: &Value,
    bytes: &mut [u8],
    path: &str,
) -> Result<(), InitialError> {
    match value {
        Value::Array(values) if values.len() == length => {
            let size = element.size();
            values.iter().enumerate().try_for_each(|(index, value)| {
                write_value(element, value, &mut bytes[index * size..], &format!("{path}[{index}]"))
            })
        }
        _ => Err(InitialError::value(path, value, format!("an array of {length}"))),
    }
}

fn write_sequence(
    element: &Kind,
    most: usize,
    value: &Value,
    bytes: &mut [u8],
    path: &str,
) -> Result<(), InitialError> {
    let count = value.as_array().map(Vec::len).filter(|count| *count <= most);
    let count =
        count.ok_or_else(|| InitialError::value(path, value, format!("an array of at most {most}")))?;
    put(bytes, &(count as u32).to_le_bytes());
    write_array(element, count, value, &mut bytes[VALUES_START..], path)
}

fn write_number(
    primitive: Primitive,
    value: &Value,
    bytes: &mut [u8],
    path: &str,
) -> Result<(), InitialError> {
    let float = || value.as_f64().ok_or_else(|| InitialError::value(path, value, "a number"));
    macro_rules! integer {
        ($type:ty) => {{
            let number = value.as_i64().and_then(|number| <$type>::try_from(number).ok());
            let expected = || format!("an integer in the range of {}", primitive.ros_name());
            let number = number.ok_or_else(|| InitialError::value(path, value, expected()));
            put(bytes, &number?.to_le_bytes())
        }};
    }
    match primitive {
        Primitive::F64 => put(bytes, &float()?.to_le_bytes()),
        Primitive::F32 => put(
            bytes,
            &single(float()?).ok_or_else(|| InitialError::value(path, value, single_range()))?.to_le_bytes(),
        ),
        Primitive::I64 => integer!(i64),
        Primitive::U64 => integer!(u64),
        Primitive::I32 => integer!(i32),
        Primitive::U32 => integer!(u32),
        Primitive::I16 => integer!(i16),
        Primitive::U16 => integer!(u16),
        Primitive::I8 => integer!(i8),
        Primitive::U8 => integer!(u8),
    }
    Ok(())
}

/// `number` in single precision, where it is a number too.
#[allow(clippy::cast_possible_truncation, reason = "the field is single precision")]
fn single(number: f64) -> Option<f32> {
    let single = number as f32;
    single.is_finite().then_some(single)
}

fn single_range() -> String {
    format!("a number within {:e} of 0: it is single precision", f32::MAX)
}

fn put(bytes: &mut [u8], number: &[u8]) {
    bytes[..number.len()].copy_from_slice(number);
}

#[cfg(test)]
mod tests {
    use super::{sample, single};
    use crate::message::{Message, view};
    use crate::messages::{MotorCommand, PlantState};
    use serde_json::json;

    #[test]
    fn fields_are_written_where_the_struct_has_them() {
        let words = sample(MotorCommand::SCHEMA, &json!({"command": [1, 2.5, 3, 4]})).unwrap();
        assert_eq!(view::<MotorCommand>(&words).command, [1.0, 2.5, 3.0, 4.0]);
        let words = sample(PlantState::SCHEMA, &json!({"position": {"z": 1.5}})).unwrap();
        assert_eq!(view::<PlantState>(&words).position.z, 1.5);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let error = |value| sample(MotorCommand::SCHEMA, &value).unwrap_err().to_string();
        assert!(error(json!({"comand": 1})).contains("no field `comand`; the fields are stamp, command"));
        assert!(error(json!({"command": vec![1; 13]})).contains("expected an array of at most 12"));
        assert!(error(json!({"command": 1})).contains("expected an array of at most 12"));
        assert_eq!(single(1.5), Some(1.5));
        assert_eq!(single(1e39), None, "an infinity in single precision");
        assert!(error(json!({"stamp": {"nanosec": -1}})).contains("range of uint32"));
    }
}
