//! Units and scales in which a channel's values would be right.

use diagnostics::unit::ROTOR_SPEED;
use toml::Spanned;
use vehicles::CommandMap;

use crate::declaration::{ChannelMap, EachNumber, Entry};
use crate::finding::Finding;
use crate::quantity::{FRACTION, PERCENT, Quantity};

/// ESCs of Betaflight and others log their electrical speeds in hundreds of revolutions a minute.
pub const HUNDREDS: f64 = 100.0;
/// Counts of sensors are as near to some units as this factor: beyond it, a scale is as likely as a unit.
const EXACT: f64 = 1.05;
/// Units of accelerations that no channel is declared in, with their sizes in m/s^2.
const FOREIGN_M_S2: [(&str, f64); 3] = [("mm/s^2", 1e-3), ("cm/s^2", 1e-2), ("ft/s^2", 0.3048)];
/// Units of times that no channel is declared in, with their sizes in s. Spreadsheets and MATLAB count days.
const FOREIGN_S: [(&str, f64); 3] = [("minutes", MINUTE_S), ("hours", 3600.0), ("days", 86_400.0)];
const MINUTE_S: f64 = 60.0;
/// A scale that is measured by the force of a flight is right within this factor: the median force is not exactly gravity's.
const SCALE_TOLERANCE: f64 = 1.25;
/// Values that no unit explains are refused beyond this factor.
const GROSS: f64 = 3.0;

/// The declared units of a flight's channels.
pub struct Units<'a> {
    /// Declaration in the flights file.
    pub channels: &'a ChannelMap,
}

