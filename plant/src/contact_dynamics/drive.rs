//! Drives of joints: the force of a motor at an instant.
//!
//! stiffness (target - position) + damping (target's rate - rate), within the limit: servos as in URDF, SDF and MuJoCo
//! (<https://mujoco.readthedocs.io/en/stable/modeling.html#actuators>). It is a function of time and of the joint's state,
//! and has no state of its own.

use scenes::{Drive as Told, Mode, Target};
use std::f64::consts::TAU;

/// An instant within a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    /// Time since the start.
    pub time_s: f64,
    /// Time of the middle of the step: schedules bend between steps.
    pub middle_s: f64,
}

/// The drive of a joint.
#[derive(Debug, Clone)]
pub(super) struct Drive {
    told: Told,
    /// True of a hinge without stops: it turns the shorter way to a target.
    turns_round: bool,
}

impl Drive {
    /// The drive `told` of a joint that can turn round or cannot.
    pub(super) fn new(told: &Told, turns_round: bool) -> Self {
        Self { told: told.clone(), turns_round }
    }

    /// Force on the child, N or N m, at this time. The joint is at `position` (m or rad) and moves at `rate`
    /// (m/s or rad/s).
    pub(super) fn force(&self, when: &Instant, position: f64, rate: f64) -> f64 {
        let target = self.told.target_of_step(when.time_s, when.middle_s);
        let Target { position: wanted, rate: wanted_rate } = target;
        let off = match (self.told.mode, self.turns_round) {
            (Mode::Speed, _) => 0.0,
            (Mode::Position, false) => wanted - position,
            (Mode::Position, true) => (wanted - position) - TAU * ((wanted - position) / TAU).round(),
        };
        let force = self.told.stiffness * off + self.told.damping * (wanted_rate - rate);
        if force.abs() > self.told.limit { self.told.limit.copysign(force) } else { force }
    }

    /// Stiffness, N/m or N m/rad, and damping, N s/m or N m s/rad.
    pub(super) fn gains(&self) -> [f64; 2] {
        [self.told.stiffness, self.told.damping]
    }

    /// Numbers that distinguish it from others.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        let Told { mode, stiffness, damping, limit, schedule } = &self.told;
        let mode = f64::from(u8::from(*mode == Mode::Position));
        [mode, *stiffness, *damping, *limit, schedule.len() as f64]
            .into_iter()
            .chain(schedule.iter().copied().flatten())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(mode: Mode, limit: f64, turns_round: bool) -> Drive {
        let told = Told { mode, stiffness: 3.0, damping: 2.0, limit, schedule: vec![[0.0, 1.0], [1.0, 3.0]] };
        Drive::new(&told, turns_round)
    }

    fn at(time_s: f64) -> Instant {
        Instant { time_s, middle_s: time_s }
    }

    #[test]
    fn a_force_is_that_of_a_spring_and_a_damper_within_the_limit() {
        let position = drive(Mode::Position, 100.0, false);
        // At 0.5 s the target is 2 and rises by 2 per second.
        assert_eq!(position.force(&at(0.5), 1.5, 1.0), 3.0 * 0.5 + 2.0 * 1.0);
        assert_eq!(position.force(&at(9.0), 4.0, 1.0), -3.0 - 2.0);
        assert_eq!(drive(Mode::Position, 0.25, false).force(&at(0.5), 1.5, 1.0), 0.25);
        assert_eq!(drive(Mode::Position, 0.25, false).force(&at(9.0), 4.0, 1.0), -0.25);
        assert_eq!(drive(Mode::Speed, 100.0, false).force(&at(0.5), 7.0, 1.5), 2.0 * 0.5);
    }

    #[test]
    fn what_turns_round_takes_the_shorter_way() {
        // From -3 rad to the target of 3 rad.
        assert_eq!(drive(Mode::Position, 100.0, false).force(&at(9.0), -3.0, 0.0), 18.0);
        let found = drive(Mode::Position, 100.0, true).force(&at(9.0), -3.0, 0.0);
        assert!((found - 3.0 * (6.0 - TAU)).abs() < 1e-12, "{found}");
    }
}
