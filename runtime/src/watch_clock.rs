//! The time that watchdogs count: host time in which the launcher itself was running.
//!
//! When everything is frozen for a while (a paused container, a closed lid, a debugger), nobody could have come on, and
//! nobody is to blame. The launcher cannot see that it was frozen; it sees that it looked late.
#![allow(clippy::disallowed_methods, reason = "the launcher watches host time; it simulates nothing")]

use std::cell::Cell;
use std::time::{Duration, Instant};

/// What a pause between two looks counts at most. The launcher looks every few milliseconds; on a busy host it may be
/// kept waiting for some tenths of a second, and so may everybody else.
const PAUSE_COUNTED_MAX: Duration = Duration::from_millis(100);

/// A clock that goes on only while somebody looks at it often.
#[derive(Debug)]
pub struct WatchClock {
    counted: Cell<Duration>,
    last_look: Cell<Instant>,
}

impl WatchClock {
    /// A clock at zero.
    pub fn new() -> Self {
        Self { counted: Cell::new(Duration::ZERO), last_look: Cell::new(Instant::now()) }
    }

    /// Counts the time since the last look, a long pause as a short one.
    pub fn look(&self) {
        self.look_at(Instant::now());
    }

    fn look_at(&self, now: Instant) {
        let pause = now.saturating_duration_since(self.last_look.replace(now));
        self.counted.set(self.counted.get() + pause.min(PAUSE_COUNTED_MAX));
    }

    /// The time counted up to the last look.
    pub fn now(&self) -> Duration {
        self.counted.get()
    }

    /// The time counted since `then`.
    pub fn since(&self, then: Duration) -> Duration {
        self.now().saturating_sub(then)
    }
}

#[cfg(test)]
mod tests {
    use super::{PAUSE_COUNTED_MAX, WatchClock};
    use std::time::{Duration, Instant};

    #[test]
    fn a_pause_of_the_launcher_counts_for_little_and_looks_in_time_count_whole() {
        let clock = WatchClock::new();
        let start = Instant::now();
        clock.look_at(start);
        let before = clock.now();
        (1..=10).for_each(|n| clock.look_at(start + n * Duration::from_millis(7)));
        assert_eq!(clock.since(before), Duration::from_millis(70));
        clock.look_at(start + Duration::from_secs(3600));
        assert_eq!(clock.since(before), Duration::from_millis(70) + PAUSE_COUNTED_MAX);
        // A host clock that went back counts as none.
        clock.look_at(start);
        assert_eq!(clock.since(before), Duration::from_millis(70) + PAUSE_COUNTED_MAX);
    }
}
