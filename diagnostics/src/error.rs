//! Error of the library's functions: opaque, with its causes, and with the side that is at fault.

use crate::component_failure::ComponentFailure;
use crate::diagnostic::Diagnostic;
use crate::parameter::ParameterError;
use anyhow::Chain;
use std::{fmt, io};

/// Result of a function of the library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Error of the library's functions.
///
/// At most one of [`Error::is_input`], [`Error::is_component`] and [`Error::is_system`] is true. If none is, a request
/// cannot be met; the text gives the reason. `Display` writes the outermost error, `{:#}` of a [`Diagnostic`] with its
/// lines; [`source`](std::error::Error::source) leads to the causes. [`Error::with_causes`] and `Debug` write them all.
///
/// ```
/// use diagnostics::{Diagnostic, Error, Place};
///
/// fn read(text: &str) -> diagnostics::Result<f64> {
///     let place = Place::of("a.toml", text, &(7..text.len()));
///     Ok(text[7..].parse().map_err(|_| Diagnostic::at(place, "expected a number"))?)
/// }
///
/// let error = read("mass = heavy").unwrap_err();
/// assert!(error.is_input() && !error.is_component() && !error.is_system());
/// assert_eq!(error.diagnostic().unwrap().file, "a.toml");
/// assert_eq!(error.to_string(), "a.toml:1:8: expected a number");
///
/// let error = Error::from(std::fs::read("/nowhere/a.toml").unwrap_err());
/// assert!(error.is_system() && error.diagnostic().is_none());
/// ```
// The outermost error is never another `Error`: the conversion from `anyhow::Error` takes it out.
pub struct Error(anyhow::Error);

impl Error {
    /// Wraps an error of another library, with its causes.
    #[must_use]
    pub fn new(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        anyhow::Error::new(error).into()
    }

    /// True if something that people wrote is at fault: a file, a manifest or a parameter.
    #[must_use]
    pub fn is_input(&self) -> bool {
        !self.is_component() && (self.diagnostic().is_some() || self.find_cause::<ParameterError>().is_some())
    }

    /// True if a component or process of the run failed: it panicked, returned an error, ended early or was killed.
    #[must_use]
    pub fn is_component(&self) -> bool {
        self.find_cause::<ComponentFailure>().is_some()
    }

    /// True if the operating system refused a request: a file, a process or a right.
    #[must_use]
    pub fn is_system(&self) -> bool {
        !self.is_component() && !self.is_input() && self.find_cause::<io::Error>().is_some()
    }

    /// The fault of a file, with its place and advice.
    #[must_use]
    pub fn diagnostic(&self) -> Option<&Diagnostic> {
        self.find_cause()
    }

    /// Name of the process that failed, if it is known.
    #[must_use]
    pub fn process(&self) -> Option<&str> {
        self.find_cause::<ComponentFailure>()?.process()
    }

    /// Text of the error and of its causes, in one line where theirs are. A cause whose text is already in it is left out.
    ///
    /// ```
    /// use diagnostics::Error;
    ///
    /// #[derive(Debug, thiserror::Error)]
    /// #[error("cannot read a.toml: {source}")]
    /// struct Unreadable {
    ///     source: std::io::Error,
    /// }
    ///
    /// let error = Error::new(Unreadable { source: std::io::Error::other("the disk is gone") });
    /// assert_eq!(error.with_causes(), "cannot read a.toml: the disk is gone");
    /// ```
    #[must_use]
    pub fn with_causes(&self) -> String {
        self.0.chain().skip(1).fold(self.to_string(), |text, cause| {
            if has_text_of(&text, cause) { text } else { format!("{text}: {cause}") }
        })
    }

    /// The first error of type `T` among this one and its causes.
    fn find_cause<T: std::error::Error + 'static>(&self) -> Option<&T> {
        find(self.0.chain())
    }
}

/// The first error of type `T` in a chain of causes.
fn find<T: std::error::Error + 'static>(mut chain: Chain<'_>) -> Option<&T> {
    chain.find_map(|cause| match cause.downcast_ref::<Error>() {
        Some(error) => error.find_cause(),
        // A box is an error of its own, which has the causes of its content.
        None => cause.downcast_ref::<T>().or_else(|| cause.downcast_ref::<Box<T>>().map(|boxed| &**boxed)),
    })
}

/// The first fault of a file among `error` and its causes.
///
/// ```
/// use diagnostics::{Diagnostic, Error, find_diagnostic};
///
/// let error = Error::from(Diagnostic::in_file("a.toml", "no rotors"));
/// assert_eq!(find_diagnostic(&error).unwrap().file, "a.toml");
/// assert_eq!(find_diagnostic(&std::io::Error::other("the disk is gone")), None);
/// ```
#[must_use]
pub fn find_diagnostic<'e>(error: &'e (dyn std::error::Error + 'static)) -> Option<&'e Diagnostic> {
    find(Chain::new(error))
}

/// True if `text` contains the text of `cause`, with or without the lines of files. Of several faults, it may contain each
/// at another place.
///
/// ```
/// use diagnostics::{Diagnostic, has_text_of};
///
/// let fault = Diagnostic::in_file("a.toml", "no rotors").and([Diagnostic::in_file("a.toml", "no mass")]);
/// assert!(has_text_of("a.toml: no rotors; b.toml: empty; a.toml: no mass", &fault));
/// assert!(!has_text_of("a.toml: no rotors", &fault));
/// ```
#[must_use]
pub fn has_text_of(text: &str, cause: &(dyn std::error::Error + 'static)) -> bool {
    let has =
        |part: &dyn fmt::Display| text.contains(&part.to_string()) || text.contains(&format!("{part:#}"));
    has(&cause) || find_here(cause).is_some_and(|fault| fault.all().all(|one| has(&one)))
}

/// `cause` as faults of a file, if it is that itself.
fn find_here<'e>(cause: &'e (dyn std::error::Error + 'static)) -> Option<&'e Diagnostic> {
    cause.downcast_ref().or_else(|| cause.downcast_ref::<Box<Diagnostic>>().map(|boxed| &**boxed))
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&*self.0, f)
    }
}

/// With all causes: a `main` that returns the error prints this.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.source()
    }
}

