//! The wake-up protocol: a reader that sleeps for a sequence is woken when it reaches the count, and never without
//! cause.
//!
//! A *sequence* counts ticks that are complete. A *waiter* belongs to one reader of one sequence and holds the count
//! for which this reader sleeps. A writer stores its sequence, then looks at the waiters that read it, and wakes only
//! those whose count is reached: a reader that is awake costs no system call.
//!
//! Both sides store, and then load what the other side stores; between the two stands a fence. All parties see the
//! fences in one order. If the reader's comes later, the reader finds the new count and does not sleep. If the
//! writer's comes later, the writer finds the reader's count. `wake_model.rs` explores the orders in which this can
//! happen.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::{self, Acquire, Relaxed, Release};
use std::time::Duration;

/// The value of a waiter on which no reader sleeps.
pub(super) const AWAKE: u32 = u32::MAX;
/// The tick of an event that does not come: of a hold while the clock runs.
pub(super) const NEVER: u32 = u32::MAX;
/// Longest sleep of the clock in a hold before it checks for a stop.
const HOLD_NAP: Duration = Duration::from_millis(100);

/// A word of memory that parties share and can sleep on: a futex, or its substitute in a model.
pub(super) trait Word {
    fn load(&self, order: Ordering) -> u32;
    fn store(&self, value: u32, order: Ordering);
    fn swap(&self, value: u32, order: Ordering) -> u32;
    fn increment(&self, order: Ordering);
    /// A fence in the one order that all parties see.
    fn fence();
    /// Sleeps until woken, or until `timeout`, if the word holds `seen`; it may also return for no reason.
    fn sleep(&self, seen: u32, timeout: Option<Duration>);
    /// Wakes the sleepers on the word.
    fn wake(&self);
}

impl Word for AtomicU32 {
    fn load(&self, order: Ordering) -> u32 {
        self.load(order)
    }

    fn store(&self, value: u32, order: Ordering) {
        self.store(value, order);
    }

    fn swap(&self, value: u32, order: Ordering) -> u32 {
        self.swap(value, order)
    }

    fn increment(&self, order: Ordering) {
        self.fetch_add(1, order);
    }

    fn fence() {
        std::sync::atomic::fence(Ordering::SeqCst);
    }

    fn sleep(&self, seen: u32, timeout: Option<Duration>) {
        use rustix::thread::futex;
        let timeout = timeout.map(crate::host_time::timespec);
        // In any case the caller looks again.
        let _ = futex::wait(self, futex::Flags::empty(), seen, timeout.as_ref());
    }

    fn wake(&self) {
        use rustix::thread::futex;
        let _ = futex::wake(self, futex::Flags::empty(), i32::MAX as u32);
    }
}

/// Stores `count` in `sequence`, and wakes those of its `waiters` whose count is reached.
pub(super) fn advance<'w, W: Word + 'w>(sequence: &W, count: u32, waiters: impl IntoIterator<Item = &'w W>) {
    // A reader that finds the count finds everything written before it.
    sequence.store(count, Release);
    W::fence();
    for waiter in waiters {
        if waiter.load(Relaxed) <= count {
            rouse(waiter);
        }
    }
}

/// Wakes the reader of `waiter`, unless another writer has noted that it does.
fn rouse<W: Word>(waiter: &W) {
    if waiter.swap(AWAKE, Relaxed) != AWAKE {
        waiter.wake();
    }
}

/// Sleeps on `waiter` until `sequence` has reached `count`, if it has not yet and the wait is not over; it may return
/// early, so the caller looks again.
///
/// Both changes of the waiter are swaps: beside a system call they cost nothing, and the model can follow them over
/// several counts. With plain stores the model lets a writer see its own older swap.
pub(super) fn sleep<W: Word>(sequence: &W, count: u32, waiter: &W, is_over: impl Fn() -> bool) {
    waiter.swap(count, Relaxed);
    W::fence();
    if sequence.load(Acquire) < count && !is_over() {
        waiter.sleep(count, None);
    }
    // No order depends on this: a writer that misses it wakes a reader that is awake.
    waiter.swap(AWAKE, Relaxed);
}

/// Wakes every sleeper, so that it sees what was stored before. A process that died may have noted a wake-up without
/// carrying it out, so the values of the waiters do not count.
pub(super) fn wake_everybody<'w, W: Word + 'w>(waiters: impl IntoIterator<Item = &'w W>) {
    W::fence();
    for waiter in waiters {
        waiter.store(AWAKE, Relaxed);
        waiter.wake();
    }
}

/// Counts an event, and wakes the processes that sleep until there is one.
pub(super) fn notify<W: Word>(events: &W) {
    events.increment(Release);
    events.wake();
}

/// Waits in the hold at `tick`, which it states in `held_at`, until `is_lifted`; each of `changes` may lift it.
pub(super) fn hold<W: Word>(
    held_at: &W,
    tick: u32,
    changes: &W,
    is_lifted: impl Fn() -> bool,
    tell: impl Fn(),
) {
    loop {
        held_at.store(tick, Release);
        tell();
        loop {
            let seen = changes.load(Acquire);
            if is_lifted() {
                break;
            }
            changes.sleep(seen, Some(HOLD_NAP));
        }
        held_at.store(NEVER, Relaxed);
        W::fence();
        // A user who requested another hold before that store may have taken the lifted one for it: so it is kept.
        if is_lifted() {
            return;
        }
    }
}

/// Requests a hold at `tick`, or lifts it. A user who then finds the clock in a hold that keeps `tick` has it.
pub(super) fn ask_for_hold<W: Word>(hold_tick: &W, tick: u32, changes: &W) {
    hold_tick.store(tick, Release);
    W::fence();
    notify(changes);
}
