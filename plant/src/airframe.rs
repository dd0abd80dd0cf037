//! The airframe: the forces and torques on the body by motors, rotors, air and effects. Every backend moves the body
//! by the forces that this room gives.
//!
//! A backend owns a [`State`] and an [`AirframeState`]. Once per tick it calls [`Airframe::begin_tick`], which
//! advances the effects' states and fixes the slow quantities for the tick, the [`Actuation`]: commands, motion
//! of the air, the battery. The rest is a function of actuation and state, evaluated at every stage of an
//! integrator. Mass, inertia and rotors are those of [`Airframe::vehicle`], which is the vehicle as it flies,
//! its effects included.
//!
//! ```
//! # use plant::{Airframe, PerRotor, RigidBody, RotorState, State};
//! # let text = vehicles::reference::HUMMINGBIRD;
//! # let vehicle = vehicles::Vehicle::parse(text, "hummingbird.toml")?;
//! # let scene = scenes::Scene::parse(scenes::reference::GROUND, "ground.toml")?;
//! let airframe = Airframe::from_files(vehicle, &scene.effects)?;
//! let (seed, dt_s) = (7, 0.001);
//! let mut effects = airframe.initial_state(seed, "plant", dt_s);
//! # let body = RigidBody::level_at(nalgebra::Vector3::z());
//! # let state = State { body, rotors: PerRotor::filled(4, RotorState::steady(400.0)) };
//! let actuation = airframe.begin_tick(&mut effects, &state, &[76.5; 4], dt_s);
//! assert_eq!(actuation.targets_rad_s.len(), 4, "rad/s, one for each rotor");
//! # Ok::<(), diagnostics::Diagnostic>(())
//! ```

use crate::actuation::{Actuation, Battery};
use crate::airframe_state::{AirframeState, DelayLine, EffectState};
use crate::arms::amid_rotors_B_m;
use crate::effects::{Action, Advance, CATALOGUE, Effect, FlightCondition, entry};
use crate::motor;
use crate::rotor::{self, Wrench};
use crate::saved::Fingerprint;
use crate::state::{PerRotor, RotorRates, RotorState, State, paired};
use diagnostics::Diagnostic;
use nalgebra::Vector3;
use vehicles::{CommandMap, EffectEntry, Vehicle};

/// A vehicle as the backends fly it: immutable.
///
/// ```
/// use plant::Airframe;
/// use plant::effects::find;
///
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let vehicle = vehicles::Vehicle::load(path.as_ref()).unwrap();
/// let heavier = find("mass-error").unwrap().nominal();
/// let airframe = Airframe::with_effects(vehicle.clone(), vec![heavier]);
/// assert!(airframe.vehicle().mass_kg != vehicle.mass_kg, "the vehicle as it flies, not as it is declared");
/// ```
#[derive(Debug, Clone)]
pub struct Airframe {
    vehicle: Vehicle,
    effects: Vec<Effect>,
    frame_shift_B_m: Vector3<f64>,
    /// The command map as it is declared: an effect may change that of the vehicle.
    declared_command: CommandMap,
}

impl Airframe {
    /// The airframe of `vehicle` as it is declared: without the effects that its file lists.
    #[must_use]
    pub fn new(vehicle: Vehicle) -> Self {
        Self::with_effects(vehicle, Vec::new())
    }

    /// The airframe of `vehicle` with the effects of its file, and behind them those of a scene's.
    ///
    /// # Errors
    /// The fault of an effect, and its place.
    pub fn from_files(vehicle: Vehicle, scene: &[EffectEntry]) -> Result<Self, Diagnostic> {
        let entries: Vec<_> = vehicle.effects.iter().chain(scene).cloned().collect();
        let airframe = Self::with_effects(vehicle, entry::resolve(&entries)?);
        entry::require(&airframe.vehicle, &airframe.effects, &entries)?;
        Ok(airframe)
    }

