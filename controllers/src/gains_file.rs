//! Gains files: TOML as vehicle files are, every number with its unit and source, positions in the errors.
//!
//! Each law has a room that says which tables its file has. The file that a law is tuned with is built in, and
//! serves where the manifest names none.

use diagnostics::parameter::Bounds;
use diagnostics::unit::Dimension;
use std::path::Path;
use vehicles::VehicleError;
use vehicles::reader::{Document, Section};

/// What makes gains of a file's root table.
pub type Reader<G> = fn(&Section<'_, '_>) -> Result<G, VehicleError>;

/// The gains in the file at `path`.
///
/// # Errors
/// The file cannot be read, or `read` refuses it.
pub fn load<G>(path: &Path, read: Reader<G>) -> Result<G, VehicleError> {
    let file = path.display().to_string();
    match vehicles::text::read(path) {
        Ok(text) => parse(&text, &file, read),
        Err(cause) => Err(VehicleError::Unreadable { file, cause }),
    }
}

/// The gains in `text`; `file_name` is for messages only.
///
/// # Errors
/// `read` refuses the text, or it has a table that `read` does not know.
pub fn parse<G>(text: &str, file_name: &str, read: Reader<G>) -> Result<G, VehicleError> {
    let doc = Document::new(file_name, text);
    let tree = doc.tree()?;
    let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
    let gains = read(&root)?;
    root.finish()?;
    Ok(gains)
}

/// The most that a gain is, in its unit: a loop that is closed once a tick of 1 µs, the shortest, holds an angle with
/// less than 4/T², a rate with less than 2/T, and is far from either with every motor.
pub(crate) const GAIN: Bounds = Bounds {
    min: 0.0,
    max: 1e9,
    unit: "in SI",
    why: "a negative gain turns a loop against itself, and no run has ticks short enough for a larger one",
};

/// A limit, a weight's deviation or a time, in its unit: none that is of use to a vehicle is so small or so large.
const LIMIT: Bounds = Bounds {
    min: 1e-12,
    max: 1e12,
    unit: "in SI",
    why: "a limit, a deviation or a time is above 0: less than 1e-12 of any unit lets nothing through, and from 1e12 \
          on squares and products of it are no figures of a vehicle",
};

/// A gain: zero or more, since a negative one turns a loop against itself.
pub(crate) fn gain(section: &Section, name: &'static str, of: Dimension) -> Result<f64, VehicleError> {
    Ok(section.chosen(name, of)?.not_negative(section.doc)?.within(section.doc, &GAIN)?.si)
}

/// A limit or a time: more than zero.
pub(crate) fn limit(section: &Section, name: &'static str, of: Dimension) -> Result<f64, VehicleError> {
    Ok(section.chosen(name, of)?.positive(section.doc)?.within(section.doc, &LIMIT)?.si)
}

/// A limit that is more than zero and less than `bound`, which `expected` describes.
pub(crate) fn limit_below(
    section: &Section,
    name: &'static str,
    of: Dimension,
    bound: f64,
    expected: &str,
) -> Result<f64, VehicleError> {
    let chosen = section.chosen(name, of)?.positive(section.doc)?.within(section.doc, &LIMIT)?;
    let holds = chosen.si < bound;
    Ok(chosen.require(section.doc, holds, expected)?.si)
}

/// Bandwidths stay below this, rad/s. Tuned, no source: a fifth of 1 kHz, at which an observer or a lag that is stepped
/// once a tick still behaves as the continuous one; from some 1000 rad/s on it diverges.
const BANDWIDTH_MAX_RAD_S: f64 = 200.0;

/// A bandwidth that steps of 1 ms resolve.
pub(crate) fn bandwidth(section: &Section, name: &'static str) -> Result<f64, VehicleError> {
    let expected = "a bandwidth above 0 and below 200 rad/s, up to which steps of 1 ms resolve it";
    limit_below(section, name, diagnostics::unit::SPEED, BANDWIDTH_MAX_RAD_S, expected)
}

/// A tilt that the altitude loop can make up for.
pub(crate) fn tilt(section: &Section, name: &'static str) -> Result<f64, VehicleError> {
    let expected = "an angle above 0 and below 60 degrees, up to which the thrust makes up for a tilt";
    limit_below(section, name, diagnostics::unit::ANGLE, std::f64::consts::FRAC_PI_3, expected)
}