impl From<anyhow::Error> for Error {
    fn from(error: anyhow::Error) -> Self {
        // `downcast` alone would also take an `Error` out from under a context.
        if (*error).is::<Self>() { error.downcast().unwrap_or_else(Self) } else { Self(error) }
    }
}

impl From<Diagnostic> for Error {
    fn from(error: Diagnostic) -> Self {
        Self(error.into())
    }
}

impl From<ParameterError> for Error {
    fn from(error: ParameterError) -> Self {
        Self(error.into())
    }
}

impl From<ComponentFailure> for Error {
    fn from(error: ComponentFailure) -> Self {
        Self(error.into())
    }
}

impl From<io::Error> for Error {
    fn from(error: io::Error) -> Self {
        Self(error.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place::Place;
    use anyhow::Context;

    fn refused() -> io::Error {
        io::Error::from(io::ErrorKind::PermissionDenied)
    }

    /// [`Error::is_component`], [`Error::is_input`] and [`Error::is_system`].
    fn kinds(error: &Error) -> [bool; 3] {
        [error.is_component(), error.is_input(), error.is_system()]
    }

    #[test]
    fn at_most_one_side_is_at_fault() {
        let of = |error: anyhow::Error| kinds(&error.into());
        assert_eq!(of(anyhow::anyhow!("the swap is over")), [false; 3]);
        assert_eq!(of(refused().into()), [false, false, true]);
        assert_eq!(of(anyhow::Error::from(refused()).context("cannot write")), [false, false, true]);
        assert_eq!(of(ParameterError::from("too large").into()), [false, true, false]);
        assert_eq!(of(Diagnostic::in_file("a.toml", "empty").into()), [false, true, false]);
        let failure = ComponentFailure::new(Some("imu"), anyhow::Error::from(refused()).context("no file"));
        assert_eq!(of(anyhow::Error::from(failure).context("the run ended")), [true, false, false]);
    }

    #[test]
    fn an_error_that_passes_through_anyhow_stays_the_same() {
        let place = Place::of("a.toml", "x = 1\n", &(4..5));
        let fault = Diagnostic::at(place, "too small");
        let passed = |error: Error| anyhow::Error::from(error);
        let error = Error::from(passed(Error::from(passed(fault.clone().into()))));
        assert!(error.0.is::<Diagnostic>(), "it is not wrapped twice");
        assert_eq!((format!("{error}"), format!("{error:#}")), (format!("{fault}"), format!("{fault:#}")));
        assert!(error.diagnostic() == Some(&fault) && std::error::Error::source(&error).is_none());

        let within = Err::<(), _>(error).context("cannot fly");
        let within = Error::from(within.unwrap_err());
        assert_eq!(within.to_string(), "cannot fly");
        assert_eq!(within.diagnostic(), Some(&fault));
        let chain = |error: &anyhow::Error| error.chain().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(chain(&passed(within)), ["cannot fly", "a.toml:1:5: too small"]);
    }

    #[test]
    fn a_marked_failure_has_the_text_and_the_causes_of_its_error() {
        let error = anyhow::Error::from(refused()).context("cannot start `imu`");
        let expected = format!("{error:#}");
        let failure = ComponentFailure::new(Some("imu"), error);
        assert_eq!(format!("{:#}", anyhow::Error::from(failure)), expected);
    }

    #[test]
    fn debug_writes_every_cause() {
        let error = Error::from(anyhow::Error::from(refused()).context("cannot write"));
        let text = format!("{error:?}");
        assert!(text.starts_with("cannot write") && text.contains("permission denied"), "{text}");
        assert_eq!(error.with_causes(), "cannot write: permission denied");
    }

    /// An error whose text contains that of its cause.
    #[derive(Debug, thiserror::Error)]
    #[error("cannot write {path}: {source}")]
    struct Unwritable {
        path: &'static str,
        source: io::Error,
    }

    #[test]
    fn each_text_is_told_once() {
        let unwritable = |path| Unwritable { path, source: refused() };
        assert_eq!(Error::new(unwritable("a")).with_causes(), "cannot write a: permission denied");
        let within = anyhow::Error::from(unwritable("a")).context("the run ended");
        assert_eq!(Error::from(within).with_causes(), "the run ended: cannot write a: permission denied");
        // A context that does not contain its cause is followed by it.
        let within = anyhow::Error::from(unwritable("a")).context("cannot write b");
        assert_eq!(Error::from(within).with_causes(), "cannot write b: cannot write a: permission denied");
    }

    /// Faults of a file behind a text that contains them.
    #[derive(Debug, thiserror::Error)]
    #[error("the vehicle: {cause}")]
    struct Boxed {
        #[source]
        cause: Box<Diagnostic>,
    }

    #[test]
    fn a_diagnostic_in_a_box_is_found_and_told_once() {
        let fault = Diagnostic::in_file("a.toml", "no rotors");
        let error = Error::new(Boxed { cause: Box::new(fault.clone()) });
        assert_eq!(error.diagnostic(), Some(&fault));
        assert!(error.is_input() && !error.is_system());
        assert_eq!(error.with_causes(), "the vehicle: a.toml: no rotors");
        let within = Error::from(anyhow::Error::from(error).context("cannot fly"));
        assert_eq!(find_diagnostic(&within), Some(&fault));
    }
}
