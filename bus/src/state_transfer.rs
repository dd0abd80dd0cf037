//! The state that a node hands over: stated after every tick, in shared memory that outlives the process.
//!
//! A ring holds the state at the start of each of the last ticks, as many as a slot can be ahead of its backup. It is
//! stated before the tick's outputs are sent: after any sample, the state that follows it can be read, even if the
//! process died right after.

use crate::component::Transfer;
use crate::error::BusError;
use crate::json_file;
use crate::names::shm_path;
use crate::plan::Plan;
use crate::shared_file;
use memmap2::MmapRaw;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Layout of a state, as the process that publishes it announces it. A successor loads the state if its own is laid out
/// the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StateLayout {
    type_name: String,
    pub(crate) size: usize,
    /// Hash of the fields of a message, or the configuration of another state.
    layout_hash: u64,
}

impl StateLayout {
    /// Layout of a state of `size` bytes with this `configuration`; `None` if it is not transferred.
    pub(crate) fn of(transfer: Transfer, size: usize, configuration: u64) -> Option<Self> {
        let (type_name, layout_hash) = match transfer {
            Transfer::Message(schema) => (schema.type_name, schema.layout_hash()),
            Transfer::Bytes(type_name) => (type_name, configuration),
            Transfer::Nothing | Transfer::File | Transfer::External(_) | Transfer::Growing(_) => return None,
        };
        Some(Self { type_name: type_name.to_owned(), size, layout_hash })
    }

    /// Layout of a state that a checkpoint holds; `None` if it holds none.
    pub(crate) fn saved(transfer: Transfer, size: usize, configuration: u64) -> Option<Self> {
        match transfer {
            Transfer::Growing(name) => {
                Some(Self { type_name: name.to_owned(), size, layout_hash: configuration })
            }
            _ => Self::of(transfer, size, configuration),
        }
    }

    /// True if a component whose state is laid out as `expected`, and transferred by `transfer`, goes on from a state of this
    /// layout.
    pub(crate) fn fits(&self, expected: &Self, transfer: Transfer) -> bool {
        let grows = matches!(transfer, Transfer::Growing(_));
        self.type_name == expected.type_name
            && self.layout_hash == expected.layout_hash
            && (grows || self.size == expected.size)
    }

    /// True if the type of the state is that of `other`.
    pub(crate) fn is_of_type_of(&self, other: &Self) -> bool {
        self.type_name == other.type_name
    }

    /// Number of 64-bit words of the state.
    pub(crate) fn words(&self) -> usize {
        self.size.div_ceil(8)
    }
}

impl std::fmt::Display for StateLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { type_name, size, layout_hash } = self;
        write!(f, "a state of type {type_name} ({size} bytes, layout {layout_hash:016x})")
    }
}

/// Bytes in front of each state: its tick plus one, so that memory that was never written holds none.
const TICK_BYTES: usize = 8;

/// The ring of one process.
#[derive(Debug)]
pub(crate) struct StateRing {
    map: MmapRaw,
    entries: usize,
    state_words: usize,
}

impl StateRing {
    /// Creates the ring of generation `generation` of node `node`, and announces it. The state is laid out as
    /// `layout`, with `more_words` of the bus behind it.
    pub(crate) fn create(
        run_dir: &Path,
        plan: &Plan,
        node: usize,
        generation: u32,
        layout: &StateLayout,
        more_words: usize,
    ) -> Result<Self, BusError> {
        let state_words = layout.words() + more_words;
        let map = shared_file::create(&ring_path(plan, node, generation), ring_bytes(plan, state_words))?;
        json_file::store(&announcement_path(run_dir, node, generation), layout)?;
        Ok(Self { map, entries: entries(plan), state_words })
    }

