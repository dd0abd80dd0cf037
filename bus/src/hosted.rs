//! Nodes and the clock on threads of the launcher's own process.
//!
//! Such a thread gets from its launcher the values that a process reads from its environment. It does not change its
//! process: signals, memory, cores and priorities belong to the owner of the process.

use crate::join::Join;
use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Part of a thread in a run.
#[derive(Clone, Debug)]
pub struct Hosted {
    /// Run and node that it joins; the clock has a name that no node has.
    pub join: Join,
    /// True if the instance is to end: its waits then return as those of an aborted run do. The thread that sets it
    /// wakes the sleepers ([`crate::lockstep::SupervisorView::set_epoch`] does).
    pub is_cancelled: Arc<AtomicBool>,
}

thread_local! {
    static HOSTED: RefCell<Option<Hosted>> = const { RefCell::new(None) };
}

impl Hosted {
    /// Runs `node` on this thread as this instance: [`Join::from_environment`] and [`crate::clock::run`] join its run.
    pub fn run<R>(self, node: impl FnOnce() -> R) -> R {
        /// Guard that clears the instance at the end, also if the node panics.
        struct Forget;
        impl Drop for Forget {
            fn drop(&mut self) {
                HOSTED.set(None);
            }
        }
        HOSTED.set(Some(self));
        let _forget = Forget;
        node()
    }
}

/// True if this thread is an instance of a run beside others of its process.
pub(crate) fn is_hosted() -> bool {
    HOSTED.with_borrow(Option::is_some)
}

/// The part that this thread takes.
pub(crate) fn join() -> Option<Join> {
    HOSTED.with_borrow(|hosted| hosted.as_ref().map(|hosted| hosted.join.clone()))
}

/// True if this thread is to end.
pub(crate) fn is_cancelled() -> bool {
    HOSTED.with_borrow(|hosted| {
        hosted.as_ref().is_some_and(|hosted| hosted.is_cancelled.load(Ordering::SeqCst))
    })
}
