//! The airframe: what the motors, the rotors, the air and the effects do to the body. Every backend moves the body
//! by the forces that this room gives.
//!
//! A backend owns a [`State`] and an [`AirframeMemory`]. Once per tick it calls [`Airframe::begin_tick`], which
//! advances the memory and settles what changes slowly against a tick, the [`Drive`]: commands, how the air moves,
//! the battery. The rest is a function of drive and state, evaluated at every stage of an integrator. Mass, inertia
//! and rotors are those of [`Airframe::vehicle`], which is the vehicle as it flies, its effects included.
//!
//! ```
//! # use plant::{Airframe, RigidBody, RotorState, State};
//! # let text = include_str!("../../vehicles/hummingbird.toml");
//! # let vehicle = vehicles::Vehicle::parse(text, "hummingbird.toml")?;
//! # let scene = scenes::Scene::parse(include_str!("../../scenes/ground.toml"), "ground.toml")?;
//! let airframe = Airframe::from_files(vehicle, &scene.effects)?;
//! let (seed, dt_s) = (7, 0.001);
//! let mut memory = airframe.memory(seed, "plant", dt_s);
//! # let body = RigidBody::level_at(nalgebra::Vector3::z());
//! # let state = State { body, rotors: [RotorState::steady(400.0); 4] };
//! let drive = airframe.begin_tick(&mut memory, &state, &[76.5; 4], dt_s);
//! # assert_eq!(drive, memory.drive);
//! # Ok::<(), vehicles::VehicleError>(())
//! ```
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in, N the newton")]

use crate::effects::battery::{self, Battery};
use crate::effects::situation::Situation;
use crate::effects::{Action, Advance, Effect, entry};
use crate::memory::{AirframeMemory, DelayLine, Remembered};
use crate::motor;
use crate::rotor::{self, Wrench};
use crate::state::{RotorRates, RotorState, State};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use vehicles::{EffectEntry, Vehicle, VehicleError};

/// A vehicle as the backends fly it: immutable.
#[derive(Debug, Clone)]
pub struct Airframe {
    vehicle: Vehicle,
    effects: Vec<Effect>,
    frame_shift_B_m: Vector3<f64>,
}

