//! Doubts about the kind of specific force in a log: the acceleration of each possible kind is compared with
//! that of the velocity or the position.

use vehicles::Vehicle;

use crate::agreement::{Agreement, Pairs};
use crate::declaration::{Entry, Frame, Holds};
use crate::flight::Flight;
use crate::frame;
use crate::specific_force::{Meaning, with_attitude};

/// Windows over which the acceleration is derived, in s.
const WINDOW_S: f64 = 0.4;
/// Below this the vehicle hardly moves, and noise is compared with noise.
const QUIET_M_S2: f64 = 0.2;
/// Above this correlation both accelerations are the same.
const SAME: f64 = 0.7;
/// Another kind is clearly the right one if it leaves less than this share of the residual.
const CLEARLY: f64 = 0.5;
/// And within this factor two cannot be told apart.
const ALIKE: f64 = 1.3;

/// Kind of force that a log may hold, and its frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Kind of the force.
    pub holds: Holds,
    /// Frame of the force.
    pub frame: Frame,
}

/// Kinds that the log may hold instead of the declared one.
#[derive(Debug)]
pub struct Doubt {
    /// Kinds that would fit, the best first.
    pub fits: Vec<Kind>,
    /// The correlation of the best with the acceleration.
    pub correlation: f64,
    /// Its residual, in m/s^2.
    pub residual_m_s2: f64,
    /// The residual as declared.
    pub declared_m_s2: f64,
}

/// Comparison of a specific force with the acceleration of the velocity or the position.
pub struct ForceDoubt<'a> {
    /// The flight, its specific force in the body.
    pub flight: &'a Flight,
    /// The vehicle.
    pub vehicle: &'a Vehicle,
    /// Declared kind.
    pub declared: Kind,
}

impl<'a> ForceDoubt<'a> {
    /// The comparison for a flight with the channels that it takes; an assumed attitude does not count.
    pub fn of(flight: &'a Flight, vehicle: &'a Vehicle, entry: &Entry) -> Option<Self> {
        let declared =
            Kind { holds: entry.holds.unwrap_or_default(), frame: entry.frame.unwrap_or_default() };
        let has_motion = !flight.velocity.is_empty() || !flight.position.is_empty();
        let is_measured = flight.assumed.is_empty() && !flight.attitude.is_empty();
        (has_motion && is_measured).then_some(Self { flight, vehicle, declared })
    }

    /// Returns the agreement of the declared kind.
    pub fn agreement(&self) -> Option<Agreement> {
        self.pairs(self.declared).agreement(QUIET_M_S2)
    }

    /// Another kind that explains clearly more than the declared one.
    pub fn doubt(&self) -> Option<Doubt> {
        let declared_m_s2 = self.pairs(self.declared).residual();
        let frames = [Frame::FluEnu, Frame::FrdNed];
        let kinds = Holds::FORCES.into_iter().flat_map(|holds| frames.map(|frame| Kind { holds, frame }));
        let tried = kinds.filter(|kind| kind.holds != self.declared.holds).filter_map(|kind| {
            let pairs = self.pairs(kind);
            let agreement = pairs.agreement(QUIET_M_S2).filter(|agreement| agreement.correlation > SAME)?;
            Some((kind, agreement.correlation, pairs.residual()))
        });
        let mut tried: Vec<(Kind, f64, f64)> = tried.collect();
        tried.sort_by(|a, b| a.2.total_cmp(&b.2));
        let (_, correlation, residual_m_s2) = *tried.first()?;
        let alike = tried.iter().filter(|(_, _, residual)| *residual <= ALIKE * residual_m_s2);
        let fits = alike.map(|(kind, ..)| *kind).collect();
        (residual_m_s2 < CLEARLY * declared_m_s2).then_some(Doubt {
            fits,
            correlation,
            residual_m_s2,
            declared_m_s2,
        })
    }

    /// The acceleration that the log means if it is of `kind`, against that of the vehicle.
    fn pairs(&self, kind: Kind) -> Pairs {
        let gravity_m_s2 = self.vehicle.gravity_m_s2;
        let (now, then) = (
            Meaning { holds: self.declared.holds, gravity_m_s2 },
            Meaning { holds: kind.holds, gravity_m_s2 },
        );
        let flight = self.flight;
        let acceleration = with_attitude(&flight.specific_force, &flight.attitude, |force, q| {
            let logged = now.logged(force, q);
            // Each change of frames undoes itself.
            let raw = frame::axes(self.declared.frame, self.declared.holds, logged.into());
            then.acceleration(frame::axes(kind.frame, kind.holds, raw).into(), q)
        });
        Pairs::accelerations(&acceleration, &flight.velocity, &flight.position, WINDOW_S)
    }
}
