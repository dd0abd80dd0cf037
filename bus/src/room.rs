//! Room for files that are mapped: it is reserved before anybody writes into it.
//!
//! A page that cannot be had kills the process that touches it (SIGBUS), with no word. So what the bus maps itself
//! is reserved when it is made, and what iceoryx2 made, right after: in flight every page is there.

use crate::control::{control_bytes, shm_prefix};
use crate::error::BusError;
use crate::message::sample_words;
use crate::plan::Plan;
use crate::process::user_id;
use crate::schema::Schema;
use crate::transport::{BORROWED_SAMPLES, Capacity, SampleHeader};
use rustix::io::Errno;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Where shared memory lies.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Asked for beside the samples: what iceoryx2 touches while it makes the files of a port would kill the process that
/// lacks it. Measured with manifests/hover.toml and manifests/swarm.toml: at most 4 KiB for each connection and each
/// service, 92 KiB and 304 KiB for all of a run; so there is room for what several processes make at a time.
const PORT_MARGIN_BYTES: u64 = 256 << 10;

/// Below this much a SIGBUS is put down to a full /dev/shm.
const FULL_BYTES: u64 = 256 << 10;

/// The bytes that are free below `folder`; `u64::MAX` where nothing limits them.
#[must_use]
pub fn free_bytes(folder: &Path) -> u64 {
    // A tmpfs without a limit says that it has no blocks at all.
    rustix::fs::statvfs(folder)
        .ok()
        .filter(|found| found.f_blocks > 0)
        .map_or(u64::MAX, |found| found.f_bavail.saturating_mul(found.f_frsize))
}

/// Gives the new `file` at `path` its size and its space.
pub(crate) fn reserve(file: &File, path: &Path, bytes: u64) -> Result<(), BusError> {
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
/// `what` is what they are for.
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
            // One that is empty is just being made: who makes it reserves it.
            Ok(()) | Err(Errno::OPNOTSUPP) => {}
            Err(Errno::INVAL) if length == 0 => {}
            Err(Errno::NOSPC) => return Err(no_room(what.to_owned(), missing_bytes(&files), folder)),
            Err(error) => return Err(cannot_reserve(path, error.into())),
        }
    }
    Ok(())
}

/// To write only: while it makes a file, iceoryx2 lets nobody read it.
fn open_to_reserve(path: &Path) -> std::io::Result<File> {
    let owner = path.symlink_metadata()?.uid();
    if owner != user_id() {
        return Err(std::io::Error::other(format!(
            "it belongs to user {owner}, who has put it in this run's way"
        )));
    }
    OpenOptions::new().write(true).custom_flags(crate::user_file::FLAGS).open(path)
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

/// Requires that iceoryx2 finds the room for a port of a topic whose messages have `size` bytes.
pub(crate) fn require_for_port(what: &str, size: usize, capacity: Capacity) -> Result<(), BusError> {
    let needed = samples_bytes(size, capacity) + PORT_MARGIN_BYTES;
    require_free(what, needed)
}

/// Requires that iceoryx2 finds the room for what a process makes before its ports.
pub(crate) fn require_for_process(what: &str) -> Result<(), BusError> {
    require_free(what, PORT_MARGIN_BYTES)
}

fn require_free(what: &str, needed: u64) -> Result<(), BusError> {
    let folder = Path::new(SHARED_MEMORY);
    if free_bytes(folder) >= needed { Ok(()) } else { Err(no_room(what.to_owned(), needed, folder)) }
}

/// The samples that a publisher of the topic keeps: those in every queue, those that are read, the history, and the
/// one in the making.
pub(crate) fn samples_bytes(size: usize, capacity: Capacity) -> u64 {
    let Capacity { queued_samples, history_samples, subscribers, .. } = capacity;
    let samples = subscribers * (queued_samples + BORROWED_SAMPLES) + history_samples + 1;
    (samples * (8 * sample_words(size) + size_of::<SampleHeader>())) as u64
}

/// The shared memory that the run of `plan` takes at least, and its largest file. Not in it: the states that nodes
/// hand over, and messages that are not `known`; who makes those finds the room or says so.
fn bytes_at_least(plan: &Plan, known: &[&Schema]) -> (u64, u64) {
    let topics = plan.topics.iter().enumerate().map(|(index, topic)| {
        let schema = known.iter().find(|schema| schema.type_name == topic.type_name);
        schema.map_or(0, |schema| samples_bytes(schema.size, plan.capacity(index)))
    });
    let files = || topics.clone().chain([control_bytes(plan) as u64]);
    (files().sum(), files().max().unwrap_or(0))
}

/// Requires that /dev/shm has the room that the run of `plan` takes, and that files may be as large as it needs them;
/// `known` are the messages that this program knows.
///
/// # Errors
/// How much was needed, and how much there is.
pub fn require(plan: &Plan, known: &[&Schema]) -> Result<(), BusError> {
    let (total, largest) = bytes_at_least(plan, known);
    let limit = rustix::process::getrlimit(rustix::process::Resource::Fsize).current.unwrap_or(u64::MAX);
    if largest > limit {
        return Err(BusError::FileLimit { needed: largest, limit });
    }
    let (topics, nodes) = (plan.topics.len(), plan.nodes.len());
    require_free(
        &format!("the samples of {topics} topics and the control segment of {nodes} nodes"),
        total + PORT_MARGIN_BYTES,
    )
}

/// What a signal says about room, for the words about a process that it killed; empty for most.
#[must_use]
pub fn signal_message(signal: i32) -> String {
    let free = free_bytes(Path::new(SHARED_MEMORY));
    match signal {
        libc::SIGBUS if free < FULL_BYTES => format!(
            ": shared memory was full, {SHARED_MEMORY} has {free} bytes free. Make room there, or give it more"
        ),
        libc::SIGBUS => {
            format!(": memory that it had mapped was not there; {SHARED_MEMORY} has {free} bytes free")
        }
        libc::SIGXFSZ => ": a file reached the limit on the size of files (`ulimit -f`)".to_owned(),
        _ => String::new(),
    }
}
