//! Closing the loop: what a real flight shows that the declared model lacks.

pub mod candidate;
pub mod clock;
pub mod fit;
pub mod model;
pub mod normal;
pub mod parameter;
pub mod prepared;
pub mod rotor;
pub mod select;
pub mod statistics;
pub mod track;
pub mod window;
