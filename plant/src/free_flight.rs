//! The backend `newton-euler`: free flight, in which there is nothing to touch.

use crate::backend::{Backend, ContactReport, Neighbour};
use crate::newton_euler::{Motion, NewtonEuler};
use crate::snapshot::{Snapshot, SnapshotError};
use crate::state::{RigidBody, State};

/// What its snapshots are called.
const NAME: &str = "newton-euler";

/// A vehicle in free flight: the model and the state that it moves.
#[derive(Debug, Clone)]
pub struct FreeFlight {
    model: NewtonEuler,
    state: State,
}

impl FreeFlight {
    /// A vehicle that starts as `body`, its rotors at the lowest command.
    #[must_use]
    pub fn new(model: NewtonEuler, body: RigidBody) -> Self {
        let state = model.start(body, 0.0);
        Self { model, state }
    }
}

impl Backend for FreeFlight {
    fn state(&self) -> &State {
        &self.state
    }

    fn motion(&self) -> Motion {
        self.model.motion(&self.state)
    }

    fn step(&mut self, commands: &[f64; 4], dt_s: f64, _traffic: &[Neighbour]) {
        self.model.step(&mut self.state, commands, dt_s);
    }

    fn settle_rotors(&mut self, commands: &[f64; 4]) {
        self.state.rotors = commands.map(|command| self.model.steady(command));
    }

    fn set_body(&mut self, body: &RigidBody) {
        self.state.body = *body;
    }

    fn contact(&self) -> ContactReport {
        ContactReport::default()
    }

    fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        Snapshot::of(NAME).with("state", &self.state)?.bytes()
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        self.state = Snapshot::read(snapshot, NAME)?.get("state")?;
        Ok(())
    }
}
