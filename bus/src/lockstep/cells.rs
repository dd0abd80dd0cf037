//! The layout of the control segment: cells of named atomics, each on cache lines of its own.
//!
//! Words that one party writes together stand in one cell. Words that other parties read at every tick are not in a
//! cache line that is written at every tick.

use crate::step_times::BUCKETS;
use std::sync::atomic::{AtomicU32, AtomicU64};

/// Declares the cells, and a text of the declarations, from which the layout's number is computed.
macro_rules! cells {
    ($($(#[$about:meta])* struct $cell:ident { $($(#[$field_about:meta])* $field:ident: $type:ty,)* })*) => {
        $(
            $(#[$about])*
            #[derive(Debug)]
            #[repr(C, align(64))]
            pub(super) struct $cell {
                $($(#[$field_about])* pub(super) $field: $type,)*
            }
        )*
        const DECLARATIONS: &str = concat!($(stringify!($cell), $(" ", stringify!($field: $type),)* ";",)*);
    };
}

cells! {
    /// The start of the segment.
    struct Head {
        run: RunCell,
        clock: ClockCell,
        steering: SteeringCell,
        notices: NoticeCell,
    }

    /// Words that every party reads at every tick. They are written at the start and at the end of the run, and when
    /// the membership changes.
    struct RunCell {
        /// The layout's number, once all is there.
        magic: AtomicU32,
        /// A [`Phase`](super::Phase); slept on.
        phase: AtomicU32,
        /// The tick at which the run ends.
        end_tick: AtomicU32,
        /// 0 until the run is aborted, then an [`Abort`](super::states::Abort).
        abort: AtomicU32,
        /// The number of the newest membership.
        epoch: AtomicU32,
        /// The tick before which every node writes its part of a requested checkpoint; 0 if none was requested.
        checkpoint_tick: AtomicU32,
        /// Number of checkpoints that were requested.
        checkpoint_asks: AtomicU32,
    }

    /// Words written by the clock.
    struct ClockCell {
        /// Ticks that may be computed.
        granted: AtomicU32,
        /// The boundary at which the clock waits, or [`NEVER`](super::wake::NEVER).
        held_at: AtomicU32,
        /// Deadlines that were missed.
        missed_deadlines: AtomicU32,
        /// The process of the clock service; 0 before it has started.
        process: AtomicU32,
        /// Host time of the first grant, and of the last completion.
        start_ns: AtomicU64,
        end_ns: AtomicU64,
        /// Processor time of the clock service.
        cpu_ns: AtomicU64,
    }

    /// Requests to the clock.
    struct SteeringCell {
        /// Counts the changes in this cell; the clock sleeps on it in a hold.
        changes: AtomicU32,
        /// The boundary at which a user wants the clock to wait.
        hold_tick: AtomicU32,
        /// The boundary at which the supervisor does.
        join_tick: AtomicU32,
        /// 1 once the run is to end at the next tick boundary.
        is_stop_requested: AtomicU32,
        /// The bits of the pace: simulated seconds per second, or 0 for none.
        pace: AtomicU64,
    }

    /// Notices for the supervisor that there is something to look at.
    struct NoticeCell {
        /// Counts the notices; the supervisor sleeps on it.
        count: AtomicU32,
    }

    /// A topic.
    struct TopicCell {
        /// Sequence: ticks whose samples are sent.
        sent: AtomicU32,
        /// Samples that readers found missing.
        gaps: AtomicU32,
        /// Sequence: ticks for which the publisher's backup has sent a shadow sample.
        shadow: Line,
    }

    /// A slot of a node, and the process in it.
    struct SlotCell {
        /// The [`Phase`](super::Phase) for which the process is ready; slept on.
        ready: AtomicU32,
        /// A [`SlotState`](super::SlotState); slept on.
        state: AtomicU32,
        /// Sequence: ticks that it has completed.
        done: AtomicU32,
        /// Sequence: ticks at whose start it has published its state.
        published: AtomicU32,
        /// The newest membership that it has acknowledged.
        epoch: AtomicU32,
        /// Origin of its state, a [`TransferOutcome`](super::TransferOutcome).
        transfer: AtomicU32,
        /// Deadlines at which it was late.
        late: AtomicU32,
        /// Its process; 0 before it has connected.
        process: AtomicU32,
        /// Steps whose simulated computing time went beyond the next due tick.
        overruns: AtomicU32,
        /// Due ticks at which it still computed, and so did not step.
        skipped_steps: AtomicU32,
        /// 1 once the instance has ended although its process may go on: it was a member of a group.
        has_left: AtomicU32,
        /// Processor time that it used between its first and its last tick.
        cpu_ns: AtomicU64,
        /// Waiter: it waits for the grant.
        grant_waiter: Line,
        /// Waiter: the clock waits for it.
        done_waiter: Line,
        /// Waiter: it waits for the process in the other slot of its node.
        other_waiter: Line,
        /// Its steps, counted by how long they took.
        steps: Steps,
    }

    /// Step times in buckets.
    struct Steps {
        counts: [AtomicU32; BUCKETS],
    }

    /// An input of a process.
    struct InputCell {
        /// Waiter: the process waits for samples.
        samples: Line,
        /// Waiter: the process waits for shadow samples.
        shadow: Line,
    }

    /// A sequence or a waiter on a cache line of its own.
    struct Line {
        word: AtomicU32,
    }
}

/// Number at the start of a segment of this layout: processes of different versions do not fly together.
pub(super) const MAGIC: u32 = number_of(DECLARATIONS) ^ VERSION;

/// Part of the number. It must be raised when the queues or the meaning of a word change, and the declarations above
/// do not.
const VERSION: u32 = 0;

/// The Fowler-Noll-Vo hash of `text`.
const fn number_of(text: &str) -> u32 {
    let (bytes, mut hash, mut index) = (text.as_bytes(), 0x811c_9dc5_u32, 0);
    while index < bytes.len() {
        hash = (hash ^ bytes[index] as u32).wrapping_mul(0x0100_0193);
        index += 1;
    }
    hash
}

const LINE: usize = 64;
const _: () = assert!(size_of::<Line>() == LINE && size_of::<InputCell>() == 2 * LINE);
const _: () = assert!(size_of::<Head>() == 4 * LINE && size_of::<TopicCell>() == 2 * LINE);
const _: () = assert!(size_of::<SlotCell>() == 4 * LINE + BUCKETS.next_multiple_of(LINE / 4) * 4);
const _: () = assert!(align_of::<Head>() == LINE && align_of::<SlotCell>() == LINE);
