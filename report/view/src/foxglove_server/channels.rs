//! The topics of a run as channels of the server, and their newest samples for clients that subscribe later.

use anyhow::{Context as _, Result};
use bus::announcement::Announcement;
use bus::watch::{WatchReader, WatchedSample};
use foxglove::{ChannelId, Context, PartialMetadata, RawChannel, Schema, SinkId};
use recorder::node::SHADOW_PREFIX;
use recorder::writer::{MESSAGE_ENCODING, SCHEMA_ENCODING, channel_metadata};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The channels of a server.
pub struct Channels {
    context: Arc<Context>,
    topics: Mutex<BTreeMap<String, Topic>>,
}

/// A topic of the run.
struct Topic {
    channel: Arc<RawChannel>,
    announcement: Announcement,
    /// The newest sample: its time and its bytes. Empty before the first one.
    newest: (u64, Vec<u8>),
}

impl Channels {
    /// The channels of the server of `context`; none yet.
    pub fn new(context: Arc<Context>) -> Self {
        Self { context, topics: Mutex::default() }
    }

    /// True once the topics of the run are known.
    pub fn are_open(&self) -> bool {
        !self.topics().is_empty()
    }

    /// Opens a channel for each of these topics.
    ///
    /// # Errors
    /// If the server refuses one.
    pub fn open(&self, topics: Vec<(String, Announcement)>) -> Result<()> {
        let mut open = self.topics();
        for (name, announcement) in topics {
            let topic = self.topic(&name, announcement)?;
            open.insert(name, topic);
        }
        Ok(())
    }

    /// A topic with a channel as its recording has it.
    fn topic(&self, name: &str, announcement: Announcement) -> Result<Topic> {
        let schema = Schema::new(
            announcement.type_name.clone(),
            SCHEMA_ENCODING,
            announcement.definition.clone().into_bytes(),
        );
        let channel = self
            .context
            .channel_builder(name)
            .message_encoding(MESSAGE_ENCODING)
            .schema(schema)
            .metadata(channel_metadata(&announcement))
            .build_raw()
            .with_context(|| format!("the server takes no topic {name}"))?;
        Ok(Topic { channel, announcement, newest: (0, Vec::new()) })
    }

    /// Opens the channel of a topic of a shadow, with the message of the topic that it shadows. Other topics are left out.
    ///
    /// # Errors
    /// If the server refuses it.
    pub fn open_shadow(&self, name: &str) -> Result<()> {
        let mut topics = self.topics();
        let shadowed = name.strip_prefix(SHADOW_PREFIX).and_then(|name| topics.get(name));
        if let Some(announcement) = shadowed.map(|topic| topic.announcement.clone()) {
            topics.insert(name.to_owned(), self.topic(name, announcement)?);
        }
        Ok(())
    }

    /// Sends the samples that have come. Returns the time of the newest one, and the topics that have no channel yet.
    pub fn send_all(&self, samples: &mut WatchReader) -> (Option<u64>, BTreeSet<String>) {
        let (mut newest_ns, mut unknown) = (None, BTreeSet::new());
        samples.read(|sample| {
            newest_ns = Some(sample.time_ns);
            if !self.send(sample) {
                unknown.insert(sample.topic.to_owned());
            }
        });
        (newest_ns, unknown)
    }

    /// Sends a sample to the clients that have subscribed to its topic; false if the topic has no channel yet.
    pub fn send(&self, sample: &WatchedSample<'_>) -> bool {
        let mut topics = self.topics();
        let Some(topic) = topics.get_mut(sample.topic) else { return false };
        topic.channel.log_with_meta(sample.cdr, PartialMetadata::with_log_time(sample.time_ns));
        topic.newest.0 = sample.time_ns;
        topic.newest.1.clear();
        topic.newest.1.extend_from_slice(sample.cdr);
        true
    }

    /// Sends the newest sample of a topic to a client that has just subscribed to it: in a paused run no other one comes.
    pub fn send_newest(&self, client: Option<SinkId>, channel: ChannelId) {
        let topics = self.topics();
        if let Some(topic) = topics.values().find(|topic| topic.channel.id() == channel)
            && !topic.newest.1.is_empty()
        {
            let (time_ns, cdr) = &topic.newest;
            let time = PartialMetadata::with_log_time(*time_ns);
            topic.channel.log_with_meta_to_sink(cdr, time, client);
        }
    }

    fn topics(&self) -> MutexGuard<'_, BTreeMap<String, Topic>> {
        lock(&self.topics)
    }
}

/// The content of a mutex, even where a thread panicked over it.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::Channels;
    use bus::Message as _;
    use bus::announcement::Announcement;
    use bus::messages::SetPoint;
    use bus::watch::WatchedSample;
    use foxglove::Context;

    #[test]
    fn topics_are_those_of_the_recording_and_that_of_a_shadow_opens_behind_its_first_sample() {
        let context = Context::new();
        let channels = Channels::new(context.clone());
        assert!(!channels.are_open());
        let announcement = Announcement::of(SetPoint::SCHEMA);
        channels.open(vec![("/pilot/set_point".to_owned(), announcement.clone())]).unwrap();
        let open = |topic| context.get_channel_by_topic(topic);
        for topic in ["/shadow/pilot/set_point", "/shadow/other", "/other"] {
            let sample = WatchedSample { tick: 0, time_ns: 0, topic, cdr: &[0, 1, 0, 0] };
            assert!(open(topic).is_none() && !channels.send(&sample));
            channels.open_shadow(topic).unwrap();
            assert_eq!(channels.send(&sample), open(topic).is_some());
        }
        for topic in ["/pilot/set_point", "/shadow/pilot/set_point"] {
            let channel = open(topic).unwrap();
            let schema = channel.schema().unwrap();
            assert_eq!(
                (schema.name.as_str(), schema.encoding.as_str()),
                (&*announcement.type_name, "ros2msg")
            );
            assert_eq!(
                (&*schema.data, channel.message_encoding()),
                (announcement.definition.as_bytes(), "cdr")
            );
            assert_eq!(channel.metadata()["layout_hash"], format!("{:016x}", announcement.layout_hash));
        }
        assert!(open("/shadow/other").is_none() && open("/other").is_none(), "no recording has them");
    }
}
