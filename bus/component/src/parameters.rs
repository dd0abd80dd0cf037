//! Parameters of a component: declared once, with unit, default, range and documentation.
//!
//! ```
//! use component::Parameters;
//! use diagnostics::parameter::positive;
//!
//! /// Gains of a controller of the altitude.
//! #[derive(Parameters)]
//! struct Gains {
//!     /// Error of the altitude to a climb.
//!     #[parameter(default = 1.5, check = positive)]
//!     altitude_1_s: f64,
//!     /// Thrust at hover.
//!     #[parameter(unit = "N")]
//!     hover: f64,
//! }
//!
//! let [altitude, hover] = Gains::DECLARED else { panic!() };
//! assert_eq!((altitude.unit, altitude.default.text().as_str(), (altitude.range)().as_str()), ("1/s", "1.5", "above 0"));
//! assert_eq!((hover.doc, hover.default.text().as_str()), ("Thrust at hover.", "required"));
//! let gains: Gains = diagnostics::read(&serde_json::json!({ "hover": 4.9, "altitude_1_s": -1.0 }))?;
//! assert!(gains.validate().is_err());
//! # Ok::<(), component::ParameterError>(())
//! ```

use diagnostics::ParameterError;
use inputs::FileKind;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;
use std::collections::BTreeMap;

/// The content of a `parameters` table; `#[derive(component::Parameters)]` implements it.
pub trait Parameters: DeserializeOwned {
    /// The parameters, in the order in which they are documented.
    const DECLARED: &'static [Parameter];

    /// Errors of all parameters that are outside their ranges, also in the tables.
    fn out_of_range(&self) -> Vec<ParameterError> {
        Vec::new()
    }

    /// Refuses a parameter that is outside its range, also in its tables.
    ///
    /// # Errors
    /// The first that is.
    fn validate(&self) -> Result<(), ParameterError> {
        self.out_of_range().into_iter().next().map_or(Ok(()), Err)
    }
}

/// All errors of `parameters`, read as a `P`. None follows from another: of a value that is missing or does not go with others, only
/// the first error counts.
pub(crate) fn faults<P: Parameters>(parameters: &Value) -> Vec<ParameterError> {
    faults_within::<P>(&mut parameters.clone())
}

/// `parameters` without those that [`faults`] refuses; `None` if no `P` can be read without them.
pub(crate) fn without_faults<P: Parameters>(parameters: &Value) -> Option<Value> {
    let mut rest = parameters.clone();
    for error in faults_within::<P>(&mut rest) {
        remove(&mut rest, error.key());
    }
    let read = diagnostics::read::<P>(&rest).ok()?;
    read.out_of_range().is_empty().then_some(rest)
}

/// As [`faults`]; removes the values that cannot be read.
fn faults_within<P: Parameters>(rest: &mut Value) -> Vec<ParameterError> {
    let (read, mut errors) = readable::<P>(rest);
    let out_of_range = read.map_or(Vec::new(), |read| read.out_of_range());
    errors.extend(out_of_range.into_iter().flat_map(ParameterError::into_each));
    errors
}

/// Reads a table within parameters, which they hold as a [`Value`].
///
/// ```
/// let table = serde_json::json!({ "roll": "x", "pitch": 1.0, "yaw": true });
/// let read = component::parameters::read::<std::collections::BTreeMap<String, f64>>(&table);
/// let keys: Vec<String> = read.unwrap_err().into_each().iter().map(|error| error.key().to_owned()).collect();
/// assert_eq!(keys, ["roll", "yaw"]);
/// ```
///
/// # Errors
/// All values that cannot be read, in one error. None follows from another.
pub fn read<T: DeserializeOwned>(value: &Value) -> Result<T, ParameterError> {
    diagnostics::read(value).map_err(|first| {
        let (_, errors) = readable::<T>(&mut value.clone());
        first.and(errors.into_iter().skip(1))
    })
}

