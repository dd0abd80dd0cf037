//! The only room that knows iceoryx2: one service per topic, its publisher and its subscribers.
//!
//! Each run has its own root path and its own prefix for shared-memory files. So runs never meet, and the remains of
//! a killed process are found by name.

use crate::error::BusError;
use crate::message::{ENCAPSULATION_WORD, sample_words};
use crate::names::{SHARED_MEMORY, shm_path, shm_prefix};
use crate::place::Place;
use crate::plan::Capacity;
use crate::reserve;
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
use iceoryx2_bb_elementary::package_version::PackageVersion;
use iceoryx2_cal::hash::Hash as _;
use iceoryx2_cal::hash::sha1::Sha1;
use std::cell::RefCell;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

type Service = ipc::Service;
type Factory = PortFactory<Service, [u64], SampleHeader>;
type Iceoryx2Node = iceoryx2::node::Node<Service>;

/// The longest path that iceoryx2 0.10 takes.
const PATH_BYTES_MAX: usize = 255;

/// Samples a subscriber holds at a time: the current one and the one that replaces it.
pub(crate) const BORROWED_SAMPLES: usize = 2;

/// Required beside the samples: the memory that iceoryx2 touches while it makes the files of a port. Without it the
/// process would be killed. Measured with manifests/hover.toml and manifests/swarm.toml: at most 4 KiB for each
/// connection and each service, 92 KiB and 304 KiB for all of a run. So there is room for several processes that make
/// ports at a time.
pub(crate) const PORT_MARGIN_BYTES: u64 = 256 << 10;

/// Header of a sample: its place in the run, and host times that no recording holds.
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
    run_id: String,
    /// The numbers of the ports whose pages are not reserved yet.
    new_ports: RefCell<Vec<String>>,
}

/// Makes iceoryx2 print errors only, in all of this process: for a program that is hummingbus's own.
pub fn limit_transport_log() {
    set_log_level(LogLevel::Error);
}

/// Error of iceoryx2, by the name that it gives to it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct IceoryxError(String);

impl IceoryxError {
    /// iceoryx2 has an error type for every call.
    fn of(error: impl std::fmt::Debug) -> Self {
        Self(format!("{error:?}"))
    }
}

