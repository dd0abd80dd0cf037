//! Ctrl-C and SIGTERM stop the runs of this process.

use anyhow::{Context, Result};
use runtime::event::StopToken;
use std::sync::OnceLock;

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
    ctrlc::set_handler(move || seen.stop()).context("cannot handle Ctrl-C")?;
    // A run that a node of another run starts has them blocked.
    bus::process::hear_stop_signals();
    Ok(TOKEN.get_or_init(|| token).clone())
}
