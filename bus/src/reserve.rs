//! Space for files that are mapped: it is reserved before any process writes into it.
//!
//! A page that cannot be had kills the process that touches it (SIGBUS), without a message. So the bus reserves its
//! own mappings when it makes them, and those of iceoryx2 right after: in flight every page is there.

use crate::error::BusError;
use crate::names::{SHARED_MEMORY, shm_prefix};
use crate::process::user_id;
use crate::user_file::FLAGS;
use rustix::io::Errno;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// The bytes that are free below `folder`; `u64::MAX` where nothing limits them.
pub(crate) fn free_bytes(folder: &Path) -> u64 {
    // A tmpfs without a limit says that it has no blocks at all.
    rustix::fs::statvfs(folder)
        .ok()
        .filter(|found| found.f_blocks > 0)
        .map_or(u64::MAX, |found| found.f_bavail.saturating_mul(found.f_frsize))
}

/// Creates the file `path` of `bytes` bytes, readable and writable by this user alone.
///
/// # Errors
/// If it exists already, or its space cannot be had.
pub(crate) fn create(path: &Path, bytes: u64) -> Result<File, BusError> {
    let mut options = OpenOptions::new();
    let file = options.read(true).write(true).create_new(true).mode(0o600).open(path);
    let file = file.map_err(|source| BusError::File { action: "create", path: path.to_owned(), source })?;
    reserve(&file, path, bytes)?;
    Ok(file)
}

/// Gives the new `file` at `path` its size and its space.
fn reserve(file: &File, path: &Path, bytes: u64) -> Result<(), BusError> {
    let folder = path.parent().unwrap_or(path);
    match allocate(file, bytes) {
        Err(Errno::OPNOTSUPP) => file.set_len(bytes).map_err(|source| cannot_reserve(path, source)),
        Err(Errno::NOSPC) => Err(no_room(format!("{}", path.display()), bytes, folder)),
        other => other.map_err(|error| cannot_reserve(path, error.into())),
    }
}

fn allocate(file: &File, bytes: u64) -> Result<(), Errno> {
    rustix::io::retry_on_intr(|| rustix::fs::fallocate(file, rustix::fs::FallocateFlags::empty(), 0, bytes))
}

fn cannot_reserve(path: &Path, source: std::io::Error) -> BusError {
    BusError::File { action: "reserve space for", path: path.to_owned(), source }
}

fn no_room(what: String, needed: u64, folder: &Path) -> BusError {
    BusError::NoRoom { what, needed, folder: folder.to_owned(), free: free_bytes(folder) }
}

/// Reserves the pages of the shared-memory files of run `run_id` that iceoryx2 has made and whose names `are_meant`;
/// `what` is their purpose.
pub(crate) fn reserve_files(
    run_id: &str,
    are_meant: impl Fn(&str) -> bool,
    what: &str,
) -> Result<(), BusError> {
    let (files, folder) = (files_of(run_id, are_meant), Path::new(SHARED_MEMORY));
    for path in &files {
        let file = match open_to_reserve(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => continue,
            other => other.map_err(|source| cannot_reserve(path, source))?,
        };
        let length = file.metadata().map_err(|source| cannot_reserve(path, source))?.len();
        match allocate(&file, length) {
            // An empty file is just being made: its maker reserves it.
            Ok(()) | Err(Errno::OPNOTSUPP) => {}
            Err(Errno::INVAL) if length == 0 => {}
            Err(Errno::NOSPC) => return Err(no_room(what.to_owned(), missing_bytes(&files), folder)),
            Err(error) => return Err(cannot_reserve(path, error.into())),
        }
    }
    Ok(())
}

/// To write only: while iceoryx2 makes a file, the file cannot be read.
fn open_to_reserve(path: &Path) -> std::io::Result<File> {
    let owner = path.symlink_metadata()?.uid();
    if owner != user_id() {
        return Err(std::io::Error::other(format!(
            "it belongs to user {owner}, who has put it in this run's way"
        )));
    }
    OpenOptions::new().write(true).custom_flags(FLAGS).open(path)
}

fn missing_bytes(files: &[PathBuf]) -> u64 {
    let found = files.iter().filter_map(|path| path.symlink_metadata().ok());
    found.map(|found| found.len().next_multiple_of(4096).saturating_sub(found.blocks() * 512)).sum()
}

/// The shared-memory files of run `run_id` whose names `are_meant`.
fn files_of(run_id: &str, are_meant: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let prefix = shm_prefix(run_id);
    let entries = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let meant = names.filter(|name| name.strip_prefix(&prefix).is_some_and(&are_meant));
    meant.map(|name| Path::new(SHARED_MEMORY).join(name)).collect()
}

/// Requires that `needed` bytes of shared memory are free for `what`.
pub(crate) fn require_free(what: &str, needed: u64) -> Result<(), BusError> {
    let folder = Path::new(SHARED_MEMORY);
    if free_bytes(folder) >= needed { Ok(()) } else { Err(no_room(what.to_owned(), needed, folder)) }
}
