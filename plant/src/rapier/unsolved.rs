//! Impulses that were not found, and energy that impulses made: both end a run.

use super::free_bodies::{FIRST_BODY, VEHICLE};
use super::scratch::Scratch;

/// A rate that is farther off ends the run, m/s. Tuned, no source.
const OFF_MOST_M_S: f64 = 1e-4;

/// Part of the kinetic energy, and of 1 J, that the impulses of a step may make by rounding. Tuned, no source.
const GAIN_MOST: f64 = 1e-6;

/// The result of a search for impulses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outcome {
    /// Greatest error of a rate.
    pub off_m_s: f64,
    /// Kinetic energy before the impulses.
    pub start_J: f64,
    /// Kinetic energy that the impulses added, beyond what was asked for; 0 where another vehicle pushes.
    pub gain_J: f64,
}

impl Outcome {
    /// True if every rate is as near to its bound as it has to be.
    pub(super) fn is_met(off_m_s: f64) -> bool {
        off_m_s <= OFF_MOST_M_S
    }

    fn is_sound(&self) -> bool {
        Self::is_met(self.off_m_s) && self.gain_J <= GAIN_MOST * (1.0 + self.start_J)
    }
}

/// Impulses that were not found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unsolved {
    /// The two that the worst of them pushes, as `bus::messages::Contact` numbers them, the vehicle as 0; none of a stop.
    objects: Option<[u32; 2]>,
    off_m_s: f64,
    gain_J: f64,
}

impl Unsolved {
    /// The fault of an outcome, if it has one; `objects` are the numbers of the free bodies.
    pub(super) fn of(outcome: &Outcome, scratch: &Scratch, objects: &[u32]) -> Option<Self> {
        if outcome.is_sound() {
            return None;
        }
        let off = scratch.constraints.iter().map(|constraint| constraint.off_m_s(&scratch.then)).enumerate();
        let worst = off.max_by(|(_, one), (_, other)| one.total_cmp(other));
        let near = worst.and_then(|(number, _)| scratch.near.get(number));
        let second = |body: usize| match body {
            VEHICLE => 0,
            _ => objects.get(body.wrapping_sub(FIRST_BODY)).copied().unwrap_or_default(),
        };
        let objects = near.map(|near| [near.object, second(near.bodies[1])]);
        Some(Self { objects, off_m_s: outcome.off_m_s, gain_J: outcome.gain_J })
    }

    /// The error message, with the name of each object.
    pub(super) fn message(&self, name: impl Fn(u32) -> String) -> String {
        let place = self.objects.map_or("at a stop or a joint".to_owned(), |objects| {
            let [first, second] = objects.map(name);
            format!("between {first} and {second}")
        });
        let found = match Outcome::is_met(self.off_m_s) {
            true => format!("they made {:.1e} J of motion", self.gain_J),
            false => {
                format!("a rate is off by {:.1e} m/s, expected {OFF_MOST_M_S:.0e} m/s at most", self.off_m_s)
            }
        };
        format!(
            "the contact impulses {place} were not found: {found}; bring the masses of what touches closer together, or \
             change `substeps`"
        )
    }
}
