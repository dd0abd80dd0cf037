//! Failure of a component, or of a process of a run.

use std::error::Error;
use std::fmt;

/// Marks an error as the failure of a component or process of a run: it panicked, returned an error, ended early or was killed.
///
/// Its text and its causes are those of the error that it marks.
///
/// ```
/// use diagnostics::ComponentFailure;
///
/// let failure = ComponentFailure::new(Some("imu"), "the gyroscope is stuck");
/// assert_eq!(failure.process(), Some("imu"));
/// assert_eq!(failure.to_string(), "the gyroscope is stuck");
/// ```
#[derive(Debug)]
pub struct ComponentFailure {
    process: Option<String>,
    error: Box<dyn Error + Send + Sync>,
}

impl ComponentFailure {
    /// Marks `error` as a failure of `process`; `None` where its name is not known.
    #[must_use]
    pub fn new(process: Option<&str>, error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self { process: process.map(str::to_owned), error: error.into() }
    }

    /// Name of the process in its manifest; `clock` for the clock.
    #[must_use]
    pub fn process(&self) -> Option<&str> {
        self.process.as_deref()
    }
}

impl fmt::Display for ComponentFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl Error for ComponentFailure {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.error.source()
    }
}
