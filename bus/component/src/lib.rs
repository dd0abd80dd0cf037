//! Components, their ports, messages and parameters. This crate has no transport: the crate `bus` connects components, and a
//! test steps one by a [`Harness`].
//!
//! To write a component, implement [`Component`] with its [contexts](context), [messages] or a [message of its own](Message).
//!
//! | subject | modules |
//! |---|---|
//! | a component and its state | `interface`, `state`, [`context`] |
//! | its declarations | [`parameters`], [`ports`], [`sample_ticks`], `registration` |
//! | messages | [`message`], [`messages`], [`schema`], `bounded`, [`announcement`] |
//! | random numbers | [`random`] |
//! | errors | [`error`] |
//! | a component in a test | `harness`, `input_messages`, `sample_memory` |
//! | checks before a sample is sent | `finite` |
//!
//! Items without documentation serve the crate `bus`: they change without notice.

// The derives name this crate `component` also in itself.
extern crate self as component;

pub mod announcement;
mod bounded;
pub mod context;
pub mod error;
#[doc(hidden)]
pub mod finite;
mod harness;
mod input_messages;
mod interface;
pub mod message;
pub mod messages;
pub mod parameters;
pub mod ports;
pub mod random;
#[doc(hidden)]
pub mod registration;
#[doc(hidden)]
pub mod sample_memory;
pub mod sample_ticks;
pub mod schema;
mod state;

pub use bounded::Bounded;
pub use bus_derive::{InputPorts, Message, OutputPorts, Parameters};
pub use diagnostics::ParameterError;
pub use error::BusError;
pub use harness::Harness;
pub use input_messages::{InputMemory, InputMessages};
pub use inputs::{FileKind, FileRole, InputFiles};
pub use interface::{Component, Failure, FirstFailure, Info, Role, StepError};
pub use message::Message;
pub use parameters::Parameters;
pub use registration::{Registration, message_of};
pub use state::{State, StateError, Transfer};

#[doc(hidden)]
pub mod __private {
    pub use bytemuck;
    pub use serde;
}
