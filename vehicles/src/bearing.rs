//! Thrust of commands over the weight by a vehicle file, and the scale or the range of the commands with which both are equal.

use crate::vehicle::{ROTORS_MAX, Vehicle};
use std::fmt;

/// Most commands that are looked at: spread over the flight, they show its median.
const COUNT: usize = 2000;
/// A scale or a range beyond this factor is no mistake of either.
const FACTOR_MAX: f64 = 8.0;
/// Halvings of the search for a factor.
const HALVINGS: usize = 50;

/// Thrust of commands over the weight.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Bearing {
    /// Median thrust over the weight.
    pub share: f64,
    /// Factor on the commands with which the thrust equals the weight; `None` if no factor does.
    pub scale: Option<f64>,
    /// Greatest command of the vehicle file as it is, and the one with which the thrust equals the weight.
    pub max: Option<[f64; 2]>,
}

impl Bearing {
    /// Thrust of `commands` over the weight of `vehicle`; `None` without commands or weight.
    ///
    /// ```
    /// use vehicles::{ROTORS_MAX, Vehicle, bearing::Bearing, reference::HUMMINGBIRD};
    ///
    /// let vehicle = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml")?;
    /// let half = Bearing::of(&vehicle, &[[0.5 * vehicle.hover_command(); ROTORS_MAX]]).unwrap();
    /// assert!(half.share < 0.5 && (half.scale.unwrap() - 2.0).abs() < 1e-6);
    /// # Ok::<(), diagnostics::Diagnostic>(())
    /// ```
    #[must_use]
    pub fn of(vehicle: &Vehicle, commands: &[[f64; ROTORS_MAX]]) -> Option<Self> {
        let weight = vehicle.mass_kg * vehicle.gravity_m_s2;
        let every = (commands.len() / COUNT).max(1);
        let shown: Vec<&[f64; ROTORS_MAX]> = commands.iter().step_by(every).collect();
        if shown.is_empty() || weight.is_nan() || weight <= 0.0 {
            return None;
        }
        let share = |scale: f64, range: f64| {
            let map = vehicle.command;
            let map = crate::CommandMap { max: map.min + range * (map.max - map.min), ..map };
            let thrust = |commands: &&[f64; ROTORS_MAX]| {
                vehicle.static_thrust_by(&map, &commands.map(|command| scale * command)) / weight
            };
            let mut shares: Vec<f64> = shown.iter().map(thrust).collect();
            shares.sort_by(f64::total_cmp);
            shares[shares.len() / 2]
        };
        let max = solved(|factor| share(1.0, 1.0 / factor));
        let map = vehicle.command;
        Some(Self {
            share: share(1.0, 1.0),
            scale: solved(|factor| share(factor, 1.0)),
            max: max.map(|factor| [map.max, map.min + (map.max - map.min) / factor]),
        })
    }
}

/// The factor at which a share that grows with it is 1.
fn solved(share: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut low, mut high) = (1.0 / FACTOR_MAX, FACTOR_MAX);
    if share(low) > 1.0 || share(high) < 1.0 {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if share(middle) < 1.0 { low = middle } else { high = middle }
    }
    Some(high)
}

impl Bearing {
    /// Scale and range with which the thrust equals the weight, as text; `None` if there is no such scale or range.
    #[must_use]
    pub fn fitting(&self) -> Option<String> {
        let scale = self.scale.map(|scale| format!("commands {scale:.2} times as large"));
        let max = self.max.map(|[max, other]| format!("`max = {other:.1}` of `[command]` in place of {max}"));
        let fits: Vec<String> = scale.into_iter().chain(max).collect();
        (!fits.is_empty()).then(|| fits.join(", or "))
    }
}

impl fmt::Display for Bearing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "by the vehicle file, the thrust of the commands is {:.2} times the weight: the `scale` of the channel `command` or the range in \
             the file's `[command]` is probably wrong",
            self.share
        )?;
        self.fitting().map_or(Ok(()), |fitting| write!(f, "; the thrust equals the weight with {fitting}"))
    }
}
