//! What the words of the control segment say that are no counts.

use crate::error::BusError;

/// How far the processes of a run have come together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
#[repr(u32)]
pub enum Phase {
    /// Publishers are being created.
    Announcing = 0,
    /// Subscribers are being created.
    Connecting = 1,
    /// Ticks are granted.
    Running = 2,
}

/// How far the end of an aborted run has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Abort {
    /// Nobody waits for what is not there yet, but for a node without outputs: those that send may still send what they
    /// have the inputs of.
    Told = 1,
    /// Those that send have left: nothing more comes.
    Drained = 2,
}

/// What a slot of a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum SlotState {
    /// Nobody.
    Empty = 0,
    /// A process that may make its connections.
    Joining = 1,
    /// A process that computes.
    Taken = 2,
}

/// What the state transfer to a backup came to: what it goes on from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum TransferOutcome {
    /// Nothing is known yet.
    Unknown = 0,
    /// The state of its predecessor: both know the same type.
    State = 1,
    /// The last sample that its predecessor sent on each output.
    LastOutput = 2,
}

impl Phase {
    pub(super) fn of(word: u32) -> Self {
        one_of([Self::Announcing, Self::Connecting, Self::Running], word)
    }
}

impl SlotState {
    pub(super) fn of(word: u32) -> Self {
        one_of([Self::Empty, Self::Joining, Self::Taken], word)
    }
}

impl TransferOutcome {
    pub(super) fn of(word: u32) -> Self {
        one_of([Self::Unknown, Self::State, Self::LastOutput], word)
    }
}

fn one_of<S: Copy + std::fmt::Debug, const N: usize>(states: [S; N], word: u32) -> S {
    let state = states.get(word as usize).copied();
    state.unwrap_or_else(|| {
        panic!("the control segment is damaged: it holds {word} where one of {states:?} stands")
    })
}

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waited {
    /// What was waited for is there.
    Reached,
    /// The run is over (or aborted), and it will not come.
    Over,
}

impl Waited {
    /// Where nothing but an abort ends the wait early.
    pub(crate) fn or_aborted(self) -> Result<(), BusError> {
        if self == Self::Reached { Ok(()) } else { Err(BusError::Aborted) }
    }
}