impl Units<'_> {
    /// The units in which the values would lie in `range`.
    pub fn units_within(&self, quantity: Quantity, value: f64, range: (f64, f64)) -> Option<String> {
        let raw = value / self.factor(quantity);
        let fits = |(_, factor): &&(&str, f64)| (range.0..range.1).contains(&(raw * factor));
        let names: Vec<String> =
            self.other_units(quantity).filter(fits).map(|(name, _)| of_unit(name)).collect();
        (!names.is_empty()).then(|| names.join(" or "))
    }

    /// A finding for values `factor` times too large: clear if another unit explains it within `tolerance`.
    pub fn by_unit(&self, quantity: Quantity, factor: f64, tolerance: f64, what: &str) -> Option<Finding> {
        if factor > 0.0 && libm::log(factor).abs() < libm::log(tolerance) {
            return None;
        }
        let fits = self.unit_that_fits(quantity, factor, tolerance).map(|unit| {
            let is_scaled = self.declared(quantity).is_some_and(|entry| entry.scale.is_some());
            // The size of a rotor's speed, or of the force in a flight that leans, is not known as well.
            let is_derivative = matches!(quantity, Quantity::AngularVelocity | Quantity::Velocity);
            let is_exact = !is_derivative || self.unit_that_fits(quantity, factor, EXACT).is_some();
            match (is_exact, is_scaled) {
                (true, false) => match self.exact_scale(quantity, factor) {
                    // No flight shows the 2 % between mg and cm/s^2.
                    Some(foreign) => format!("{unit} or {foreign}"),
                    None => unit,
                },
                (true, true) => format!("{unit}, or {}", self.scale(quantity, factor)),
                (false, _) => self.scale_before(quantity, factor, &unit),
            }
        });
        Some(finding(quantity, fits, &format!("declared in {}, {what}", self.unit(quantity))))
    }

    /// As [`Self::by_unit`], but also clear where no unit explains a gross factor.
    pub fn by_unit_or_scale(
        &self,
        quantity: Quantity,
        factor: f64,
        tolerance: f64,
        what: &str,
    ) -> Option<Finding> {
        let found = self.by_unit(quantity, factor, tolerance, what)?;
        let is_unexplained = found.fits.is_none() && is_gross(factor);
        Some(if is_unexplained { self.by_scale(quantity, factor, what) } else { found })
    }

    /// A finding for values that are `factor` times too large in the declared unit, and wrong in all others.
    pub fn by_scale(&self, quantity: Quantity, factor: f64, what: &str) -> Finding {
        let exact = self.exact_scale(quantity, factor);
        let scale = exact.unwrap_or_else(|| self.measured_scale(quantity, factor));
        let fits = format!("no unit alone, but {scale}");
        finding(quantity, Some(fits), &format!("declared in {}, {what}", self.unit(quantity)))
    }

    /// Advice of a scale, where `unit` alone is near and leaves an error, which is said.
    pub fn scale_before(&self, quantity: Quantity, factor: f64, unit: &str) -> String {
        let errors =
            self.other_units(quantity).map(|(_, other)| factor * other / self.factor(quantity) - 1.0);
        let error = errors.min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
        let (percent, way) = (100.0 * error.abs(), if error > 0.0 { "large" } else { "small" });
        let scale = self.scale(quantity, factor);
        format!("{scale} ({unit} alone leaves the values about {percent:.0} % too {way})")
    }

    /// The keys for accelerations in a foreign unit, if its size is near the measured one.
    fn exact_scale(&self, quantity: Quantity, factor: f64) -> Option<String> {
        let declared = match self.declared(quantity).and_then(|entry| entry.scale.as_ref()) {
            None => 1.0,
            Some(EachNumber::All(scale)) => *scale,
            Some(EachNumber::Each(_)) => return None,
        };
        let measured = declared * self.factor(quantity) / factor;
        let is_near = |size: f64| libm::log(size / measured).abs() < libm::log(SCALE_TOLERANCE);
        let mut foreign = FOREIGN_M_S2.iter().filter(|_| quantity == Quantity::SpecificForce);
        let (name, size) = foreign.find(|(_, size)| is_near(*size))?;
        Some(format!("{} with `scale = {size}` ({name})", of_unit(quantity.dimension().si())))
    }

    /// The keys for times in foreign units whose sizes are `right`; `None` beside a scale that is declared already.
    pub fn long_times(&self, right: impl Fn(f64) -> bool) -> Option<String> {
        self.declared(Quantity::Time).filter(|entry| entry.scale.is_none())?;
        let named = |(name, size): &(&str, f64)| format!("{} with `scale = {size}` ({name})", of_unit("s"));
        let fitting: Vec<String> = FOREIGN_S.iter().filter(|(_, size)| right(*size)).map(named).collect();
        (!fitting.is_empty()).then(|| fitting.join(" or "))
    }

    /// The measured scale; of a sensor with the source of the exact one.
    fn measured_scale(&self, quantity: Quantity, factor: f64) -> String {
        let scale = self.scale(quantity, factor);
        // Times in minutes make everything turn faster than the gyroscope says.
        let is_by_minutes = libm::log(factor * MINUTE_S).abs() < libm::log(EXACT);
        match quantity {
            Quantity::AngularVelocity if is_by_minutes => {
                format!("`scale = {MINUTE_S}` of `time` (minutes), or {scale} here,")
            }
            Quantity::AngularVelocity | Quantity::SpecificForce => {
                format!("{scale} (take the figure of the sensor's data sheet)")
            }
            _ => scale,
        }
    }

    /// The scale with which values are right that are `factor` times too large.
    fn scale(&self, quantity: Quantity, factor: f64) -> String {
        match self.declared(quantity).and_then(|entry| entry.scale.as_ref()) {
            None => format!("a `scale` of about {}", rounded(1.0 / factor)),
            Some(EachNumber::All(scale)) => format!("a `scale` of about {}", rounded(scale / factor)),
            Some(EachNumber::Each(_)) => format!("a `scale` {} times as large", rounded(1.0 / factor)),
        }
    }

    /// The one reading in which values would be right that are now `factor` times too large; `None` where several would
    /// be.
    pub fn unit_that_fits(&self, quantity: Quantity, factor: f64, tolerance: f64) -> Option<String> {
        let declared = self.factor(quantity);
        let is_near = |other: f64| libm::log((factor * other / declared).abs()).abs() < libm::log(tolerance);
        let units = self.other_units(quantity).map(|(name, other)| (of_unit(name), *other));
        let is_scaled = self.declared(quantity).is_some_and(|entry| entry.scale.is_some());
        let hundreds = ROTOR_SPEED.factor("rpm").filter(|_| quantity == Quantity::RotorSpeed && !is_scaled);
        let hundreds = hundreds.map(|rpm| (of_hundreds(), HUNDREDS * rpm));
        let mut fitting = units.chain(hundreds).filter(|(_, other)| is_near(*other)).map(|(name, _)| name);
        fitting.next().filter(|_| fitting.next().is_none())
    }

    /// The units that it is not declared in.
    pub fn other_units(&self, quantity: Quantity) -> impl Iterator<Item = &'static (&'static str, f64)> {
        quantity.dimension().units.iter().filter(move |(name, _)| *name != self.unit(quantity))
    }

    /// The declaration of a channel.
    pub fn declared(&self, quantity: Quantity) -> Option<&Entry> {
        self.channels.get(&quantity).map(Spanned::get_ref)
    }

    /// The declared unit; SI where the flights file leaves it to the type of message.
    pub fn unit(&self, quantity: Quantity) -> &str {
        let declared = self.declared(quantity).and_then(|entry| entry.unit.as_deref());
        declared.unwrap_or(quantity.dimension().units[0].0)
    }

    /// Commands as the log has them: before scale, offset and unit. With a scale or an offset for each number, as they are in the
    /// unit.
    pub fn commands_in_log(&self, commands: [f64; 2], map: CommandMap) -> [f64; 2] {
        let entry = self.declared(Quantity::Command);
        let all = |numbers: Option<&EachNumber>, otherwise: f64| match numbers {
            Some(EachNumber::All(number)) => *number,
            _ => otherwise,
        };
        let scale = all(entry.and_then(|entry| entry.scale.as_ref()), 1.0);
        let offset = all(entry.and_then(|entry| entry.offset.as_ref()), 0.0);
        let is_share = [FRACTION, PERCENT].contains(&self.unit(Quantity::Command));
        let (factor, min) = if is_share {
            (self.factor(Quantity::Command) * (map.max - map.min), map.min)
        } else {
            (1.0, 0.0)
        };
        commands.map(|command| ((command - min) / factor - offset) / scale)
    }

    /// The factor from the declared unit to SI.
    pub fn factor(&self, quantity: Quantity) -> f64 {
        quantity.dimension().factor(self.unit(quantity)).unwrap_or(1.0)
    }
}