/// The `T` that `rest` holds once all values that cannot be read are removed, and their errors; `None` if there is none then.
fn readable<T: DeserializeOwned>(rest: &mut Value) -> (Option<T>, Vec<ParameterError>) {
    let mut errors: Vec<ParameterError> = Vec::new();
    loop {
        let error = match diagnostics::read::<T>(rest) {
            Ok(read) => return (Some(read), errors),
            Err(error) => error,
        };
        let is_removed = remove(rest, error.key());
        if errors.is_empty() || matches!(error, ParameterError::Unknown { .. } | ParameterError::Value { .. })
        {
            errors.push(error);
        }
        if !is_removed {
            return (None, errors);
        }
    }
}

/// Removes the value at the dotted `key`, whose names may have dots in them; false if there is none. An entry is removed with its list,
/// whose other entries then keep their numbers.
fn remove(value: &mut Value, key: &str) -> bool {
    match value {
        Value::Object(table) => {
            // The others keep their order, in which their errors are found.
            table.shift_remove(key).is_some()
                || key.match_indices('.').any(|(end, _)| {
                    let (name, rest) = (&key[..end], &key[end + 1..]);
                    let Some(inner) = table.get_mut(name) else { return false };
                    remove(inner, rest) || (inner.is_array() && table.shift_remove(name).is_some())
                })
        }
        Value::Array(list) => key.split_once('.').is_some_and(|(index, rest)| {
            let entry = index.parse::<usize>().ok().and_then(|index| list.get_mut(index));
            entry.is_some_and(|entry| remove(entry, rest))
        }),
        _ => false,
    }
}

/// Declaration of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Key in the manifest.
    pub name: &'static str,
    /// Meaning, in one or more sentences.
    pub doc: &'static str,
    /// Unit; empty for texts, files and tables.
    pub unit: &'static str,
    /// Value where the manifest has none.
    pub default: DefaultValue,
    /// Accepted values in words; empty where any that the unit allows is accepted.
    pub range: fn() -> String,
    /// Keys of the table that it is, or of each table in it.
    pub table: &'static [Parameter],
    /// Stand-in for the name of such a table in it, or for its number in a list; empty where it is itself the table.
    pub entry: &'static str,
    /// Value in examples, as TOML; empty where there is none.
    pub example: &'static str,
    /// Kind of the file whose path it is. `None` for all other values, and for files without a declared kind. The launcher does not look
    /// into tables.
    pub file: Option<FileKind>,
    /// True if it counts only at the start: the state begins with it. A run from a checkpoint refuses other values. The launcher does not
    /// look into tables.
    pub is_initial: bool,
}

/// Value of a parameter that a manifest leaves out.
#[derive(Clone, Copy, Debug)]
pub enum DefaultValue {
    /// None: the parameter is required.
    Required,
    /// Description of it.
    Text(&'static str),
    /// Function that writes it.
    Value(fn() -> String),
}

impl DefaultValue {
    /// The value in words.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Required => "required".to_owned(),
            Self::Text(text) => (*text).to_owned(),
            Self::Value(text) => text(),
        }
    }
}

/// The parameters in `declared` with the keys of their tables, by dotted key, each table before its keys.
///
/// ```
/// let keys: Vec<String> = component::parameters::dotted(&[]).into_iter().map(|(key, _)| key).collect();
/// assert!(keys.is_empty());
/// ```
#[must_use]
pub fn dotted(declared: &'static [Parameter]) -> Vec<(String, &'static Parameter)> {
    let of_parameter = |parameter: &'static Parameter| {
        let Parameter { name, entry, table, .. } = *parameter;
        let path = if entry.is_empty() { name.to_owned() } else { format!("{name}.{entry}") };
        let within = dotted(table).into_iter().map(move |(key, inner)| (format!("{path}.{key}"), inner));
        std::iter::once((name.to_owned(), parameter)).chain(within)
    };
    declared.iter().flat_map(of_parameter).collect()
}

