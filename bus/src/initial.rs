//! The value that a delayed input has before its first sample: a message made from named fields.

use crate::message::BODY_START;
use crate::sample_memory::empty_sample;
use crate::schema::{Kind, Primitive, Schema};
use serde_json::Value;

/// A sample of `schema` whose fields have the values of `value` (a table) and are zero elsewhere.
///
/// # Errors
/// What does not fit: an unknown field, a value of another kind, an array of another length.
pub fn sample(schema: &Schema, value: &Value) -> Result<Box<[u64]>, String> {
    let mut words = empty_sample(schema.size);
    write_message(schema, value, &mut bytemuck::cast_slice_mut(&mut words)[BODY_START..], "")?;
    Ok(words)
}

fn write_message(schema: &Schema, value: &Value, bytes: &mut [u8], path: &str) -> Result<(), String> {
    let Value::Object(fields) = value else {
        return Err(format!("`{path}` is {value}, expected a table of fields"));
    };
    for (name, value) in fields {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        let field = schema.fields.iter().find(|field| field.name == name).ok_or_else(|| {
            let known = schema.fields.iter().map(|field| field.name).collect::<Vec<_>>().join(", ");
            format!("there is no field `{path}`; the fields are {known}")
        })?;
        write_value(&field.kind, value, &mut bytes[field.offset..], &path)?;
    }
    Ok(())
}

fn write_value(kind: &Kind, value: &Value, bytes: &mut [u8], path: &str) -> Result<(), String> {
    match kind {
        Kind::Primitive(primitive) => write_number(*primitive, value, bytes, path),
        Kind::Message(schema) => write_message(schema, value, bytes, path),
        Kind::Array(element, length) => write_array(element, *length, value, bytes, path),
        Kind::Text => Err(format!("`{path}` is a constant")),
    }
}

fn write_array(
    element: &Kind,
    length: usize,
    value: &Value,
    bytes: &mut [u8],
    path: &str,
) -> Result<(), String> {
    match value {
        Value::Array(values) if values.len() == length => {
            let size = size_of_kind(element);
            values.iter().enumerate().try_for_each(|(index, value)| {
                write_value(element, value, &mut bytes[index * size..], &format!("{path}[{index}]"))
            })
        }
        _ => Err(format!("`{path}` is {value}, expected an array of {length}")),
    }
}

fn write_number(primitive: Primitive, value: &Value, bytes: &mut [u8], path: &str) -> Result<(), String> {
    let float = || value.as_f64().ok_or_else(|| format!("`{path}` is {value}, expected a number"));
    macro_rules! integer {
        ($type:ty) => {{
            let number = value.as_i64().and_then(|number| <$type>::try_from(number).ok());
            put(bytes, &number.ok_or_else(|| integer_error(primitive, value, path))?.to_le_bytes())
        }};
    }
    match primitive {
        Primitive::F64 => put(bytes, &float()?.to_le_bytes()),
        Primitive::F32 => put(bytes, &single(float()?, path)?.to_le_bytes()),
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
fn single(number: f64, path: &str) -> Result<f32, String> {
    let single = number as f32;
    let words = || {
        format!("`{path}` is {number}, expected a number within {:e} of 0: it is single precision", f32::MAX)
    };
    single.is_finite().then_some(single).ok_or_else(words)
}

fn put(bytes: &mut [u8], number: &[u8]) {
    bytes[..number.len()].copy_from_slice(number);
}

fn integer_error(primitive: Primitive, value: &Value, path: &str) -> String {
    format!("`{path}` is {value}, expected an integer in the range of {}", primitive.ros_name())
}

fn size_of_kind(kind: &Kind) -> usize {
    match kind {
        Kind::Primitive(primitive) => match primitive {
            Primitive::F64 | Primitive::I64 | Primitive::U64 => 8,
            Primitive::F32 | Primitive::I32 | Primitive::U32 => 4,
            Primitive::I16 | Primitive::U16 => 2,
            Primitive::I8 | Primitive::U8 => 1,
        },
        Kind::Message(schema) => schema.size,
        Kind::Array(element, length) => length * size_of_kind(element),
        Kind::Text => 0,
    }
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
        let error = |value| sample(MotorCommand::SCHEMA, &value).unwrap_err();
        assert!(error(json!({"comand": 1})).contains("no field `comand`; the fields are stamp, command"));
        assert!(error(json!({"command": [1, 2]})).contains("expected an array of 4"));
        assert_eq!(single(1.5, "range"), Ok(1.5));
        assert!(
            single(1e39, "range").unwrap_err().contains("`range` is 1"),
            "an infinity in single precision"
        );
        assert!(error(json!({"stamp": {"nanosec": -1}})).contains("range of uint32"));
    }
}
