//! Vehicle physics: the motion and its equations; and the node that puts it on the bus.
//!
//! | room | what it holds |
//! |---|---|
//! | `state` | the rigid body and the rotors, as carried from tick to tick |
//! | `airframe` | the forces that every backend moves the body by |
//! | `actuation`, `airframe_state` | what acts over a tick; what effects carry from tick to tick |
//! | [`effects`] | the physics beyond the declared vehicle |
//! | `motor` | the lag between commanded and actual rotor speed |
//! | [`rotor`] | thrust and torques of the rotors on the body |
//! | `rotation` | turning vectors inside of an integration step |
//! | `newton_euler` | equations of motion and their integration |
//! | `backend` | what a plant can do, whichever physics moves it |
//! | `free_flight` | the backend `newton-euler` |
//! | [`contact_dynamics`] | the backend `rapier`: ground, walls, other vehicles, rigs |
//! | [`saved`] | parts of a state as bytes of a fixed number |
//! | [`snapshot`] | a backend's state as bytes with names |
//! | [`node`], `memory` | the plant as a process of a run, and its state |
//! | `arms` | where the rotors are, and how wide they can be |
//! | `airworthy`, `odd`, `beyond` | what a vehicle must be to fly at all; what is odd about it; starts beyond the validated envelope |
//! | `parameters`, `origin` | what manifests say of a plant, and the flight that starts from it |
//! | `others` | which vehicles of the traffic are others |
//! | `output` | what a plant publishes |
//! | [`propeller_stand`] | one rotor alone, bolted down |
//! | [`traffic`] | the node that sends all plants of a run the positions of the others |
//!
//! ```
//! use nalgebra::Vector3;
//! use plant::{NewtonEuler, RigidBody};
//!
//! let text = vehicles::reference::HUMMINGBIRD;
//! let model = NewtonEuler::new(vehicles::Vehicle::parse(text, "hummingbird.toml")?, 1);
//! let hover = model.vehicle().hover_command();
//! let mut state = model.start(RigidBody::level_at(Vector3::new(0.0, 0.0, 1.0)), hover);
//! model.step(&mut state, &[hover; 4], 0.001);
//! assert!((state.body.position_W_m.z - 1.0).abs() < 1e-9);
//! # Ok::<(), diagnostics::Diagnostic>(())
//! ```
#![forbid(unsafe_code)]
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame that a vector is written in, _WB a rotation between the two, _N or _V a unit"
)]

mod actuation;
mod airframe;
mod airframe_state;
mod airworthy;
mod arms;
mod backend;
mod beyond;
pub mod contact_dynamics;
pub mod effects;
mod free_flight;
mod memory;
mod motor;
mod newton_euler;
pub mod node;
mod odd;
mod origin;
mod others;
mod output;
mod parameters;
pub mod propeller_stand;
mod rotation;
pub mod rotor;
pub mod saved;
pub mod snapshot;
mod state;
pub mod traffic;

pub use actuation::{Actuation, Battery};
pub use airframe::Airframe;
pub use airframe_state::{AirframeState, EffectState};
pub use backend::{Backend, ContactReport, Neighbour, NotePart};
pub use contact_dynamics::Rapier;
pub use free_flight::FreeFlight;
pub use memory::PlantMemory;
pub use newton_euler::{Accelerations, NewtonEuler};
pub use rotor::Wrench;
pub use state::{PerRotor, RigidBody, RotorState, State};
