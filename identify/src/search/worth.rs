//! Worth of an effect: the prediction errors with and without it.

use crate::numbers::digits::rounded;
use serde::Serialize;

/// A prediction error with and without an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worth {
    /// The channel.
    pub channel: &'static str,
    /// Horizon in s.
    pub horizon_s: f64,
    /// Root mean square without the effect, the other effects fitted to that.
    pub without: f64,
    /// Root mean square with it.
    pub with: f64,
    /// Unit of both.
    pub unit: &'static str,
}

impl Worth {
    /// Error with the effect in units of that without.
    pub fn ratio(&self) -> f64 {
        self.with / self.without
    }
}

/// The errors after each horizon in words, without the effect -> with it; `None` where there are none.
///
/// ```
/// use identify::worth::{Worth, in_words};
/// let of = |channel, horizon_s, without, with, unit| Worth { channel, horizon_s, without, with, unit };
/// let worths = [of("velocity", 0.1, 0.11, 0.05, "m/s"), of("velocity", 0.5, 0.48, 0.06, "m/s"), of("attitude", 0.5, 2.1, 2.0, "deg")];
/// let words = "after 0.1 s: velocity 0.1100 -> 0.05000 m/s; after 0.5 s: velocity 0.4800 -> 0.06000 m/s, attitude 2.100 -> 2.000 deg";
/// assert_eq!(in_words(&worths).as_deref(), Some(words));
/// assert_eq!(in_words(&[]), None);
/// ```
#[must_use]
pub fn in_words(worths: &[Worth]) -> Option<String> {
    let mut horizons_s: Vec<f64> = worths.iter().map(|worth| worth.horizon_s).collect();
    horizons_s.sort_by(f64::total_cmp);
    horizons_s.dedup();
    let one = |Worth { channel, without, with, unit, .. }: &Worth| {
        format!("{channel} {} -> {} {unit}", rounded(*without), rounded(*with))
    };
    let of_horizon = |horizon_s: &f64| {
        let of_all = worths.iter().filter(|worth| worth.horizon_s.total_cmp(horizon_s).is_eq());
        format!("after {horizon_s} s: {}", of_all.map(one).collect::<Vec<_>>().join(", "))
    };
    let words: Vec<String> = horizons_s.iter().map(of_horizon).collect();
    (!words.is_empty()).then(|| words.join("; "))
}
