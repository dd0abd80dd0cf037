//! The state of a controller: laid out alike for all laws, so that any of them can take over from any other.
//!
//! A process is swapped for one of another law, also in Python or C++, only if the states of both have one layout.
//! The state therefore holds the quantities that mean the same to all laws, and room for the law's own state. That is a
//! typed message, [`Law::State`]. Only a law with the same type of state reads it, and only if no other program has flown since.

use crate::allocation::RotorWrench;
use crate::control::Integrals;
use crate::law::Law;
use component::Message;
use component::random::{FNV_OFFSET, fnv1a};

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
    /// Layout hash of its state, combined with its name.
    #[field(unit = "1")]
    state: u64,
}

impl LawId {
    /// The identity of `L`.
    pub fn of<L: Law>() -> Self {
        const { assert!(L::INFO.name.len() <= NAME_MAX, "a law's name fits into `NAME_MAX` bytes") }
        let mut name = [0; NAME_MAX];
        name[..L::INFO.name.len()].copy_from_slice(L::INFO.name.as_bytes());
        Self { name, state: L::State::SCHEMA.layout_hash() ^ fnv1a(&name, FNV_OFFSET) }
    }

    /// Layout hash of the law's state. If a program in another language has written only its own name, this is the hash of no layout: the
    /// words are still those of the law before.
    pub fn layout(&self) -> u64 {
        self.state ^ fnv1a(&self.name, FNV_OFFSET)
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

    /// The law's own state; `None` if the program that flew last has left no `S`.
    ///
    /// It compares hashes of layouts, and allocates to compute one: a step does not call it.
    #[must_use]
    pub fn law_state<S: Message>(&self) -> Option<&S> {
        (self.id.layout() == S::SCHEMA.layout_hash()).then(|| self.words())
    }

    /// As [`Self::law_state`], to be changed.
    pub fn law_state_mut<S: Message>(&mut self) -> Option<&mut S> {
        if self.law_state::<S>().is_some() { Some(self.words_mut()) } else { None }
    }

    /// The first words as an `S`, which the caller knows them to be.
    pub(crate) fn words<S: Message>(&self) -> &S {
        const { assert!(size_of::<S>() <= 8 * WORDS_MAX, "a law's state fits into `WORDS_MAX` words") }
        bytemuck::from_bytes(&bytemuck::bytes_of(&self.law_state)[..size_of::<S>()])
    }

    /// As [`Self::words`], to be changed.
    pub(crate) fn words_mut<S: Message>(&mut self) -> &mut S {
        const { assert!(size_of::<S>() <= 8 * WORDS_MAX, "a law's state fits into `WORDS_MAX` words") }
        bytemuck::from_bytes_mut(&mut bytemuck::bytes_of_mut(&mut self.law_state)[..size_of::<S>()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foresight::ForesightState;
    use crate::geometric::GeometricLaw;
    use crate::lqr::LqrLaw;
    use crate::pid::PidState;

    #[test]
    fn a_law_s_own_state_is_read_by_its_type_alone() {
        let mut state = ControllerState { id: LawId::of::<GeometricLaw>(), ..ControllerState::default() };
        state.law_state_mut::<ForesightState>().unwrap().thrust_made = 4.7;
        assert_eq!(state.law_state::<ForesightState>().map(|left| left.thrust_made), Some(4.7));
        assert_eq!(state.law_state::<PidState>(), None);
        assert_eq!(state.law_state_mut::<PidState>(), None);
        assert_eq!(ControllerState::default().law_state::<ForesightState>(), None);
    }

    #[test]
    fn a_program_that_writes_its_name_leaves_no_state_of_the_law_before() {
        let id = LawId::of::<GeometricLaw>();
        assert_eq!(id.layout(), LawId::of::<LqrLaw>().layout(), "they have one type of state");
        let program = LawId { name: *b"python\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", ..id };
        let state = ControllerState { id: program, ..ControllerState::default() };
        assert_eq!(state.law_state::<ForesightState>(), None);
    }
}
