//! The computation of a node, without its type.

use crate::component::StateError;
use crate::tick::Tick;

/// Computation of a node: its steps, and the state that they change.
pub(crate) trait Computation {
    /// As [`State::configuration`](crate::component::State::configuration).
    fn configuration(&self) -> u64;
    /// Number of bytes of the state.
    fn state_size(&self) -> usize;
    /// Writes the state.
    fn save(&self, bytes: &mut [u8]);
    /// Continues from a state.
    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError>;
    /// As [`State::adopt`](crate::component::State::adopt).
    fn adopt(&mut self, _bytes: &[u8]) -> Result<bool, StateError> {
        Ok(false)
    }
    /// Computes a tick.
    fn step(&mut self, tick: &mut Tick<'_>) -> Result<(), String>;
}
