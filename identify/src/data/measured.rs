//! Measured states of a flight, with the moments at which windows of predictions may begin.

use flights::{Channel, Flight, Played};
use vehicles::ROTORS_MAX;

/// Times are sums of decimal fractions: a nanosecond of slack keeps the last moment.
pub const SLACK_S: f64 = 1e-9;

/// The measured states of a flight, as a player plays them.
#[derive(Debug)]
pub struct Measured {
    /// The states as played.
    pub played: Played,
    /// Rotor speeds in place of commands.
    pub rotor_speed: Option<Channel<ROTORS_MAX>>,
    /// Pieces of the flight in which windows lie, from first to last moment in s; empty where they lie anywhere.
    pieces_s: Vec<(f64, f64)>,
    /// Time from a piece's begin to its first window, in s.
    settling_s: f64,
    /// True if the model does not turn by itself: its attitude and rates are the measured ones.
    pub turns_as_measured: bool,
}

impl Measured {
    /// The states of `flight`; `None` where it has neither commands nor rotor speeds, or no motion.
    pub fn of(flight: &Flight) -> Option<Self> {
        let is_commanded = !flight.command.is_empty();
        if !is_commanded && flight.rotor_speed.is_empty() {
            return None;
        }
        let rotor_speed = (!is_commanded).then(|| flight.rotor_speed.clone());
        Some(Self {
            played: Played::of(flight).ok()?,
            rotor_speed,
            pieces_s: Vec::new(),
            settling_s: 0.0,
            turns_as_measured: false,
        })
    }

    /// With windows in these pieces of the flight alone, each behind the time in which rotors settle that are simulated from its begin on.
    pub fn within(self, pieces_s: Vec<(f64, f64)>, settling_s: f64) -> Self {
        Self { pieces_s, settling_s, ..self }
    }

    /// With the measured attitude and rates in place of predicted ones, so that the errors are due to forces
    /// alone.
    pub fn turning_as_measured(self) -> Self {
        Self { turns_as_measured: true, ..self }
    }

    /// The first moment from `from_s` on with a whole window in a piece.
    pub fn next_window_s(&self, from_s: f64, window_s: f64) -> f64 {
        if self.pieces_s.is_empty() {
            return from_s;
        }
        let next = self.pieces_s.iter().find(|piece| from_s.max(piece.0) + window_s <= piece.1);
        next.map_or(f64::INFINITY, |piece| from_s.max(piece.0))
    }

    /// True if the window lies in a piece, with rotors that have settled.
    pub fn is_chosen(&self, from_s: f64, to_s: f64) -> bool {
        let holds =
            |piece: &(f64, f64)| piece.0 + self.settling_s <= from_s + SLACK_S && to_s <= piece.1 + SLACK_S;
        self.pieces_s.is_empty() || self.pieces_s.iter().any(holds)
    }
}
