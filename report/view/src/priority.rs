//! Priority of the threads that serve watchers.

/// Niceness of these threads.
const LOWEST: i32 = 19;

/// Gives this thread, and no other, the lowest priority: where cores are short, a run that is watched has them first.
pub fn step_back() {
    // A lower priority is never refused; without it, watching costs more.
    let _ = rustix::process::setpriority_process(None, LOWEST);
}
