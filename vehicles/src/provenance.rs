//! Where a number of a vehicle file came from: kept beside the physics for reports and refits.

use diagnostics::Place;

/// What a file says as the source of a number that has none.
pub const NO_SOURCE: &str = "none";

/// How well a number is known.
#[derive(Debug, Clone, PartialEq)]
pub enum Uncertainty {
    /// One standard deviation, converted to SI like the value itself.
    OneSigma(f64),
    /// What the file says in words, such as "not stated".
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
    /// How well it is known.
    pub uncertainty: Uncertainty,
}

impl Provenance {
    /// Whether the file cites a source; it says `source = "none"` where there is none.
    #[must_use]
    pub fn has_source(&self) -> bool {
        self.source != NO_SOURCE
    }
}

/// A number with everything that the file says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Stated {
    /// What it is called.
    pub name: String,
    /// The number, in the file's unit.
    pub value: f64,
    /// The file's unit.
    pub unit: String,
    /// Where it comes from.
    pub source: String,
    /// How well it is known, in the file's unit.
    pub uncertainty: Uncertainty,
    /// Where the number stands.
    pub place: Place,
    /// Where the unit stands.
    pub unit_place: Place,
}