/// The configuration of the run `run_id`, whose directory is `run_dir`.
fn config(run_dir: &Path, run_id: &str) -> Result<Config, IceoryxError> {
    let root = run_dir.join("iceoryx2");
    let mut config = Config::default();
    config.global.set_root_path(
        &IoxPath::new(root.as_os_str().as_encoded_bytes())
            .map_err(|error| IceoryxError(format!("{root:?}: {error:?}")))?,
    );
    config.global.prefix = FileName::new(shm_prefix(run_id).as_bytes()).map_err(IceoryxError::of)?;
    // Dead processes are the launcher's business; looking for them here would only slow the start.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// Gives back the resources of dead processes of the run: their ports and their shared memory.
///
/// # Errors
/// An error of iceoryx2.
pub fn reap_dead(run_dir: &Path, run_id: &str) -> Result<(), IceoryxError> {
    let config = config(run_dir, run_id)?;
    let mut failure = None;
    iceoryx2::node::Node::<Service>::list(&config, |state| {
        if let NodeState::Dead(view) = state
            && let Err(error) = view.try_remove_stale_resources()
        {
            failure = Some(IceoryxError::of(error));
        }
        CallbackProgression::Continue
    })
    .map_err(IceoryxError::of)?;
    failure.map_or(Ok(()), Err)
}

impl Transport {
    /// Connects node `node_name` to the run `run_id`, whose directory is `run_dir`.
    pub(crate) fn new(
        run_dir: &Path,
        run_id: &str,
        node_name: &str,
        place: &Place,
    ) -> Result<Self, BusError> {
        let fail = |reason: IceoryxError| {
            transport_error(node_name, "joining the shared memory of the run", &reason)
        };
        if place.is_process() {
            limit_transport_log();
        }
        let config = config(run_dir, run_id).map_err(fail)?;
        let what = format!("node `{node_name}` in shared memory");
        reserve::require_free(&what, PORT_MARGIN_BYTES)?;
        make_node_counter(&config, run_id)
            .map_err(|error| fail(IceoryxError(format!("cannot make the counter of its nodes: {error}"))))?;
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(|error| fail(IceoryxError::of(error)))?;
        let (node_name, run_id) = (node_name.to_owned(), run_id.to_owned());
        Ok(Self { node, node_name, run_id, new_ports: RefCell::default() })
    }

    /// The service of a topic's samples from one generation of its publisher. Each generation has its own: a reader
    /// of the topic knows for each tick whose sample counts.
    fn service(&self, topic: &str, generation: u32, capacity: Capacity) -> Result<Factory, BusError> {
        let fail = |reason: IceoryxError| {
            transport_error(&self.node_name, &format!("opening topic {topic}"), &reason)
        };
        let name = ServiceName::new(&format!("{topic}@{generation}"))
            .map_err(|error| fail(IceoryxError::of(error)))?;
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
            .map_err(|error| fail(IceoryxError::of(error)))
    }

    /// Creates the publisher of `topic`, whose messages have `size` bytes.
    pub(crate) fn publisher(
        &self,
        topic: &str,
        generation: u32,
        size: usize,
        capacity: Capacity,
    ) -> Result<Sender, BusError> {
        let what = format!("node `{}` publishing on topic {topic}", self.node_name);
        reserve::require_free(&what, samples_bytes(size, capacity) + PORT_MARGIN_BYTES)?;
        let publisher = self
            .service(topic, generation, capacity)?
            .publisher_builder()
            .initial_max_slice_len(sample_words(size))
            .max_loaned_samples(1)
            // Only the queue of a reader that died or hangs can be full: no publisher may wait for it. A living
            // reader that lost a sample would miss its sequence number and stop the run.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| {
                let action = format!("publishing on topic {topic}");
                transport_error(&self.node_name, &action, &IceoryxError::of(error))
            })?;
        self.new_ports.borrow_mut().push(publisher.id().value().to_string());
        Ok(Sender { publisher, words: sample_words(size) })
    }

    /// Creates a subscriber of `topic`.
    pub(crate) fn subscriber(
        &self,
        topic: &str,
        generation: u32,
        capacity: Capacity,
    ) -> Result<Receiver, BusError> {
        let what = format!("node `{}` subscribing to topic {topic}", self.node_name);
        reserve::require_free(&what, PORT_MARGIN_BYTES)?;
        let subscriber = self
            .service(topic, generation, capacity)?
            .subscriber_builder()
            .buffer_size(capacity.queued_samples)
            .create()
            .map_err(|error| {
                let action = format!("subscribing to topic {topic}");
                transport_error(&self.node_name, &action, &IceoryxError::of(error))
            })?;
        self.new_ports.borrow_mut().push(subscriber.id().value().to_string());
        Ok(Receiver { subscriber })
    }

    /// Reserves the pages of the files made for the ports since the last call: from then on, no sample can find that
    /// a page cannot be had.
    pub(crate) fn reserve(&self) -> Result<(), BusError> {
        let ports = std::mem::take(&mut *self.new_ports.borrow_mut());
        if ports.is_empty() {
            return Ok(());
        }
        // A file is named by its ports; those of services have none.
        let is_new = |name: &str| {
            name.ends_with(".dynamic")
                || name.split(['_', '.']).any(|part| ports.iter().any(|port| port == part))
        };
        reserve::reserve_files(&self.run_id, is_new, &format!("the samples of node `{}`", self.node_name))
    }
}

/// The type that iceoryx2 0.10 keeps in the counter of its nodes; its hash is part of the file's name.
const COUNTER_TYPE: &str = "iceoryx2::node::global_management_segment::State";

/// Makes the counter of the run's nodes, open to this user alone, if it is not there yet. Otherwise iceoryx2 0.10
/// would make it itself, and open it to every user for any umask.
fn make_node_counter(config: &Config, run_id: &str) -> std::io::Result<()> {
    use std::io::Write as _;
    let version = PackageVersion::get();
    let (major, minor, patch) = (version.major(), version.minor(), version.patch());
    let hash = Sha1::new(COUNTER_TYPE.as_bytes()).value();
    let (hash, suffix) = (hash.as_base64url(), config.global.node.global_mgmt_suffix);
    let path = shm_path(run_id, &format!("{hash}_node.{major}_{minor}_{patch}{suffix}"));
    // In one step, and never over another's: nodes that come at the same time share one counter.
    let folder = path.parent().unwrap_or(Path::new(SHARED_MEMORY));
    let mut draft = tempfile::Builder::new().prefix(&shm_prefix(run_id)).tempfile_in(folder)?;
    // Even if the umask would take them away.
    draft.as_file().set_permissions(std::fs::Permissions::from_mode(0o600))?;
    // The version that wrote it, and the count, each in 8 bytes.
    draft.write_all(&[version.to_u64().to_ne_bytes(), [0; 8]].concat())?;
    match draft.persist_noclobber(&path) {
        // Of this user, or another one has put it there.
        Err(refused) if refused.error.kind() == std::io::ErrorKind::AlreadyExists => {
            crate::user_file::open(&path, true).map(|_| ())
        }
        other => Ok(other.map(|_| ())?),
    }
}

