//! The state of a controller: laid out alike for all laws, so that any of them can take over from any other.
//!
//! A process is swapped for one of another law, also in Python or C++, only if the states of both have one layout.
//! The state therefore holds the quantities that mean the same to all laws, and room for the law's own state. That is a
//! typed message, [`Law::State`]. Only a law with the same type of state reads it.

use crate::allocation::RotorWrench;
use crate::control::Integrals;
use crate::law::Law;
use bus::Message;

/// The most 64-bit words that a law's own state takes.
const WORDS_MAX: usize = 32;

/// The most bytes of a law's name.
const NAME_MAX: usize = 24;

/// Law that a state belongs to; zero before the first tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LawId")]
pub(crate) struct LawId {
    /// The law's name, zeros behind.
    #[field(unit = "1")]
    name: [u8; NAME_MAX],
    /// Layout hash of its state.
    #[field(unit = "1")]
    pub state: u64,
}

impl LawId {
    /// The identity of `L`.
    pub fn of<L: Law>() -> Self {
        const { assert!(L::INFO.name.len() <= NAME_MAX, "a law's name fits into `NAME_MAX` bytes") }
        let mut name = [0; NAME_MAX];
        name[..L::INFO.name.len()].copy_from_slice(L::INFO.name.as_bytes());
        Self { name, state: L::State::SCHEMA.layout_hash() }
    }
}

/// State of a controller between ticks.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ControllerState")]
pub struct ControllerState {
    /// The law that left it.
    pub(crate) id: LawId,
    /// Thrust that was demanded last.
    #[field(unit = "N", frame = "body")]
    pub thrust: f64,
    /// Torque that was demanded last.
    #[field(unit = "N*m", frame = "body")]
    pub torque: [f64; 3],
    /// Outputs of the law's integrators.
    pub integrals: Integrals,
    /// Remaining part of the predecessor's thrust that this law does not ask for itself.
    #[field(unit = "N", frame = "body")]
    pub residual_thrust: f64,
    /// The same of its torque.
    #[field(unit = "N*m", frame = "body")]
    pub residual_torque: [f64; 3],
    /// The law's own state in the first words.
    #[field(unit = "1")]
    law_state: [u64; WORDS_MAX],
}

impl ControllerState {
    /// True if no law has left it yet.
    pub(crate) fn is_new(&self) -> bool {
        self.id == LawId::default()
    }

    /// The wrench that was demanded last.
    pub(crate) fn wrench(&self) -> RotorWrench {
        RotorWrench { thrust_N: self.thrust, torque_B_N_m: self.torque.into() }
    }

    /// Notes the wrench that is demanded.
    pub(crate) fn set_wrench(&mut self, wrench: &RotorWrench) {
        self.thrust = wrench.thrust_N;
        self.torque = wrench.torque_B_N_m.into();
    }

    /// The law's own state, which is an `S`.
    #[must_use]
    pub fn law_state<S: Message>(&self) -> &S {
        const { assert!(size_of::<S>() <= 8 * WORDS_MAX, "a law's state fits into `WORDS_MAX` words") }
        bytemuck::from_bytes(&bytemuck::bytes_of(&self.law_state)[..size_of::<S>()])
    }

    /// As [`Self::law_state`], to be changed.
    pub fn law_state_mut<S: Message>(&mut self) -> &mut S {
        const { assert!(size_of::<S>() <= 8 * WORDS_MAX, "a law's state fits into `WORDS_MAX` words") }
        bytemuck::from_bytes_mut(&mut bytemuck::bytes_of_mut(&mut self.law_state)[..size_of::<S>()])
    }
}
