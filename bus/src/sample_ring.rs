//! The samples of a topic in shared memory that outlives its publisher: the recorder reads the samples of group
//! members there.
//!
//! A member that writes here needs neither a loan nor a queue, and the recorder reads the bytes where they lie. The
//! control segment orders the two: a reader looks at the sample of a tick when the topic's count says that it is
//! sent. The publisher comes back to its place in the ring when the reader has completed that tick: the clock grants
//! no tick more than a window ahead of the slowest node. A sample that is counted is there, even if the publisher
//! dies right after.

use crate::error::BusError;
use crate::message::sample_words;
use crate::names::shm_path;
use crate::plan::Plan;
use crate::sample_ticks::SampleTicks;
use crate::shared_file;
use memmap2::MmapRaw;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

const WORD_BYTES: usize = size_of::<u64>();

/// The ring of a topic.
#[derive(Debug)]
pub(crate) struct SampleRing {
    map: MmapRaw,
    entries: usize,
    ticks: SampleTicks,
    /// Words of a sample; its stamp stands in front of them.
    sample_words: usize,
}

impl SampleRing {
    /// Creates the ring of topic `topic`, whose messages have `size` bytes, with all its pages.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub(crate) fn create(plan: &Plan, topic: usize, size: usize) -> Result<Self, BusError> {
        let map = shared_file::create(&path(plan, topic), bytes(plan, topic, size))?;
        Ok(Self::of(map, plan, topic, size))
    }

    /// Opens the ring of topic `topic`, whose messages have `size` bytes.
    ///
    /// # Errors
    /// If its publisher has not created it, or for messages of another size.
    pub(crate) fn open(plan: &Plan, topic: usize, size: usize) -> Result<Self, BusError> {
        let map = shared_file::open(&path(plan, topic), bytes(plan, topic, size), "the samples of a topic")?;
        Ok(Self::of(map, plan, topic, size))
    }

    fn of(map: MmapRaw, plan: &Plan, topic: usize, size: usize) -> Self {
        let ticks = plan.topics[topic].ticks;
        Self { map, entries: entries(plan, topic), ticks, sample_words: sample_words(size) }
    }

    /// Writes `sample` as that of `tick`, at which one is due.
    ///
    /// # Panics
    /// If it has not the size of the topic's samples.
    pub(crate) fn store(&mut self, tick: u32, sample: &[u64]) {
        assert_eq!(sample.len(), self.sample_words, "a sample has the size of its topic");
        let (stamp, words) = self.entry(tick);
        // SAFETY: `words` points to as many words as the sample has (asserted), inside the mapping. No other process reads
        // them: the topic's count does not include this tick, and who reads the tick that lay here has completed it.
        unsafe { std::ptr::copy_nonoverlapping(sample.as_ptr(), words, sample.len()) };
        stamp.store(u64::from(tick) + 1, Relaxed);
    }

    /// The sample of `tick`, if it is there; the topic's count must say that the tick is sent.
    pub(crate) fn at(&self, tick: u32) -> Option<&[u64]> {
        let (stamp, words) = self.entry(tick);
        // SAFETY: the words are inside the mapping, which lives as long as `self`. Their publisher writes them again only
        // when this process has completed the tick, which it has not as long as it computes from them.
        let sample = unsafe { std::slice::from_raw_parts(words, self.sample_words) };
        (stamp.load(Relaxed) == u64::from(tick) + 1).then_some(sample)
    }

    /// The stamp and the words of the entry of `tick`. The stamp is the tick plus one, so that memory that was never
    /// written holds no sample.
    fn entry(&self, tick: u32) -> (&AtomicU64, *mut u64) {
        #[allow(clippy::cast_possible_truncation, reason = "at most the number of ticks, which has 32 bits")]
        let number = self.ticks.sequence(tick) as usize;
        let first = number % self.entries * (1 + self.sample_words);
        let end = (first + 1 + self.sample_words) * WORD_BYTES;
        assert!(end <= self.map.len(), "the sample of tick {tick} is outside its ring");
        let start = self.map.as_mut_ptr().cast::<u64>();
        // SAFETY: the entry lies inside the mapping (asserted), which starts at a page; all processes use its first word as
        // an atomic.
        unsafe { (&*start.add(first).cast::<AtomicU64>(), start.add(first + 1)) }
    }
}

/// A publisher is at most a window ahead of the recorder; one sample more is that of the tick that it computes.
fn entries(plan: &Plan, topic: usize) -> usize {
    let longest = plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
    let ticks = u64::from(plan.window_ticks) + u64::from(longest);
    usize::try_from(plan.topics[topic].ticks.most_within(ticks)).unwrap_or(usize::MAX - 2) + 2
}

fn bytes(plan: &Plan, topic: usize, size: usize) -> usize {
    entries(plan, topic) * (1 + sample_words(size)) * WORD_BYTES
}

fn path(plan: &Plan, topic: usize) -> PathBuf {
    shm_path(&plan.run_id, &format!("samples_{topic}"))
}

#[cfg(test)]
mod tests {
    use super::SampleRing;
    use crate::plan::{Plan, TopicPlan};
    use crate::sample_ticks::SampleTicks;

    /// A plan with one topic, whose files go with it.
    struct Run(Plan);

    impl Run {
        fn new(ticks: SampleTicks) -> Self {
            let (name, type_name) = ("/plant/state".to_owned(), "test_msgs/msg/State".to_owned());
            Self(Plan::for_test(1000, vec![TopicPlan { name, type_name, ticks }], vec![]))
        }
    }

    impl Drop for Run {
        fn drop(&mut self) {
            let _ = std::fs::remove_file(super::path(&self.0, 0));
        }
    }

    #[test]
    fn a_reader_a_window_behind_finds_each_sample_and_none_that_is_not_sent() {
        let at_60_hz = SampleTicks::measured(1, 1_000_000, 16_666_667, 3_000_000);
        for ticks in [SampleTicks::every(1), SampleTicks::every(5), at_60_hz] {
            let run = Run::new(ticks);
            let mut sender = SampleRing::create(&run.0, 0, 12).unwrap();
            let reader = SampleRing::open(&run.0, 0, 12).unwrap();
            let sample = |tick: u32| [1, u64::from(tick), 7 * u64::from(tick)];
            assert_eq!(reader.at(0), None, "fresh memory holds no sample");
            for tick in (0..1000).filter(|tick| ticks.is_due(*tick)) {
                sender.store(tick, &sample(tick));
                let oldest = tick.saturating_sub(run.0.window_ticks);
                for sent in (oldest..=tick).filter(|sent| ticks.is_due(*sent)) {
                    assert_eq!(reader.at(sent), Some(&sample(sent)[..]), "{sent} at {tick}");
                }
                assert_eq!(reader.at(ticks.next(tick + 1)), None);
            }
        }
    }

    #[test]
    fn messages_of_another_size_are_refused_by_the_files_name() {
        let run = Run::new(SampleTicks::every(1));
        let missing = SampleRing::open(&run.0, 0, 12).unwrap_err().to_string();
        assert!(missing.contains("samples_0"), "{missing}");
        let _sender = SampleRing::create(&run.0, 0, 12).unwrap();
        let error = SampleRing::open(&run.0, 0, 120).unwrap_err().to_string();
        assert!(error.contains("samples_0") && error.contains("instead of"), "{error}");
    }
}
