//! A live run is paused, stepped, paced, swapped and stopped from outside.
//!
//! - [`protocol`]: requests to a run, and its answers
//! - `server`: the launcher's socket in the run directory
//! - `control`: requests carried out by the launcher
//! - [`client`]: the other end of the socket

pub mod client;
pub(crate) mod control;
pub mod protocol;
mod server;

pub use server::Remote;
pub(crate) use server::{Asked, Reply};
