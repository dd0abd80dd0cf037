//! The only room that knows iceoryx2: one service per topic, its publisher and its subscribers.
//!
//! Each run has its own root path and its own prefix for shared-memory files, so runs never meet, and
//! whatever a killed process leaves behind is found by name.

use crate::control::shm_prefix;
use crate::error::BusError;
use crate::message::{ENCAPSULATION_WORD, sample_words};
use iceoryx2::node::NodeState;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{
    BackpressureStrategy, CallbackProgression, Config, FileName, LogLevel, NodeBuilder, Path as IoxPath,
    SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend, ipc, set_log_level,
};
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

type Service = ipc::Service;
type Factory = PortFactory<Service, [u64], SampleHeader>;
type Iceoryx2Node = iceoryx2::node::Node<Service>;

/// Samples a subscriber holds at a time: the current one and the one that replaces it.
const BORROWED_SAMPLES: usize = 2;

/// What travels beside a sample: its place in the run, and host times that no recording holds.
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[repr(C)]
pub struct SampleHeader {
    /// The tick whose computation sent it.
    pub tick: u64,
    /// Samples sent before it on its topic.
    pub sequence: u64,
    /// Monotonic host time at which the sender had all its inputs.
    pub received_ns: u64,
    /// Monotonic host time at which the sender's computation was done.
    pub done_ns: u64,
    /// Monotonic host time at which it was sent.
    pub sent_ns: u64,
}

/// This process's connection to the shared memory of a run.
#[derive(Debug)]
pub(crate) struct Transport {
    node: Iceoryx2Node,
    node_name: String,
}

/// How a topic's queues are sized.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capacity {
    /// Samples that wait in a subscriber's queue at most.
    pub(crate) queued_samples: usize,
    /// Samples that a publisher keeps for a subscriber that joins later.
    pub(crate) history_samples: usize,
    /// Subscribers of the topic.
    pub(crate) subscribers: usize,
    /// Processes of the run.
    pub(crate) nodes: usize,
}

/// The configuration of the run `run_id`, whose directory is `run_dir`; the error is iceoryx2's.
fn config(run_dir: &Path, run_id: &str) -> Result<Config, String> {
    set_log_level(LogLevel::Error);
    let root = run_dir.join("iceoryx2");
    let mut config = Config::default();
    config.global.set_root_path(
        &IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|error| format!("{root:?}: {error:?}"))?,
    );
    config.global.prefix =
        FileName::new(shm_prefix(run_id).as_bytes()).map_err(|error| format!("{error:?}"))?;
    // Dead processes are the launcher's business; looking for them here would only slow the start.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// Gives back what dead processes of the run hold: their ports and their shared memory.
///
/// # Errors
/// iceoryx2's words.
pub fn reap_dead(run_dir: &Path, run_id: &str) -> Result<(), String> {
    let config = config(run_dir, run_id)?;
    let mut failure = None;
    iceoryx2::node::Node::<Service>::list(&config, |state| {
        if let NodeState::Dead(view) = state
            && let Err(error) = view.try_remove_stale_resources()
        {
            failure = Some(format!("{error:?}"));
        }
        CallbackProgression::Continue
    })
    .map_err(|error| format!("{error:?}"))?;
    failure.map_or(Ok(()), Err)
}

impl Transport {
    /// Connects node `node_name` to the run `run_id`, whose directory is `run_dir`.
    pub(crate) fn new(run_dir: &Path, run_id: &str, node_name: &str) -> Result<Self, BusError> {
        let fail =
            |reason: String| transport_error(node_name, "joining the shared memory of the run", reason);
        let config = config(run_dir, run_id).map_err(fail)?;
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(|error| fail(format!("{error:?}")))?;
        keep_to_this_user(run_id).map_err(|error| fail(error.to_string()))?;
        Ok(Self { node, node_name: node_name.to_owned() })
    }

    /// The service of a topic's samples from one generation of its publisher. Each generation has its own:
    /// who reads the topic knows for each tick whose sample counts.
    fn service(&self, topic: &str, generation: u32, capacity: Capacity) -> Result<Factory, BusError> {
        let fail =
            |reason: String| transport_error(&self.node_name, &format!("opening topic {topic}"), reason);
        let name =
            ServiceName::new(&format!("{topic}@{generation}")).map_err(|error| fail(format!("{error:?}")))?;
        self.node
            .service_builder(&name)
            .publish_subscribe::<[u64]>()
            .user_header::<SampleHeader>()
            // Nothing may be overwritten. The window keeps queues of living readers from running full.
            .enable_safe_overflow(false)
            .subscriber_max_buffer_size(capacity.queued_samples)
            .subscriber_max_borrowed_samples(BORROWED_SAMPLES)
            .history_size(capacity.history_samples)
            .max_publishers(1)
            .max_subscribers(capacity.subscribers.max(1))
            .max_nodes(capacity.nodes)
            .open_or_create()
            .map_err(|error| fail(format!("{error:?}")))
    }

