//! Waiting for a count, by sleeping or by polling, and for a state.

use super::segment::Segment;
use super::states::Waited;
use super::wake::{self, Word};
use crate::host_time::monotonic_ns;
use crate::plan::Wait;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::time::Duration;

/// Time for which a reader with `wait = "adaptive"` polls before it sleeps: about five context switches.
const ADAPTIVE_SPIN_NS: u64 = 10_000;
/// Polls between two looks at the clock or two yields.
const POLLS: u32 = 64;
/// Longest sleep of a process that waits for a state, before it checks for an abort.
const STATE_NAP: Duration = Duration::from_millis(50);

/// Waits until `sequence` reaches `count`, or `is_over` says that it never will.
pub(super) fn wait_for_count(
    segment: &Segment,
    sequence: &AtomicU32,
    count: u32,
    waiter: &AtomicU32,
    wait: Wait,
    is_over: impl Fn() -> bool,
) -> Waited {
    let polls_until_ns = if wait == Wait::Adaptive { monotonic_ns() + ADAPTIVE_SPIN_NS } else { 0 };
    loop {
        if sequence.load(Acquire) >= count {
            return Waited::Reached;
        }
        if is_over() {
            return Waited::Over;
        }
        if segment.place().is_terminated() {
            segment.request_stop();
        }
        let polls = match wait {
            Wait::Block => false,
            Wait::Spin => true,
            Wait::Adaptive => monotonic_ns() < polls_until_ns,
        };
        if polls {
            poll(sequence, count);
        } else {
            wake::sleep(sequence, count, waiter, &is_over);
        }
    }
}

/// Polls `sequence` a few times, then lets another process have the core.
fn poll(sequence: &AtomicU32, count: u32) {
    for _ in 0..POLLS {
        if sequence.load(Acquire) >= count {
            return;
        }
        std::hint::spin_loop();
    }
    rustix::thread::sched_yield();
}

/// Sets `word` to `state`, and wakes the processes that wait for it.
pub(super) fn set_state(word: &AtomicU32, state: u32) {
    word.store(state, Release);
    word.wake();
}

/// Waits until `word` is at least `state`; only for joining, which is not timed to the microsecond.
pub(super) fn wait_for_state(segment: &Segment, word: &AtomicU32, state: u32) -> Waited {
    loop {
        let found = word.load(Acquire);
        if found >= state {
            return Waited::Reached;
        }
        if segment.is_aborted() {
            return Waited::Over;
        }
        // The timeout covers an abort that falls between the look at the flag and the sleep.
        word.sleep(found, Some(STATE_NAP));
    }
}