/// True if iceoryx2 can keep the files of run `run_id` below `run_dir`. It takes no path beyond 255 bytes, even if it
/// opens none, and panics over longer ones. It does not take every character.
#[must_use]
pub fn takes_run_dir(run_dir: &Path, run_id: &str) -> bool {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/._-+,=@~ ".contains(&byte);
    let bytes = run_dir.as_os_str().as_encoded_bytes();
    bytes.iter().copied().all(is_plain) && bytes.len() <= run_dir_bytes_max(run_id)
}

/// Longest run directory that fits. Behind it the longest path has `/iceoryx2/`, the prefix, the hash of a service
/// (40 characters), a publisher and a subscriber, and `.connection`. Publisher and subscriber are numbers of 128
/// bits, up to 39 digits, with `_` between them.
fn run_dir_bytes_max(run_id: &str) -> usize {
    const LONGEST: usize = "/iceoryx2/".len() + 40 + "_".len() + 39 + "_".len() + 39 + ".connection".len();
    PATH_BYTES_MAX.saturating_sub(LONGEST + shm_prefix(run_id).len())
}

/// The samples that a publisher of the topic keeps: those in every queue, those that are read, the history, and the
/// one in the making.
pub(crate) fn samples_bytes(size: usize, capacity: Capacity) -> u64 {
    let Capacity { queued_samples, history_samples, subscribers, .. } = capacity;
    let samples = subscribers * (queued_samples + BORROWED_SAMPLES) + history_samples + 1;
    (samples * (8 * sample_words(size) + size_of::<SampleHeader>())) as u64
}

/// Open files that a process needs at least while it opens a topic: with fewer left, iceoryx2 fails without a reason.
const FILES_LEFT_MIN: u64 = 16;

/// Hint at the limit on open files, where this process is near it; else empty. The listing itself is one of them.
fn few_files_left() -> String {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile).current.unwrap_or(u64::MAX);
    let open =
        std::fs::read_dir("/proc/self/fd").map_or(0, |entries| entries.count() as u64).saturating_sub(1);
    hint_of_files(open, limit)
}

fn hint_of_files(open: u64, limit: u64) -> String {
    if open.saturating_add(FILES_LEFT_MIN) < limit {
        return String::new();
    }
    format!("; it has {open} files open, and its limit is {limit}: raise that (`ulimit -n`), 1024 is usual")
}

