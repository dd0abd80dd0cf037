//! Parameters of components: the error for one that is refused, and the checks that raise it.

use crate::nearest::{nearest, suggestion, typo_of};
use crate::number_text;
use crate::place::Place;
use std::fmt::{self, Display};
use std::ops::RangeBounds;

/// A parameter that a component refuses.
///
/// ```
/// use diagnostics::ParameterError;
///
/// let error = ParameterError::value("mode", "\"varying\" or \"constant\"", "\"slow\"").within("gains");
/// assert_eq!(error.key(), "gains.mode");
/// assert_eq!(error.to_string(), "`gains.mode` must be \"varying\" or \"constant\", found \"slow\"");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// A value that the parameter cannot have.
    #[error("`{key}` must be {expected}, found {found}")]
    Value {
        /// The dotted key, as the manifest has it.
        key: String,
        /// Accepted values, so that "must be" can stand before them.
        expected: String,
        /// Value that was found.
        found: String,
    },
    /// A parameter that is needed and not given.
    #[error("missing key `{key}`{}{expected}", if .expected.is_empty() { "" } else { ", expected " })]
    Missing {
        /// The dotted key.
        key: String,
        /// Values that it should hold; empty where that is not known.
        expected: String,
    },
    /// A parameter that the component does not have.
    #[error("unknown key `{key}`, expected {}", list(.known))]
    Unknown {
        /// The dotted key.
        key: String,
        /// The keys that there are in its place.
        known: Vec<String>,
    },
    /// Parameters, ports or files that do not go together, or a file that is refused.
    #[error("{message}")]
    Conflict {
        /// The dotted key that is to blame first; empty where no key is.
        key: String,
        /// Contradiction.
        message: String,
        /// Advice; empty where the message says what to do.
        help: String,
    },
    /// A file that the parameter names, with the faults in it.
    #[error("{faults}")]
    File {
        /// The dotted key.
        key: String,
        /// The faults.
        faults: Box<FileFaults>,
    },
    /// Several refused parameters, in one error; [`Self::into_each`] takes them apart.
    #[error("{}", lines(.0))]
    Several(Vec<Self>),
}

/// Faults of a file that a parameter names.
#[derive(Debug, Clone, PartialEq)]
pub struct FileFaults {
    /// The faults.
    pub each: Vec<FileFault>,
    /// The component that has the parameter; empty where it is not known.
    pub who: String,
    /// Other components that read the file, and the places that name it for them.
    pub also: Vec<(String, Place)>,
}

/// A fault of a file that a parameter names.
#[derive(Debug, Clone, PartialEq)]
pub struct FileFault {
    /// The file.
    pub file: String,
    /// Place in the file; none where the fault is of the whole.
    pub place: Option<Place>,
    /// The dotted key that is to blame; empty where none is in particular.
    pub key: String,
    /// Expected and found values.
    pub message: String,
    /// Advice; empty where the message says it.
    pub help: String,
    /// The fault in text, with its place and the advice.
    pub text: String,
    /// The fault for terminals, with the line of that file.
    pub shown: String,
}

impl FileFault {
    fn reword(&mut self, reword: &impl Fn(&str) -> String) {
        let Self { file, place, message, help, text, shown, .. } = self;
        let of_place = place.as_mut().map(|place| &mut place.file);
        for words in [file, message, help, text, shown].into_iter().chain(of_place) {
            *words = reword(words);
        }
    }
}

/// The faults behind the components that read the file; with `{:#}` the faults alone, with the lines of that file.
impl Display for FileFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let who: Vec<&str> = std::iter::once(self.who.as_str())
            .chain(self.also.iter().map(|(who, _)| who.as_str()))
            .filter(|who| !who.is_empty())
            .collect();
        if !f.alternate() && !who.is_empty() {
            write!(f, "{}: ", who.join(", "))?;
        }
        let text = |fault: &FileFault| if f.alternate() { fault.shown.clone() } else { fault.text.clone() };
        // Whoever prints it has written the word before the first.
        let between = if f.alternate() { "\nerror: " } else { "\n" };
        f.write_str(&self.each.iter().map(text).collect::<Vec<_>>().join(between))
    }
}