/// True for a factor that no vehicle and no sensor explains.
pub fn is_gross(factor: f64) -> bool {
    libm::log(factor.abs()).abs() > libm::log(GROSS)
}

/// Three digits of a number.
fn rounded(number: f64) -> String {
    if (0.01..1000.0).contains(&number) { format!("{number:.3}") } else { format!("{number:.2e}") }
}

/// Four digits of a number, without zeros at the end; a whole number below ten million is whole.
pub fn short(number: f64) -> String {
    let size = number.abs();
    if number.fract() == 0.0 && size < 1e7 {
        return format!("{number:.0}");
    }
    if !(1e-4..1e7).contains(&size) {
        return format!("{number:.3e}");
    }
    let digits = usize::try_from(3 - libm::log10(size).floor() as i32).unwrap_or(0);
    let text = format!("{number:.digits$}");
    if digits > 0 { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The keys for hundreds of revolutions a minute.
pub fn of_hundreds() -> String {
    format!("{} with `scale = {HUNDREDS}` (hundreds)", of_unit("rpm"))
}

/// The key of a unit.
pub fn of_unit(name: &str) -> String {
    format!("`unit = \"{name}\"`")
}

/// A finding about `channel`, clear where something `fits`.
pub fn finding(channel: Quantity, fits: Option<String>, what: &str) -> Finding {
    let advice = fits.as_ref().map_or(String::new(), |fits| format!("; {fits} would fit"));
    Finding { channel, message: format!("`{channel}`: {what}{advice}"), fits }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_have_four_digits() {
        let texts = [28_837_366.05, 42_226_166.550_000_004, 43_988.0, 43_988.4, 76.5, 0.123_456, 1.0, 0.0];
        let expected = ["2.884e7", "4.223e7", "43988", "43988", "76.5", "0.1235", "1", "0"];
        assert_eq!(texts.map(short), expected);
    }
}
