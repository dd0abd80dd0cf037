//! The time that watchdogs count: host time in which the launcher itself was running.
//!
//! While everything is frozen (a paused container, a closed lid, a debugger), no process can advance, and none is to
//! blame. The launcher cannot see that it was frozen; it sees that it looked late.

use std::time::Duration;

/// Longest time that a pause between two looks counts. The launcher looks every few milliseconds. On a busy host it
/// may be delayed by some tenths of a second, and so may every other process.
const PAUSE_COUNTED_MAX: Duration = Duration::from_millis(100);

/// A clock that goes on only while it is looked at often.
#[derive(Clone, Copy, Debug)]
pub struct WatchClock {
    counted: Duration,
    last_look: Duration,
}

impl WatchClock {
    /// A clock at zero, which is first looked at when the host's monotonic clock shows `host`.
    pub fn new(host: Duration) -> Self {
        Self { counted: Duration::ZERO, last_look: host }
    }

    /// Counts the time since the last look, a long pause as a short one.
    pub fn look(&mut self, host: Duration) {
        let pause = host.saturating_sub(std::mem::replace(&mut self.last_look, host));
        self.counted += pause.min(PAUSE_COUNTED_MAX);
    }

    /// The time counted up to the last look.
    pub fn now(&self) -> Duration {
        self.counted
    }

    /// The time counted since `then`.
    pub fn since(&self, then: Duration) -> Duration {
        self.now().saturating_sub(then)
    }
}

#[cfg(test)]
mod tests {
    use super::{PAUSE_COUNTED_MAX, WatchClock};
    use std::time::Duration;

    #[test]
    fn a_pause_of_the_launcher_counts_for_little_and_looks_in_time_count_whole() {
        let start = Duration::from_secs(5);
        let mut clock = WatchClock::new(start);
        (1..=10).for_each(|n| clock.look(start + n * Duration::from_millis(7)));
        assert_eq!(clock.now(), Duration::from_millis(70));
        let before = clock.now();
        clock.look(start + Duration::from_secs(3600));
        assert_eq!(clock.since(before), PAUSE_COUNTED_MAX);
        // A host clock that went back counts as none.
        clock.look(start);
        assert_eq!(clock.since(before), PAUSE_COUNTED_MAX);
    }
}