impl ParameterError {
    /// A value that `key` cannot have.
    #[must_use]
    pub fn value(key: impl Into<String>, expected: impl Into<String>, found: impl Display) -> Self {
        Self::Value { key: key.into(), expected: expected.into(), found: found.to_string() }
    }

    /// A parameter that is needed and not given; `expected` describes its value, empty where that is not known.
    #[must_use]
    pub fn missing(key: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Missing { key: key.into(), expected: expected.into() }
    }

    /// A parameter that there is not, but `known` ones in its place.
    #[must_use]
    pub fn unknown<'a>(key: impl Into<String>, known: impl IntoIterator<Item = &'a str>) -> Self {
        Self::Unknown { key: key.into(), known: known.into_iter().map(str::to_owned).collect() }
    }

    /// Creates the error for a contradiction, of which `key` is to blame first; empty where none is.
    #[must_use]
    pub fn conflict(key: impl Into<String>, message: impl Display) -> Self {
        Self::Conflict { key: key.into(), message: message.to_string(), help: String::new() }
    }

    /// The same with `help` as the advice on a contradiction, in each of several errors. Other errors keep the advice that follows from
    /// what was expected.
    ///
    /// ```
    /// use diagnostics::ParameterError;
    ///
    /// let error = ParameterError::conflict("scene", "the scene holds a rig").advised("leave `rig` out of the scene");
    /// assert_eq!((error.to_string().as_str(), error.help().as_str()), ("the scene holds a rig", "leave `rig` out of the scene"));
    /// assert_eq!(error.of("process `plant`").within("process.plant").help(), "leave `rig` out of the scene");
    /// ```
    #[must_use]
    pub fn advised(mut self, help: impl Into<String>) -> Self {
        self.advise(&help.into());
        self
    }

    fn advise(&mut self, advice: &str) {
        match self {
            Self::Conflict { help, .. } => advice.clone_into(help),
            Self::Several(errors) => errors.iter_mut().for_each(|error| error.advise(advice)),
            Self::Value { .. } | Self::Missing { .. } | Self::Unknown { .. } | Self::File { .. } => {}
        }
    }

    /// Gathers the results of all `checks`, which do not depend on each other.
    ///
    /// ```
    /// use diagnostics::ParameterError;
    /// use diagnostics::parameter::positive;
    ///
    /// let checks = [positive("mass_kg", -1.0), positive("span_m", 0.2), positive("rate_hz", 0.0)];
    /// let error = ParameterError::gather(checks).unwrap_err();
    /// let keys: Vec<String> = error.into_each().iter().map(|error| error.key().to_owned()).collect();
    /// assert_eq!(keys, ["mass_kg", "rate_hz"]);
    /// ```
    ///
    /// # Errors
    /// The errors of all checks, as one.
    pub fn gather<T>(checks: impl IntoIterator<Item = Result<T, Self>>) -> Result<Vec<T>, Self> {
        let (mut passed, mut errors) = (Vec::new(), Vec::new());
        for check in checks {
            match check {
                Ok(value) => passed.push(value),
                Err(error) => errors.push(error),
            }
        }
        let mut errors = errors.into_iter();
        match errors.next() {
            Some(first) => Err(first.and(errors)),
            None => Ok(passed),
        }
    }

    /// Gathers the results of two checks, which do not depend on each other.
    ///
    /// # Errors
    /// The errors of both, as one.
    pub fn both<A, B>(first: Result<A, Self>, second: Result<B, Self>) -> Result<(A, B), Self> {
        match (first, second) {
            (Ok(first), Ok(second)) => Ok((first, second)),
            (Err(first), Err(second)) => Err(first.and([second])),
            (Err(error), Ok(_)) | (Ok(_), Err(error)) => Err(error),
        }
    }

    /// This error, and `others` beside it.
    #[must_use]
    pub fn and(self, others: impl IntoIterator<Item = Self>) -> Self {
        let mut each = self.into_each();
        each.extend(others.into_iter().flat_map(Self::into_each));
        match each.len() {
            1 => each.remove(0),
            _ => Self::Several(each),
        }
    }

    /// The errors that this one holds, each on its own.
    #[must_use]
    pub fn into_each(self) -> Vec<Self> {
        match self {
            Self::Several(errors) => errors.into_iter().flat_map(Self::into_each).collect(),
            error => vec![error],
        }
    }

    /// The same of the component `who`.
    #[must_use]
    pub fn of(self, who: impl Into<String>) -> Self {
        let who = who.into();
        match self {
            Self::Several(errors) => Self::Several(errors.into_iter().map(|error| error.of(&*who)).collect()),
            Self::File { key, mut faults } => {
                faults.who = if faults.who.is_empty() { who } else { format!("{who}: {}", faults.who) };
                Self::File { key, faults }
            }
            error => Self::conflict(error.key(), format!("{who}: {error}")).advised(error.help()),
        }
    }

    /// The dotted key that is to blame, of several errors that of the first; empty where none is in particular.
    #[must_use]
    pub fn key(&self) -> &str {
        match self {
            Self::Value { key, .. }
            | Self::Missing { key, .. }
            | Self::Unknown { key, .. }
            | Self::File { key, .. }
            | Self::Conflict { key, .. } => key,
            Self::Several(errors) => errors.first().map_or("", Self::key),
        }
    }

    /// Returns advice; empty where the message says what to do.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Missing { .. } => "add it to this table".to_owned(),
            Self::Unknown { .. } => {
                self.suggestion().unwrap_or_else(|| "remove it, or write one of these keys".to_owned())
            }
            Self::Value { .. } => self.suggestion().unwrap_or_default(),
            Self::Conflict { help, .. } => help.clone(),
            Self::File { .. } | Self::Several(_) => String::new(),
        }
    }

    /// Advice on a likely mistake. For an unknown key, or a value that is one of several, it asks for the
    /// known name that was probably meant. For a number in quotation marks it is the line to write in its
    /// place.
    ///
    /// ```
    /// use diagnostics::ParameterError;
    ///
    /// let error = ParameterError::value("kind", "\"step\", \"ramp\" or \"doublet\"", "\"stp\"");
    /// assert_eq!(error.suggestion().as_deref(), Some("did you mean `step`?"));
    /// let error = ParameterError::value("run.duration_s", "a number", "the text \"8 s\"");
    /// assert_eq!(error.suggestion().as_deref(), Some("the unit is in the key's name: write `duration_s = 8.0`"));
    /// ```
    #[must_use]
    pub fn suggestion(&self) -> Option<String> {
        match self {
            Self::Unknown { key, known } => suggestion(last_name(key), known.iter().map(String::as_str)),
            Self::Value { key, expected, found } => match choices(expected) {
                Some(choices) => suggestion(quoted(found).first()?, choices),
                None => number_text::advice(key, expected, found),
            },
            _ => None,
        }
    }

    /// The known key that an unknown one was probably meant to be.
    #[must_use]
    pub fn meant(&self) -> Option<&str> {
        let Self::Unknown { key, known } = self else { return None };
        nearest(last_name(key), known.iter().map(String::as_str))
    }

    /// The known key that an unknown one is, but for one or two letters.
    #[must_use]
    pub fn typo(&self) -> Option<&str> {
        let Self::Unknown { key, known } = self else { return None };
        typo_of(last_name(key), known.iter().map(String::as_str))
    }

    /// The same with `unit` behind the number that was found, unless it stands there already: for keys whose names do
    /// not hold it. The unit of pure numbers, `1`, would read as another number and is left out.
    #[must_use]
    pub fn in_unit(mut self, unit: &str) -> Self {
        if let Self::Value { found, .. } = &mut self
            && unit != "1"
            && !found.ends_with(&format!(" {unit}"))
        {
            *found = format!("{found} {unit}");
        }
        self
    }

    /// The same error in other words: `reword` returns each text of a message, and each text and file of the faults in a file.
    ///
    /// ```
    /// use diagnostics::ParameterError;
    ///
    /// let error = ParameterError::conflict("gain", "gain=1: no such key").reworded(|text| text.replace("gain=1", "gain"));
    /// assert_eq!(error.to_string(), "gain: no such key");
    /// ```
    #[must_use]
    pub fn reworded(mut self, reword: impl Fn(&str) -> String) -> Self {
        self.reword(&reword);
        self
    }

    fn reword(&mut self, reword: &impl Fn(&str) -> String) {
        match self {
            Self::Conflict { message, help, .. } => {
                *message = reword(message);
                *help = reword(help);
            }
            Self::File { faults, .. } => faults.each.iter_mut().for_each(|fault| fault.reword(reword)),
            Self::Several(errors) => errors.iter_mut().for_each(|error| error.reword(reword)),
            Self::Value { .. } | Self::Missing { .. } | Self::Unknown { .. } => {}
        }
    }

    /// The same error of the parameter within the table `table`.
    #[must_use]
    pub fn within(mut self, table: &str) -> Self {
        let key = match &mut self {
            Self::Value { key, .. }
            | Self::Missing { key, .. }
            | Self::Unknown { key, .. }
            | Self::File { key, .. }
            | Self::Conflict { key, .. } => key,
            Self::Several(errors) => {
                let each = std::mem::take(errors).into_iter().map(|error| error.within(table));
                return Self::Several(each.collect());
            }
        };
        let told = format!("`{key}`: ");
        *key = if key.is_empty() { table.to_owned() } else { format!("{table}.{key}") };
        let whole = key.clone();
        if let Self::Conflict { message, .. } = &mut self {
            // A message that begins with its key is given the whole one.
            *message = match message.strip_prefix(&told) {
                Some(message) => format!("`{whole}`: {message}"),
                None => format!("`{table}`: {message}"),
            };
        }
        self
    }
}

