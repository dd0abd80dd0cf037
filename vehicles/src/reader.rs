//! Walks the TOML tree of a vehicle file, keeps positions, and refuses every key that is not read.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::LazyLock;

use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::provenance::{NO_SOURCE, Provenance, Stated, Uncertainty};
use diagnostics::parameter::{Bounds, not_negative, positive};
use diagnostics::unit::Dimension;
use diagnostics::{Diagnostic, Faults, ParameterError, Place, leading_number, nearest, parse_toml};

/// The file being read: for positions, and to gather provenance on the way.
pub struct Document<'t> {
    file: &'t str,
    text: &'t str,
    /// Provenance of every number, in the order of reading.
    pub provenance: RefCell<Vec<Provenance>>,
}

impl<'t> Document<'t> {
    /// The file named `file` with this text.
    pub fn new(file: &'t str, text: &'t str) -> Self {
        Document { file, text, provenance: RefCell::default() }
    }

    /// Parses the text into its tree.
    pub fn tree(&self) -> Result<Spanned<DeTable<'t>>, Diagnostic> {
        parse_toml(self.text)
            .map_err(|misread| Diagnostic::at(misread.place(self.file, self.text), misread.error))
    }

    /// The place of the bytes `span`, for messages.
    pub fn place(&self, span: &Range<usize>) -> Place {
        Place::of(self.file, self.text, span)
    }

    /// The place of the bytes `span`, with the earlier place `first` that belongs to it.
    pub(crate) fn place_after(&self, span: &Range<usize>, first: &Range<usize>) -> Place {
        self.place(span).after(self.text, first)
    }

    /// An invalid value.
    pub fn bad(
        &self,
        at: &Range<usize>,
        key: &str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Diagnostic {
        Diagnostic::at(self.place(at), ParameterError::value(key, expected, found.into()))
    }
}

/// A number in SI, and where it stands in its file.
#[derive(Clone)]
pub struct Quantity<'d, 't> {
    /// The file.
    pub doc: &'d Document<'t>,
    /// The number, in SI.
    pub si: f64,
    /// The whole dotted key.
    pub key: String,
    /// Place of the number, in bytes.
    pub at: Range<usize>,
    unit: &'static str,
}

impl Quantity<'_, '_> {
    /// Refuses the number unless `holds`.
    pub fn require(self, holds: bool, expected: &str) -> Result<Self, Diagnostic> {
        if holds {
            Ok(self)
        } else {
            Err(self.doc.bad(&self.at, &self.key, expected, format!("{} {}", self.si, self.unit)))
        }
    }

    /// Refuses zero and less.
    pub fn positive(self) -> Result<Self, Diagnostic> {
        self.pass(positive)
    }

    /// Refuses a number outside of `bounds`.
    pub fn within(self, bounds: &Bounds) -> Result<Self, Diagnostic> {
        self.pass(|key, si| bounds.check(key, si))
    }

    /// Refuses less than zero.
    pub fn not_negative(self) -> Result<Self, Diagnostic> {
        self.pass(not_negative)
    }

    fn pass(self, check: impl Fn(&str, f64) -> Result<(), ParameterError>) -> Result<Self, Diagnostic> {
        match check(&self.key, self.si) {
            Ok(()) => Ok(self),
            Err(error) => Err(Diagnostic::at(self.doc.place(&self.at), error.in_unit(self.unit))),
        }
    }
}

/// Origin of a number: known of something that exists, or chosen.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Origin {
    Known,
    Chosen,
}

/// One table of the file; remembers which keys were asked for.
///
/// ```
/// use vehicles::reader::{Document, Section};
///
/// let doc = Document::new("a.toml", "name = 'a'\nnaem = 'b'");
/// let tree = doc.tree()?;
/// let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
/// assert_eq!(root.text("name")?, "a");
/// assert_eq!(root.finish().unwrap_err().key(), "naem");
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
pub struct Section<'d, 't> {
    /// The file.
    pub doc: &'d Document<'t>,
    /// The whole dotted key of the table; empty for the root.
    pub path: String,
    /// Place of the table, in bytes.
    pub at: Range<usize>,
    table: &'d DeTable<'t>,
    asked: RefCell<BTreeSet<&'d str>>,
    /// The table of the base, which has what this one has not.
    lower: Option<Box<Self>>,
    /// The value, where the file has it in place of a table: the rest is the base's.
    alone: Option<&'d Spanned<DeValue<'t>>>,
}

