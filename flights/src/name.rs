//! Names of numbers in logs, as a flights file writes them.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, Visitor};

/// Name of a column, a variable or a field; a column's number, from 1, as `#3`. A `-` in front negates the number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name {
    /// The name without its sign.
    pub plain: String,
    /// True if the number is negated.
    pub is_negated: bool,
}

impl Name {
    /// The factor of the sign.
    pub fn sign(&self) -> f64 {
        if self.is_negated { -1.0 } else { 1.0 }
    }
}

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        let plain = text.trim_start_matches('-');
        Self { plain: plain.to_owned(), is_negated: plain.len() < text.len() }
    }
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NameVisitor)
    }
}

struct NameVisitor;

impl Visitor<'_> for NameVisitor {
    type Value = Name;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a name, or the number of a column from 1")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Name, E> {
        Ok(text.into())
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Name, E> {
        match number {
            0 => Err(E::invalid_value(serde::de::Unexpected::Signed(0), &self)),
            _ => Ok(Name { plain: format!("#{}", number.unsigned_abs()), is_negated: number < 0 }),
        }
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Name, E> {
        self.visit_i64(i64::try_from(number).unwrap_or(i64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize)]
    struct Entry {
        columns: Vec<Name>,
    }

    #[test]
    fn columns_are_named_by_text_or_number() {
        let entry: Entry = toml::from_str("columns = [\"a\", \"-b\", 3, -4, \"#5\", \"-#6\"]").unwrap();
        let read: Vec<_> = entry.columns.iter().map(|name| (name.plain.as_str(), name.sign())).collect();
        assert_eq!(read, [("a", 1.0), ("b", -1.0), ("#3", 1.0), ("#4", -1.0), ("#5", 1.0), ("#6", -1.0)]);
        for text in ["columns = [0]", "columns = [1.5]", "columns = [true]"] {
            assert!(toml::from_str::<Entry>(text).is_err(), "{text}");
        }
    }
}