/// What acts on the airframe over one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Drive {
    /// Rotor speeds that the motors are asked for, in the order of the motor commands.
    pub targets_rad_s: [f64; 4],
    /// How the air moves.
    pub air_velocity_W_m_s: Vector3<f64>,
    /// By which part of itself the thrust of each rotor is more than it should be.
    pub thrust_deviation: [f64; 4],
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
    /// What is wrong with an effect, and where.
    pub fn from_files(vehicle: Vehicle, scene: &[EffectEntry]) -> Result<Self, VehicleError> {
        let entries: Vec<_> = vehicle.effects.iter().chain(scene).cloned().collect();
        let airframe = Self::with_effects(vehicle, entry::resolve(&entries)?);
        entry::require_rigid(&airframe.vehicle, &entries)?;
        Ok(airframe)
    }

    /// The airframe of `vehicle` with these effects instead of those that its file lists.
    #[must_use]
    pub fn with_effects(mut vehicle: Vehicle, effects: Vec<Effect>) -> Self {
        let declared_B_m = amid_rotors_B_m(&vehicle);
        for (effect, action) in actions(&effects) {
            if let Action::Vehicle(change) = action {
                change(&effect.values, &mut vehicle);
            }
        }
        let frame_shift_B_m = amid_rotors_B_m(&vehicle) - declared_B_m;
        Self { vehicle, effects, frame_shift_B_m }
    }

    /// The vehicle as it flies, changed by its effects.
    #[must_use]
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// How far the effects have moved the frame, seen from the centre of mass, from where it is declared.
    #[must_use]
    pub fn frame_shift_B_m(&self) -> &Vector3<f64> {
        &self.frame_shift_B_m
    }

    /// Its effects, in the order in which they are summed.
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// What its effects remember before the first tick, for ticks of `dt_s` of the node named `node` in a run
    /// whose seed is `seed`.
    #[must_use]
    pub fn memory(&self, seed: u64, node: &str, dt_s: f64) -> AirframeMemory {
        let random = |effect: &Effect| bus::random::stream(seed, &format!("{node}/{}", effect.kind.name));
        AirframeMemory {
            drive: Drive::default(),
            commands: DelayLine::new(self.delay_s() / dt_s),
            remembered: self.effects.iter().map(|effect| Remembered::new(random(effect))).collect(),
        }
    }

    /// What acts over the tick of `dt_s` that begins at `state`, under raw motor `commands` held over it.
    #[must_use]
    pub fn begin_tick(
        &self,
        memory: &mut AirframeMemory,
        state: &State,
        commands: &[f64; 4],
        dt_s: f64,
    ) -> Drive {
        let delayed = memory.commands.pass(commands, self.delay_s() / dt_s);
        let mut drive = self.asked(&delayed);
        for (effect, remembered) in self.effects.iter().zip(&mut memory.remembered) {
            self.advance(effect, remembered, state, &mut drive, dt_s);
        }
        memory.drive = drive;
        drive
    }

    /// The battery, if an effect models it.
    #[must_use]
    pub fn battery(&self, memory: &AirframeMemory, state: &State) -> Option<Battery> {
        let is_battery = |effect: &Effect| effect.kind.name == battery::BATTERY_SAG.name;
        let at = self.effects.iter().position(is_battery)?;
        let speeds_rad_s = state.rotors.map(|rotor| rotor.speed_rad_s);
        Some(battery::at(
            &self.effects[at].values,
            memory.remembered[at].lag[0],
            &self.vehicle,
            &speeds_rad_s,
        ))
    }

    /// What acts under `commands` in still air, without what effects remember.
    pub(crate) fn asked(&self, commands: &[f64; 4]) -> Drive {
        Drive {
            targets_rad_s: commands.map(|command| self.vehicle.command.speed(command)),
            ..Drive::default()
        }
    }

    /// Rates of change of the rotors.
    pub(crate) fn rotor_rates(&self, drive: &Drive, state: &State) -> [RotorRates; 4] {
        std::array::from_fn(|i| motor::rates(&self.vehicle.motor, &state.rotors[i], drive.targets_rad_s[i]))
    }

    /// All forces but gravity and contacts, and their torques about the centre of mass. The effects are added in
    /// their order; the order is part of the result, as float addition is not associative.
    pub(crate) fn wrench(&self, drive: &Drive, state: &State, rotors: &[RotorRates; 4]) -> Wrench {
        let situation = Situation::new(&self.vehicle, state, &drive.air_velocity_W_m_s);
        let thrusts_N = std::array::from_fn(|i| self.thrust_N(drive, &situation, i));
        let w_B_rad_s = &state.body.angular_velocity_B_rad_s;
        let mut sum = rotor::wrench(&self.vehicle, &thrusts_N, &state.rotors, rotors, w_B_rad_s);
        for (effect, action) in actions(&self.effects) {
            if let Action::Wrench(wrench) = action {
                sum += wrench(&effect.values, &situation);
            }
        }
        sum
    }

    /// The rotors at the end of a tick of `dt_s` that began with `drive`, whatever the body does: one Runge-Kutta
    /// step of fourth order.
    #[must_use]
    pub fn spun(&self, drive: &Drive, rotors: &[RotorState; 4], dt_s: f64) -> [RotorState; 4] {
        let motor = &self.vehicle.motor;
        let moved = std::array::from_fn(|i| motor::moved(motor, &rotors[i], drive.targets_rad_s[i], dt_s));
        self.settled(drive, &moved)
    }

    /// The rotors with accelerations that fit their speeds and targets, as shown at the end of a tick.
    pub(crate) fn settled(&self, drive: &Drive, rotors: &[RotorState; 4]) -> [RotorState; 4] {
        std::array::from_fn(|i| motor::settled(&self.vehicle.motor, &rotors[i], drive.targets_rad_s[i]))
    }

    fn thrust_N(&self, drive: &Drive, situation: &Situation, rotor: usize) -> f64 {
        let mut sum_N = situation.thrust_N(rotor) * (1.0 + drive.thrust_deviation[rotor]);
        for (effect, action) in actions(&self.effects) {
            if let Action::Thrust(added_N) = action {
                sum_N += added_N(&effect.values, situation, rotor);
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

    /// Has one effect remember a tick more and change the drive.
    fn advance(
        &self,
        effect: &Effect,
        remembered: &mut Remembered,
        state: &State,
        drive: &mut Drive,
        dt_s: f64,
    ) {
        for action in effect.kind.actions {
            if let Action::Tick(tick) = action {
                let situation = Situation::new(&self.vehicle, state, &drive.air_velocity_W_m_s);
                tick(&effect.values, &mut Advance { situation, drive, remembered, dt_s });
            }
        }
    }
}

/// The mean of the rotors' places, from the centre of mass.
pub(crate) fn amid_rotors_B_m(vehicle: &Vehicle) -> Vector3<f64> {
    vehicle.rotors.iter().map(|rotor| rotor.position_m).sum::<Vector3<f64>>() / 4.0
}

/// Each action of each effect, in order.
fn actions(effects: &[Effect]) -> impl Iterator<Item = (&Effect, &'static Action)> {
    effects.iter().flat_map(|effect| effect.kind.actions.iter().map(move |action| (effect, action)))
}
