//! Topics whose publisher and readers share a process: their newest samples in the memory of that process.

use crate::sample_memory::empty_sample;
use crate::transport::SampleHeader;

/// The two newest samples of a topic. Its readers step in the order of the ticks, so that none reads an older one: with a
/// delay of one tick a reader may step behind the publisher of the same tick, and then reads the sample before the newest.
#[derive(Debug)]
pub(crate) struct LocalTopic {
    newest: LocalSample,
    previous: LocalSample,
}

/// A sample, or memory for one.
#[derive(Debug)]
struct LocalSample {
    header: SampleHeader,
    words: Box<[u64]>,
    is_sent: bool,
}

impl LocalSample {
    fn empty(size: usize) -> Self {
        Self { header: SampleHeader::default(), words: empty_sample(size), is_sent: false }
    }

    fn sent(&self) -> Option<(SampleHeader, &[u64])> {
        self.is_sent.then_some((self.header, &*self.words))
    }
}

impl LocalTopic {
    /// A topic of messages of `size` bytes, of which none is sent yet.
    pub(crate) fn new(size: usize) -> Self {
        Self { newest: LocalSample::empty(size), previous: LocalSample::empty(size) }
    }

    /// The newest sample that was sent at or before `tick`.
    pub(crate) fn at(&self, tick: u32) -> Option<(SampleHeader, &[u64])> {
        let is_seen = |sample: &&LocalSample| sample.is_sent && sample.header.tick <= u64::from(tick);
        [&self.newest, &self.previous].into_iter().find(is_seen).and_then(LocalSample::sent)
    }

    /// The newest sample.
    pub(crate) fn newest(&self) -> Option<(SampleHeader, &[u64])> {
        self.newest.sent()
    }

    /// Sends `words`, which become memory for the sample after the next one.
    pub(crate) fn send(&mut self, header: SampleHeader, words: &mut Box<[u64]>) {
        std::mem::swap(&mut self.newest, &mut self.previous);
        std::mem::swap(&mut self.newest.words, words);
        (self.newest.header, self.newest.is_sent) = (header, true);
    }
}

#[cfg(test)]
mod tests {
    use super::LocalTopic;
    use crate::transport::SampleHeader;

    #[test]
    fn a_reader_gets_the_newest_sample_up_to_its_tick() {
        let mut topic = LocalTopic::new(8);
        let mut words = vec![0; 2].into_boxed_slice();
        assert!(topic.at(100).is_none() && topic.newest().is_none());
        for tick in [0_u32, 3, 6] {
            words[1] = u64::from(tick) + 1;
            topic.send(SampleHeader { tick: u64::from(tick), ..SampleHeader::default() }, &mut words);
            for (asked, expected) in
                [(tick, Some(tick)), (tick + 2, Some(tick)), (tick.max(1) - 1, tick.checked_sub(3))]
            {
                let found = topic.at(asked).map(|(header, words)| (header.tick, words[1]));
                assert_eq!(
                    found,
                    expected
                        .map(|sent| (u64::from(sent), u64::from(sent) + 1))
                        .or((tick == 0 && asked == 0).then_some((0, 1))),
                    "at {asked} after {tick}"
                );
            }
        }
    }
}
