//! Reads types from JSON and TOML, so that an error carries its key, its place and the expected value.

use crate::diagnostic::Diagnostic;
use crate::parameter::ParameterError;
use crate::place::Place;
use serde::de::value::{BorrowedStrDeserializer, MapAccessDeserializer};
use serde::de::{self, DeserializeOwned, DeserializeSeed, IntoDeserializer, Unexpected, Visitor};
use serde::{Deserializer, forward_to_deserialize_any};
use serde_json::Value;
use serde_spanned::Spanned;
use serde_spanned::de::{SpannedDeserializer, is_spanned};
use std::fmt::Display;
use std::ops::Range;
use toml::de::{DeString, DeTable, DeValue};

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
/// assert_eq!((error.key(), error.to_string().as_str()), ("roll", "`roll` must be a number, found the text \"two\""));
/// let error = read(r#"{ "rol": 2.0 }"#).unwrap_err();
/// assert_eq!((error.key(), error.to_string().as_str()), ("rol", "unknown key `rol`, expected `roll`"));
/// ```
pub fn read<P: DeserializeOwned>(parameters: &Value) -> Result<P, ParameterError> {
    P::deserialize(Tree::of_json(parameters)).map_err(|misread| misread.error)
}

/// Reads the TOML `text` of `file` as a `T`.
///
/// # Errors
/// The first place where it is not TOML, or does not hold the value that `T` has there.
///
/// ```
/// #[derive(Debug, serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Run {
///     seed: u64,
/// }
///
/// let error = diagnostics::read_toml::<Run>("a.toml", "seed = 1\nsede = 2").unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "a.toml:2:1: unknown key `sede`, expected `seed`\n  help: did you mean `seed`?"
/// );
/// let error = diagnostics::read_toml::<Run>("a.toml", "seed = 'x'").unwrap_err();
/// assert_eq!(error.to_string().lines().next(), Some("a.toml:1:8: `seed` must be a whole number, at least 0, found the text \"x\""));
/// ```
pub fn read_toml<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, Diagnostic> {
    let misread = |misread: Misread| Diagnostic::at(misread.place(file, text), misread.error);
    let table = parse_toml(text).map_err(misread)?;
    let span = table.span();
    read_tree(&Spanned::new(span, DeValue::Table(table.into_inner()))).map_err(misread)
}

/// Parses `text`.
///
/// # Errors
/// The place at which it is not TOML, and the reason.
pub fn parse_toml(text: &str) -> Result<Spanned<DeTable<'_>>, Misread> {
    DeTable::parse(text).map_err(|error| {
        let span = error.span();
        if error.message() == DUPLICATE_KEY
            && let Some(second) = &span
        {
            return duplicate(text, second);
        }
        let why = match error.message().trim() {
            // TOML takes anything that it cannot read for text without quotes.
            why if why.starts_with("string values must be quoted") => {
                "this is neither a number, a text in quotes, true, false, a list nor a table"
            }
            why => why,
        };
        Misread { error: format!("not valid TOML: {why}").into(), span, first: None }
    })
}

/// Message of the parser for a key that its table has already.
const DUPLICATE_KEY: &str = "duplicate key";

/// The error of the key at `second`, which its table has already.
fn duplicate(text: &str, second: &Range<usize>) -> Misread {
    let key = text.get(second.clone()).unwrap_or_default();
    let first = first_of(text, second, key.trim_matches(['"', '\'']));
    let message = match &first {
        Some(first) => {
            let line = Place::of("", text, first).line;
            format!("not valid TOML: the key `{key}` is there twice, first in line {line}")
        }
        None => format!("not valid TOML: the key `{key}` is there twice"),
    };
    Misread { error: message.into(), span: Some(second.clone()), first }
}

/// Place of the first key `name` in the table that has it again at `second`.
fn first_of(text: &str, second: &Range<usize>, name: &str) -> Option<Range<usize>> {
    // Under another name of the same length the second one finds its place in the tree, beside the first.
    let other = "z".repeat(second.len());
    let renamed = format!("{}{other}{}", text.get(..second.start)?, text.get(second.end..)?);
    let (tree, _) = DeTable::parse_recoverable(&renamed);
    let first = beside(tree.get_ref(), second, name)?;
    (first.start < second.start).then_some(first)
}

