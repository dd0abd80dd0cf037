//! The lockstep bus: messages, ports, the node loop and the clock service.

// The derive names this crate `bus` also when it is used inside it.
extern crate self as bus;

pub mod announcement;
pub mod clock;
pub mod control;
pub mod error;
pub mod initial;
pub mod kind;
pub mod message;
pub mod messages;
mod node;
pub mod plan;
mod port;
pub mod process;
pub mod profile;
pub mod random;
pub mod schema;
mod transport;

pub use bus_derive::Message;
pub use error::BusError;
pub use message::Message;
pub use node::{ConnectedNode, Input, NODE_VARIABLE, Node, Output, RawInput, Tick};

#[doc(hidden)]
pub mod __private {
    pub use bytemuck;
}
