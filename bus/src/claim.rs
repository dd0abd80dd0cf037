//! A process's place in a run: taken once, and free again when the process dies.

use crate::error::BusError;
use crate::names::process_name;
use crate::user_file::FLAGS;
use std::fs::{File, TryLockError};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// A process's place in a run, taken for as long as this value lives: the kernel frees it when the process dies.
#[derive(Debug)]
pub(crate) struct Claim {
    _lock: File,
}

/// Takes the place of process `name` in the run whose directory is `run_dir`.
///
/// # Errors
/// If another process has it: two clocks, or two processes of one node, would mix their ticks.
pub(crate) fn claim(run_dir: &Path, name: &str) -> Result<Claim, BusError> {
    let path = claim_path(run_dir, name);
    let fail = |source| BusError::File { action: "open", path: path.clone(), source };
    let mut options = File::options();
    options.create(true).truncate(false).write(true).mode(0o600).custom_flags(FLAGS);
    let lock = options.open(&path).map_err(fail)?;
    match lock.try_lock() {
        Ok(()) => Ok(Claim { _lock: lock }),
        Err(TryLockError::WouldBlock) => Err(BusError::Claimed { name: name.to_owned() }),
        Err(TryLockError::Error(source)) => Err(BusError::File { action: "lock", path, source }),
    }
}

fn claim_path(run_dir: &Path, name: &str) -> PathBuf {
    run_dir.join(format!("{}.claim", name.replace('/', ".")))
}

/// True if the process has connected to the run: generation `generation` of node `node`.
#[must_use]
pub fn is_made(run_dir: &Path, node: &str, generation: u32) -> bool {
    claim_path(run_dir, &process_name(node, generation)).exists()
}

/// Removes the claim of a process that has left: generation `generation` of node `node`.
pub fn remove(run_dir: &Path, node: &str, generation: u32) {
    // A process that never joined has none.
    let _ = std::fs::remove_file(claim_path(run_dir, &process_name(node, generation)));
}
