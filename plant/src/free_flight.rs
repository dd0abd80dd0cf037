//! The backend `newton-euler`: free flight, in which there is nothing to touch.

use crate::backend::{Backend, ContactReport, Neighbour};
use crate::effects::battery::Battery;
use crate::memory::AirframeMemory;
use crate::newton_euler::{Motion, NewtonEuler};
use crate::snapshot::{Snapshot, SnapshotError};
use crate::state::{RigidBody, State};

/// What its snapshots are called.
const NAME: &str = "newton-euler";

/// A vehicle in free flight: the model, the state that it moves, and what its effects remember.
#[derive(Debug, Clone)]
pub struct FreeFlight {
    model: NewtonEuler,
    state: State,
    memory: AirframeMemory,
}

impl FreeFlight {
    /// A vehicle that starts as `body`, its rotors at the lowest command; `memory` is made by its airframe.
    #[must_use]
    pub fn new(model: NewtonEuler, body: RigidBody, memory: AirframeMemory) -> Self {
        let state = model.start(body, 0.0);
        Self { model, state, memory }
    }
}

impl Backend for FreeFlight {
    fn state(&self) -> &State {
        &self.state
    }

    fn motion(&self) -> Motion {
        self.model.motion_under(&self.memory.drive, &self.state)
    }

    fn step(&mut self, commands: &[f64; 4], dt_s: f64, _traffic: &[Neighbour]) {
        let drive = self.model.airframe().begin_tick(&mut self.memory, &self.state, commands, dt_s);
        self.model.advance(&mut self.state, &drive, dt_s);
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

    fn battery(&self) -> Option<Battery> {
        self.model.airframe().battery(&self.memory, &self.state)
    }

    fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        Snapshot::of(NAME).with("state", &self.state)?.with("memory", &self.memory)?.bytes()
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let snapshot = Snapshot::read(snapshot, NAME)?;
        let memory = snapshot.fitting("memory", |memory| self.memory.fits(memory))?;
        (self.state, self.memory) = (snapshot.get("state")?, memory);
        Ok(())
    }
}
