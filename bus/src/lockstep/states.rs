//! Words of the control segment that are not counts.

use crate::error::BusError;

/// Common progress of the processes of a run in joining.
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

/// Progress of the end of an aborted run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Abort {
    /// Only nodes without outputs still wait for samples. The senders may still send the samples whose inputs they
    /// have.
    Told = 1,
    /// The senders have left: no more samples come.
    Drained = 2,
}

/// State of a slot of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum SlotState {
    /// No process.
    Empty = 0,
    /// A process that may make its connections.
    Joining = 1,
    /// A process that computes.
    Taken = 2,
}

/// Outcome of the state transfer to a backup: the origin of its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum TransferOutcome {
    /// The outcome is not known yet.
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

/// Reason why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waited {
    /// The awaited count or state was reached.
    Reached,
    /// The run is over or aborted: it will not be reached.
    Over,
}

impl Waited {
    /// Returns an error if the wait ended early; for waits that only an abort ends early.
    pub(crate) fn or_aborted(self) -> Result<(), BusError> {
        if self == Self::Reached { Ok(()) } else { Err(BusError::Aborted) }
    }
}
