//! Keys that say how a CSV file is written, where the file does not show it.

use serde::Deserialize;

/// Form of a CSV file. Absent keys are found from the file.
///
/// ```
/// let dialect: vehicles::table::Dialect = toml::from_str("header_line = 4\ndelimiter = \";\"\ndecimal = \",\"").unwrap();
/// assert_eq!(dialect.header_line, Some(4));
/// let error = toml::from_str::<vehicles::table::Dialect>("delimiter = \"ab\"").unwrap_err();
/// assert!(error.to_string().contains("one character"));
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dialect {
    /// Line of the header, from 1.
    pub header_line: Option<u64>,
    /// False for a file without a header.
    pub header: Option<bool>,
    /// Delimiter between cells.
    pub delimiter: Option<Delimiter>,
    /// Mark between the whole part of a number and its fraction.
    pub decimal: Option<Decimal>,
}

/// Delimiter between cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Delimiter {
    /// A character of one byte.
    Byte(u8),
    /// One or more blanks or tabs.
    Blanks,
}

impl TryFrom<String> for Delimiter {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        match text.as_bytes() {
            b" " => Ok(Self::Blanks),
            [byte] if Self::is_possible(*byte) => Ok(Self::Byte(*byte)),
            _ => Err(
                "one character that is no part of a number, such as \",\", \";\", \"\\t\", \"|\" or \" \"",
            ),
        }
    }
}

impl Delimiter {
    /// True for a byte that can stand between cells.
    pub fn is_possible(byte: u8) -> bool {
        byte == b'\t' || byte.is_ascii_punctuation() && !matches!(byte, b'"' | b'.' | b'+' | b'-')
    }
}

/// Mark between the whole part of a number and its fraction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum Decimal {
    /// `1.5`
    #[serde(rename = ".")]
    Point,
    /// `1,5`
    #[serde(rename = ",")]
    Comma,
}

impl Decimal {
    /// Returns the number in a cell.
    pub fn number(self, cell: &str) -> Option<f64> {
        match self {
            Self::Point => parsed(cell),
            Self::Comma if cell.contains('.') => None,
            Self::Comma => parsed(&cell.replacen(',', ".", 1)),
        }
    }
}

/// The minus sign of Unicode. Programs write it in Swedish, Norwegian, Finnish and other languages.
const MINUS: char = '\u{2212}';

/// Returns the number in a cell with a decimal point. Its minus signs are hyphens or those of Unicode.
fn parsed(cell: &str) -> Option<f64> {
    let number = cell.parse().ok();
    number
        .or_else(|| cell.contains(MINUS).then(|| cell.replace(MINUS, "-")).and_then(|cell| cell.parse().ok()))
}

/// Returns the number in a cell, whichever mark it has.
pub fn number(cell: &str) -> Option<f64> {
    Decimal::Point.number(cell).or_else(|| Decimal::Comma.number(cell))
}

/// True for a number with a comma in it that could also stand between thousands, as `12,345`.
pub fn is_group(cell: &str) -> bool {
    let digits = cell.trim_start_matches(['+', '-', MINUS]);
    digits.split_once(',').is_some_and(|(whole, rest)| {
        let is_digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
        (1..=3).contains(&whole.len())
            && !whole.starts_with('0')
            && rest.len() == 3
            && is_digits(whole)
            && is_digits(rest)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_one_mark() {
        for (cell, point, comma) in [
            ("1.5", Some(1.5), None),
            ("1,5", None, Some(1.5)),
            ("-0,25e-3", None, Some(-0.25e-3)),
            ("4", Some(4.0), Some(4.0)),
            ("\u{2212}1.5", Some(-1.5), None),
            ("\u{2212}2,5e\u{2212}1", None, Some(-0.25)),
            ("\u{2212}", None, None),
            ("1,234,5", None, None),
            ("1.234,5", None, None),
            ("", None, None),
        ] {
            assert_eq!((Decimal::Point.number(cell), Decimal::Comma.number(cell)), (point, comma), "{cell}");
        }
        assert!(["1,234", "-12,345", "+123,456", "\u{2212}1,234"].into_iter().all(is_group));
        assert!(!["0,123", "1,23", "1,2345", "1234,567", "1.234", ",123"].into_iter().any(is_group));
    }

    #[test]
    fn delimiters_are_no_parts_of_numbers() {
        for text in ["", "ab", "1", "a", ".", "-", "\"", "\n", "°"] {
            assert!(Delimiter::try_from(text.to_owned()).is_err(), "{text:?}");
        }
        assert_eq!(Delimiter::try_from("|".to_owned()), Ok(Delimiter::Byte(b'|')));
        assert_eq!(Delimiter::try_from(" ".to_owned()), Ok(Delimiter::Blanks));
    }
}