impl From<std::convert::Infallible> for ParameterError {
    fn from(never: std::convert::Infallible) -> Self {
        match never {}
    }
}

/// A message without a key.
impl From<String> for ParameterError {
    fn from(message: String) -> Self {
        Self::conflict("", message)
    }
}

/// A message without a key.
impl From<&str> for ParameterError {
    fn from(message: &str) -> Self {
        Self::conflict("", message)
    }
}

/// Name of a dotted key without the tables on the way, which are not part of a misspelling.
fn last_name(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}

/// The names that `expected` lists in quotes; `None` if they are no choice.
fn choices(expected: &str) -> Option<Vec<&str>> {
    Some(quoted(expected)).filter(|names| names.len() > 1)
}

/// The texts between quotes of `text`, of either kind.
fn quoted(text: &str) -> Vec<&str> {
    text.split(['`', '"']).skip(1).step_by(2).collect()
}

/// The texts of `errors`, a line each.
fn lines(errors: &[ParameterError]) -> String {
    errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        [one] => format!("`{one}`"),
        _ => format!("one of `{}`", names.join("`, `")),
    }
}

/// Passes a number that `is_good`.
///
/// # Errors
/// It is not; `expected` describes the accepted numbers.
///
/// ```
/// use diagnostics::parameter::require;
///
/// let angle_deg = 91.0;
/// let error = require("half_angle_deg", angle_deg, angle_deg < 90.0, "below 90").unwrap_err();
/// assert_eq!(error.to_string(), "`half_angle_deg` must be below 90, found 91");
/// ```
pub fn require(
    key: &str,
    found: impl Display,
    is_good: bool,
    expected: impl Into<String>,
) -> Result<(), ParameterError> {
    if is_good { Ok(()) } else { Err(ParameterError::value(key, expected, found)) }
}