/// Key of the number in a parameter's table.
const VALUE: &str = "value";
/// The table of a parameter of which the file has the value alone.
static EMPTY: LazyLock<DeTable<'static>> = LazyLock::new(DeTable::new);

impl<'d, 't> Section<'d, 't> {
    /// The `table` at `path`.
    pub fn new(doc: &'d Document<'t>, path: String, at: Range<usize>, table: &'d DeTable<'t>) -> Self {
        Section { doc, path, at, table, asked: RefCell::default(), lower: None, alone: None }
    }

    /// This table on top of that of the base.
    #[must_use]
    pub(crate) fn above(self, lower: Self) -> Self {
        Section { lower: Some(Box::new(lower)), ..self }
    }

    /// The table that has `name`, if that is the base's.
    fn inherited(&self, name: &'d str) -> Option<&Self> {
        let lower = self.lower.as_deref()?;
        (self.find(name).is_none() && lower.has(name)).then_some(lower)
    }

    /// True if the number is of this table's file, not of its base.
    pub(crate) fn is_own(&self, number: &Quantity<'d, 't>) -> bool {
        std::ptr::eq(self.doc, number.doc)
    }

    /// The whole dotted key of `name` in this table.
    pub fn key(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    /// The value of `name`, if the file has it.
    fn find(&self, name: &'d str) -> Option<&'d Spanned<DeValue<'t>>> {
        self.asked.borrow_mut().insert(name);
        self.alone.filter(|_| name == VALUE).or_else(|| self.table.get(name))
    }

    pub(crate) fn need(&self, name: &'d str, expected: &str) -> Result<&'d Spanned<DeValue<'t>>, Diagnostic> {
        self.find(name).ok_or_else(|| {
            let missing = ParameterError::missing(self.key(name), expected);
            if self.path.is_empty() {
                let start = self.doc.place(&first_content(self.doc.text));
                Diagnostic::at(start, missing).help(format!("add {} to this file", shape(name, expected)))
            } else {
                Diagnostic::at(self.doc.place(&self.at), missing)
            }
        })
    }

    /// True if the file has `name`.
    pub fn has(&self, name: &'d str) -> bool {
        self.find(name).is_some() || self.inherited(name).is_some()
    }

    /// A sub-table.
    pub fn section(&self, name: &'d str) -> Result<Section<'d, 't>, Diagnostic> {
        if let Some(lower) = self.inherited(name) {
            return lower.section(name);
        }
        self.as_section(self.key(name), self.need(name, "a table")?, "a table")
    }

    fn as_section(
        &self,
        key: String,
        value: &'d Spanned<DeValue<'t>>,
        expected: &str,
    ) -> Result<Section<'d, 't>, Diagnostic> {
        match value.get_ref().as_table() {
            Some(table) => Ok(Section::new(self.doc, key, value.span(), table)),
            None => Err(self.wrong_type(&key, value, expected)),
        }
    }

    /// An array of tables; none where the file does not have `name`.
    pub fn sections_if_any(&self, name: &'d str) -> Result<Vec<Section<'d, 't>>, Diagnostic> {
        if self.has(name) { self.sections(name) } else { Ok(Vec::new()) }
    }

    /// An array of tables.
    pub fn sections(&self, name: &'d str) -> Result<Vec<Section<'d, 't>>, Diagnostic> {
        let value = self.need(name, "an array of tables")?;
        let Some(array) = value.get_ref().as_array() else {
            return Err(self.wrong_type(&self.key(name), value, "an array of tables"));
        };
        let key = |index| format!("{}.{index}", self.key(name));
        let tables =
            array.iter().enumerate().map(|(index, item)| self.as_section(key(index), item, "a table"));
        Diagnostic::gather(tables)
    }

    /// The names of all keys, in alphabetical order.
    pub(crate) fn keys(&self) -> impl Iterator<Item = &'d str> {
        self.table.keys().map(|key| key.get_ref().as_ref())
    }

