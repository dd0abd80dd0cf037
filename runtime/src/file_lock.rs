//! Locks on files: the kernel gives a lock back when the process that holds it dies, however it dies.

use rustix::io::Errno;
use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};

/// Advice for a file system on which two runs could not be kept apart.
const NO_LOCKS: &str = "the file system cannot lock files (flock), as some network file systems cannot; write to a local \
                        folder and move the file afterwards";

/// Locks `file` for this process alone; false where another process holds a lock on it.
///
/// # Errors
/// If the file system has no locks.
pub fn try_exclusive(file: &File) -> io::Result<bool> {
    lock(|| file.try_lock())
}

/// Locks `file` against processes that want it alone; false if one of them has it.
///
/// # Errors
/// If the file system has no locks.
pub fn try_shared(file: &File) -> io::Result<bool> {
    lock(|| file.try_lock_shared())
}

/// Locks `file` for this process alone, and waits for others to give it back.
///
/// # Errors
/// If the file system has no locks.
pub fn exclusive(file: &File) -> io::Result<()> {
    lock(|| file.lock().map_err(TryLockError::Error)).map(|_| ())
}

/// Attempts it again where a signal interrupts it; false where another process holds a lock.
fn lock(attempt: impl Fn() -> Result<(), TryLockError>) -> io::Result<bool> {
    loop {
        match attempt() {
            Ok(()) => return Ok(true),
            Err(TryLockError::WouldBlock) => return Ok(false),
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Interrupted => {}
            Err(TryLockError::Error(error)) => {
                return Err(match Errno::from_io_error(&error) {
                    Some(Errno::NOSYS | Errno::NOLCK | Errno::OPNOTSUPP) => io::Error::other(NO_LOCKS),
                    _ => error,
                });
            }
        }
    }
}
