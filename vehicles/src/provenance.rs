//! Where a number of a vehicle file came from: kept beside the physics for reports and refits.

/// How well a number is known.
#[derive(Debug, Clone, PartialEq)]
pub enum Uncertainty {
    /// One standard deviation, converted to SI like the value itself.
    OneSigma(f64),
    /// What the file says in words, such as "not stated".
    Said(String),
}

/// One parameter as the file gave it.
#[derive(Debug, Clone, PartialEq)]
pub struct Provenance {
    /// Dotted key, such as `body.mass`.
    pub key: String,
    /// Line in the file, from 1.
    pub line: usize,
    /// The unit the file used (the source's own).
    pub unit: String,
    /// The source as the file cites it.
    pub source: String,
    /// How well it is known.
    pub uncertainty: Uncertainty,
}
