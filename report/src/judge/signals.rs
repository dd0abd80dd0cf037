//! Newest values of the fields that conditions need.

use recorder::RecordingError;
use recorder::fields::TopicFields;

/// Fields of topics, and which of them have a sample of the tick that is under way.
#[derive(Debug, Default)]
pub struct Signals {
    topics: Vec<Topic>,
}

#[derive(Debug)]
struct Topic {
    fields: TopicFields,
    /// True if a sample of the tick under way has come.
    is_fresh: bool,
    /// True if a sample has come at all.
    is_known: bool,
}

/// A field of a topic, by its numbers.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    topic: usize,
    field: usize,
}

impl Signals {
    /// The signal `field` of `topic`, which `open` opens at its first use.
    ///
    /// # Errors
    /// As `open` says.
    pub fn signal(
        &mut self,
        topic: &str,
        field: &str,
        open: &mut dyn FnMut(&str) -> Result<TopicFields, RecordingError>,
    ) -> Result<Signal, RecordingError> {
        let topic = match self.number(topic) {
            Some(number) => number,
            None => {
                self.topics.push(Topic { fields: open(topic)?, is_fresh: false, is_known: false });
                self.topics.len() - 1
            }
        };
        let field = self.topics[topic].fields.add(field);
        Ok(Signal { topic, field })
    }

    /// The number of `topic`; `None` if no signal is a field of it.
    pub fn number(&self, topic: &str) -> Option<usize> {
        self.topics.iter().position(|known| known.fields.topic() == topic)
    }

    /// Takes the sample `cdr` of topic number `topic`, sent at the tick under way.
    ///
    /// # Errors
    /// If it does not fit its definition, or lacks a field.
    pub fn take(&mut self, topic: usize, cdr: &[u8]) -> Result<(), RecordingError> {
        let topic = &mut self.topics[topic];
        topic.fields.read(cdr)?;
        (topic.is_fresh, topic.is_known) = (true, true);
        Ok(())
    }

    /// Takes the sample `cdr` of topic number `topic`, which was sent before the tick under way.
    ///
    /// # Errors
    /// As [`Signals::take`].
    pub fn hold(&mut self, topic: usize, cdr: &[u8]) -> Result<(), RecordingError> {
        let topic = &mut self.topics[topic];
        topic.fields.read(cdr)?;
        topic.is_known = true;
        Ok(())
    }

    /// Ends the tick: no sample is fresh.
    pub fn end_tick(&mut self) {
        self.topics.iter_mut().for_each(|topic| topic.is_fresh = false);
    }

    /// The newest values of `signal`, one or three of a vector; `None` before the first sample.
    pub fn held(&self, signal: Signal) -> Option<&[f64]> {
        let topic = &self.topics[signal.topic];
        topic.is_known.then(|| topic.fields.values(signal.field))
    }

    /// The values of `signal` that were sent at the tick under way.
    pub fn fresh(&self, signal: Signal) -> Option<&[f64]> {
        self.held(signal).filter(|_| self.topics[signal.topic].is_fresh)
    }

    /// The unit of `signal`; empty before the first sample.
    pub fn unit(&self, signal: Signal) -> &str {
        self.topics[signal.topic].fields.unit(signal.field)
    }
}
