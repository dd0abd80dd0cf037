//! The lockstep bus: the plan of a run, the node loop, the clock service and the transport.
//!
//! Components, their ports, messages and parameters are in the crate [`component`], which this crate exports
//! again: `bus::messages` is `component::messages`.
//!
//! To write a component, use [`Component`], its [contexts](context), [messages] or a [message of its own](Message),
//! and [`run_process`]; to test one, [`Harness`]. Modules without documentation serve launchers: they change without
//! notice.
//!
//! | subject | modules |
//! |---|---|
//! | components of a plan | `making` |
//! | the plan of a run, written by the launcher | [`plan`], `membership`, `depths`, `names` |
//! | one tick of a node, under every host | `stepper`, `tick`, `handles`, `timing`, [`computing_time`], `computation` |
//! | a node in a process or on a thread | `join`, `place`, `node`, `links`, `connected`, `executor`, `group`, `run_process` |
//! | all nodes on one thread, without shared memory | `simulation` |
//! | pacing: the control segment and the clock service | `lockstep`, `clock` |
//! | ports, and transport of samples | `port`, `transport` (iceoryx2), `local` (within a process), `sample_ring` (to the recorder), [`watch`] (to watchers) |
//! | states: hand-over, checkpoints | `state_transfer`, `hand_over`, [`checkpoint`], `saved_sample` |
//! | host times | `profile`, `step_times`, `host_time` |
//! | remarks of components on a run | [`remark`] |
//! | files and memory of a run | [`announcement`], `description`, `shared_file`, `json_file`, `user_file`, `reserve`, `room`, `claim`, `process` |
//! | nodes of other languages, tests, people | [`dynamic`], `node_harness`, `initial`, [`asked`] |

// Documentation and tests name this crate `bus` also in it.
extern crate self as bus;

pub mod announcement;
pub mod asked;
pub mod checkpoint;
#[doc(hidden)]
pub mod claim;
#[doc(hidden)]
pub mod clock;
mod computation;
pub mod computing_time;
mod connected;
mod depths;
#[doc(hidden)]
pub mod description;
pub mod dynamic;
mod executor;
#[doc(hidden)]
pub mod group;
mod hand_over;
mod handles;
#[doc(hidden)]
pub mod host_time;
#[doc(hidden)]
pub mod initial;
mod join;
mod json_file;
mod links;
mod local;
#[doc(hidden)]
pub mod lockstep;
mod making;
#[doc(hidden)]
pub mod membership;
#[doc(hidden)]
pub mod names;
mod node;
mod node_harness;
#[doc(hidden)]
pub mod place;
pub mod plan;
mod port;
#[cfg(test)]
mod port_suite;
#[doc(hidden)]
pub mod process;
#[doc(hidden)]
pub mod profile;
pub mod remark;
mod reserve;
#[doc(hidden)]
pub mod room;
mod run_process;
mod sample_ring;
mod saved_sample;
mod shared_file;
mod simulation;
#[cfg(test)]
#[path = "../../tests/runs/skipped.rs"]
mod skipped;
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

pub use ::component;
pub use ::component::{
    Bounded, BusError, Component, FileKind, FileRole, Harness, InputFiles, InputMemory, InputMessages,
    InputPorts, Message, OutputPorts, ParameterError, Parameters, Registration, message_of,
};
#[doc(inline)]
pub use ::component::{context, error, message, messages, parameters, ports, random, sample_ticks, schema};
use ::component::{finite, registration, sample_memory};
#[doc(hidden)]
pub use handles::{Input, Output};
pub use join::{GENERATION_VARIABLE, Join, NODE_VARIABLE};
#[doc(hidden)]
pub use making::goes_on_from;
#[doc(hidden)]
pub use node::Node;
pub use node_harness::{NodeHarness, Sample};
pub use run_process::{run_component, run_process};
pub use simulation::{Simulation, Topic};
#[doc(hidden)]
pub use tick::Tick;
pub use transport::{IceoryxError, limit_transport_log, reap_dead, takes_run_dir};
