//! The buffers of a step, and the search for its impulses in them.
//!
//! The buffers are kept, so that a step takes no memory, and forgotten after it.

use super::free_bodies::{FIRST_BODY, Work};
use super::islands::{FOUND_M_S, Islands};
use super::solver::Body;
use super::ties::Ties;
use super::touching::Touching;
use super::unsolved::Found;
use crate::backend::TRAFFIC_MAX;

/// The buffers of a step.
#[derive(Default)]
pub(super) struct Scratch {
    pub touching: Touching,
    pub ties: Ties,
    pub twists: Twists,
    /// The step of the free bodies without contacts.
    pub work: Work,
    islands: Islands,
}

/// The world, the vehicle, free bodies and other vehicles, as impulses see them.
#[derive(Default)]
pub(super) struct Twists {
    /// At the step's start.
    pub now: Vec<Body>,
    /// At its end.
    pub then: Vec<Body>,
    /// At its end, before something was tried.
    pub before: Vec<Body>,
}

impl Scratch {
    /// Empty buffers, for a vehicle among so many free bodies.
    pub(super) fn new(bodies: usize) -> Self {
        let all = || Vec::with_capacity(FIRST_BODY + bodies + TRAFFIC_MAX);
        let twists = Twists { now: all(), then: all(), before: all() };
        Self { touching: Touching::new(bodies), twists, ..Self::default() }
    }

    /// Finds the impulses and gives them to the bodies at the step's end.
    pub(super) fn solve(&mut self) -> Found {
        let fastest_m_s = self.touching.fastest_m_s(&self.twists.then);
        Found { off_m_s: self.find_with_others(), fastest_m_s }
    }

    /// Finds the impulses, those of other vehicles included. If another vehicle would drive this one into a still
    /// object, no impulses satisfy both: the other is left out, and flies into it. Returns the greatest error of a rate.
    fn find_with_others(&mut self) -> f64 {
        let is_among_others = self.touching.is_among_others();
        if is_among_others {
            self.twists.before.clone_from(&self.twists.then);
        }
        let off_m_s = self.find_impulses();
        if off_m_s <= FOUND_M_S || !is_among_others {
            return off_m_s;
        }
        self.touching.forget();
        self.touching.leave_out_others();
        self.twists.then.clone_from(&self.twists.before);
        self.find_impulses()
    }

    /// Finds the impulses for the bodies at the step's end; returns by how much a rate is off at most.
    pub(super) fn find_impulses(&mut self) -> f64 {
        let Self { touching, ties, twists, islands, .. } = self;
        islands.solve(&mut twists.then, &twists.now, &mut touching.constraints, &ties.joints)
    }
}
