//! What a run shows of itself while it flies, to whoever maps its control segment.
//!
//! Nothing of this is waited for and nothing of it reaches a message: a look never disturbs a run.

use crate::control::Control;
use crate::step_times::{BUCKETS, StepTimes, bucket_of};
use std::sync::atomic::Ordering::{Relaxed, SeqCst};

/// The index of the word of slot 0, and of every slot's slot, that holds a process number.
const PROCESS_ID: usize = 15;
/// The index of the word of a topic's slot that counts its gaps.
const GAPS: usize = 1;
const WORDS_OF_A_LINE: usize = 16;
/// Slots at the end of the segment that count a slot's step times.
pub(crate) const STEP_LINES: usize = BUCKETS / WORDS_OF_A_LINE;
const _: () = assert!(BUCKETS.is_multiple_of(WORDS_OF_A_LINE), "no two nodes count in one cache line");

impl Control {
    /// Counts a step of `slot` that took `ns`. Only `slot` itself does so: a load and a store suffice.
    pub(crate) fn count_step(&self, slot: usize, ns: u64) {
        let bucket = bucket_of(ns);
        let word = self.word(self.step_line(slot) + bucket / WORDS_OF_A_LINE, bucket % WORDS_OF_A_LINE);
        word.store(word.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// How long the steps of `slot` took, from its inputs being taken to its outputs being computed.
    #[must_use]
    pub fn step_times(&self, slot: usize) -> StepTimes {
        let first = self.step_line(slot);
        let count = |bucket| self.word(first + bucket / WORDS_OF_A_LINE, bucket % WORDS_OF_A_LINE);
        StepTimes::new(std::array::from_fn(|bucket| count(bucket).load(Relaxed)))
    }

    /// Notes that this process computes `slot`.
    pub(crate) fn set_process(&self, slot: usize) {
        self.word(self.slot_line(slot), PROCESS_ID).store(std::process::id(), Relaxed);
    }

    /// The process that computes `slot`; `None` before it has connected.
    #[must_use]
    pub fn process(&self, slot: usize) -> Option<u32> {
        Some(self.word(self.slot_line(slot), PROCESS_ID).load(Relaxed)).filter(|&id| id != 0)
    }

    /// Notes that this process is the clock service.
    pub(crate) fn set_clock_process(&self) {
        self.word(0, PROCESS_ID).store(std::process::id(), Relaxed);
    }

    /// The process of the clock service; `None` before it has started.
    #[must_use]
    pub fn clock_process(&self) -> Option<u32> {
        Some(self.word(0, PROCESS_ID).load(Relaxed)).filter(|&id| id != 0)
    }

    /// Counts a gap that a reader found in `topic`; it ends the run.
    pub(crate) fn count_gap(&self, topic: usize) {
        self.word(self.topic_line(topic), GAPS).fetch_add(1, Relaxed);
    }

    /// Gaps that readers found in `topic`: each ends the run, so there are none in one that goes on.
    #[must_use]
    pub fn gaps(&self, topic: usize) -> u32 {
        self.word(self.topic_line(topic), GAPS).load(Relaxed)
    }

    /// Ticks of `topic` whose samples are sent.
    #[must_use]
    pub fn ticks_sent(&self, topic: usize) -> u32 {
        self.word(self.topic_line(topic), 0).load(SeqCst)
    }
}