/// Refuses parameters that do not go together; `key` is to blame first. The `message` has the contradiction, and advice behind a
/// semicolon. Longer advice is that of [`ParameterError::advised`].
///
/// # Errors
/// They do not, as `is_wrong` says.
///
/// ```
/// use diagnostics::parameter::refuse;
///
/// let period_ticks = 2;
/// let error = refuse(period_ticks != 1, "period_ticks", || format!("it is {period_ticks}, expected 1")).unwrap_err();
/// assert_eq!((error.key(), error.to_string().as_str()), ("period_ticks", "it is 2, expected 1"));
/// ```
pub fn refuse<M: Display>(
    is_wrong: bool,
    key: &str,
    message: impl FnOnce() -> M,
) -> Result<(), ParameterError> {
    if is_wrong { Err(ParameterError::conflict(key, message())) } else { Ok(()) }
}

/// Passes a finite number.
///
/// # Errors
/// It is infinite or none.
pub fn finite(key: &str, value: f64) -> Result<(), ParameterError> {
    require(key, value, value.is_finite(), "a finite number")
}

/// Passes a finite number above zero.
///
/// # Errors
/// It is zero, less, infinite or none.
pub fn positive(key: &str, value: f64) -> Result<(), ParameterError> {
    require(key, value, value.is_finite() && value > 0.0, "a finite number above 0")
}

