//! Place of an instance of a run: a process of its own, or a thread beside others.
//!
//! Signals, memory, cores and priorities of a process belong to its owner. An instance on a thread leaves them as they are.

use crate::error::BusError;
use crate::host_time::{clock_ns, process_cpu_ns};
use rustix::time::ClockId;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Place of an instance of a run.
#[derive(Clone, Debug, Default)]
pub enum Place {
    /// In a process of its own.
    #[default]
    Process,
    /// On a thread of the launcher's process. The flag is true if the instance is to end: its waits then return as those
    /// of an aborted run do. The thread that sets the flag wakes the sleepers
    /// ([`crate::lockstep::SupervisorView::set_epoch`] does).
    Thread(Arc<AtomicBool>),
}

impl Place {
    /// True if the process is the instance's own.
    pub(crate) fn is_process(&self) -> bool {
        matches!(self, Self::Process)
    }

    /// True if this instance alone is to end.
    pub(crate) fn is_cancelled(&self) -> bool {
        match self {
            Self::Process => false,
            Self::Thread(is_cancelled) => is_cancelled.load(Ordering::SeqCst),
        }
    }

    /// True if the process of this instance was asked to end. A signal to a process of several is for its owner.
    pub(crate) fn is_terminated(&self) -> bool {
        self.is_process() && crate::process::is_terminated()
    }

    /// Processor time of the instance so far, in nanoseconds.
    pub(crate) fn cpu_ns(&self) -> u64 {
        match self {
            Self::Process => process_cpu_ns(),
            Self::Thread(_) => clock_ns(ClockId::ThreadCPUTime),
        }
    }

    /// Keeps the instance's process on core `cpu`, if it has its own.
    pub(crate) fn stay_on(&self, cpu: Option<usize>) {
        if self.is_process() {
            crate::process::stay_on(cpu);
        }
    }

    /// Makes the instance's process wait its turn, if it has its own: [`crate::process::wait_for_turn`].
    pub(crate) fn wait_for_turn(&self) {
        if self.is_process() {
            crate::process::wait_for_turn();
        }
    }

    /// Locks the memory of the instance's process, if it has its own.
    pub(crate) fn lock_memory(&self) -> Result<(), BusError> {
        if self.is_process() { crate::process::lock_memory() } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::Place;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn an_instance_on_a_thread_ends_by_its_own_flag_and_counts_its_own_time() {
        let flag = Arc::new(AtomicBool::new(false));
        let thread = Place::Thread(flag.clone());
        assert!(!thread.is_cancelled() && !thread.is_process());
        flag.store(true, Ordering::SeqCst);
        assert!(thread.is_cancelled() && !Place::Process.is_cancelled());
        let of_thread = thread.cpu_ns();
        assert!(of_thread <= Place::Process.cpu_ns(), "a thread's time is part of its process's");
    }
}
