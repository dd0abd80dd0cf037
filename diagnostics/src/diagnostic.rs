//! Fault of a file that a person wrote: the place, what was expected, what was found, what to do.

use crate::nearest::nearest;
use crate::parameter::{FileFault, FileFaults, ParameterError};
use crate::place::Place;
use crate::plain::plain;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::collections::BTreeSet;
use std::fmt;
use std::io;

/// Fault at a place in a file, and the other faults of the file.
///
/// ```
/// use diagnostics::{Diagnostic, ParameterError, Place};
///
/// let text = "[body]\nmass_kg = -1\n";
/// let place = Place::of("a.toml", text, &(17..19));
/// let error = Diagnostic::at(place, ParameterError::value("body.mass_kg", "a number above 0", -1));
/// assert_eq!(error.key(), "body.mass_kg");
/// assert_eq!(
///     error.to_string(),
///     "a.toml:2:11: `body.mass_kg` must be a number above 0, found -1"
/// );
///
/// // All errors of a file at once.
/// let missing = Diagnostic::in_file("a.toml", "no rotors").help("add [[rotors]]");
/// let both = Diagnostic::gather([Ok(1), Err(error), Err(missing)]).unwrap_err();
/// assert_eq!(both.all().count(), 2);
///
/// // For terminals, with the line.
/// assert_eq!(
///     format!("{both:#}"),
///     "a.toml:2:11: `body.mass_kg` must be a number above 0, found -1
///   |
/// 2 | mass_kg = -1
///   |           ^^
/// error: a.toml: no rotors
///   help: add [[rotors]]"
/// );
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// The file's name as it was given to the reader; empty where it is about none.
    pub file: String,
    /// Place in the file; none where the fault is of the whole.
    pub place: Option<Place>,
    /// The key, the expected value and the value that was found.
    pub error: ParameterError,
    /// Advice; empty where the message says it.
    pub help: String,
    /// Everything beside this fault; in a box, since faults are passed on in results.
    beside: Box<Beside>,
}

/// Everything beside a fault.
#[derive(Debug, Clone, Default, PartialEq)]
struct Beside {
    /// Other faults of the file.
    others: Vec<Diagnostic>,
    /// Legal but unusual values, which may explain the faults.
    warnings: Vec<Diagnostic>,
}

impl Diagnostic {
    /// Advice on a file that cannot be read at all.
    pub const CHECK_PATH: &'static str = "check the path";
    /// Advice on a file whose bytes are not text.
    const SAVE_AS_TEXT: &'static str = "save it as UTF-8 text, or check the path";

    /// Creates a fault of the whole file.
    #[must_use]
    pub fn in_file(file: impl Into<String>, error: impl Into<ParameterError>) -> Self {
        let error = error.into();
        let help = error.help();
        Self { file: file.into(), place: None, error, help, beside: Box::default() }
    }

    /// Creates a fault at `place`.
    #[must_use]
    pub fn at(place: Place, error: impl Into<ParameterError>) -> Self {
        Self { place: Some(place.clone()), ..Self::in_file(place.file, error) }
    }

    /// A file that cannot be read at all.
    #[must_use]
    pub fn unreadable(file: impl Into<String>, cause: &io::Error) -> Self {
        let help =
            if cause.kind() == io::ErrorKind::InvalidData { Self::SAVE_AS_TEXT } else { Self::CHECK_PATH };
        Self::in_file(file, format!("cannot read this file: {}", plain(&cause.to_string()))).help(help)
    }

    /// The same with `help` as advice.
    #[must_use]
    pub fn help(self, help: impl Into<String>) -> Self {
        Self { help: help.into(), ..self }
    }

    /// Creates the error of the parameter `key`, which names the file of these faults.
    ///
    /// ```
    /// use diagnostics::{Diagnostic, Place};
    ///
    /// let fault = Diagnostic::at(Place::of("bird.toml", "mass = -1\n", &(7..9)), "it is negative");
    /// let named = fault.named_by("vehicle").of("process `plant`");
    /// let place = Place::of("hover.toml", "vehicle = 'bird.toml'\n", &(10..21));
    /// let error = Diagnostic::at(place, named);
    /// assert_eq!(error.to_string(), "hover.toml:1:11: process `plant`: bird.toml:1:8: it is negative");
    /// // For terminals: the line that is wrong, once.
    /// let shown = format!("{error:#}");
    /// assert!(shown.starts_with("bird.toml:1:8: it is negative\n  |\n1 | mass = -1\n"));
    /// assert!(shown.ends_with("\n  named in hover.toml:1:11 by process `plant`"));
    /// ```
    #[must_use]
    pub fn named_by(&self, key: impl Into<String>) -> ParameterError {
        let each = self.all().map(FileFault::from).collect();
        let faults = FileFaults { each, who: String::new(), also: Vec::new() };
        ParameterError::File { key: key.into(), faults: Box::new(faults) }
    }

