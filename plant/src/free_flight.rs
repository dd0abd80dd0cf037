//! The backend `newton-euler`: free flight, in which there is nothing to touch.

use crate::actuation::Battery;
use crate::airframe_state::AirframeState;
use crate::backend::{Backend, CONFIGURATION, ContactReport, Neighbour, NotePart};
use crate::motor;
use crate::newton_euler::{Accelerations, NewtonEuler};
use crate::saved::{Fingerprint, Saved};
use crate::snapshot::SnapshotError;
use crate::state::{PerRotor, RigidBody, RotorState, State};

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
    configuration: Fingerprint,
}

impl FreeFlight {
    /// A vehicle that starts as `body`, its rotors at the lowest command; `effects` are made by its airframe.
    #[must_use]
    pub fn new(model: NewtonEuler, body: RigidBody, effects: AirframeState) -> Self {
        let state = model.start(body, 0.0);
        let configuration = model.airframe().fingerprint(NAME);
        Self { model, state, effects, configuration }
    }

    /// Moves the vehicle by one tick of `dt_s` in which its rotors turn as `rotors` say, one for each, and as no command
    /// asks: their speeds at the begin of the tick, which grow by their accelerations.
    pub fn step_with_rotors(&mut self, rotors: &PerRotor<RotorState>, dt_s: f64) {
        let airframe = self.model.airframe();
        let unasked = PerRotor::filled(rotors.len(), 0.0);
        self.state.rotors = *rotors;
        airframe.begin_tick(&mut self.effects, &self.state, &unasked, dt_s);
        let actuation = &mut self.effects.actuation;
        actuation.targets_rad_s = rotors.map(|rotor| motor::target_of(&airframe.vehicle().motor, &rotor));
        self.model.advance_with_rotors(&mut self.state, actuation, dt_s);
    }
}

impl Backend for FreeFlight {
    fn name(&self) -> &'static str {
        NAME
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn accelerations(&self) -> Accelerations {
        self.model.accelerations_under(&self.effects.actuation, &self.state)
    }

    fn step(&mut self, commands: &[f64], dt_s: f64, _traffic: &[Neighbour]) {
        let actuation = self.model.airframe().begin_tick(&mut self.effects, &self.state, commands, dt_s);
        self.model.advance(&mut self.state, actuation, dt_s);
    }

    fn settle_rotors(&mut self, commands: &[f64]) {
        self.state.rotors = self.model.steady_each(commands);
    }

    fn set_measured_voltage(&mut self, voltage_V: Option<f64>) {
        self.effects.measured_voltage_V = voltage_V;
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

    fn configuration(&self) -> u64 {
        self.configuration.and(self.model.airframe().kinds()).number()
    }

    fn parts(&self, note: &mut dyn FnMut(&'static str, &dyn Saved)) {
        note(CONFIGURATION, &self.configuration);
        note("state", &self.state);
        note("effects", &self.effects);
    }

    fn parts_mut(&mut self, note: &mut NotePart<'_>) -> Result<(), SnapshotError> {
        note(CONFIGURATION, &mut self.configuration)?;
        note("state", &mut self.state)?;
        note("effects", &mut self.effects)
    }
}