    /// Opens the ring of a running process; `None` if it publishes no state, or one of another layout.
    pub(crate) fn open(
        run_dir: &Path,
        plan: &Plan,
        node: usize,
        generation: u32,
        layout: &StateLayout,
        more_words: usize,
    ) -> Result<Option<Self>, BusError> {
        let announced = announcement_path(run_dir, node, generation);
        if !announced.exists() {
            return Ok(None);
        }
        let found: StateLayout = json_file::load(&announced, "the layout of a state")?;
        if found != *layout {
            return Ok(None);
        }
        let path = ring_path(plan, node, generation);
        let state_words = layout.words() + more_words;
        let map = shared_file::open(&path, ring_bytes(plan, state_words), "the states of a process")?;
        Ok(Some(Self { map, entries: entries(plan), state_words }))
    }

    /// Publishes `state` as that at the start of `tick`.
    pub(crate) fn store(&self, tick: u32, state: &[u64]) {
        let (stamp, words) = self.entry(tick);
        stamp.store(u64::from(tick) + 1, Relaxed);
        for (word, value) in words.iter().zip(state) {
            word.store(*value, Relaxed);
        }
    }

    /// Reads the state at the start of `tick`; false if the ring does not hold it.
    pub(crate) fn load(&self, tick: u32, state: &mut [u64]) -> bool {
        let (stamp, words) = self.entry(tick);
        if stamp.load(Relaxed) != u64::from(tick) + 1 {
            return false;
        }
        for (word, value) in words.iter().zip(state) {
            *value = word.load(Relaxed);
        }
        true
    }

    /// The stamp and the state of the entry of `tick`.
    fn entry(&self, tick: u32) -> (&AtomicU64, &[AtomicU64]) {
        let length = 1 + self.state_words;
        let first = (tick as usize % self.entries) * length;
        assert!((first + length) * 8 <= self.map.len(), "the entry of tick {tick} is outside the state ring");
        // SAFETY: the mapping lives as long as `self`, the words are inside it (asserted) and start at a multiple of
        // 8 from a page-aligned start; every process accesses these bytes as atomics only. The order against the
        // other process comes from the slot's state word.
        let words = unsafe {
            std::slice::from_raw_parts(self.map.as_mut_ptr().add(first * 8).cast::<AtomicU64>(), length)
        };
        (&words[0], &words[1..])
    }
}

/// A slot is at most a window ahead of its backup; one state more belongs to the tick that it computes.
fn entries(plan: &Plan) -> usize {
    let longest = plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
    (plan.window_ticks + longest + 2) as usize
}

fn ring_bytes(plan: &Plan, state_words: usize) -> usize {
    entries(plan) * (TICK_BYTES + state_words * 8)
}

fn ring_path(plan: &Plan, node: usize, generation: u32) -> PathBuf {
    shm_path(&plan.run_id, &format!("state_{node}.{generation}"))
}

fn announcement_path(run_dir: &Path, node: usize, generation: u32) -> PathBuf {
    run_dir.join(format!("state-{node}.{generation}.json"))
}

/// Removes the state of generation `generation` of node `node`, once no process reads it any more.
pub fn remove(run_dir: &Path, plan: &Plan, node: usize, generation: u32) {
    // A process without a state has neither.
    let _ = std::fs::remove_file(ring_path(plan, node, generation));
    let _ = std::fs::remove_file(announcement_path(run_dir, node, generation));
}

#[cfg(test)]
mod tests {
    use super::StateLayout;
    use crate::component::{State, Transfer};
    use crate::messages::{MotorCommand, SetPoint};

    #[test]
    fn states_are_laid_out_alike_if_type_size_and_configuration_are_the_same() {
        let of = |name, size| StateLayout::of(Transfer::Bytes(name), size, 7);
        assert_eq!(of("plant", 96), of("plant", 96));
        assert_ne!(of("plant", 96), of("plant", 104), "another configuration");
        assert_ne!(of("plant", 96), of("stand", 96), "another type");
        assert_ne!(of("plant", 96), StateLayout::of(Transfer::Bytes("plant"), 96, 8), "other effects");
        let message = |transfer| StateLayout::of(transfer, 40, 0);
        assert_ne!(message(SetPoint::TRANSFER), message(MotorCommand::TRANSFER));
        let unsaved = [Transfer::Nothing, Transfer::File, Transfer::External("a firmware")];
        assert_eq!(unsaved.map(message), [None, None, None]);
    }
}
