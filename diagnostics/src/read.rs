//! Reads a component's parameters from JSON, so that an error carries its key and what was expected there.

use crate::parameter::ParameterError;
use serde::de::value::{MapAccessDeserializer, MapDeserializer, SeqDeserializer, StrDeserializer};
use serde::de::{self, DeserializeOwned, IntoDeserializer, Visitor};
use serde::{Deserializer, forward_to_deserialize_any};
use serde_json::Value;
use std::fmt::Display;

/// Reads `parameters` as a `P`.
///
/// # Errors
/// The first that is missing, unknown or of another type than `P` has there.
///
/// ```
/// #[derive(Debug, serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Gains {
///     roll: f64,
/// }
///
/// let read = |text| diagnostics::read::<Gains>(&serde_json::from_str(text).unwrap());
/// assert_eq!(read(r#"{ "roll": 2.0 }"#).unwrap().roll, 2.0);
/// let error = read(r#"{ "roll": "two" }"#).unwrap_err();
/// assert_eq!((error.key(), error.to_string().as_str()), ("roll", "`roll` must be f64, found string \"two\""));
/// let error = read(r#"{ "rol": 2.0 }"#).unwrap_err();
/// assert_eq!((error.key(), error.to_string().as_str()), ("rol", "unknown field `rol`, expected `roll`"));
/// ```
pub fn read<P: DeserializeOwned>(parameters: &Value) -> Result<P, ParameterError> {
    serde_path_to_error::deserialize(Json(parameters)).map_err(|error| {
        let path = error.path().to_string();
        let error = error.into_inner();
        // The path of an unknown key ends in it already.
        match path.as_str() {
            "." => error,
            path if matches!(error, ParameterError::Unknown { .. }) => {
                path.rsplit_once('.').map_or(error.clone(), |(table, _)| error.within(table))
            }
            path => error.within(path),
        }
    })
}

/// A value on its way into a type.
struct Json<'v>(&'v Value);

impl<'de> Deserializer<'de> for Json<'de> {
    type Error = ParameterError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ParameterError> {
        match self.0 {
            Value::Null => visitor.visit_unit(),
            Value::Bool(flag) => visitor.visit_bool(*flag),
            Value::Number(number) => match (number.as_u64(), number.as_i64()) {
                (Some(number), _) => visitor.visit_u64(number),
                (None, Some(number)) => visitor.visit_i64(number),
                (None, None) => visitor.visit_f64(number.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Array(items) => {
                let mut items = SeqDeserializer::new(items.iter().map(Json));
                let value = visitor.visit_seq(&mut items)?;
                items.end()?;
                Ok(value)
            }
            Value::Object(table) => {
                let entries = table.iter().map(|(key, value)| (key.as_str(), Json(value)));
                let mut entries = MapDeserializer::new(entries);
                let value = visitor.visit_map(&mut entries)?;
                entries.end()?;
                Ok(value)
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ParameterError> {
        if self.0.is_null() { visitor.visit_none() } else { visitor.visit_some(self) }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, ParameterError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ParameterError> {
        match self.0 {
            Value::String(variant) => {
                let variant: StrDeserializer<'_, ParameterError> = variant.as_str().into_deserializer();
                variant.deserialize_enum(name, variants, visitor)
            }
            Value::Object(table) => {
                let entries = table.iter().map(|(key, value)| (key.as_str(), Json(value)));
                MapAccessDeserializer::new(MapDeserializer::new(entries))
                    .deserialize_enum(name, variants, visitor)
            }
            other => Err(ParameterError::value("", "a string", other)),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

impl<'v> IntoDeserializer<'v, ParameterError> for Json<'v> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

/// What serde has to say, with the key that it is about; [`read`] puts the tables on the way in front.
impl de::Error for ParameterError {
    fn custom<T: Display>(message: T) -> Self {
        Self::conflict("", message)
    }

    fn invalid_type(found: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::value("", expected.to_string(), found)
    }

    fn invalid_value(found: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::value("", expected.to_string(), found)
    }

    fn invalid_length(length: usize, expected: &dyn de::Expected) -> Self {
        Self::value("", expected.to_string(), format_args!("a list of {length}"))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self::value("", format!("one of `{}`", expected.join("`, `")), format_args!("`{variant}`"))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let known = expected.iter().map(|key| (*key).to_owned()).collect();
        Self::Unknown { key: field.to_owned(), known }
    }

    fn missing_field(field: &'static str) -> Self {
        Self::Missing { key: field.to_owned() }
    }
}
