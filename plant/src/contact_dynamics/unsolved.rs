//! Impulses that were not found, and energy that impulses made: both end a run.

use super::free_bodies::{FIRST_BODY, VEHICLE};
use super::solver::Body;
use super::touching::Touching;

/// A rate that is farther off than this, and than a part of the fastest rate, ends the run, m/s. Tuned, no source.
const OFF_MOST_M_S: f64 = 1e-4;

/// Part of the fastest rate by which a rate may be off, too. For contacts that only just stick or slip the iteration may find no shifts (`direct`). With shifts that are
/// nearly right, they push while they part, and by less than the coefficients of friction and restitution are known. Solvers
/// without shifts leave that error whole (A. Castro and others, An unconstrained convex formulation of compliant
/// contact, 2022). Tuned, no source.
const OFF_MOST_OF_FASTEST: f64 = 0.05;

/// A rate that is farther off than this, and than a part of the fastest rate, is counted for the run's summary, m/s: it moves a body
/// by 10 µm in a second. Tuned, no source.
const OFF_TOLD_M_S: f64 = 1e-5;

/// The part of the fastest rate. Tuned, no source.
const OFF_TOLD_OF_FASTEST: f64 = 1e-3;

/// Part of the kinetic energy, and of 1 J, that the impulses of a step may make by rounding. Tuned, no source.
const GAIN_MOST: f64 = 1e-6;

/// The result of a search for impulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Greatest error of a rate.
    pub off_m_s: f64,
    /// Greatest speed at which two that touch come nearer or slip, before the impulses.
    pub fastest_m_s: f64,
}

/// The same with the energy of the bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outcome {
    pub found: Found,
    /// Kinetic energy before the impulses.
    pub start_J: f64,
    /// Kinetic energy that the impulses added, beyond what was asked for; 0 where another vehicle pushes.
    pub gain_J: f64,
}

impl Found {
    /// The error of a rate up to which impulses are taken as found.
    fn may_be_off_m_s(&self) -> f64 {
        OFF_MOST_M_S.max(OFF_MOST_OF_FASTEST * self.fastest_m_s)
    }

    /// True if the impulses are taken as found.
    pub(super) fn is_met(&self) -> bool {
        self.off_m_s <= self.may_be_off_m_s()
    }

    /// True if the rates are off by so little that the run's summary does not count it.
    pub(super) fn is_accurate(&self) -> bool {
        self.off_m_s <= OFF_TOLD_M_S.max(OFF_TOLD_OF_FASTEST * self.fastest_m_s)
    }
}

impl Outcome {
    fn is_sound(&self) -> bool {
        self.found.is_met() && self.gain_J <= GAIN_MOST * (1.0 + self.start_J)
    }
}

/// Impulses that were not found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unsolved {
    /// The two that the worst of them pushes, as `component::messages::Contact` numbers them, the vehicle as 0; none of a stop.
    objects: Option<[u32; 2]>,
    outcome: Outcome,
}

impl Unsolved {
    /// The fault of an outcome, if it has one. `then` are the bodies with the impulses of `touching`; `objects` are the
    /// numbers of the free bodies.
    pub(super) fn of(outcome: &Outcome, touching: &Touching, then: &[Body], objects: &[u32]) -> Option<Self> {
        if outcome.is_sound() {
            return None;
        }
        let off = touching.constraints.iter().map(|constraint| constraint.off_m_s(then)).enumerate();
        let worst = off.max_by(|(_, one), (_, other)| one.total_cmp(other));
        let near = worst.and_then(|(number, _)| touching.near.get(number));
        let second = |body: usize| match body {
            VEHICLE => 0,
            _ => objects.get(body.wrapping_sub(FIRST_BODY)).copied().unwrap_or_default(),
        };
        let objects = near.map(|near| [near.object, second(near.bodies[1])]);
        Some(Self { objects, outcome: *outcome })
    }

    /// The error message, with the name of each object.
    pub(super) fn message(&self, name: impl Fn(u32) -> String) -> String {
        let place = self.objects.map_or("at a stop or a joint".to_owned(), |objects| {
            let [first, second] = objects.map(name);
            format!("between {first} and {second}")
        });
        let Outcome { found: impulses, gain_J, .. } = self.outcome;
        let found = match impulses.is_met() {
            true => format!("they made {gain_J:.1e} J of motion"),
            false => {
                let (off_m_s, most_m_s) = (impulses.off_m_s, impulses.may_be_off_m_s());
                format!("a rate is off by {off_m_s:.1e} m/s, expected {most_m_s:.0e} m/s at most")
            }
        };
        format!(
            "the contact impulses {place} were not found: {found}; bring the masses of what touches closer together, or \
             change `substeps`"
        )
    }
}
