//! Events that a launcher reports while a run flies, and the request to end the run.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// An event of a run, for its listeners.
///
/// ```
/// use runtime::event::{Progress, RunEvent};
/// let mut farthest_s = 0.0;
/// let mut listener = |event: RunEvent<'_>| match event {
///     RunEvent::Note(text) => eprintln!("{text}"),
///     RunEvent::Progress(now) => farthest_s = f64::from(now.ticks) * now.tick_s,
/// };
/// listener(RunEvent::Progress(Progress { ticks: 500, duration_ticks: 1000, tick_s: 1e-3, host_s: 0.1 }));
/// assert_eq!(farthest_s, 0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunEvent<'a> {
    /// A message that the user should see while the run goes on.
    Note(&'a str),
    /// Progress of the run; every few milliseconds.
    Progress(Progress),
}

/// Progress of a run.
///
/// ```
/// # use runtime::event::Progress;
/// let now = Progress { ticks: 250, duration_ticks: 1000, tick_s: 1e-3, host_s: 0.05 };
/// let faster_than_real_time = f64::from(now.ticks) * now.tick_s / now.host_s;
/// assert!((faster_than_real_time - 5.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Ticks that every node has completed.
    pub ticks: u32,
    /// Ticks of the whole run.
    pub duration_ticks: u32,
    /// Simulated time of a tick, in seconds.
    pub tick_s: f64,
    /// Host time since the first grant, in seconds; 0 before that.
    pub host_s: f64,
}

/// Asks a run to stop, from any thread: the first time at the next tick boundary, the second time at once.
///
/// A token may be given to several runs, which all end then; one that was used lets no other begin.
///
/// ```
/// let token = runtime::event::StopToken::new();
/// let elsewhere = token.clone();
/// std::thread::spawn(move || elsewhere.stop()).join().unwrap();
/// assert_eq!(token.count(), 1);
/// ```
#[derive(Clone, Debug, Default)]
pub struct StopToken(Arc<AtomicUsize>);

impl StopToken {
    /// A token without a request.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Requests a stop at the next tick boundary; if that was done before, an end at once.
    pub fn stop(&self) {
        self.0.fetch_add(1, Ordering::SeqCst);
    }

    /// Number of times that a stop was requested.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.load(Ordering::SeqCst)
    }
}