    /// The dotted key that is to blame; empty where none is in particular.
    #[must_use]
    pub fn key(&self) -> &str {
        self.error.key()
    }

    /// Iterates over this fault and the others of the file, each on its own.
    pub fn all(&self) -> impl Iterator<Item = Self> + '_ {
        let alone = Self { beside: Box::default(), ..self.clone() };
        std::iter::once(alone).chain(self.beside.others.iter().cloned())
    }

    /// This, and `others` beside it.
    #[must_use]
    pub fn and(mut self, others: impl IntoIterator<Item = Self>) -> Self {
        for mut other in others {
            let more = std::mem::take(&mut other.beside.others);
            self.beside.others.push(other);
            self.beside.others.extend(more);
        }
        self
    }

    /// The same faults, with `warnings` that may explain them.
    #[must_use]
    pub fn with_warnings(mut self, warnings: Vec<Self>) -> Self {
        self.beside.warnings = warnings;
        self
    }

    /// Legal but unusual values beside the faults; its text is without them.
    #[must_use]
    pub fn warnings(&self) -> &[Self] {
        &self.beside.warnings
    }

    /// The same faults, each told once: a misspelt key is not missing as well, and the faults of a file that several
    /// components read are those of all.
    fn each_once(self) -> Self {
        let mut faults: Vec<Self> = self.all().collect();
        join_misspelt(&mut faults);
        // A file is told where it is named first.
        in_order_of_lines(&mut faults);
        let mut once: Vec<Self> = Vec::with_capacity(faults.len());
        for mut fault in faults {
            let is_told = once.iter_mut().any(|told| told.takes_over(&mut fault));
            if !is_told {
                once.push(fault);
            }
        }
        in_order_of_lines(&mut once);
        let mut once = once.into_iter();
        once.next().map_or(self, |first| first.and(once))
    }

    /// Takes the faults of the same file from `other`, and adds its component; true if `other` has no more faults.
    fn takes_over(&mut self, other: &mut Self) -> bool {
        let (ParameterError::File { faults: told, .. }, ParameterError::File { faults: new, .. }) =
            (&mut self.error, &mut other.error)
        else {
            return false;
        };
        let count = new.each.len();
        new.each.retain(|fault| !told.each.contains(fault));
        if let (true, Some(place)) = (new.each.len() < count, &other.place) {
            told.also.push((new.who.clone(), place.clone()));
            told.also.append(&mut new.also);
        }
        new.each.is_empty()
    }

    /// Gathers the results of all `checks`.
    ///
    /// # Errors
    /// Those of all checks as one, so that one look shows every fault.
    pub fn gather<T>(checks: impl IntoIterator<Item = Result<T, Self>>) -> Result<Vec<T>, Self> {
        let mut faults = Faults::default();
        let passed = checks.into_iter().filter_map(|check| faults.keep(check)).collect();
        faults.finish(Some(passed))
    }
}

/// Sorts `faults` by their lines; their files stay in the order of their first faults, and those without a place are last.
fn in_order_of_lines(faults: &mut [Diagnostic]) {
    let mut files: Vec<String> = Vec::new();
    for place in faults.iter().filter_map(|fault| fault.place.as_ref()) {
        if !files.contains(&place.file) {
            files.push(place.file.clone());
        }
    }
    let number = |file: &String| files.iter().position(|other| other == file);
    faults.sort_by_key(|fault| match &fault.place {
        Some(place) => (number(&place.file).unwrap_or(files.len()), place.line, place.column),
        None => (files.len(), 0, 0),
    });
}

/// The faults of a file, gathered on the way so that one look shows all of them.
///
/// ```
/// use diagnostics::{Diagnostic, Faults};
///
/// let mut faults = Faults::default();
/// let name = faults.keep(Ok("bird"));
/// let mass_kg = faults.keep::<f64>(Err(Diagnostic::in_file("a.toml", "no mass")));
/// assert_eq!(faults.finish(name.zip(mass_kg)).unwrap_err().to_string(), "a.toml: no mass");
/// ```
#[derive(Debug, Default)]
pub struct Faults(Vec<Diagnostic>);