    /// A text, not empty.
    pub fn text(&self, name: &'d str) -> Result<&'d str, Diagnostic> {
        if let Some(lower) = self.inherited(name) {
            return lower.text(name);
        }
        let value = self.need(name, "a text")?;
        match value.get_ref().as_str() {
            Some(text) if !text.trim().is_empty() => Ok(text),
            Some(_) => Err(self.doc.bad(&value.span(), &self.key(name), "a text", "an empty text")),
            None => Err(self.wrong_type(&self.key(name), value, "a text")),
        }
    }

    /// A text that has to be one of `choices`; returns the value beside it.
    pub fn choice<T: Copy>(&self, name: &'d str, choices: &[(&str, T)]) -> Result<T, Diagnostic> {
        if let Some(lower) = self.inherited(name) {
            return lower.choice(name, choices);
        }
        let text = self.text(name)?;
        if let Some((_, chosen)) = choices.iter().find(|(name, _)| *name == text) {
            return Ok(*chosen);
        }
        let names: Vec<_> = choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let expected = format!("one of {}", names.join(", "));
        let near = nearest(text, choices.iter().map(|(name, _)| *name));
        let help = near.map_or(String::new(), |near| format!("did you mean \"{near}\"?"));
        Err(self.doc.bad(&self.at_of(name), &self.key(name), expected, format!("\"{text}\"")).help(help))
    }

    /// True or false.
    pub(crate) fn flag(&self, name: &'d str) -> Result<bool, Diagnostic> {
        let value = self.need(name, "true or false")?;
        value.get_ref().as_bool().ok_or_else(|| self.wrong_type(&self.key(name), value, "true or false"))
    }

    /// A parameter: a table with `value`, `unit`, `source` and `uncertainty`; the value in SI.
    pub fn quantity(&self, name: &'d str, dimension: Dimension) -> Result<Quantity<'d, 't>, Diagnostic> {
        self.number_of(name, dimension, Origin::Known)
    }

    /// A parameter within `bounds`, in SI.
    pub fn bounded(&self, name: &'d str, dimension: Dimension, bounds: &Bounds) -> Result<f64, Diagnostic> {
        Ok(self.quantity(name, dimension)?.within(bounds)?.si)
    }

    /// A number that was chosen, such as a gain: as [`Self::quantity`], but it has an `uncertainty` only
    /// if the file has one.
    pub fn chosen(&self, name: &'d str, dimension: Dimension) -> Result<Quantity<'d, 't>, Diagnostic> {
        self.number_of(name, dimension, Origin::Chosen)
    }

    fn number_of(
        &self,
        name: &'d str,
        dimension: Dimension,
        origin: Origin,
    ) -> Result<Quantity<'d, 't>, Diagnostic> {
        let parameter = self.parameter(name).map_err(|fault| self.spelt_out(fault, name, dimension))?;
        let mut faults = Faults::default();
        let value = faults.keep(parameter.need("value", "a number"));
        let number = value.and_then(|value| faults.keep(parameter.number("value", value)));
        let factor = faults.keep(parameter.meta(dimension, origin));
        let (value, number, factor) = faults.finish((|| Some((value?, number?, factor?)))())?;
        let (doc, si, at, unit) = (parameter.doc, number * factor, value.span(), dimension.si());
        let quantity = Quantity { doc, si, key: parameter.path, at, unit };
        quantity.require(si.is_finite(), "a number that is finite in SI")
    }

    /// The fault of the parameter `name`, with a line to paste where the file has the number alone.
    fn spelt_out(&self, fault: Diagnostic, name: &'d str, dimension: Dimension) -> Diagnostic {
        match self.find(name).and_then(|found| number_alone(found, dimension)) {
            Some((value, unit)) => fault.help(format!(
                "write {name} = {{ value = {value}, unit = \"{unit}\", source = \"none\" }}, with its source if it has one"
            )),
            None => fault,
        }
    }

    /// A parameter whose value is an array of three numbers, each within `bounds`.
    pub fn vector(
        &self,
        name: &'d str,
        dimension: Dimension,
        bounds: &Bounds,
    ) -> Result<[f64; 3], Diagnostic> {
        let parameter = self.parameter(name)?;
        let mut faults = Faults::default();
        let value = faults.keep(parameter.need("value", "an array of three numbers"));
        let numbers = value.and_then(|value| faults.keep(parameter.three(value)));
        let factor = faults.keep(parameter.meta(dimension, Origin::Known));
        let (value, numbers, factor) = faults.finish((|| Some((value?, numbers?, factor?)))())?;
        let numbers = numbers.map(|number| number * factor);
        let written = value.get_ref().as_array().into_iter().flat_map(|array| array.iter());
        let checks = numbers.iter().zip(written).map(|(si, number)| {
            let refused = |error: ParameterError| Diagnostic::at(parameter.doc.place(&number.span()), error);
            bounds.check(&parameter.path, *si).map_err(refused)
        });
        Diagnostic::gather(checks)?;
        Ok(numbers)
    }

    /// A parameter of which only the reader of the catalogue knows the dimension: as it is written.
    pub(crate) fn stated(&self, name: &'d str) -> Result<Stated, Diagnostic> {
        let parameter = self.parameter(name)?;
        let mut faults = Faults::default();
        let value = faults.keep(parameter.need("value", "a number"));
        let number = value.and_then(|value| faults.keep(parameter.number("value", value)));
        let unit = faults.keep(parameter.text("unit"));
        let source = faults.keep(parameter.source());
        let uncertainty = faults.keep(parameter.uncertainty(1.0));
        faults.keep(parameter.finish());
        let key = self.table.keys().find(|key| **key.get_ref() == *name);
        let stated = (|| {
            Some(Stated {
                name: name.to_owned(),
                value: number?,
                unit: unit?.to_owned(),
                source: source?.to_owned(),
                uncertainty: uncertainty?,
                key_place: self.doc.place(&key.map_or(parameter.at.clone(), Spanned::span)),
                place: parameter.doc.place(&value?.span()),
                unit_place: parameter.doc.place(&parameter.at_of("unit")),
            })
        })();
        faults.finish(stated)
    }

    pub(crate) fn parameter(&self, name: &'d str) -> Result<Section<'d, 't>, Diagnostic> {
        if let Some(lower) = self.inherited(name) {
            return lower.parameter(name);
        }
        let expected = "a table with value, unit, source and uncertainty";
        let value = self.need(name, expected)?;
        if let Some(parameter) = self.replacing(name, value)? {
            return Ok(parameter);
        }
        self.as_section(self.key(name), value, expected)
    }

    /// The parameter of the base with another value, where the file has nothing but that; `None` where it has more.
    fn replacing(&self, name: &'d str, value: &'d Spanned<DeValue<'t>>) -> Result<Option<Self>, Diagnostic> {
        let Some(lower) = self.lower.as_deref().filter(|lower| lower.has(name)) else { return Ok(None) };
        let alone = match value.get_ref() {
            DeValue::Integer(_) | DeValue::Float(_) | DeValue::Array(_) => value,
            DeValue::Table(table) if table.len() == 1 && table.contains_key(VALUE) => &table[VALUE],
            _ => return Ok(None),
        };
        let parameter = Section::new(self.doc, self.key(name), value.span(), &EMPTY);
        let parameter = Section { alone: Some(alone), ..parameter };
        Ok(Some(parameter.above(lower.parameter(name)?)))
    }

    /// Checks unit, source and uncertainty of a parameter's table; notes them; gives the factor to SI.
    pub(crate) fn meta(&self, dimension: Dimension, origin: Origin) -> Result<f64, Diagnostic> {
        let mut faults = Faults::default();
        let unit = faults.keep(self.text("unit"));
        let factor = unit.and_then(|unit| faults.keep(self.factor(dimension, unit)));
        let source = faults.keep(self.source());
        let uncertainty = match origin {
            Origin::Chosen if !self.has("uncertainty") => Some(Uncertainty::Said("chosen".to_owned())),
            _ => faults.keep(self.uncertainty(factor.unwrap_or(1.0))),
        };
        faults.keep(self.finish());
        let (unit, factor, source, uncertainty) =
            faults.finish((|| Some((unit?, factor?, source?, uncertainty?)))())?;
        self.note(unit, source, uncertainty);
        Ok(factor)
    }

    /// The factor from `unit` to SI.
    fn factor(&self, dimension: Dimension, unit: &str) -> Result<f64, Diagnostic> {
        dimension.factor(unit).ok_or_else(|| {
            self.doc.bad(&self.at_of("unit"), &self.key("unit"), dimension.describe(), format!("\"{unit}\""))
        })
    }

    /// Remembers where a parameter came from.
    pub(crate) fn note(&self, unit: &str, source: &str, uncertainty: Uncertainty) {
        self.doc.provenance.borrow_mut().push(Provenance {
            key: self.path.clone(),
            file: self.doc.file.to_owned(),
            line: self.doc.place(&self.at).line,
            unit: unit.to_owned(),
            source: source.to_owned(),
            uncertainty,
        });
    }

    /// Returns the source of a number.
    pub(crate) fn source(&self) -> Result<&'d str, Diagnostic> {
        if let Some(lower) = self.inherited("source") {
            return lower.source();
        }
        self.need("source", "a text, or \"none\" for a number without a source")?;
        self.text("source")
    }

