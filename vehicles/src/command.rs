//! The map between a raw motor command (counts, PWM) and the rotor speed it asks for.

/// Linear map with saturation at both ends. The fields satisfy `min < max` and
/// `0 <= speed_at_min_rad_s < speed_at_max_rad_s` when they come from a vehicle file.
///
/// ```
/// let map = vehicles::CommandMap {
///     min: 0.0,
///     max: 200.0,
///     speed_at_min_rad_s: 100.0,
///     speed_at_max_rad_s: 900.0,
///     zero_is_off: true,
/// };
/// assert_eq!((map.speed(100.0), map.command(500.0), map.speed(0.0)), (500.0, 100.0, 0.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandMap {
    /// Smallest command, in raw counts.
    pub min: f64,
    /// Largest command, in raw counts.
    pub max: f64,
    /// Steady rotor speed at `min`, in rad/s.
    pub speed_at_min_rad_s: f64,
    /// Steady rotor speed at `max`, in rad/s.
    pub speed_at_max_rad_s: f64,
    /// True if a command of zero or less switches the motor off (speed 0) instead of saturating at `min`.
    pub zero_is_off: bool,
}

impl CommandMap {
    /// The steady speed in rad/s that a raw `command` asks for. A command that is not a number counts
    /// as `min`, so that no NaN enters the state.
    pub fn speed(&self, command: f64) -> f64 {
        if self.zero_is_off && command <= 0.0 {
            return 0.0;
        }
        between(self.speed_at_min_rad_s, self.speed_at_max_rad_s, self.share(command))
    }

    /// The place of a raw `command` between the smallest, 0, and the largest, 1. A motor that is off has 0, too.
    #[must_use]
    pub fn share(&self, command: f64) -> f64 {
        // `max` first: it answers a NaN with `min`.
        let held = command.max(self.min).min(self.max);
        (held - self.min) / (self.max - self.min)
    }

    /// The raw command that asks for `speed_rad_s`, saturated at the limits of the motor.
    pub fn command(&self, speed_rad_s: f64) -> f64 {
        if self.zero_is_off && speed_rad_s <= 0.0 {
            return 0.0;
        }
        let held = speed_rad_s.max(self.speed_at_min_rad_s).min(self.speed_at_max_rad_s);
        let share = (held - self.speed_at_min_rad_s) / (self.speed_at_max_rad_s - self.speed_at_min_rad_s);
        between(self.min, self.max, share)
    }
}

/// The point at `share` (0...1) of the way from `low` to `high`; exact at both ends.
fn between(low: f64, high: f64, share: f64) -> f64 {
    low * (1.0 - share) + high * share
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: CommandMap = CommandMap {
        min: 1.0,
        max: 200.0,
        speed_at_min_rad_s: 100.0,
        speed_at_max_rad_s: 900.0,
        zero_is_off: false,
    };

    #[test]
    fn both_directions_agree_inside_the_range() {
        for command in [1.0, 17.25, 100.0, 200.0] {
            assert!((MAP.command(MAP.speed(command)) - command).abs() < 1e-12);
        }
    }

    #[test]
    fn it_saturates_at_both_ends() {
        assert_eq!(MAP.speed(-5.0), 100.0);
        assert_eq!(MAP.speed(1e9), 900.0);
        assert_eq!(MAP.speed(f64::NAN), 100.0);
        assert_eq!(MAP.command(0.0), 1.0);
        assert_eq!(MAP.command(1e9), 200.0);
        assert_eq!(MAP.command(f64::NAN), 1.0);
        assert_eq!(
            [-5.0, 1.0, 100.5, 1e9, f64::NAN].map(|command| MAP.share(command)),
            [0.0, 0.0, 0.5, 1.0, 0.0]
        );
    }

    #[test]
    fn zero_switches_off_only_where_the_vehicle_says_so() {
        let map = CommandMap { zero_is_off: true, ..MAP };
        assert_eq!((map.speed(0.0), map.command(0.0)), (0.0, 0.0));
        assert_eq!(map.speed(0.5), 100.0);
    }
}
