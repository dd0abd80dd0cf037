//! The lockstep bus: messages, ports, the node loop and the clock service.

// The derive names this crate `bus` also when it is used inside it.
extern crate self as bus;

pub mod announcement;
pub mod clock;
pub mod component;
mod connected;
pub mod context;
pub mod control;
pub mod error;
mod finite;
mod harness;
pub mod hosted;
pub mod initial;
pub mod kind;
mod live;
pub mod membership;
pub mod message;
pub mod messages;
mod node;
mod node_harness;
pub mod plan;
mod port;
pub mod ports;
pub mod process;
pub mod profile;
pub mod random;
mod registration;
pub mod room;
mod run_process;
mod sample_memory;
pub mod schema;
pub mod state_transfer;
pub mod step_times;
mod tick;
mod transport;
pub mod user_file;

pub use bus_derive::{InputPorts, Message, OutputPorts};
pub use component::Component;
pub use connected::ConnectedNode;
pub use diagnostics::ParameterError;
pub use error::BusError;
pub use harness::Harness;
pub use message::Message;
pub use node::{GENERATION_VARIABLE, Input, NODE_VARIABLE, Node, Output, RawInput};
pub use node_harness::{NodeHarness, Sample};
pub use registration::Registration;
pub use run_process::{Join, run_process};
pub use tick::Tick;
pub use transport::{reap_dead, takes_run_dir};

#[doc(hidden)]
pub mod __private {
    pub use bytemuck;
}