    /// Returns the uncertainty of a number; a number without a source need not have one.
    fn uncertainty(&self, factor: f64) -> Result<Uncertainty, Diagnostic> {
        // A source that is missing or no text is a fault of its own.
        let needs_none = self.source().ok().is_none_or(|source| source == NO_SOURCE);
        if !self.has("uncertainty") && needs_none {
            return Ok(Uncertainty::Said("not stated".to_owned()));
        }
        if let Some(lower) = self.inherited("uncertainty") {
            return lower.uncertainty(factor);
        }
        let expected = "a number (one standard deviation, in the same unit) or a text such as \"not stated\"";
        let value = self.need("uncertainty", expected)?;
        if value.get_ref().is_str() {
            return Ok(Uncertainty::Said(self.text("uncertainty")?.to_owned()));
        }
        let sigma = self.number("uncertainty", value)?;
        if sigma < 0.0 || !(sigma * factor).is_finite() {
            return Err(self.doc.bad(&value.span(), &self.key("uncertainty"), expected, sigma.to_string()));
        }
        Ok(Uncertainty::OneSigma(sigma * factor))
    }

    fn three(&self, value: &Spanned<DeValue<'t>>) -> Result<[f64; 3], Diagnostic> {
        let found: Vec<_> = value.get_ref().as_array().into_iter().flat_map(|array| array.iter()).collect();
        let [x, y, z] = found[..] else {
            let (key, expected) = (self.key("value"), "an array of three numbers");
            return Err(match value.get_ref().as_array() {
                Some(array) => {
                    self.doc.bad(&value.span(), &key, expected, format!("an array of {}", array.len()))
                }
                None => self.wrong_type(&key, value, expected),
            });
        };
        let numbers = Diagnostic::gather([x, y, z].map(|number| {
            let read = self.number("value", number);
            // A line with the key would stand for the whole array.
            read.map_err(|fault| {
                if number.get_ref().is_str() {
                    fault.help("write numbers without quotation marks")
                } else {
                    fault
                }
            })
        }))?;
        Ok(std::array::from_fn(|axis| numbers[axis]))
    }