    /// Creates the publisher of `topic`, whose messages have `size` bytes.
    pub(crate) fn publisher(
        &self,
        topic: &str,
        generation: u32,
        size: usize,
        capacity: Capacity,
    ) -> Result<Sender, BusError> {
        let publisher = self
            .service(topic, generation, capacity)?
            .publisher_builder()
            .initial_max_slice_len(sample_words(size))
            .max_loaned_samples(1)
            // Only the queue of a reader that died or hangs can be full: nobody may wait for it. A living
            // reader that lost a sample would miss its sequence number and stop the run.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| {
                transport_error(
                    &self.node_name,
                    &format!("publishing on topic {topic}"),
                    format!("{error:?}"),
                )
            })?;
        Ok(Sender { publisher, words: sample_words(size) })
    }

    /// Creates a subscriber of `topic`.
    pub(crate) fn subscriber(
        &self,
        topic: &str,
        generation: u32,
        capacity: Capacity,
    ) -> Result<Receiver, BusError> {
        let subscriber = self
            .service(topic, generation, capacity)?
            .subscriber_builder()
            .buffer_size(capacity.queued_samples)
            .create()
            .map_err(|error| {
                transport_error(
                    &self.node_name,
                    &format!("subscribing to topic {topic}"),
                    format!("{error:?}"),
                )
            })?;
        Ok(Receiver { subscriber })
    }
}