/// Passes a finite number that is zero or more.
///
/// # Errors
/// It is less than zero, infinite or none.
pub fn not_negative(key: &str, value: f64) -> Result<(), ParameterError> {
    require(key, value, value.is_finite() && value >= 0.0, "a finite number, 0 or more")
}

/// Passes a number above zero and up to `max`, in `unit`.
///
/// # Errors
/// It is not.
pub fn positive_up_to(key: &str, value: f64, max: f64, unit: &str) -> Result<(), ParameterError> {
    let is_good = value > 0.0 && value <= max;
    require(key, value, is_good, format!("above 0 and at most {max} {unit}").trim_end())
}

/// Passes a number above zero and up to `max`, in `unit`, as [`positive_up_to`] does.
pub fn up_to(max: f64, unit: &'static str) -> impl Fn(&str, f64) -> Result<(), ParameterError> {
    move |key, value| positive_up_to(key, value, max, unit)
}

/// Passes a number in `range`, which `expected` describes.
///
/// ```
/// use diagnostics::parameter::within;
///
/// assert!(within(0.0..=1.0, "0 to 1")("loss", 1.5).is_err());
/// ```
pub fn within(
    range: impl RangeBounds<f64>,
    expected: &'static str,
) -> impl Fn(&str, f64) -> Result<(), ParameterError> {
    move |key, value| require(key, value, range.contains(&value), expected)
}

/// Passes numbers that `check` passes, each.
///
/// # Errors
/// The first that it refuses.
///
/// ```
/// use diagnostics::parameter::{all, finite};
///
/// assert!(all(finite, "start_m", &[0.0, 1.0]).is_ok());
/// assert!(all(finite, "start_m", &[0.0, f64::NAN]).is_err());
/// ```
pub fn all(
    check: impl Fn(&str, f64) -> Result<(), ParameterError>,
    key: &str,
    values: &[f64],
) -> Result<(), ParameterError> {
    values.iter().try_for_each(|value| check(key, *value))
}

/// Range of a quantity in SI, and the reason for its ends.
///
/// ```
/// use diagnostics::parameter::Bounds;
///
/// const GRAVITY: Bounds = Bounds { min: 0.0, max: 300.0, unit: "m/s^2", why: "the sun has 274" };
/// assert!(GRAVITY.check("gravity", 9.81).is_ok());
/// let error = GRAVITY.check("gravity", 981.0).unwrap_err();
/// assert_eq!(error.to_string(), "`gravity` must be 0.0 to 300.0 m/s^2 (the sun has 274), found 981.0 m/s^2");
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// The least.
    pub min: f64,
    /// The most.
    pub max: f64,
    /// Their unit.
    pub unit: &'static str,
    /// The things that have the most and the least, or the reason why nothing that flies has more.
    pub why: &'static str,
}

impl Bounds {
    /// True if `si` lies within, both ends included; no NaN does.
    fn contains(&self, si: f64) -> bool {
        (self.min..=self.max).contains(&si)
    }

    /// The number `si` for a message on it: without the last digits of a conversion to SI, unless they take it out of the range.
    fn shown(&self, si: f64) -> f64 {
        let rounded = format!("{si:.8e}").parse().unwrap_or(si);
        if self.contains(rounded) { si } else { rounded }
    }