    /// The airframe of `vehicle` with these effects instead of those that its file lists.
    #[must_use]
    pub fn with_effects(mut vehicle: Vehicle, effects: Vec<Effect>) -> Self {
        let (declared_B_m, declared_command) = (amid_rotors_B_m(&vehicle), vehicle.command);
        // A file may list them in any order, in which a change may see those before it.
        let mut by_catalogue = effects.clone();
        by_catalogue.sort_by_key(|effect| CATALOGUE.iter().position(|kind| *kind == effect.kind));
        for (effect, action) in actions(&by_catalogue) {
            if let Action::Vehicle(change) = action {
                change(&effect.values, &mut vehicle);
            }
        }
        let frame_shift_B_m = amid_rotors_B_m(&vehicle) - declared_B_m;
        Self { vehicle, effects, frame_shift_B_m, declared_command }
    }

    /// The vehicle as it flies, changed by its effects.
    #[must_use]
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// The command map as it is declared.
    pub(crate) fn declared_command(&self) -> &CommandMap {
        &self.declared_command
    }

    /// Returns the frame's displacement by the effects from its declared place, seen from the centre of mass.
    pub(crate) fn frame_shift_B_m(&self) -> &Vector3<f64> {
        &self.frame_shift_B_m
    }

    /// Fingerprint of the facts that the state of its flight with the backend `backend` depends on, without its effects: the
    /// number of its rotors.
    pub(crate) fn fingerprint(&self, backend: &'static str) -> Fingerprint {
        let rotors = self.vehicle.rotors.len() as f64;
        Fingerprint::of(std::iter::once(backend)).with(std::iter::once(rotors))
    }

