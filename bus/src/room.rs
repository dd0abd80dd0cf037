//! Check that a run has the shared memory that it takes.

use crate::error::BusError;
use crate::lockstep::segment_bytes;
use crate::names::SHARED_MEMORY;
use crate::plan::Plan;
use crate::reserve::{free_bytes, require_free};
use crate::schema::Schema;
use crate::transport::{PORT_MARGIN_BYTES, samples_bytes};
use std::path::Path;

/// Free bytes below which a SIGBUS is attributed to a full /dev/shm.
const FULL_BYTES: u64 = 256 << 10;

/// The shared memory that the run of `plan` takes at least, and its largest file. It does not include the states that
/// nodes hand over, and messages that are not `known`: their makers find the room or report an error.
fn bytes_at_least(plan: &Plan, known: &[&Schema]) -> (u64, u64) {
    let topics = plan.topics.iter().enumerate().map(|(index, topic)| {
        let schema = known.iter().find(|schema| schema.type_name == topic.type_name);
        schema.map_or(0, |schema| samples_bytes(schema.size, plan.capacity(index)))
    });
    let files = || topics.clone().chain([segment_bytes(plan) as u64]);
    (files().sum(), files().max().unwrap_or(0))
}

/// Requires that /dev/shm has the room that the run of `plan` takes, and that files may be as large as it needs them;
/// `known` are the messages that this program knows.
///
/// # Errors
/// The bytes needed and the bytes free, or the limit.
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

/// Text about room for the message about a process that `signal` killed; empty for most signals.
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