impl Faults {
    /// Returns the value that was read; keeps the fault and returns `None`, if it is faulty.
    pub fn keep<T>(&mut self, read: Result<T, Diagnostic>) -> Option<T> {
        read.map_err(|fault| self.0.push(fault)).ok()
    }

    /// True if there were none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// `value`, which is there unless there were faults.
    ///
    /// # Errors
    /// The faults there were.
    ///
    /// # Panics
    /// If there is neither a value nor a fault.
    pub fn finish<T>(self, value: Option<T>) -> Result<T, Diagnostic> {
        let mut faults = self.0.into_iter();
        match faults.next() {
            Some(first) => Err(first.and(faults).each_once()),
            None => Ok(value.expect("what is not faulty was read")),
        }
    }
}

/// The fault alone, without the others of the file.
impl From<Diagnostic> for FileFault {
    fn from(fault: Diagnostic) -> Self {
        Self {
            key: fault.key().to_owned(),
            message: fault.error.to_string(),
            text: fault.to_string(),
            shown: format!("{fault:#}"),
            file: fault.file,
            place: fault.place,
            help: fault.help,
        }
    }
}

/// Drops each missing key for which an unknown one of the same table stands: it is misspelt.
fn join_misspelt(faults: &mut Vec<Diagnostic>) {
    let mut joined = BTreeSet::new();
    for index in 0..faults.len() {
        let unknown = &faults[index];
        if !unknown.is_unknown() {
            continue;
        }
        let (table, written) = split(unknown.key());
        let is_twin = |at: &usize| {
            let fault = &faults[*at];
            fault.is_missing() && fault.file == unknown.file && split(fault.key()).0 == table
        };
        let twins: Vec<usize> = (0..faults.len()).filter(|at| is_twin(at) && !joined.contains(at)).collect();
        let name = |at: &usize| split(faults[*at].key()).1;
        let Some(meant) = nearest(written, twins.iter().map(name)) else { continue };
        let twin = twins.iter().find(|at| name(at) == meant).copied();
        let help = format!("did you mean `{meant}`?");
        joined.extend(twin);
        faults[index].help = help;
    }
    let mut at = 0..;
    faults.retain(|_| at.next().is_some_and(|at| !joined.contains(&at)));
}

/// The table of a dotted key, and its last name.
fn split(key: &str) -> (&str, &str) {
    key.rsplit_once('.').unwrap_or(("", key))
}

impl Diagnostic {
    fn is_missing(&self) -> bool {
        matches!(self.error, ParameterError::Missing { .. })
    }

    fn is_unknown(&self) -> bool {
        matches!(self.error, ParameterError::Unknown { .. })
    }
}

/// As an object: file, line, column, message, help.
impl Serialize for Diagnostic {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Diagnostic", 5)?;
        object.serialize_field("file", &self.file)?;
        object.serialize_field("line", &self.place.as_ref().map(|place| place.line))?;
        object.serialize_field("column", &self.place.as_ref().map(|place| place.column))?;
        object.serialize_field("message", &self.error.to_string())?;
        object.serialize_field("help", &self.help)?;
        object.end()
    }
}

/// `file:line:column: message`, which editors jump to, then `help:`; with `{:#}` the line of the file between them.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.error, &self.place) {
            (ParameterError::File { faults, .. }, Some(place)) if f.alternate() => {
                let by = |who: &str| if who.is_empty() { String::new() } else { format!(" by {who}") };
                write!(f, "{faults:#}\n  named in {place}{}", by(&faults.who))?;
                for (who, place) in &faults.also {
                    write!(f, ", and in {place}{}", by(who))?;
                }
            }
            _ => self.write_head(f)?,
        }
        if !self.help.is_empty() {
            write!(f, "\n  help: {}", self.help)?;
        }
        for other in &self.beside.others {
            // Whoever prints it has written the word before the first.
            f.write_str(if f.alternate() { "\nerror: " } else { "\n" })?;
            other.fmt(f)?;
        }
        Ok(())
    }
}

