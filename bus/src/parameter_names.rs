//! The names of a component's parameters, as the type that they are read into declares them.

use serde::de::{DeserializeOwned, Deserializer, Error as _, Visitor, value::Error};
use serde::forward_to_deserialize_any;

/// The fields of `P`; empty if it is not a struct.
pub(crate) fn of<P: DeserializeOwned>() -> &'static [&'static str] {
    let mut names: &'static [&'static str] = &[];
    // Refused in any case: it has named its fields by then.
    let _ = P::deserialize(Question(&mut names));
    names
}

/// Receives the request of a type for its fields, and gives it nothing.
struct Question<'a>(&'a mut &'static [&'static str]);

impl<'de> Deserializer<'de> for Question<'_> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom("there is nothing to read"))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        *self.0 = fields;
        self.deserialize_any(visitor)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::of;

    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "only its fields' names are read")]
    struct Parameters {
        mass_kg: f64,
        #[serde(default)]
        gains: Vec<f64>,
        #[serde(rename = "at")]
        time_s: Option<f64>,
    }

    #[test]
    fn a_struct_tells_the_names_that_it_reads() {
        assert_eq!(of::<Parameters>(), ["mass_kg", "gains", "at"]);
        assert!(of::<()>().is_empty());
        assert!(of::<std::collections::BTreeMap<String, f64>>().is_empty());
    }
}
