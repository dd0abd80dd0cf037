//! The text of a vehicle file, with a comment on each line about the source of its number.

use diagnostics::{printable_line, shortened};
use std::fmt::Write as _;

/// Begin of every vehicle file that is made from a model.
pub const MARK: &str = "# Made from ";
/// Names of links in one comment.
const NAMES_MAX: usize = 4;
/// Characters of a name of the model in a comment.
const NAME_CHARS_MAX: usize = 60;
/// Entries that are smaller than this, relative to the largest, are rounding.
const ROUNDING: f64 = 1e-12;

/// Origin of a number.
pub enum Origin {
    /// The model; with the place in it.
    Model(String),
    /// A choice that needs no measurement; with its name.
    Chosen(String),
    /// Not the model: the reference vehicle, or a choice; with the reason.
    Assumed(String),
}

/// A vehicle file as it grows.
pub struct Text {
    /// Name of the model's file.
    file: String,
    /// The lines so far.
    pub text: String,
    /// Numbers that the model does not have, each with the reason.
    pub assumed: Vec<String>,
    table: String,
}

impl Text {
    /// A file without numbers.
    pub fn new(file: &str, name: &str) -> Self {
        let file = plain(file);
        let text = format!(
            "{MARK}{file} by `hummingbus new vehicle`. Numbers that are \"not in {file}\" are to be measured.\n\
             # Body frame: x forward, y left, z up, from the centre of mass. Keys: docs/vehicles.md.\n\nname = {}\n",
            quoted(&plain(name))
        );
        Self { file, text, assumed: Vec::new(), table: String::new() }
    }

    /// Begins a table; `key` is its name in the list of assumed numbers.
    pub fn table(&mut self, header: &str, key: &str) {
        self.push(&format!("\n{header}\n"));
        self.table = key.to_owned();
    }

    /// A line of text.
    pub fn line(&mut self, line: &str, origin: &Origin) {
        let comment = self.comment(line.split(' ').next().unwrap_or_default(), origin);
        self.push(&format!("{line} # {comment}\n"));
    }

    /// A number with its unit.
    pub fn number(&mut self, key: &str, value: &str, unit: &str, origin: &Origin) {
        let source = self.source(origin);
        let unit = quoted(unit);
        let table = format!(
            "{key} = {{ value = {value}, unit = {unit}, source = {source}, uncertainty = \"not stated\" }}"
        );
        self.line(&table, origin);
    }

    /// A sense of rotation: +1 is counter-clockwise seen from above.
    pub fn spin(&mut self, spin: f64, origin: &Origin) {
        let value = if spin > 0.0 { "counter-clockwise" } else { "clockwise" };
        let source = self.source(origin);
        self.line(&format!("spin = {{ value = {}, source = {source} }}", quoted(value)), origin);
    }

    fn source(&self, origin: &Origin) -> String {
        match origin {
            Origin::Model(_) => quoted(&self.file),
            Origin::Chosen(name) => quoted(name),
            Origin::Assumed(why) => quoted(&format!("not measured: {why}")),
        }
    }

    fn comment(&mut self, key: &str, origin: &Origin) -> String {
        match origin {
            Origin::Model(place) => format!("from {}: {place}", self.file),
            Origin::Chosen(name) => format!("chosen: {name}"),
            Origin::Assumed(why) => {
                self.assumed.push(format!("{}.{key}: {why}", self.table));
                let advice = if why.starts_with("the Hummingbird") { "measure it" } else { "check it" };
                format!("not in {}: {why}; {advice}", self.file)
            }
        }
    }

    fn push(&mut self, text: &str) {
        // Writing to a string does not fail.
        let _ = self.text.write_str(text);
    }
}

/// A name of the model within a comment or a text.
pub fn plain(name: &str) -> String {
    printable_line(&shortened(name, NAME_CHARS_MAX)).into_owned()
}

/// A text in TOML.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// Names in one comment.
pub fn listed(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(NAMES_MAX).map(|name| plain(name)).collect();
    let word = if names.len() == 1 { "link" } else { "links" };
    match names.len().saturating_sub(NAMES_MAX) {
        0 => format!("{word} {}", shown.join(", ")),
        more => format!("{word} {} and {more} more", shown.join(", ")),
    }
}

/// A number to ten digits; 0 if it is rounding beside `scale`.
pub fn digits(value: f64, scale: f64) -> String {
    if value.abs() <= ROUNDING * scale {
        return "0".to_owned();
    }
    let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

#[cfg(test)]
mod tests {
    use super::{digits, listed, quoted};

    #[test]
    fn numbers_keep_ten_digits_and_texts_stay_one_line() {
        assert_eq!(digits(0.1 + 0.2, 1.0), "0.3");
        assert_eq!(digits(5.6e-17, 0.17), "0");
        assert_eq!(digits(1.23e-9, 1.23e-9), "1.23e-9");
        assert_eq!(quoted("a\"b"), "'a\"b'");
        let names: Vec<String> = (0..6).map(|k| format!("l{k}\n")).collect();
        assert_eq!(listed(&names), "links l0\\n, l1\\n, l2\\n, l3\\n and 2 more");
    }
}