impl Diagnostic {
    /// Place and message, for terminals with the line.
    fn write_head(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{place}: {}", self.error)?,
            None if self.file.is_empty() => write!(f, "{}", self.error)?,
            None => write!(f, "{}: {}", self.file, self.error)?,
        }
        match (&self.place, f.alternate()) {
            (Some(place), true) => write!(f, "\n{place:#}"),
            _ => Ok(()),
        }
    }
}

impl std::error::Error for Diagnostic {}

#[cfg(test)]
mod tests {
    use super::{Diagnostic, ParameterError, Place};

    fn at(offset: usize) -> Diagnostic {
        Diagnostic::at(Place::of("a.toml", "x = 1\ny = 2\n", &(offset..offset + 1)), "bad value")
    }

    #[test]
    fn a_diagnostic_names_file_line_and_column() {
        let error = at(10).help("give another");
        assert_eq!(error.to_string(), "a.toml:2:5: bad value\n  help: give another");
    }

    #[test]
    fn advice_on_text_is_given_where_the_bytes_are_no_text() {
        use std::io::{Error, ErrorKind};
        let told = |kind| Diagnostic::unreadable("a.toml", &Error::new(kind, "odd")).to_string();
        assert!(told(ErrorKind::InvalidData).contains("UTF-8"));
        assert!(told(ErrorKind::NotFound).ends_with("help: check the path"));
    }

    #[test]
    fn a_misspelt_key_is_one_fault() {
        let at = |error| Diagnostic::at(Place::of("a.toml", "mas = 1", &(0..3)), error);
        let missing = |key: &str| Err::<(), _>(at(ParameterError::missing(key, "")));
        let unknown = |key: &str| Err(at(ParameterError::unknown(key, ["gravity", "mass", "max"])));
        let faults =
            [missing("body.mass"), missing("body.gravity"), missing("motor.mass"), unknown("body.mas")];
        let gathered = Diagnostic::gather(faults).unwrap_err();
        let keys: Vec<String> = gathered.all().map(|fault| fault.key().to_owned()).collect();
        assert_eq!(keys, ["body.gravity", "motor.mass", "body.mas"]);
        assert!(gathered.to_string().ends_with("did you mean `mass`?"), "{gathered}");
        let shuffled = Diagnostic::gather([unknown("mas"), missing("mass")]).unwrap_err();
        assert_eq!(shuffled.all().count(), 1);
    }

    #[test]
    fn a_fault_of_a_file_of_several_components_is_told_once() {
        let named = |line: usize, who: &str, faults: usize| {
            let all: Vec<_> =
                [4, 10].into_iter().take(faults).map(|offset| Err::<(), _>(at(offset))).collect();
            let error = Diagnostic::gather(all).unwrap_err().named_by("vehicle").of(who);
            Err::<(), _>(Diagnostic::at(Place::of("m.toml", "\n\n\n", &(line..line)), error))
        };
        let both = Diagnostic::gather([named(0, "plant", 1), named(1, "controller", 1)]).unwrap_err();
        assert_eq!(both.to_string(), "m.toml:1:1: plant, controller: a.toml:1:5: bad value");
        let shown = format!("{both:#}");
        assert_eq!(shown.matches("bad value").count(), 1, "{shown}");
        assert!(shown.ends_with("named in m.toml:1:1 by plant, and in m.toml:2:1 by controller"), "{shown}");
        let two = Diagnostic::gather([named(0, "plant", 2)]).unwrap_err();
        assert!(format!("{two:#}").contains("\nerror: a.toml:2:5: bad value"), "{two:#}");
        // The fault of one of them alone stays beside it.
        let more = Diagnostic::gather([named(0, "plant", 1), named(1, "controller", 2)]).unwrap_err();
        let shown = format!("{more:#}");
        assert_eq!(
            (shown.matches("a.toml:1:5").count(), shown.matches("a.toml:2:5").count()),
            (1, 1),
            "{shown}"
        );
    }

    #[test]
    fn several_are_told_at_once_each_with_its_place() {
        let gathered = Diagnostic::gather([Ok(1), Err(at(4)), Ok(2), Err(at(10))]).unwrap_err();
        assert_eq!(gathered.to_string(), "a.toml:1:5: bad value\na.toml:2:5: bad value");
        let gathered = Diagnostic::in_file("b.toml", "bad").and([gathered]);
        assert_eq!(gathered.all().count(), 3);
        assert_eq!(Diagnostic::gather::<i32>([Ok(1), Ok(2)]), Ok(vec![1, 2]));
    }
}
