//! Measured flights: what was logged, in SI units and in the frames of this project, whatever file it came from.

pub mod flight;

pub use flight::{Channel, Flight, Role};