    /// Names of the kinds of its effects, in their order.
    pub(crate) fn kinds(&self) -> impl Iterator<Item = &'static str> {
        self.effects.iter().map(|effect| effect.kind.name)
    }

    /// Its effects, in the order in which they are summed.
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// The state of its effects before the first tick, for ticks of `dt_s` of the node named `node` in a run
    /// whose seed is `seed`.
    #[must_use]
    pub fn initial_state(&self, seed: u64, node: &str, dt_s: f64) -> AirframeState {
        let random = |kind: &str| component::random::stream(seed, &format!("{node}/{kind}"));
        let state = |kind: &str| EffectState::new(kind, random(kind), self.vehicle.rotors.len());
        AirframeState {
            actuation: Actuation::none(self.vehicle.rotors.len()),
            measured_voltage_V: None,
            commands: DelayLine::new(self.delay_s() / dt_s, self.vehicle.rotors.len()),
            effects: self.kinds().map(state).collect(),
        }
    }

    /// Actuation over the tick of `dt_s` that begins at `state`, under raw motor `commands` held over it: one for each
    /// rotor. It is kept in `memory`.
    pub fn begin_tick<'m>(
        &self,
        memory: &'m mut AirframeState,
        state: &State,
        commands: &[f64],
        dt_s: f64,
    ) -> &'m Actuation {
        let AirframeState { actuation, measured_voltage_V, commands: line, effects } = memory;
        let measured_voltage_V = *measured_voltage_V;
        let delayed = line.pass(commands, self.delay_s() / dt_s);
        actuation.ask(self.targets_rad_s(&delayed));
        for (effect, effect_state) in self.effects.iter().zip(effects) {
            for action in effect.kind.actions {
                if let Action::Tick(tick) = action {
                    let condition = FlightCondition::new(&self.vehicle, state, &actuation.air_velocity_W_m_s);
                    let (actuation, state) = (&mut *actuation, &mut *effect_state);
                    tick(
                        &effect.values,
                        &mut Advance { condition, actuation, state, measured_voltage_V, dt_s },
                    );
                }
            }
        }
        actuation
    }

    /// The battery, if an effect models it: with the voltage that was measured, if there is one.
    #[must_use]
    pub fn battery(&self, effects: &AirframeState, state: &State) -> Option<Battery> {
        let speeds_rad_s = state.rotors.map(|rotor| rotor.speed_rad_s);
        let modelled = self.effects.iter().zip(&effects.effects).find_map(|(effect, effect_state)| {
            effect.kind.actions.iter().find_map(|action| match action {
                Action::Battery(battery) => {
                    Some(battery(&effect.values, effect_state, &self.vehicle, &speeds_rad_s))
                }
                _ => None,
            })
        })?;
        let voltage_V = effects.measured_voltage_V.unwrap_or(modelled.voltage_V);
        Some(Battery { voltage_V, ..modelled })
    }

    /// Returns the actuation under `commands` in still air, without the state of effects.
    pub(crate) fn commanded(&self, commands: &[f64]) -> Actuation {
        Actuation::of(self.targets_rad_s(commands).collect())
    }

    /// Speeds that these commands ask the rotors for.
    fn targets_rad_s(&self, commands: &[f64]) -> impl Iterator<Item = f64> {
        let speed = |(rotor, command): (usize, &f64)| self.vehicle.commanded_speed_rad_s(rotor, *command);
        commands.iter().enumerate().map(speed)
    }

    /// Rates of change of the rotors, into `rates`.
    pub(crate) fn set_rotor_rates(
        &self,
        actuation: &Actuation,
        state: &State,
        rates: &mut PerRotor<RotorRates>,
    ) {
        let motor = &self.vehicle.motor;
        let pairs = state.rotors.iter().zip(&actuation.targets_rad_s);
        rates.assign(pairs.map(|(rotor, target)| motor::rates(motor, rotor, *target)));
    }

    /// Returns all forces but gravity and contacts, and their torques about the centre of mass. The effects are added
    /// in their order; the order is part of the result, as float addition is not associative.
    pub(crate) fn wrench(
        &self,
        actuation: &Actuation,
        state: &State,
        rotors: &PerRotor<RotorRates>,
    ) -> Wrench {
        let condition = FlightCondition::new(&self.vehicle, state, &actuation.air_velocity_W_m_s);
        let thrusts_N =
            PerRotor::from_fn(self.vehicle.rotors.len(), |i| self.thrust_N(actuation, &condition, i));
        let w_B_rad_s = &state.body.angular_velocity_B_rad_s;
        let mut sum = rotor::wrench(&self.vehicle, &thrusts_N, &state.rotors, rotors, w_B_rad_s);
        for (effect, action) in actions(&self.effects) {
            if let Action::Wrench(wrench) = action {
                sum += wrench(&effect.values, &condition);
            }
        }
        sum
    }

    /// The rotors at the end of a tick of `dt_s` that began with `actuation`, independent of the body: one
    /// Runge-Kutta step of fourth order.
    #[must_use]
    pub fn spun(
        &self,
        actuation: &Actuation,
        rotors: &PerRotor<RotorState>,
        dt_s: f64,
    ) -> PerRotor<RotorState> {
        let motor = &self.vehicle.motor;
        let moved = |rotor: &RotorState, target: &f64| motor::moved(motor, rotor, *target, dt_s);
        let mut spun = paired(rotors, &actuation.targets_rad_s, moved);
        self.settle(actuation, &mut spun);
        spun
    }

    /// Gives the rotors accelerations that fit their speeds and targets, as shown at the end of a tick.
    pub(crate) fn settle(&self, actuation: &Actuation, rotors: &mut PerRotor<RotorState>) {
        let motor = &self.vehicle.motor;
        for (rotor, target) in rotors.iter_mut().zip(&actuation.targets_rad_s) {
            *rotor = motor::settled(motor, rotor, *target);
        }
    }

    fn thrust_N(&self, actuation: &Actuation, condition: &FlightCondition, rotor: usize) -> f64 {
        let mut sum_N = condition.thrust_N(rotor) * (1.0 + actuation.thrust_deviation[rotor]);
        for (effect, action) in actions(&self.effects) {
            if let Action::Thrust(added_N) = action {
                sum_N += added_N(&effect.values, condition, rotor);
            }
        }
        sum_N
    }

    fn delay_s(&self) -> f64 {
        let delay = |(effect, action): (&Effect, &Action)| match action {
            Action::Delay(delay_s) => delay_s(&effect.values),
            _ => 0.0,
        };
        actions(&self.effects).map(delay).sum()
    }
}

/// Each action of each effect, in order.
fn actions(effects: &[Effect]) -> impl Iterator<Item = (&Effect, &'static Action)> {
    effects.iter().flat_map(|effect| effect.kind.actions.iter().map(move |action| (effect, action)))
}
