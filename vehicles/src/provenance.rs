//! Provenance of the numbers of a vehicle file: kept beside the physics for reports and refits.

use diagnostics::Place;

/// Text of a file for a number that has no source.
pub const NO_SOURCE: &str = "none";

/// Uncertainty of a number.
#[derive(Debug, Clone, PartialEq)]
pub enum Uncertainty {
    /// One standard deviation, converted to SI like the value itself.
    OneSigma(f64),
    /// Text of the file, such as "not stated".
    Said(String),
}

/// One parameter as the file gave it.
///
/// ```
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml")?;
/// let mass = vehicle.provenance.iter().find(|known| known.key == "body.mass").unwrap();
/// assert!(mass.unit == "kg" && !mass.source.is_empty());
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// Dotted key, such as `body.mass`.
    pub key: String,
    /// The file, as it was named when it was read.
    pub file: String,
    /// Line in the file, from 1.
    pub line: usize,
    /// The unit the file used (the source's own).
    pub unit: String,
    /// The source as the file cites it.
    pub source: String,
    /// Its uncertainty.
    pub uncertainty: Uncertainty,
}

impl Provenance {
    /// True if the file cites a source; otherwise it has `source = "none"`.
    #[must_use]
    pub fn has_source(&self) -> bool {
        self.source != NO_SOURCE
    }
}

/// A number with its facts in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Stated {
    /// Its name.
    pub name: String,
    /// The number, in the file's unit.
    pub value: f64,
    /// The file's unit.
    pub unit: String,
    /// Its source.
    pub source: String,
    /// Its uncertainty, in the file's unit.
    pub uncertainty: Uncertainty,
    /// Place of its key.
    pub key_place: Place,
    /// Place of the number.
    pub place: Place,
    /// Place of the unit.
    pub unit_place: Place,
}
