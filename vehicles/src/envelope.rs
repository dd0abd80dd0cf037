//! The flight envelope in which a model of a vehicle was validated: the ranges of the flights that its predictions were
//! compared with. Beyond them it was not compared.

use crate::reader::Section;
use diagnostics::unit::{ACCELERATION, ANGLE, Dimension, FREQUENCY, LENGTH, SPEED, VELOCITY};
use diagnostics::{Diagnostic, Faults};

/// The table `[envelope]` of a vehicle file; a range that no flight showed is absent.
///
/// ```
/// use vehicles::{Vehicle, reference::HUMMINGBIRD};
///
/// let speed = "{ value = 2.5, unit = \"m/s\", source = \"three flights\", uncertainty = \"99 % of the time\" }";
/// let vehicle = Vehicle::parse(&format!("{HUMMINGBIRD}\n[envelope]\nspeed_max = {speed}\n"), "a.toml")?;
/// let envelope = vehicle.envelope.unwrap();
/// assert_eq!((envelope.speed_max_m_s, envelope.tilt_max_rad), (Some(2.5), None));
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Envelope {
    /// Greatest speed in the world.
    pub speed_max_m_s: Option<f64>,
    /// Greatest angle between the body's z axis and the vertical.
    pub tilt_max_rad: Option<f64>,
    /// Greatest angular velocity.
    pub angular_velocity_max_rad_s: Option<f64>,
    /// Greatest specific force: 9.81 m/s² in hover, more under load.
    pub specific_force_max_m_s2: Option<f64>,
    /// Least height: z of the world, as the logs of the validation have it.
    pub height_min_m: Option<f64>,
    /// Greatest height, as the least one.
    pub height_max_m: Option<f64>,
    /// Frequency up to which residuals were compared.
    pub frequency_max_hz: Option<f64>,
}

/// A number of an envelope: its key in files, its dimension, and its place.
pub type EnvelopeNumber = (&'static str, Dimension, fn(&mut Envelope) -> &mut Option<f64>);

impl Envelope {
    /// All numbers, in the order of a file.
    pub const NUMBERS: [EnvelopeNumber; 7] = [
        ("speed_max", VELOCITY, |it| &mut it.speed_max_m_s),
        ("tilt_max", ANGLE, |it| &mut it.tilt_max_rad),
        ("angular_velocity_max", SPEED, |it| &mut it.angular_velocity_max_rad_s),
        ("specific_force_max", ACCELERATION, |it| &mut it.specific_force_max_m_s2),
        ("height_min", LENGTH, |it| &mut it.height_min_m),
        ("height_max", LENGTH, |it| &mut it.height_max_m),
        ("frequency_max", FREQUENCY, |it| &mut it.frequency_max_hz),
    ];
}

/// The `[envelope]` of a vehicle file, if it has one.
///
/// # Errors
/// An unknown key, or one that is not a number with unit, source and uncertainty.
pub(crate) fn read(root: &Section) -> Result<Option<Envelope>, Diagnostic> {
    if !root.has("envelope") {
        return Ok(None);
    }
    let (section, mut envelope) = (root.section("envelope")?, Envelope::default());
    let mut faults = Faults::default();
    for (key, dimension, number) in Envelope::NUMBERS {
        if !section.has(key) {
            continue;
        }
        let low_m = envelope.height_min_m.filter(|_| key == "height_max");
        let read = section.quantity(key, dimension).and_then(|quantity| {
            // Heights may lie below the origin of the world.
            let quantity = if key.starts_with("height") { quantity } else { quantity.positive()? };
            let is_above = low_m.is_none_or(|low_m| quantity.si > low_m);
            quantity.require(is_above, "a height above `envelope.height_min`")
        });
        *number(&mut envelope) = faults.keep(read).map(|quantity| quantity.si);
    }
    faults.keep(section.finish());
    faults.finish(Some(Some(envelope)))
}