/// Place of the key `name` in the table that has a key at `span`.
fn beside(table: &DeTable<'_>, span: &Range<usize>, name: &str) -> Option<Range<usize>> {
    if table.keys().any(|key| key.span() == *span) {
        return table.get_key_value(name).map(|(key, _)| key.span());
    }
    table.values().find_map(|value| beside_in(value, span, name))
}

fn beside_in(value: &Spanned<DeValue<'_>>, span: &Range<usize>, name: &str) -> Option<Range<usize>> {
    match value.get_ref() {
        DeValue::Table(table) => beside(table, span, name),
        DeValue::Array(items) => items.iter().find_map(|item| beside_in(item, span, name)),
        _ => None,
    }
}

/// Reads a part of a TOML file as a `T`.
///
/// # Errors
/// The first place where it does not hold the value that `T` has there.
///
/// ```
/// let table = diagnostics::parse_toml("wheel = { radius_m = true }").unwrap();
/// let wheel = &table.get_ref()["wheel"];
/// let misread = diagnostics::read_tree::<std::collections::BTreeMap<String, f64>>(wheel).unwrap_err();
/// assert_eq!((misread.error.key(), misread.span()), ("radius_m", 21..25));
/// ```
pub fn read_tree<T: DeserializeOwned>(tree: &Spanned<DeValue<'_>>) -> Result<T, Misread> {
    T::deserialize(Tree::of_toml(tree))
}

/// A value that the type to be read does not accept.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{error}")]
pub struct Misread {
    /// The key, the expected value and the value that was found.
    pub error: ParameterError,
    span: Option<Range<usize>>,
    /// Bytes of an earlier place that belongs to the error, such as the first of two equal keys.
    first: Option<Range<usize>>,
}

impl Misread {
    /// Returns the bytes of the text that are to blame; the very first where none are in particular.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.span.clone().unwrap_or(0..0)
    }

    /// True for a key that the table does not have: without it the rest can be read.
    #[must_use]
    pub fn is_unknown_key(&self) -> bool {
        matches!(self.error, ParameterError::Unknown { .. })
    }

    /// True for a key that is needed and not there.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self.error, ParameterError::Missing { .. })
    }

    /// Returns the bytes of an earlier place that belongs to the error, such as the first of two equal keys.
    #[must_use]
    pub fn first(&self) -> Option<Range<usize>> {
        self.first.clone()
    }

    /// Returns the place in the `text` of `file`.
    #[must_use]
    pub fn place(&self, file: &str, text: &str) -> Place {
        let place = Place::of(file, text, &self.span());
        match &self.first {
            Some(first) => place.after(text, first),
            None => place,
        }
    }

    /// The same in a text that begins at byte `base` of a longer one.
    #[must_use]
    pub fn shifted(self, base: usize) -> Self {
        let shifted = |span: Range<usize>| base + span.start..base + span.end;
        Self { span: Some(shifted(self.span())), first: self.first.map(shifted), ..self }
    }

    /// The same error, in the table `table`.
    #[must_use]
    pub fn within(self, table: &str) -> Self {
        Self { error: self.error.within(table), ..self }
    }

    fn at(self, span: Option<Range<usize>>) -> Self {
        Self { span: self.span.or(span), ..self }
    }
}

/// A value on its way into a type, and where it stands.
struct Tree<'v> {
    shape: Shape<'v>,
    span: Option<Range<usize>>,
}