fn transport_error(node: &str, action: &str, reason: &IceoryxError) -> BusError {
    let reason = reason.to_string() + &few_files_left();
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
    pub(crate) fn update_subscribers(&self) -> Result<(), IceoryxError> {
        self.publisher.update_connections().map_err(IceoryxError::of)
    }

    /// Takes a sample to write into; it may hold the bytes of an earlier sample.
    pub(crate) fn loan(&self) -> Result<Loan, IceoryxError> {
        let sample = self.publisher.loan_slice_uninit(self.words).map_err(IceoryxError::of)?;
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

    pub(crate) fn send(mut self, header: SampleHeader) -> Result<(), IceoryxError> {
        *self.sample.user_header_mut() = header;
        self.sample.send().map(|_| ()).map_err(IceoryxError::of)
    }
}

/// The receiving end of a topic.
#[derive(Debug)]
pub(crate) struct Receiver {
    subscriber: Subscriber<Service, [u64], SampleHeader>,
}

impl Receiver {
    /// The oldest sample that was not received yet.
    pub(crate) fn receive(&self) -> Result<Option<Received>, IceoryxError> {
        let sample = self.subscriber.receive().map_err(IceoryxError::of)?;
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
    use super::{Receiver, SampleHeader, Sender, Transport, hint_of_files, run_dir_bytes_max, takes_run_dir};
    use crate::announcement::Announcement;
    use crate::host_time::monotonic_ns;
    use crate::message::Message as _;
    use crate::messages::SetPoint;
    use crate::names::shm_prefix;
    use crate::place::Place;
    use crate::plan::{Capacity, InputPlan, TopicPlan};
    use crate::port::{Feed, InPort, Source};
    use crate::sample_ticks::SampleTicks;
    use std::os::unix::fs::{MetadataExt, PermissionsExt};

    #[test]
    fn a_process_near_its_limit_on_open_files_is_told_so() {
        assert_eq!(hint_of_files(40, 1024), "");
        assert!(
            hint_of_files(18, 30).contains("18 files open, and its limit is 30: raise that (`ulimit -n`)")
        );
        assert_eq!(hint_of_files(40, u64::MAX), "");
    }

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
            Transport::new(self.folder.path(), &self.id, node, &Place::Process).unwrap()
        }
    }

    impl Drop for Run {
        fn drop(&mut self) {
            let prefix = shm_prefix(&self.id);
            let files = std::fs::read_dir("/dev/shm").unwrap().flatten();
            let ours = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
            ours.for_each(|file| drop(std::fs::remove_file(file.path())));
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
            ticks: SampleTicks::every(1),
        };
        let announcement = Announcement { size: SIZE, ..Announcement::of(SetPoint::SCHEMA) };
        InPort::new(
            &input,
            &topic,
            &announcement,
            None,
            Feed::Shared(Source::joined(0, receiver, Some(0), SampleTicks::every(1))),
        )
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

    /// Shared-memory files of `run`: name and metadata.
    fn files(run: &Run) -> Vec<(String, std::fs::Metadata)> {
        let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let named = entries.map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry));
        let ours = named.filter(|(name, _)| name.starts_with(&shm_prefix(&run.id)));
        ours.map(|(name, entry)| (name, entry.metadata().unwrap())).collect()
    }

    #[test]
    fn no_file_of_a_run_is_open_to_other_users() {
        let run = Run::new();
        let processes: Vec<_> = std::thread::scope(|scope| {
            (0..4)
                .map(|_| scope.spawn(|| run.join("plant")))
                .collect::<Vec<_>>()
                .into_iter()
                .map(|process| process.join().unwrap())
                .collect()
        });
        let _sender = processes[0].publisher(TOPIC, 0, SIZE, CAPACITY).unwrap();
        let files = files(&run);
        assert!(files.len() > 2);
        for (name, data) in &files {
            assert_eq!(data.permissions().mode() & 0o077, 0, "{name}");
        }
        // iceoryx2 has found the counter that was made for it: one of its own would be open to all at first.
        let counters: Vec<_> = files.iter().filter(|(name, _)| name.contains("global_mgmt")).collect();
        assert_eq!(counters.len(), 1, "{counters:?}");
        let counter = std::fs::read(format!("/dev/shm/{}", counters[0].0)).unwrap();
        assert_eq!(counter[8..12], 4_u32.to_ne_bytes(), "every process counts in it");
    }

    #[test]
    fn every_page_of_shared_memory_is_there_before_the_first_sample() {
        let run = Run::new();
        let (plant, imu) = (run.join("plant"), run.join("imu"));
        let capacity = Capacity { queued_samples: 500, ..CAPACITY };
        let _sender = plant.publisher(TOPIC, 0, 1000, capacity).unwrap();
        let _receiver = imu.subscriber(TOPIC, 0, capacity).unwrap();
        plant.reserve().unwrap();
        imu.reserve().unwrap();
        let files = files(&run);
        for (name, data) in &files {
            assert!(
                data.blocks() * 512 >= data.len(),
                "{name}: {} blocks for {} bytes",
                data.blocks(),
                data.len()
            );
        }
        // The estimate before is neither more than the memory taken nor far from it.
        let largest = files.iter().map(|(_, data)| data.len()).max().unwrap();
        let asked = super::samples_bytes(1000, capacity);
        assert!(largest > asked && largest < asked + asked / 4, "asked for {asked} bytes, took {largest}");
    }

    #[test]
    fn the_longest_run_directory_that_is_taken_is_one_that_iceoryx2_takes() {
        let run = Run::new();
        let folder = std::fs::canonicalize(run.folder.path()).unwrap();
        let rest = run_dir_bytes_max(&run.id) - folder.as_os_str().len() - 1;
        let longest = folder.join("x".repeat(rest));
        std::fs::create_dir(&longest).unwrap();
        assert!(
            takes_run_dir(&longest, &run.id) && !takes_run_dir(&folder.join("x".repeat(rest + 1)), &run.id)
        );
        let [plant, imu] =
            ["plant", "imu"].map(|name| Transport::new(&longest, &run.id, name, &Place::Process).unwrap());
        let sender = plant.publisher(TOPIC, 0, SIZE, CAPACITY).unwrap();
        let mut port = port(imu.subscriber(TOPIC, 0, CAPACITY).unwrap());
        send(&sender, 0);
        port.take(0, "imu").unwrap();
        for name in ["a\"b", "a'b", "a\nb", "ä", "a*", "a|b", "a\\b"] {
            assert!(!takes_run_dir(&folder.join(name), &run.id), "{name}");
        }
    }

    #[test]
    fn a_file_that_another_user_put_in_the_way_is_named() {
        let run = Run::new();
        let plant = run.join("plant");
        let _sender = plant.publisher(TOPIC, 0, SIZE, CAPACITY).unwrap();
        let (name, _) = files(&run).into_iter().find(|(name, _)| name.ends_with(".data")).unwrap();
        let path = format!("/dev/shm/{name}");
        if std::os::unix::fs::chown(&path, Some(65534), None).is_err() {
            crate::skipped::skip("only root can give a file to another user");
            return;
        }
        let error = plant.reserve().unwrap_err().to_string();
        assert!(error.contains(&path) && error.contains("belongs to user 65534"), "{error}");
    }
}
