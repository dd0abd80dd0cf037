//! The faults that a simulated run may meet, and which of them may end it.

/// Something that may happen at any step while the storm lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fault {
    // A run goes on in spite of any of these.
    /// A process stands still for a while.
    Pause,
    /// The host's clock jumps, or every process was frozen.
    Leap,
    /// The supervisor does not hear of a change.
    LostNotice,
    /// A process wakes without cause.
    SpuriousWakeUp,
    /// A user requests a swap.
    Swap,
    /// A user pauses the run, steps it, or lets it go on.
    Steer,
    /// A user requests a stop.
    Stop,
    /// The plan of a backup cannot be written.
    StoreBackup,
    /// A node stands still while it starts, and then the clock when all have joined; both together are longer than a
    /// watchdog.
    SlowStart,
    /// The same of a backup that joins while the others wait for it; no storm has it.
    SlowBackup,
    // These may end it.
    /// A user requests a second stop.
    Interrupt,
    /// A process dies.
    Death,
    /// A process hangs for good.
    Hang,
    /// A sidecar does not get ready.
    NeverReady,
    /// A process cannot be started.
    Start,
    /// A membership cannot be written.
    StoreMembership,
}

use Fault::{
    Death, Hang, Interrupt, Leap, LostNotice, NeverReady, Pause, SlowStart, SpuriousWakeUp, Start, Steer,
    Stop, StoreBackup, StoreMembership, Swap,
};

pub(super) const HARMLESS: [Fault; 9] =
    [Pause, Leap, LostNotice, SpuriousWakeUp, Swap, Steer, Stop, StoreBackup, SlowStart];
pub(super) const HARMFUL: [Fault; 6] = [Interrupt, Death, Hang, NeverReady, Start, StoreMembership];
