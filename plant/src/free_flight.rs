//! The backend `newton-euler`: free flight, in which there is nothing to touch.

use crate::actuation::Battery;
use crate::airframe_state::AirframeState;
use crate::backend::{Backend, ContactReport, Neighbour};
use crate::newton_euler::{Accelerations, NewtonEuler};
use crate::snapshot::{Snapshot, SnapshotError};
use crate::state::{RigidBody, State};

/// What its snapshots are called.
const NAME: &str = "newton-euler";

/// A vehicle in free flight: the model, the state that it moves, and the state of its effects.
///
/// ```
/// use nalgebra::Vector3;
/// use plant::{Airframe, Backend, FreeFlight, NewtonEuler, RigidBody};
///
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let vehicle = vehicles::Vehicle::load(path.as_ref()).unwrap();
/// let hover = vehicle.hover_command();
/// let airframe = Airframe::new(vehicle);
/// let effects = airframe.initial_state(1, "plant", 1e-3);
/// let body = RigidBody::level_at(Vector3::new(0.0, 0.0, 1.0));
/// let mut flight = FreeFlight::new(NewtonEuler::flying(airframe, 1), body, effects);
/// flight.settle_rotors(&[hover; 4]);
/// flight.step(&[hover; 4], 1e-3, &[]);
/// assert!((flight.state().body.position_W_m.z - 1.0).abs() < 1e-9);
/// ```
#[derive(Debug, Clone)]
pub struct FreeFlight {
    model: NewtonEuler,
    state: State,
    effects: AirframeState,
}

impl FreeFlight {
    /// A vehicle that starts as `body`, its rotors at the lowest command; `effects` are made by its airframe.
    #[must_use]
    pub fn new(model: NewtonEuler, body: RigidBody, effects: AirframeState) -> Self {
        let state = model.start(body, 0.0);
        Self { model, state, effects }
    }
}

impl Backend for FreeFlight {
    fn state(&self) -> &State {
        &self.state
    }

    fn accelerations(&self) -> Accelerations {
        self.model.accelerations_under(&self.effects.actuation, &self.state)
    }

    fn step(&mut self, commands: &[f64; 4], dt_s: f64, _traffic: &[Neighbour]) {
        let actuation = self.model.airframe().begin_tick(&mut self.effects, &self.state, commands, dt_s);
        self.model.advance(&mut self.state, &actuation, dt_s);
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
        self.model.airframe().battery(&self.effects, &self.state)
    }

    fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        Snapshot::of(NAME).with("state", &self.state)?.with("effects", &self.effects)?.bytes()
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let snapshot = Snapshot::read(snapshot, NAME)?;
        let effects = snapshot.fitting("effects", |effects| self.effects.fits(effects))?;
        (self.state, self.effects) = (snapshot.get("state")?, effects);
        Ok(())
    }
}
