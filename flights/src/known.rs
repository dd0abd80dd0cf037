//! Known rotors: the stretches of a flight in which its commands determine the speeds of the rotors.
//!
//! A command holds until the next. In a gap of the commands it is unknown, and behind the gap the rotors need time to
//! follow again. `identify` compares, a window predicts and a replay counts within these stretches alone.

use vehicles::gaps::{held_period_s, of_held};

use crate::flight::Flight;

/// Time after which the rotors follow the commands, from any speeds before.
pub const SETTLE_S: f64 = 0.5;

/// Slack at the ends of a stretch: times are differences of decimal fractions.
const SLACK_S: f64 = 1e-6;

/// Stretches with known rotor speeds, in order and apart from each other.
///
/// ```
/// use flights::{Channel, Flight, KnownRotors, Role};
///
/// let mut flight = Flight::new("gap", "log.csv", Role::Fit);
/// flight.command.time_s = (0..300).map(|k| f64::from(k) * 0.02).filter(|t| !(2.0..3.5).contains(t)).collect();
/// flight.command.values = vec![[40.0; 12]; flight.command.time_s.len()];
/// let known = KnownRotors::of(&flight);
/// assert!(known.hold(0.5, 1.9) && !known.hold(1.9, 2.1) && !known.hold(3.6, 3.9) && known.hold(4.1, 5.0));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct KnownRotors {
    stretches: Vec<(f64, f64)>,
}

impl KnownRotors {
    /// Stretches of `flight`. They begin [`SETTLE_S`] after the first command and after each gap of the
    /// commands. They end one period after the last command before a gap or the end. In a log that writes
    /// commands only on change, the last one holds, but not from one of its files to the next. Without
    /// commands, measured speeds are known wherever they were measured.
    #[must_use]
    pub fn of(flight: &Flight) -> Self {
        let command = &flight.command;
        let Some((first_s, _)) = command.span_s() else { return Self::measured(flight) };
        let (gaps, last_s) = (flight.command_gaps_s(), command.time_s.last().copied());
        if flight.commands_on_change {
            return Self::between(&gaps, (first_s, f64::INFINITY), (SETTLE_S, 0.0));
        }
        let period_s = held_period_s(&command.time_s).unwrap_or(0.0);
        Self::between(&gaps, (first_s, last_s.unwrap_or(first_s)), (SETTLE_S, period_s))
    }

    fn measured(flight: &Flight) -> Self {
        let span_s = flight.rotor_speed.span_s();
        span_s.map_or(Self { stretches: Vec::new() }, |span_s| {
            Self::between(&of_held(&flight.rotor_speed.time_s), span_s, (0.0, 0.0))
        })
    }

    /// Stretches between `gaps`, which begin `late_s` after the first sample and end `long_s` after the last.
    fn between(gaps: &[(f64, f64)], span_s: (f64, f64), (late_s, long_s): (f64, f64)) -> Self {
        let begins = std::iter::once(span_s.0).chain(gaps.iter().map(|gap| gap.1));
        let ends = gaps.iter().map(|gap| gap.0).chain([span_s.1]);
        let stretches = begins.zip(ends).map(|(from_s, to_s)| (from_s + late_s, to_s + long_s));
        Self { stretches: stretches.filter(|(from_s, to_s)| from_s < to_s).collect() }
    }

    /// True if the rotors are known from `from_s` to `to_s`.
    #[must_use]
    pub fn hold(&self, from_s: f64, to_s: f64) -> bool {
        let begun = self.stretches.partition_point(|stretch| stretch.0 <= from_s + SLACK_S);
        begun.checked_sub(1).is_some_and(|last| to_s <= self.stretches[last].1 + SLACK_S)
    }

    /// The stretches.
    #[must_use]
    pub fn stretches_s(&self) -> &[(f64, f64)] {
        &self.stretches
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, Role};
    use vehicles::ROTORS_MAX;

    fn flight(time_s: Vec<f64>) -> Flight {
        let command = Channel { values: vec![[1.0; ROTORS_MAX]; time_s.len()], time_s };
        Flight { command, ..Flight::new("f", "log", Role::Fit) }
    }

    #[test]
    fn commands_that_come_long_before_or_after_the_motion_say_nothing_of_it() {
        let mut times = vec![0.0];
        times.extend((0..200).map(|k| 1000.0 + 0.01 * f64::from(k)));
        let known = KnownRotors::of(&flight(times));
        assert!(!known.hold(1.0, 2.0) && !known.hold(1000.1, 1000.2) && known.hold(1000.5, 1002.0));
        assert!(!known.hold(1001.0, 1003.0), "the last command holds a period");
    }

    #[test]
    fn a_stretch_shorter_than_the_rotors_need_to_settle_is_none() {
        let times = (0..400).map(|k| 0.01 * f64::from(k)).filter(|t| t % 1.0 < 0.4).collect();
        assert_eq!(KnownRotors::of(&flight(times)).stretches_s(), []);
    }

    #[test]
    fn commands_on_change_hold() {
        let mut written = flight(vec![0.0, 0.01, 0.02, 3.0, 3.01]);
        assert!(!KnownRotors::of(&written).hold(1.0, 2.0));
        written.commands_on_change = true;
        assert!(KnownRotors::of(&written).hold(0.5, 99.0) && !KnownRotors::of(&written).hold(0.4, 1.0));
    }

    #[test]
    fn commands_on_change_do_not_hold_from_file_to_file() {
        let mut written = flight(vec![0.0, 1.0, 5.0, 6.0]);
        (written.commands_on_change, written.command_breaks_s) = (true, vec![(2.0, 4.0), (8.0, 9.0)]);
        let known = KnownRotors::of(&written);
        assert_eq!(known.stretches_s(), [(0.5, 2.0), (5.5, 8.0)]);
    }

    #[test]
    fn without_commands_the_measured_speeds_are_known() {
        let mut measured = flight(Vec::new());
        assert_eq!(KnownRotors::of(&measured).stretches_s(), []);
        let time_s = vec![1.0, 1.02, 1.04, 3.0, 3.02];
        measured.rotor_speed = Channel { values: vec![[500.0; ROTORS_MAX]; time_s.len()], time_s };
        let known = KnownRotors::of(&measured);
        assert!(known.hold(1.0, 1.04) && !known.hold(1.04, 1.1) && known.hold(3.0, 3.02));
    }
}
