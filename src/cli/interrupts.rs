//! Ctrl-C and SIGTERM stop the runs of this process.

use anyhow::{Context, Result};
use runtime::event::StopToken;
use std::process::exit;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a process that SIGINT ends: 128 and the number of the signal.
const ENDED: i32 = 130;

/// True while a second request ends this process at once.
static IS_WITHOUT_RUN: AtomicBool = AtomicBool::new(false);

/// A time in which this process has no run that would have to end in order: a second Ctrl-C ends the process at once.
pub struct WithoutRun(());

impl WithoutRun {
    /// The time from now until this is dropped.
    pub fn begin() -> Self {
        IS_WITHOUT_RUN.store(true, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for WithoutRun {
    fn drop(&mut self) {
        IS_WITHOUT_RUN.store(false, Ordering::SeqCst);
    }
}

/// A token that Ctrl-C and SIGTERM use from now on, instead of ending this process. All runs of the process share it:
/// one that is stopped lets no other begin.
///
/// # Errors
/// If the signals cannot be handled.
pub fn stop_token() -> Result<StopToken> {
    static TOKEN: OnceLock<StopToken> = OnceLock::new();
    if let Some(token) = TOKEN.get() {
        return Ok(token.clone());
    }
    let token = StopToken::new();
    let seen = token.clone();
    let stop = move || {
        seen.stop();
        if seen.count() > 1 && IS_WITHOUT_RUN.load(Ordering::SeqCst) {
            exit(ENDED);
        }
    };
    ctrlc::set_handler(stop).context("cannot handle Ctrl-C")?;
    // A run that a node of another run starts has them blocked.
    bus::process::hear_stop_signals();
    Ok(TOKEN.get_or_init(|| token).clone())
}