    /// A finite number, integer or not.
    pub(crate) fn number(&self, name: &str, value: &Spanned<DeValue<'t>>) -> Result<f64, Diagnostic> {
        let expected = "a finite number";
        let number = match value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(int) => {
                i64::from_str_radix(int.as_str(), int.radix()).ok().map(|int| int as f64)
            }
            _ => return Err(self.wrong_type(&self.key(name), value, expected)),
        };
        number.filter(|number: &f64| number.is_finite()).ok_or_else(|| {
            self.doc.bad(&value.span(), &self.key(name), expected, self.doc.text[value.span()].to_owned())
        })
    }

    fn wrong_type(&self, key: &str, value: &Spanned<DeValue<'t>>, expected: &str) -> Diagnostic {
        self.doc.bad(&value.span(), key, expected, seen(value))
    }

    /// Returns the place of the value of `name`, in bytes; that of the table itself where it has none.
    pub fn at_of(&self, name: &str) -> Range<usize> {
        self.table.get(name).map_or(self.at.clone(), Spanned::span)
    }

    /// Refuses every key that was not read, in the file's order.
    pub fn finish(&self) -> Result<(), Diagnostic> {
        let asked: Vec<&str> = self.asked.borrow().iter().copied().collect();
        self.require_known(&asked)
    }

    /// Refuses every key that is not `known`, in the file's order: first in a reader that stops at the first missing key, so
    /// that a misspelt key is not told as a missing one.
    pub fn require_known(&self, known: &[&str]) -> Result<(), Diagnostic> {
        let mut known = known.to_vec();
        known.sort_unstable();
        let unknown = self.table.keys().filter(|key| !known.contains(&key.get_ref().as_ref()));
        let mut unknown: Vec<_> = unknown.collect();
        unknown.sort_by_key(|key| key.span().start);
        Diagnostic::gather(unknown.into_iter().map(|key| {
            let error = ParameterError::unknown(self.key(key.get_ref()), known.iter().copied());
            Err::<(), _>(Diagnostic::at(self.doc.place(&key.span()), error))
        }))
        .map(drop)
    }

    /// Refuses a key that is probably `name`, where the table does not have that.
    pub(crate) fn require_spelt(&self, name: &'d str) -> Result<(), Diagnostic> {
        let near = |key: &&Spanned<DeString<'t>>| nearest(key.get_ref(), [name]).is_some();
        match self.table.keys().find(near).filter(|_| !self.has(name)) {
            Some(key) => {
                let error = ParameterError::unknown(self.key(key.get_ref()), [name]);
                Err(Diagnostic::at(self.doc.place(&key.span()), error))
            }
            None => Ok(()),
        }
    }
}

