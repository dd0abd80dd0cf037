//! The state that a node hands over: stated after every tick, in shared memory that outlives the process.
//!
//! A ring holds the state at the start of each of the last ticks, as many as a slot can be ahead of its
//! backup. It is stated before the tick's outputs are sent: whatever was sent, the state that follows it
//! can be read, also when the process died right after.

use crate::announcement::Announcement;
use crate::error::BusError;
use crate::names::shm_path;
use crate::plan::Plan;
use crate::schema::Schema;
use crate::shared_file;
use memmap2::MmapRaw;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

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
    /// Creates the ring of generation `generation` of node `node`, whose state is `schema` with `more_words` of the bus
    /// behind it, and announces it.
    pub(crate) fn create(
        run_dir: &Path,
        plan: &Plan,
        node: usize,
        generation: u32,
        schema: &Schema,
        more_words: usize,
    ) -> Result<Self, BusError> {
        let state_words = schema.size.div_ceil(8) + more_words;
        let map = shared_file::create(&ring_path(plan, node, generation), ring_bytes(plan, state_words))?;
        Announcement::of(schema).store(&announcement_path(run_dir, node, generation))?;
        Ok(Self { map, entries: entries(plan), state_words })
    }

    /// Opens the ring of a process that flies; `None` where it states no state, or one of another type.
    pub(crate) fn open(
        run_dir: &Path,
        plan: &Plan,
        node: usize,
        generation: u32,
        schema: &Schema,
        more_words: usize,
    ) -> Result<Option<Self>, BusError> {
        let announced = announcement_path(run_dir, node, generation);
        if !announced.exists() || Announcement::load(&announced)?.layout_hash != schema.layout_hash() {
            return Ok(None);
        }
        let path = ring_path(plan, node, generation);
        let state_words = schema.size.div_ceil(8) + more_words;
        let map = shared_file::open(&path, ring_bytes(plan, state_words), "the states of a process")?;
        Ok(Some(Self { map, entries: entries(plan), state_words }))
    }

    /// Publishes `state` as that at the start of `tick`.
    pub(crate) fn store(&self, tick: u32, state: &[u8]) {
        let (stamp, words) = self.entry(tick);
        stamp.store(u64::from(tick) + 1, Relaxed);
        for (word, bytes) in words.iter().zip(state.chunks(8)) {
            word.store(word_of(bytes), Relaxed);
        }
    }

    /// Reads the state at the start of `tick`; false if the ring does not hold it.
    pub(crate) fn load(&self, tick: u32, state: &mut [u8]) -> bool {
        let (stamp, words) = self.entry(tick);
        if stamp.load(Relaxed) != u64::from(tick) + 1 {
            return false;
        }
        for (word, bytes) in words.iter().zip(state.chunks_mut(8)) {
            bytes.copy_from_slice(&word.load(Relaxed).to_le_bytes()[..bytes.len()]);
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

/// Up to eight bytes as a word, zeros behind them.
fn word_of(bytes: &[u8]) -> u64 {
    // The fast way for all words but the last.
    if let Ok(whole) = bytes.try_into() {
        return u64::from_le_bytes(whole);
    }
    let mut word = [0; 8];
    word[..bytes.len()].copy_from_slice(bytes);
    u64::from_le_bytes(word)
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

/// Removes what generation `generation` of node `node` stated, once nobody reads it any more.
pub fn remove(run_dir: &Path, plan: &Plan, node: usize, generation: u32) {
    // A process without a state has neither.
    let _ = std::fs::remove_file(ring_path(plan, node, generation));
    let _ = std::fs::remove_file(announcement_path(run_dir, node, generation));
}