/// A component without declared parameters.
macro_rules! undeclared {
    ($($type:ty),*) => {$(
        impl Parameters for $type {
            const DECLARED: &'static [Parameter] = &[];
        }
    )*};
}

undeclared!((), IgnoredAny, Value);

impl<T: DeserializeOwned> Parameters for BTreeMap<String, T> {
    const DECLARED: &'static [Parameter] = &[];
}

/// Numbers of a parameter, each of which has to be within its range.
pub trait Numbers {
    /// Requires `check` to accept each number.
    ///
    /// # Errors
    /// The first that it refuses.
    fn all(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError>;
}

impl Numbers for f64 {
    fn all(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        check(*self)
    }
}

impl Numbers for u32 {
    fn all(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        check(f64::from(*self))
    }
}

impl Numbers for usize {
    fn all(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        check(*self as f64)
    }
}

impl<const N: usize> Numbers for [f64; N] {
    fn all(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        self.iter().try_for_each(|number| check(*number))
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn all(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        self.iter().try_for_each(|numbers| numbers.all(check))
    }
}

/// The range that `check` requires, in words: as it refuses what is no number.
#[doc(hidden)]
pub fn range_of(check: &dyn Fn(&str, f64) -> Result<(), ParameterError>) -> String {
    match check("", f64::NAN) {
        Err(ParameterError::Value { expected, .. }) => {
            let range = expected.strip_prefix("a finite number").unwrap_or(&expected);
            range.trim_start_matches([',', ' ']).to_owned()
        }
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Parameters, range_of};
    use diagnostics::parameter::{finite, not_negative, positive};
    use inputs::{FileKind, FileRole, InputFiles};
    use serde_json::json;
    use std::collections::BTreeMap;
    use std::path::{Path, PathBuf};

    /// Lists of flights.
    const LIST: FileKind =
        FileKind { others: |_, path| vec![path.with_extension("csv")], ..FileKind::of(FileRole::Settings) };

    /// A table that names files, and has a value for the start.
    #[derive(component::Parameters)]
    #[allow(dead_code, reason = "only the declarations are read")]
    struct Named {
        /// Flights.
        #[parameter(shown = "none", file = LIST)]
        flights: Option<PathBuf>,
        /// Any file.
        data: PathBuf,
        /// Height at the start.
        #[parameter(default = 0.0, initial)]
        height_m: f64,
    }

    /// A table with all kinds of fields.
    #[derive(Debug, PartialEq, component::Parameters)]
    #[parameters(default)]
    struct Gains {
        /// Offset of each axis.
        #[parameter(default = [0.0; 3], check = finite)]
        offset_m: [f64; 3],
        /// Index of the axis.
        #[parameter(rename = "self", unit = "1")]
        own: Option<u32>,
        /// Streams.
        #[parameter(default = Vec::new(), shown = "none", table = Stream, entry = "N")]
        streams: Vec<Stream>,
        /// One more.
        #[parameter(default = Stream { rate_hz: 1.0 }, shown = "1 Hz", table = Stream)]
        main: Stream,
        /// Streams by name.
        #[parameter(default = BTreeMap::new(), table = Stream, entry = "NAME")]
        named: BTreeMap<String, Stream>,
    }

    /// A table within.
    #[derive(Debug, PartialEq, component::Parameters)]
    struct Stream {
        /// Rate.
        #[parameter(check = positive)]
        rate_hz: f64,
    }

    #[test]
    fn a_table_is_read_with_its_defaults_and_refuses_other_keys() {
        let read = |value| diagnostics::read::<Gains>(&value);
        assert_eq!(read(json!({})).unwrap(), Gains::default());
        let given = read(json!({ "self": 2, "streams": [{ "rate_hz": 5.0 }] })).unwrap();
        assert_eq!((given.own, given.streams[0].rate_hz), (Some(2), 5.0));
        let error = read(json!({ "own": 2 })).unwrap_err().to_string();
        assert_eq!(
            error,
            "unknown key `own`, expected one of `offset_m`, `self`, `streams`, `main`, `named`"
        );
        assert!(read(json!({ "streams": [{}] })).unwrap_err().to_string().contains("`streams.0.rate_hz`"));
    }

    #[test]
    fn declarations_have_unit_default_and_range() {
        let [offset, own, streams, ..] = Gains::DECLARED else { panic!("{:?}", Gains::DECLARED) };
        assert_eq!((offset.unit, offset.default.text().as_str()), ("m", "[0.0, 0.0, 0.0]"));
        assert_eq!((own.name, own.unit, own.default.text().as_str()), ("self", "1", "none"));
        assert_eq!((streams.default.text().as_str(), streams.table[0].name), ("none", "rate_hz"));
        assert_eq!((range_of(&finite).as_str(), range_of(&not_negative).as_str()), ("", "0 or more"));
    }

    #[test]
    fn a_parameter_declares_the_kind_of_its_file_and_that_it_counts_at_the_start_alone() {
        let [flights, data, height] = Named::DECLARED else { panic!("{:?}", Named::DECLARED) };
        assert_eq!((flights.default.text().as_str(), data.file.is_none()), ("none", true));
        let others = flights.file.map(|kind| (kind.others)(&InputFiles::default(), Path::new("a.txt")));
        assert_eq!(others, Some(vec![PathBuf::from("a.csv")]));
        assert!(height.is_initial && !flights.is_initial);
    }

    #[test]
    fn all_errors_of_a_table_are_found_and_none_that_follows() {
        let keys = |value| {
            let errors = super::faults::<Gains>(&value);
            errors.iter().map(|error| error.key().to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(keys(json!({ "one": 1, "self": "x", "two": 2 })), ["one", "self", "two"]);
        let ranges =
            json!({ "named": { "a.b": { "rate_hz": 0.0 } }, "main": { "rate_hz": -1.0 }, "more": 1 });
        assert_eq!(keys(ranges), ["more", "main.rate_hz", "named.a.b.rate_hz"]);
        // Without its value of a wrong type the table lacks it, which nobody wrote.
        assert_eq!(keys(json!({ "main": { "rate_hz": "x" } })), ["main.rate_hz"]);
        assert_eq!(keys(json!({ "named": { "a.b": { "rate_hz": [] } } })), ["named.a.b.rate_hz"]);
        assert_eq!(keys(json!({ "streams": [3], "one": 1 })).len(), 2);
    }

    #[test]
    fn parameters_without_their_faults_can_be_read() {
        let rest = |value| super::without_faults::<Gains>(&value);
        let given = json!({ "self": 2, "one": 1, "main": { "rate_hz": 2.0 } });
        assert_eq!(rest(given), Some(json!({ "self": 2, "main": { "rate_hz": 2.0 } })));
        let ranges = json!({ "self": 2, "streams": [{ "rate_hz": 1.0 }, { "rate_hz": 0.0 }] });
        assert_eq!(rest(ranges), None, "the table has no default for it");
        assert_eq!(super::without_faults::<Stream>(&json!({ "rate_hz": "x" })), None);
    }

    #[test]
    fn a_number_out_of_its_range_is_refused_by_its_key() {
        let gains = Gains { offset_m: [0.0, f64::NAN, 0.0], ..Gains::default() };
        assert_eq!(gains.validate().unwrap_err().key(), "offset_m");
        assert!(Gains::default().validate().is_ok());
        for (key, value) in [
            ("streams.1.rate_hz", json!({ "streams": [{ "rate_hz": 1.0 }, { "rate_hz": 0.0 }] })),
            ("main.rate_hz", json!({ "main": { "rate_hz": -1.0 } })),
            ("named.up.rate_hz", json!({ "named": { "up": { "rate_hz": 0.0 } } })),
        ] {
            let gains: Gains = diagnostics::read(&value).unwrap();
            assert_eq!(gains.validate().unwrap_err().key(), key);
        }
    }
}
