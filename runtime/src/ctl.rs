//! A live run is paused, stepped, paced, swapped and stopped from outside.
//!
//! - [`protocol`]: what can be asked of a run, and what it answers
//! - `server`: the launcher's socket in the run directory
//! - `control`: what the launcher does with a request
//! - [`client`]: the other end of the socket

pub mod client;
pub(crate) mod control;
pub mod protocol;
mod server;

pub use server::Remote;
pub(crate) use server::{Asked, Reply};
