//! Values that are listed one by one: numbers, or texts and truth values.

use serde::{Deserialize, Serialize};
use std::fmt;
use toml::Value;

/// A list of values to choose from.
///
/// ```
/// use campaign::list::List;
/// let kinds: List = vec![toml::Value::from("pid"), "lqr".into()].try_into()?;
/// assert_eq!((kinds.len(), kinds.nth(1)), (2, 1.0));
/// assert!(List::try_from(vec![toml::Value::from("pid"), 3.0.into()]).is_err());
/// # Ok::<(), campaign::list::Mixed>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(try_from = "Vec<Value>", into = "Vec<Value>")]
pub enum List {
    /// Numbers.
    Numbers(Vec<f64>),
    /// Texts and truth values.
    Choices(Vec<Value>),
}

/// Error of a list with numbers beside other values, or with tables.
#[derive(Debug)]
pub struct Mixed;

impl fmt::Display for Mixed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected a list of numbers, or one of texts and truth values")
    }
}

impl std::error::Error for Mixed {}

impl TryFrom<Vec<Value>> for List {
    type Error = Mixed;

    fn try_from(values: Vec<Value>) -> Result<Self, Mixed> {
        let number =
            |value: &Value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
        if let Some(numbers) = values.iter().map(number).collect() {
            return Ok(Self::Numbers(numbers));
        }
        let is_choice = |value: &Value| value.is_str() || value.is_bool();
        if values.iter().all(is_choice) { Ok(Self::Choices(values)) } else { Err(Mixed) }
    }
}

impl From<Vec<f64>> for List {
    fn from(numbers: Vec<f64>) -> Self {
        Self::Numbers(numbers)
    }
}

impl From<List> for Vec<Value> {
    fn from(list: List) -> Self {
        match list {
            List::Numbers(numbers) => numbers.into_iter().map(Value::from).collect(),
            List::Choices(choices) => choices,
        }
    }
}

impl List {
    /// Number of the values.
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "an empty list is refused")]
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Choices(choices) => choices.len(),
        }
    }

    /// The numbers; none where others are listed.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        match self {
            Self::Numbers(numbers) => numbers,
            Self::Choices(_) => &[],
        }
    }

    /// The number that stands for value `index` in plan and rows: the value itself, or the index of another one.
    #[must_use]
    pub fn nth(&self, index: usize) -> f64 {
        match self {
            Self::Numbers(numbers) => numbers[index],
            Self::Choices(_) => index as f64,
        }
    }

    /// True if these numbers are whole.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.numbers().iter().all(|number| number.fract() == 0.0)
    }
}

/// A text or truth value as tables and reports show it: a text without quotes.
#[must_use]
pub fn shown(choice: &Value) -> String {
    choice.as_str().map_or_else(|| choice.to_string(), str::to_owned)
}
