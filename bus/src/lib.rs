//! The lockstep bus: messages, ports, the node loop and the clock service.
//!
//! To write a component, use [`Component`], its [contexts](context), [messages] or a [message of its own](Message),
//! and [`run_process`]; to test one, [`Harness`]. Modules without documentation serve launchers: they change without
//! notice.
//!
//! | subject | modules |
//! |---|---|
//! | a component and its declarations | [`component`], [`parameters`], [`ports`], [`context`], [`random`], `state`, `registration` |
//! | messages | [`message`], [`messages`], [`schema`], `bounded`, `finite` |
//! | the plan of a run, written by the launcher | [`plan`], [`sample_ticks`], `membership`, `depths`, `names` |
//! | one tick of a node, under every host | `stepper`, `timing`, [`computing_time`], `computation` |
//! | a node in a process or on a thread | `join`, `place`, `node`, `links`, `connected`, `executor`, `group`, `run_process` |
//! | all nodes on one thread, without shared memory | `simulation`, `sample_memory` |
//! | pacing: the control segment and the clock service | `lockstep`, `clock` |
//! | transport of samples | `transport` (iceoryx2), `local` (within a process), `sample_ring` (to the recorder), [`watch`] (to watchers) |
//! | states: hand-over, checkpoints | `state_transfer`, `hand_over`, [`checkpoint`], `saved_sample` |
//! | host times | `profile`, `step_times`, `host_time` |
//! | remarks of components on a run | [`remark`] |
//! | files and memory of a run | `announcement`, `description`, `shared_file`, `json_file`, `user_file`, `reserve`, `room`, `claim`, `process` |
//! | nodes of other languages, tests, people | [`dynamic`], `harness`, `node_harness`, `input_messages`, [`asked`] |

// The derive names this crate `bus` also when it is used inside it.
extern crate self as bus;

pub mod announcement;
pub mod asked;
mod bounded;
pub mod checkpoint;
#[doc(hidden)]
pub mod claim;
#[doc(hidden)]
pub mod clock;
pub mod component;
mod computation;
pub mod computing_time;
mod connected;
pub mod context;
mod depths;
#[doc(hidden)]
pub mod description;
pub mod dynamic;
pub mod error;
mod executor;
mod finite;
#[doc(hidden)]
pub mod group;
mod hand_over;
mod handles;
mod harness;
#[doc(hidden)]
pub mod host_time;
#[doc(hidden)]
pub mod initial;
mod input_messages;
mod join;
mod json_file;
mod links;
mod local;
#[doc(hidden)]
pub mod lockstep;
#[doc(hidden)]
pub mod membership;
pub mod message;
pub mod messages;
#[doc(hidden)]
pub mod names;
mod node;
mod node_harness;
pub mod parameters;
#[doc(hidden)]
pub mod place;
pub mod plan;
mod port;
pub mod ports;
#[doc(hidden)]
pub mod process;
#[doc(hidden)]
pub mod profile;
pub mod random;
mod registration;
pub mod remark;
mod reserve;
#[doc(hidden)]
pub mod room;
mod run_process;
mod sample_memory;
mod sample_ring;
pub mod sample_ticks;
mod saved_sample;
pub mod schema;
mod shared_file;
mod simulation;
#[cfg(test)]
#[path = "../../tests/runs/skipped.rs"]
mod skipped;
mod state;
#[doc(hidden)]
pub mod state_transfer;
#[doc(hidden)]
pub mod step_times;
mod stepper;
mod tick;
mod timing;
mod transport;
#[doc(hidden)]
pub mod user_file;
pub mod watch;

pub use bounded::Bounded;
pub use bus_derive::{InputPorts, Message, OutputPorts, Parameters};
pub use component::Component;
pub use diagnostics::ParameterError;
pub use error::BusError;
#[doc(hidden)]
pub use handles::{Input, Output};
pub use harness::Harness;
pub use input_messages::{InputMemory, InputMessages};
pub use inputs::{FileKind, FileRole, InputFiles};
pub use join::{GENERATION_VARIABLE, Join, NODE_VARIABLE};
pub use message::Message;
#[doc(hidden)]
pub use node::Node;
pub use node_harness::{NodeHarness, Sample};
pub use parameters::Parameters;
pub use registration::{Registration, message_of};
pub use run_process::run_process;
pub use simulation::{Simulation, Topic};
#[doc(hidden)]
pub use tick::Tick;
pub use transport::{IceoryxError, limit_transport_log, reap_dead, takes_run_dir};

#[doc(hidden)]
pub mod __private {
    pub use bytemuck;
    pub use serde;
}
