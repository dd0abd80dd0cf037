//! Figures of conditions: values without limits, as the judge of a run hands them to the launcher.

use diagnostics::Error;
use serde::{Deserialize, Serialize};

/// Figures of all conditions of a run, in the order of the manifest.
///
/// ```
/// use report::judge::{Figures, Found};
/// let found = Found { values: vec![1.0, f64::NAN], ..Found::default() };
/// let figures = Figures { pass: vec![found], ..Figures::default() };
/// let read = Figures::of_bytes(&figures.to_bytes()?)?;
/// assert!(read.pass[0].values[1].is_nan());
/// # Ok::<(), diagnostics::Error>(())
/// ```
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Figures {
    /// Figures of the pass conditions.
    pub pass: Vec<Found>,
    /// Figures of the measures.
    pub measures: Vec<Found>,
    /// Figures of the comparisons.
    pub compare: Vec<WindowFigures>,
}

/// Values of one condition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Values: one, or the smallest and the largest; none without a sample.
    pub values: Vec<f64>,
    /// Reason why there are none, if it is another.
    pub why: Option<String>,
    /// Time of the first sample by which the condition fails for any later samples; `None` for a mean, an RMS and the
    /// like.
    pub lost_s: Option<f64>,
    /// Time of the last sample of the span.
    pub last_s: Option<f64>,
}

/// RMS errors of one comparison, NaN without a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowFigures {
    /// Windows compared.
    pub windows: u32,
    /// RMS length of the position error.
    pub position_rms_m: f64,
    /// RMS length of the velocity error.
    pub velocity_rms_m_s: f64,
    /// RMS angle of the attitude error.
    pub attitude_rms_deg: f64,
}

impl Figures {
    /// The figures as bytes, every number exactly.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        postcard::to_stdvec(self).map_err(Error::new)
    }

    /// The figures that [`Figures::to_bytes`] made these `bytes` of.
    ///
    /// # Errors
    /// If the bytes are not such figures.
    pub fn of_bytes(bytes: &[u8]) -> Result<Self, Error> {
        postcard::from_bytes(bytes).map_err(Error::new)
    }
}
