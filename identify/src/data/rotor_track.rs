//! The rotors over a flight, on its grid.

use plant::{PerRotor, RotorState};
use std::sync::Arc;
use vehicles::ROTORS_MAX;

/// A number for each rotor; zeros behind the last.
pub type EachRotor = [f64; ROTORS_MAX];

/// The rotors over a flight, on its grid.
#[derive(Debug, Clone)]
pub struct Rotors {
    /// Rotors that act on the vehicle: measured where speeds were logged, else computed from the commands.
    pub flown: Arc<Vec<PerRotor<RotorState>>>,
    /// Rotor speeds that follow from the commands; zeros behind the last rotor.
    pub commanded: Arc<Vec<EachRotor>>,
}

impl Rotors {
    /// Rotors, and the speeds that follow from the commands.
    pub fn new(flown: Vec<PerRotor<RotorState>>, commanded: Vec<EachRotor>) -> Self {
        Self { flown: Arc::new(flown), commanded: Arc::new(commanded) }
    }
}
