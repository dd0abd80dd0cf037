//! What a control law is: its state, how it begins, how it goes on after another law, its step.

use crate::allocation::RotorWrench;
use crate::control::{ControlInput, ControlOutput, Integrals};
use bus::Message;

/// A control law at one period, with all that does not change during a run.
pub trait Law {
    /// Name in manifests.
    const NAME: &'static str;

    /// All that it remembers between ticks.
    type State: Message;

    /// The greatest angular acceleration that it asks for against a body rate, 1/s: with the period it tells whether
    /// the loop can be closed at all. 0 where the law is made for its period.
    fn rate_gain_1_s(&self) -> f64 {
        0.0
    }

    /// What it begins with before the first tick of a run.
    fn start(&self, input: &ControlInput<'_>) -> Start<Self::State>;

    /// What it begins with after another law. It need not ask for the other's last wrench, since
    /// [`crate::bumpless::BumplessTransfer`] makes up for the rest, and an integrator should not take that up: it would
    /// keep amid a manoeuvre what is gone a moment later.
    fn take_over(&self, from: &Predecessor<'_, Self::State>, input: &ControlInput<'_>) -> Start<Self::State>;

    /// The demand now; advances the state by one period. `last` was asked for one period ago.
    fn step(&self, state: &mut Self::State, last: &RotorWrench, input: &ControlInput<'_>) -> ControlOutput;
}

/// What a law begins with.
#[derive(Debug, Clone, Copy)]
pub struct Start<S> {
    /// Its state.
    pub state: S,
    /// The wrench that the rotors are taken to have been asked for one period ago.
    pub wrench: RotorWrench,
}

/// What is known of the law that flew before.
#[derive(Debug, Clone, Copy)]
pub struct Predecessor<'a, S> {
    /// The wrench that it asked for last. It may be a broken law, and the wrench no number.
    pub wrench: RotorWrench,
    /// What its integrators asked for; `None` where only its last command is known.
    pub integrals: Option<Integrals>,
    /// Its state, where that is of the same type as the successor's.
    pub state: Option<&'a S>,
}