/// Shape of a value, in either language.
enum Shape<'v> {
    Null,
    Bool(bool),
    Unsigned(u64),
    Signed(i64),
    Float(f64),
    Text(&'v str),
    /// A value that no type is read from.
    Other(&'static str),
    List(Vec<Tree<'v>>),
    Table(Vec<Entry<'v>>),
}

/// A value in a table, with its key and where that stands.
type Entry<'v> = (&'v str, Option<Range<usize>>, Tree<'v>);

impl<'v> Tree<'v> {
    fn of_json(value: &'v Value) -> Self {
        let entry = |(key, value): (&'v String, &'v Value)| (key.as_str(), None, Self::of_json(value));
        let shape = match value {
            Value::Null => Shape::Null,
            Value::Bool(flag) => Shape::Bool(*flag),
            Value::Number(number) => match (number.as_u64(), number.as_i64()) {
                (Some(number), _) => Shape::Unsigned(number),
                (None, Some(number)) => Shape::Signed(number),
                (None, None) => Shape::Float(number.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => Shape::Text(text),
            Value::Array(items) => Shape::List(items.iter().map(Self::of_json).collect()),
            Value::Object(table) => Shape::Table(table.iter().map(entry).collect()),
        };
        Self { shape, span: None }
    }

    fn of_toml(value: &'v Spanned<DeValue<'v>>) -> Self {
        let entry = |(key, value): (&'v Spanned<DeString<'v>>, _)| {
            (key.get_ref().as_ref(), Some(key.span()), Self::of_toml(value))
        };
        let shape = match value.get_ref() {
            DeValue::Boolean(flag) => Shape::Bool(*flag),
            DeValue::Integer(number) => {
                let (digits, radix) = (number.as_str(), number.radix());
                match (u64::from_str_radix(digits, radix), i64::from_str_radix(digits, radix)) {
                    (Ok(number), _) => Shape::Unsigned(number),
                    (Err(_), Ok(number)) => Shape::Signed(number),
                    (Err(_), Err(_)) => Shape::Other("an integer of more than 64 bits"),
                }
            }
            DeValue::Float(number) => {
                number.as_str().parse().map_or(Shape::Other("a number that is none"), Shape::Float)
            }
            DeValue::String(text) => Shape::Text(text),
            DeValue::Datetime(_) => Shape::Other("a date or time"),
            DeValue::Array(items) => Shape::List(items.iter().map(Self::of_toml).collect()),
            DeValue::Table(table) => Shape::Table(table.iter().map(entry).collect()),
        };
        Self { shape, span: Some(value.span()) }
    }
}

impl<'v> Shape<'v> {
    /// The value as it stands in a file.
    fn seen(&self) -> String {
        seen(match self {
            Self::Null => Unexpected::Unit,
            Self::Bool(flag) => Unexpected::Bool(*flag),
            Self::Unsigned(number) => Unexpected::Unsigned(*number),
            Self::Signed(number) => Unexpected::Signed(*number),
            Self::Float(number) => Unexpected::Float(*number),
            Self::Text(text) => Unexpected::Str(text),
            Self::Other(what) => Unexpected::Other(what),
            Self::List(_) => Unexpected::Seq,
            Self::Table(_) => Unexpected::Map,
        })
    }

    fn visit<V: Visitor<'v>>(self, visitor: V) -> Result<V::Value, Misread> {
        match self {
            Self::Null => visitor.visit_unit(),
            Self::Bool(flag) => visitor.visit_bool(flag),
            Self::Unsigned(number) => visitor.visit_u64(number),
            Self::Signed(number) => visitor.visit_i64(number),
            Self::Float(number) => visitor.visit_f64(number),
            Self::Text(text) => visitor.visit_borrowed_str(text),
            Self::Other(what) => Err(de::Error::invalid_type(Unexpected::Other(what), &visitor)),
            Self::Table(entries) => visitor.visit_map(Entries::of(entries)),
            Self::List(items) => {
                let count = items.len();
                let mut items = Items(items.into_iter().enumerate());
                let value = visitor.visit_seq(&mut items)?;
                match items.0.len() {
                    0 => Ok(value),
                    left => {
                        Err(de::Error::invalid_length(count, &format!("a list of {}", count - left).as_str()))
                    }
                }
            }
        }
    }
}

impl<'de> Deserializer<'de> for Tree<'de> {
    type Error = Misread;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misread> {
        self.shape.visit(visitor).map_err(|misread| misread.at(self.span))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misread> {
        match self.shape {
            Shape::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Misread> {
        let span = self.span.clone();
        visitor.visit_newtype_struct(self).map_err(|misread| misread.at(span))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misread> {
        if is_spanned(name) {
            let span = self.span.clone().unwrap_or(0..0);
            return visitor.visit_map(SpannedDeserializer::new(self, span));
        }
        self.deserialize_any(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misread> {
        match self.shape {
            Shape::Text(variant) => {
                BorrowedStrDeserializer::new(variant).deserialize_enum(name, variants, visitor)
            }
            Shape::Table(entries) if entries.len() == 1 => {
                MapAccessDeserializer::new(Entries::of(entries)).deserialize_enum(name, variants, visitor)
            }
            Shape::Table(_) => Err(de::Error::custom("expected a table with one key, the variant's name")),
            shape => {
                let expected = format!("one of `{}`", variants.join("`, `"));
                Err(ParameterError::value("", expected, shape.seen()).into())
            }
        }
        .map_err(|misread: Misread| misread.at(self.span))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

impl<'v> IntoDeserializer<'v, Misread> for Tree<'v> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

/// The entries of a table on their way into a type.
struct Entries<'v> {
    rest: std::vec::IntoIter<Entry<'v>>,
    /// The one whose key is read and whose value is not.
    open: Option<(&'v str, Tree<'v>)>,
}

impl<'v> Entries<'v> {
    fn of(entries: Vec<Entry<'v>>) -> Self {
        Self { rest: entries.into_iter(), open: None }
    }
}

impl<'v> de::MapAccess<'v> for Entries<'v> {
    type Error = Misread;

    fn next_key_seed<K: DeserializeSeed<'v>>(&mut self, seed: K) -> Result<Option<K::Value>, Misread> {
        let Some((key, span, value)) = self.rest.next() else { return Ok(None) };
        self.open = Some((key, value));
        let read = seed.deserialize(Tree { shape: Shape::Text(key), span: span.clone() });
        read.map(Some).map_err(|misread| misread.at(span))
    }

    fn next_value_seed<S: DeserializeSeed<'v>>(&mut self, seed: S) -> Result<S::Value, Misread> {
        let (key, value) = self.open.take().expect("the key of an entry is read before its value");
        let span = value.span.clone();
        seed.deserialize(value).map_err(|misread| misread.at(span).within(key))
    }
}

/// The elements of a list on their way into a type.
struct Items<'v>(std::iter::Enumerate<std::vec::IntoIter<Tree<'v>>>);

impl<'v> de::SeqAccess<'v> for Items<'v> {
    type Error = Misread;

    fn next_element_seed<S: DeserializeSeed<'v>>(&mut self, seed: S) -> Result<Option<S::Value>, Misread> {
        let Some((index, item)) = self.0.next() else { return Ok(None) };
        let span = item.span.clone();
        seed.deserialize(item).map(Some).map_err(|misread| misread.at(span).within(&index.to_string()))
    }
}

impl From<ParameterError> for Misread {
    fn from(error: ParameterError) -> Self {
        Self { error, span: None, first: None }
    }
}

/// Errors of serde, with the key that they are about; the tables on the way are put in front on the way out.
impl de::Error for Misread {
    fn custom<T: Display>(message: T) -> Self {
        ParameterError::conflict("", message).into()
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        ParameterError::value("", in_words(expected), seen(found)).into()
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn de::Expected) -> Self {
        ParameterError::value("", in_words(expected), format_args!("a list of {length}")).into()
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let expected = format!("one of `{}`", expected.join("`, `"));
        ParameterError::value("", expected, format_args!("`{variant}`")).into()
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        ParameterError::unknown(field, expected.iter().copied()).into()
    }

    fn missing_field(field: &'static str) -> Self {
        ParameterError::missing(field, "").into()
    }
}

/// Plain name of a type.
fn in_words(expected: &dyn de::Expected) -> String {
    let name = expected.to_string();
    match name.as_str() {
        "f32" | "f64" => "a number".to_owned(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, at least 0".to_owned(),
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".to_owned(),
        "a string" => "a text".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a map" => "a table".to_owned(),
        "a sequence" => "a list".to_owned(),
        other if other.starts_with("struct ") => "a table".to_owned(),
        other => match other.strip_prefix("an array of length ") {
            Some(length) => format!("a list of {length}"),
            None => name,
        },
    }
}

/// A value as it stands in a file.
fn seen(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(flag) => flag.to_string(),
        Unexpected::Unsigned(number) => number.to_string(),
        Unexpected::Signed(number) => number.to_string(),
        // With its decimal point: 3.0 is no whole number.
        Unexpected::Float(number) => format!("{number:?}"),
        Unexpected::Str(text) => format!("the text {text:?}"),
        Unexpected::Map => "a table".to_owned(),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Unit | Unexpected::Option => "nothing".to_owned(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::{read, read_toml};
    use std::collections::BTreeMap;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Wheel {
        #[serde(rename = "radius_m")]
        _radius_m: f64,
    }

    type Wheels = BTreeMap<String, Vec<Wheel>>;

    fn refused(text: &str) -> (String, String) {
        let in_toml = read_toml::<Wheels>("a.toml", text).unwrap_err();
        let json: serde_json::Value = toml::from_str(text).unwrap();
        assert_eq!(read::<Wheels>(&json).unwrap_err(), in_toml.error, "alike in both languages");
        let place = in_toml.place.as_ref().unwrap();
        (format!("{}:{}", place.line, place.column), in_toml.error.to_string())
    }

    #[test]
    fn an_error_has_the_whole_key_and_its_place() {
        let told = |text| {
            let (place, error) = refused(text);
            format!("{place} {error}")
        };
        assert_eq!(
            told("[[a]]\nradius_m = 'x'"),
            "2:12 `a.0.radius_m` must be a number, found the text \"x\""
        );
        assert_eq!(told("[[a]]\nradius_m = 1\n[[a]]"), "3:1 missing key `a.1.radius_m`");
        assert_eq!(told("a = 3"), "1:5 `a` must be a list, found 3");
    }

    #[test]
    fn a_key_that_is_there_twice_is_shown_at_both_places() {
        for (text, places) in [
            ("a = 1\nb = 2\na = 3", "3:1 1"),
            ("[p.q]\nx = 1\n\n[p.r]\nx = 1\n[p.q]\ny = 1", "6:4 1"),
            ("a = { b = 1, c = 2, b = 3 }", "1:21 1"),
            ("[[l]]\nx = 1\n[[l]]\ny = 1\n'y' = 2\n", "5:1 4"),
            ("[t]\na.b = 1\na.b = 2\n", "3:3 2"),
        ] {
            let error = read_toml::<Wheels>("a.toml", text).unwrap_err();
            let place = error.place.as_ref().unwrap();
            let (shown, told) = (format!("{error:#}"), error.error.to_string());
            let first = told.rsplit(' ').next().unwrap();
            assert_eq!(format!("{}:{} {first}", place.line, place.column), places, "{told}");
            assert!(told.contains("is there twice") && shown.contains("the first one"), "{shown}");
        }
    }

    #[test]
    fn a_choice_of_another_type_is_told_with_the_choices() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(rename_all = "lowercase")]
        enum Side {
            Left,
            Right,
        }
        let read = |text| read_toml::<BTreeMap<String, Side>>("a.toml", text);
        assert!(matches!(read("a = 'left'").unwrap()["a"], Side::Left));
        assert!(matches!(read("a = 'right'").unwrap()["a"], Side::Right));
        let error = read("a = 3").unwrap_err();
        assert_eq!(error.error.to_string(), "`a` must be one of `left`, `right`, found 3");
    }

    #[test]
    fn an_unknown_key_may_contain_a_dot() {
        let (place, error) = refused("[[a]]\n'b.c' = 1");
        assert_eq!((place.as_str(), error.as_str()), ("2:1", "unknown key `a.0.b.c`, expected `radius_m`"));
    }

    #[test]
    fn keys_and_values_know_their_places() {
        type Places = BTreeMap<toml::Spanned<String>, Option<toml::Spanned<u8>>>;
        let places = read_toml::<Places>("a.toml", "a = 1").unwrap();
        let (key, value) = places.first_key_value().unwrap();
        assert_eq!((key.span(), value.as_ref().unwrap().span()), (0..1, 4..5));
    }

    #[test]
    fn a_list_that_is_too_long_is_refused() {
        let error = read_toml::<BTreeMap<String, [f64; 2]>>("a.toml", "a = [1, 2, 3]").unwrap_err();
        assert_eq!(error.error.to_string(), "`a` must be a list of 2, found a list of 3");
    }

    #[test]
    fn what_is_no_toml_is_told_with_its_place() {
        let error = read_toml::<Wheels>("a.toml", "a = 1\nb = ").unwrap_err().to_string();
        assert!(error.starts_with("a.toml:2:5: not valid TOML: "), "{error}");
        let error = read_toml::<Wheels>("a.toml", "a = 1 2").unwrap_err().to_string();
        assert!(error.contains("this is neither a number"), "{error}");
    }
}