    /// Passes a number within.
    ///
    /// # Errors
    /// It is not within.
    pub fn check(&self, key: &str, si: f64) -> Result<(), ParameterError> {
        let Self { min, max, unit, why } = self;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let (expected, found) =
            (format!("{min:?} to {max:?}{unit} ({why})"), format!("{:?}{unit}", self.shown(si)));
        require(key, found, self.contains(si), expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_check_passes_what_is_no_number() {
        for check in [finite, positive, not_negative] {
            assert!(check("a", f64::NAN).is_err() && check("a", f64::INFINITY).is_err());
        }
        assert!(positive_up_to("a", f64::NAN, 1.0, "m").is_err());
        assert!(positive("a", 0.0).is_err() && not_negative("a", 0.0).is_ok());
    }

    #[test]
    fn a_number_is_told_with_its_unit_once() {
        let told = |error: Result<(), ParameterError>, unit| error.unwrap_err().in_unit(unit).to_string();
        assert!(told(positive("ratio", -1.0), "1").ends_with("found -1"));
        assert!(told(positive("mass", -1.0), "kg").ends_with("found -1 kg"));
        let bounds = |unit| Bounds { min: 0.0, max: 1.0, unit, why: "it is so" };
        assert!(told(bounds("kg").check("mass", 2.0), "kg").ends_with("found 2.0 kg"));
        assert!(told(bounds("counts").check("command", 2.0), "1").ends_with("found 2.0 counts"));
        assert!(
            told(bounds("rad").check("angle", 90.1_f64.to_radians()), "rad")
                .ends_with("found 1.57254166 rad")
        );
        assert!(told(bounds("rad").check("angle", 1.0 + 1e-12), "rad").ends_with("found 1.000000000001 rad"));
        let error = bounds("").check("gain", 2.0);
        assert_eq!(told(error, "rad/s"), "`gain` must be 0.0 to 1.0 (it is so), found 2.0 rad/s");
    }

    #[test]
    fn a_misspelt_name_among_several_is_told_with_the_one_that_is_meant() {
        let value =
            |found: &str| ParameterError::value("channels", "one of `position`, `attitude`", found).help();
        assert_eq!(value("`positoin`"), "did you mean `position`?");
        assert_eq!(value("3"), "");
    }

    #[test]
    fn several_errors_are_one_until_they_are_taken_apart() {
        let checks = || [positive("a", -1.0), finite("b", 1.0), finite("c", f64::NAN)];
        let error = ParameterError::gather(checks()).unwrap_err().within("table");
        let told = "`table.a` must be a finite number above 0, found -1\n\
                    `table.c` must be a finite number, found NaN";
        assert_eq!((error.key(), error.to_string().as_str()), ("table.a", told));
        assert_eq!(error.clone().and([error]).into_each().len(), 4);
        assert_eq!(ParameterError::gather([positive("a", -1.0)]), Err(positive("a", -1.0).unwrap_err()));
        assert_eq!(ParameterError::gather([Ok(1), Ok(2)]), Ok(vec![1, 2]));
        let both = ParameterError::both(positive("a", 0.0), finite("b", f64::NAN)).unwrap_err();
        let named = both.of("plant").into_each();
        assert!(named.iter().all(|error| error.to_string().starts_with("plant: ")), "{named:?}");
    }

    #[test]
    fn advice_goes_with_its_error() {
        let refused = |advice: &str| {
            refuse(true, "a", || "a and b exclude each other").map_err(|error| error.advised(advice))
        };
        let error = refused("leave b out").unwrap_err().reworded(|text| text.replace('b', "c"));
        assert_eq!(
            (error.to_string(), error.help()),
            ("a and c exclude each other".into(), "leave c out".into())
        );
        let both =
            ParameterError::both(refused(""), positive("d", 0.0)).unwrap_err().advised("leave one out");
        let helps: Vec<String> = both.of("plant").into_each().iter().map(ParameterError::help).collect();
        assert_eq!(helps, ["leave one out", ""]);
        // What follows from the error itself is kept behind the name of a component, too.
        let value = ParameterError::value("kind", "\"step\", \"ramp\" or \"doublet\"", "\"stp\"").of("plant");
        assert_eq!((value.help(), value.key()), ("did you mean `step`?".into(), "kind"));
    }

    #[test]
    fn an_unknown_key_is_told_with_those_that_there_are() {
        let known = vec!["gains".to_owned(), "vehicle".to_owned()];
        let error = ParameterError::Unknown { key: "gain".to_owned(), known };
        assert_eq!(error.to_string(), "unknown key `gain`, expected one of `gains`, `vehicle`");
    }
}