/// Closes the run's shared-memory files to other users: iceoryx2 0.10 leaves the counter of its nodes open to all.
fn keep_to_this_user(run_id: &str) -> std::io::Result<()> {
    let prefix = shm_prefix(run_id);
    for entry in std::fs::read_dir("/dev/shm")?.flatten() {
        if !entry.file_name().to_string_lossy().starts_with(&prefix) {
            continue;
        }
        let is_open = |data: std::fs::Metadata| data.permissions().mode() & 0o077 != 0;
        if entry.metadata().is_ok_and(is_open) {
            match std::fs::set_permissions(entry.path(), std::fs::Permissions::from_mode(0o600)) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
    }
    Ok(())
}

fn transport_error(node: &str, action: &str, reason: String) -> BusError {
    BusError::Transport { node: node.to_owned(), action: action.to_owned(), reason }
}

/// The sending end of a topic.
#[derive(Debug)]
pub(crate) struct Sender {
    publisher: Publisher<Service, [u64], SampleHeader>,
    words: usize,
}

impl Sender {
    /// Meets the subscribers that have come, and hands them the history.
    pub(crate) fn meet_subscribers(&self) -> Result<(), String> {
        self.publisher.update_connections().map_err(|error| format!("{error:?}"))
    }

    /// Takes a sample to write into; it may hold the bytes of an earlier sample.
    pub(crate) fn loan(&self) -> Result<Loan, String> {
        let sample = self.publisher.loan_slice_uninit(self.words).map_err(|error| format!("{error:?}"))?;
        // SAFETY: shared memory starts zeroed and holds nothing but words, and every bit pattern is a u64.
        let mut sample = unsafe { sample.assume_init() };
        sample.payload_mut()[0] = ENCAPSULATION_WORD;
        Ok(Loan { sample })
    }
}

/// A sample in the making.
#[derive(Debug)]
pub(crate) struct Loan {
    sample: SampleMut<Service, [u64], SampleHeader>,
}

impl Loan {
    pub(crate) fn words(&mut self) -> &mut [u64] {
        self.sample.payload_mut()
    }

    pub(crate) fn send(mut self, header: SampleHeader) -> Result<(), String> {
        *self.sample.user_header_mut() = header;
        self.sample.send().map(|_| ()).map_err(|error| format!("{error:?}"))
    }
}

/// The receiving end of a topic.
#[derive(Debug)]
pub(crate) struct Receiver {
    subscriber: Subscriber<Service, [u64], SampleHeader>,
}

impl Receiver {
    /// The oldest sample that was not received yet.
    pub(crate) fn receive(&self) -> Result<Option<Received>, String> {
        let sample = self.subscriber.receive().map_err(|error| format!("{error:?}"))?;
        Ok(sample.map(|sample| Received { sample }))
    }
}

/// A received sample; dropping it gives its memory back to the publisher.
#[derive(Debug)]
pub(crate) struct Received {
    sample: Sample<Service, [u64], SampleHeader>,
}

impl Received {
    pub(crate) fn words(&self) -> &[u64] {
        self.sample.payload()
    }

    pub(crate) fn header(&self) -> &SampleHeader {
        self.sample.user_header()
    }
}

#[cfg(test)]
mod tests {
    use super::{Capacity, Receiver, SampleHeader, Sender, Transport};
    use crate::control::{monotonic_ns, shm_prefix};
    use crate::plan::{InputPlan, TopicPlan};
    use crate::port::{InPort, Source};

    const TOPIC: &str = "/plant/state";
    const SIZE: usize = 8;
    const CAPACITY: Capacity = Capacity { queued_samples: 8, history_samples: 1, subscribers: 2, nodes: 4 };

    /// A run of this test's own; its files go with it.
    struct Run {
        folder: tempfile::TempDir,
        id: String,
    }

    impl Run {
        fn new() -> Self {
            let id = format!("transport-{:x}-{:x}", std::process::id(), monotonic_ns());
            Self { folder: tempfile::tempdir().unwrap(), id }
        }

        fn join(&self, node: &str) -> Transport {
            Transport::new(self.folder.path(), &self.id, node).unwrap()
        }
    }

    impl Drop for Run {
        fn drop(&mut self) {
            let prefix = shm_prefix(&self.id);
            let files = std::fs::read_dir("/dev/shm").unwrap().flatten();
            let own = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
            own.for_each(|file| drop(std::fs::remove_file(file.path())));
        }
    }

    fn send(sender: &Sender, tick: u64) {
        let header = SampleHeader { tick, sequence: tick, ..SampleHeader::default() };
        sender.loan().unwrap().send(header).unwrap();
    }

    fn port(receiver: Receiver) -> InPort {
        let input = InputPlan { port: "state".to_owned(), topic: 0, delay_ticks: 0, initial: None };
        let topic = TopicPlan {
            name: TOPIC.to_owned(),
            type_name: "test_msgs/msg/State".to_owned(),
            period_ticks: 1,
        };
        InPort::new(&input, &topic, SIZE, 0, None, Source::joined(0, receiver, Some(0), 1))
    }

    #[test]
    fn a_second_publisher_of_a_topic_is_refused() {
        let run = Run::new();
        let (plant, rogue) = (run.join("plant"), run.join("rogue"));
        let sender = plant.publisher(TOPIC, 0, SIZE, CAPACITY).unwrap();
        let mut port = port(run.join("imu").subscriber(TOPIC, 0, CAPACITY).unwrap());
        send(&sender, 0);
        let error = rogue.publisher(TOPIC, 0, SIZE, CAPACITY).unwrap_err().to_string();
        assert!(error.contains("node `rogue`: publishing on topic /plant/state failed"), "{error}");
        send(&sender, 1);
        port.take(1, "imu").unwrap();
    }

    #[test]
    fn samples_of_another_publisher_in_the_place_of_a_dead_one_are_named() {
        let run = Run::new();
        let (plant, rogue) = (run.join("plant"), run.join("rogue"));
        let sender = plant.publisher(TOPIC, 0, SIZE, CAPACITY).unwrap();
        let mut port = port(run.join("imu").subscriber(TOPIC, 0, CAPACITY).unwrap());
        send(&sender, 0);
        port.take(0, "imu").unwrap();
        drop(sender);
        send(&rogue.publisher(TOPIC, 0, SIZE, CAPACITY).unwrap(), 0);
        let error = port.take(1, "imu").unwrap_err().to_string();
        assert!(error.contains("node `imu`, topic /plant/state, tick 1"), "{error}");
        assert!(error.contains("another process publishes on the topic"), "{error}");
    }

    #[test]
    fn no_file_of_a_run_is_open_to_other_users() {
        use std::os::unix::fs::PermissionsExt;
        let run = Run::new();
        let _sender = run.join("plant").publisher(TOPIC, 0, SIZE, CAPACITY).unwrap();
        let prefix = shm_prefix(&run.id);
        let files = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let own: Vec<_> =
            files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix)).collect();
        assert!(own.len() > 2);
        for file in own {
            let mode = file.metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{:?} has mode {mode:o}", file.file_name());
        }
    }
}
