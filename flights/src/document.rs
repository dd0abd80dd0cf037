//! The text of a flights file with its name: places for messages, and the paths written in it.

use std::fmt::Display;
use std::ops::Range;
use std::path::{Path, PathBuf};

use diagnostics::{Diagnostic, ParameterError, Place, nearest};
use serde::de::DeserializeOwned;

use crate::error::FlightsError;
use crate::quantity::Quantity;

/// Other names of channels, as logs and other programs have them.
const OTHER_NAMES: [(Quantity, &[&str]); 9] = [
    (Quantity::Time, &["t", "timestamp", "stamp"]),
    (Quantity::Command, &["actuator", "motor", "motors", "pwm", "throttle", "thrust"]),
    (Quantity::RotorSpeed, &["erpm", "motor_speed", "rpm"]),
    (Quantity::Position, &["pose", "xyz"]),
    (Quantity::Velocity, &["speed", "twist"]),
    (Quantity::Attitude, &["euler", "orientation", "quaternion", "rotation"]),
    (
        Quantity::AngularVelocity,
        &["angular_rate", "angular_rates", "body_rates", "gyro", "gyroscope", "rates"],
    ),
    (Quantity::SpecificForce, &["acc", "accel", "acceleration", "accelerometer", "linear_acceleration"]),
    (Quantity::BatteryVoltage, &["battery", "vbat", "voltage"]),
];

/// Name of the channel that was probably meant, if `told` refuses the name of a channel.
fn meant(told: &str) -> Option<&'static str> {
    let (all, found) = told.lines().next()?.rsplit_once(", found `")?;
    let found = found.strip_suffix('`').filter(|_| all.contains("`angular_velocity`"))?;
    let is_it = |names: &[&str]| names.iter().any(|name| name.eq_ignore_ascii_case(found));
    let other = OTHER_NAMES.iter().find(|(_, names)| is_it(names)).map(|(quantity, _)| quantity.name());
    other.or_else(|| nearest(found, OTHER_NAMES.iter().map(|(quantity, _)| quantity.name())))
}

/// A flights file that was read.
pub struct Document {
    path: PathBuf,
    text: String,
}

impl Document {
    /// The file at `path` with this text.
    pub fn new(path: &Path, text: String) -> Self {
        Self { path: path.to_owned(), text }
    }

    /// The text as a `T`; refuses keys that `T` does not have.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, FlightsError> {
        let read = diagnostics::read_toml(&self.path.display().to_string(), &self.text);
        read.map_err(|error| {
            let help = match meant(&error.to_string()) {
                Some(name) => format!("did you mean `{name}`? docs/flights.md has the format"),
                None if error.help.is_empty() => "docs/flights.md has the format".to_owned(),
                None => error.help.clone(),
            };
            FlightsError::File(error.help(help))
        })
    }

    /// Returns the place at which `span` begins.
    pub fn place(&self, span: &Range<usize>) -> Place {
        Place::of(self.path.display().to_string(), &self.text, span)
    }

    /// An invalid value.
    pub fn bad(
        &self,
        span: &Range<usize>,
        key: impl Into<String>,
        expected: &str,
        found: impl Display,
        advice: &str,
    ) -> FlightsError {
        let error = ParameterError::value(key, expected, found);
        FlightsError::File(Diagnostic::at(self.place(span), error).help(advice))
    }

    /// Names of the variables in the file that are not set, so that their defaults are taken; each once.
    pub fn defaults(&self) -> Vec<String> {
        let mut names = Vec::new();
        let lines = self.text.lines().filter(|line| !line.trim_start().starts_with('#'));
        for inside in lines.flat_map(|line| line.split("${").skip(1)) {
            let name = inside.split([':', '}']).next().unwrap_or_default();
            if std::env::var_os(name).is_none() && !names.iter().any(|known| known == name) {
                names.push(name.to_owned());
            }
        }
        names
    }

    /// A path as written: `${NAME:-default}` is the environment's NAME, and a relative path starts at the folder
    /// of the flights file.
    pub fn resolve(&self, key: &str, written: &str, place: &Range<usize>) -> Result<PathBuf, FlightsError> {
        let expanded =
            inputs::variables::expand(written, |name| std::env::var(name).ok()).map_err(|found| {
                let advice = "set the variable, or give a default: ${NAME:-path}";
                self.bad(place, key, "a path", found.to_string(), advice)
            })?;
        Ok(inputs::tidy(&self.path.parent().unwrap_or(Path::new("")).join(expanded)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_channel_that_was_meant_is_named() {
        let told = |found: &str| {
            let text = format!("{found} = 1.0\n");
            let document = Document::new(Path::new("flights.toml"), text);
            document.parse::<std::collections::BTreeMap<Quantity, f64>>().unwrap_err().to_string()
        };
        for (found, meant) in
            [("Accel", "specific_force"), ("gyro", "angular_velocity"), ("atitude", "attitude")]
        {
            let told = told(found);
            assert!(told.contains(&format!("did you mean `{meant}`?")), "{told}");
        }
        assert!(!told("colour").contains("did you mean"));
    }
}