/// The start of the first line that is neither blank nor a comment: no line of the file is to blame for what is missing in it.
fn first_content(text: &str) -> Range<usize> {
    let is_content = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let before: usize = text.split_inclusive('\n').take_while(|line| !is_content(line)).map(str::len).sum();
    let start = if before < text.len() { before } else { 0 };
    start..start
}

/// A value of another type than is expected, as people call it.
pub(crate) fn seen(value: &Spanned<DeValue<'_>>) -> String {
    match value.get_ref() {
        DeValue::String(text) => format!("the text {text:?}"),
        DeValue::Integer(number) => number.as_str().to_owned(),
        DeValue::Float(number) => number.as_str().to_owned(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(time) => format!("the time {time}"),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// A number that stands without a table, as the file has it, and its unit: that of the SI where a text names none.
fn number_alone<'v>(found: &'v Spanned<DeValue<'_>>, dimension: Dimension) -> Option<(String, &'v str)> {
    match found.get_ref() {
        DeValue::Integer(_) | DeValue::Float(_) => Some((seen(found), dimension.si())),
        DeValue::String(text) => {
            let (value, unit) = leading_number(text)?;
            let unit = if unit.is_empty() { dimension.si() } else { unit };
            dimension.factor(unit).map(|_| (format!("{value:?}"), unit))
        }
        _ => None,
    }
}

/// A missing key of a file as it is written: a table with its brackets.
fn shape(name: &str, expected: &str) -> String {
    match expected {
        "a table" => format!("[{name}]"),
        "an array of tables" => format!("[[{name}]]"),
        _ => format!("`{name}`"),
    }
}
