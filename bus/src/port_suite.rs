//! Tests that every transport passes: samples from another process, from a member of the same group, and from the ring in which the recorder
//! reads a group.

use crate::BusError;
use crate::announcement::Announcement;
use crate::local::LocalTopic;
use crate::message::{Message as _, view, view_mut};
use crate::messages::{SetPoint, Time};
use crate::names::{SHARED_MEMORY, shm_prefix};
use crate::place::Place;
use crate::plan::{Capacity, InputPlan, OutputPlan, Plan, TopicPlan};
use crate::port::{Feed, InPort, OutPort, Source};
use crate::sample_memory::empty_sample;
use crate::sample_ring::SampleRing;
use crate::sample_ticks::SampleTicks;
use crate::transport::Transport;

const TICKS: u32 = 300;
const TICK_NS: u64 = 1_000_000;
const SIZE: usize = size_of::<SetPoint>();
const CAPACITY: Capacity = Capacity { queued_samples: 8, history_samples: 1, subscribers: 2, nodes: 4 };
const INITIAL: SetPoint =
    SetPoint { stamp: Time { sec: 0, nanosec: 0 }, altitude: -1.0, roll: 0.0, pitch: 0.0, yaw: 0.0 };

/// Transport of a topic's samples.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// iceoryx2.
    Process,
    /// Memory of the process that both nodes share.
    Member,
    /// Shared memory, for the recorder. It holds samples by tick and gives none at other ticks.
    Ring,
}

const WAYS: [Way; 3] = [Way::Process, Way::Member, Way::Ring];

/// Plan of a run with one topic. Its files in shared memory go with it.
struct Run {
    plan: Plan,
    folder: tempfile::TempDir,
}

impl Run {
    fn new(ticks: SampleTicks) -> Self {
        let (name, type_name) = ("/pilot/set_point".to_owned(), SetPoint::SCHEMA.type_name.to_owned());
        let plan = Plan::for_test(TICKS, vec![TopicPlan { name, type_name, ticks }], vec![]);
        Self { plan, folder: tempfile::tempdir().unwrap() }
    }

    fn join(&self, node: &str) -> Transport {
        Transport::new(self.folder.path(), &self.plan.run_id, node, &Place::Process).unwrap()
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let prefix = shm_prefix(&self.plan.run_id);
        let files = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        let ours = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
        ours.for_each(|file| drop(std::fs::remove_file(file.path())));
    }
}

/// An output and an input of one topic, connected.
struct Connection {
    way: Way,
    // The input goes first: its samples go back while the output still stands.
    input: InPort,
    output: OutPort,
    locals: Vec<Option<LocalTopic>>,
    run: Run,
}

impl Connection {
    fn new(way: Way, ticks: SampleTicks, delay_ticks: u32) -> Self {
        let run = Run::new(ticks);
        let topic = &run.plan.topics[0];
        let (sender, feed, ring) = match way {
            Way::Process => {
                let sender = run.join("pilot").publisher(&topic.name, 0, SIZE, CAPACITY).unwrap();
                let receiver = run.join("controller").subscriber(&topic.name, 0, CAPACITY).unwrap();
                (Some(sender), Feed::Shared(Source::new(0, receiver, 0, ticks)), None)
            }
            Way::Member => (None, Feed::Local { generation: 0 }, None),
            Way::Ring => {
                let ring = SampleRing::create(&run.plan, 0, SIZE).unwrap();
                (None, Feed::Ring(SampleRing::open(&run.plan, 0, SIZE).unwrap()), Some(ring))
            }
        };
        let is_staged = sender.is_none();
        let output = OutputPlan { port: "set_point".to_owned(), topic: 0 };
        let mut output = OutPort::new(&output, topic, SetPoint::SCHEMA, sender, is_staged);
        if let Some(ring) = ring {
            output.record(ring);
        }
        let input = InputPlan { port: "set_point".to_owned(), topic: 0, delay_ticks, initial: None };
        let mut initial = empty_sample(SIZE);
        *view_mut(&mut initial) = INITIAL;
        let announcement = Announcement::of(SetPoint::SCHEMA);
        let input = InPort::new(&input, topic, &announcement, Some(initial), feed);
        let locals = if way == Way::Member { vec![Some(LocalTopic::new(SIZE))] } else { Vec::new() };
        Self { way, input, output, locals, run }
    }

    /// Writes `message` and sends it at `tick`.
    fn send(&mut self, tick: u32, message: SetPoint) -> Result<(), BusError> {
        *view_mut(self.output.words("pilot")?) = message;
        self.publish(tick)
    }

    /// Sends what is written at `tick`.
    fn publish(&mut self, tick: u32) -> Result<(), BusError> {
        self.output.send(tick, u64::from(tick) * TICK_NS, [0; 3], "pilot", &mut self.locals)
    }

    fn send_if_due(&mut self, tick: u32) {
        if self.output.is_sent(tick) {
            self.send(tick, message(tick)).unwrap();
        }
    }

    /// Requires `tick` to read the newest sample up to its limit, and to know if it was sent at that limit.
    fn require_read(&mut self, tick: u32) {
        self.input.take(tick, "controller").unwrap();
        let (way, ticks, limit) = (self.way, self.run.plan.topics[0].ticks, self.input.limit(tick));
        let fresh = limit.and_then(|limit| self.input.fresh(limit, &self.locals));
        let due = limit.filter(|limit| ticks.is_due(*limit));
        let expected = due.map(|due| (cdr(&sent(due)), ticks.sequence(due)));
        assert_eq!(
            fresh.map(|(cdr, sequence)| (cdr.to_vec(), sequence)),
            expected,
            "{way:?}, {ticks:?}, tick {tick}"
        );
        if way != Way::Ring {
            let newest: &SetPoint = view(self.input.words(&self.locals));
            let expected = limit.map_or(INITIAL, |limit| sent(ticks.newest(limit)));
            assert_eq!(cdr(newest), cdr(&expected), "{way:?}, {ticks:?}, tick {tick}");
        }
    }
}

/// The message that a node writes at `tick`, which the bus stamps.
fn message(tick: u32) -> SetPoint {
    SetPoint { altitude: f64::from(tick), yaw: f64::from(tick) * 1e-3, ..SetPoint::default() }
}

/// The message that is sent at `tick`.
fn sent(tick: u32) -> SetPoint {
    SetPoint { stamp: Time::from_ns(u64::from(tick) * TICK_NS), ..message(tick) }
}

/// The bytes of a message in a recording.
fn cdr(message: &SetPoint) -> Vec<u8> {
    [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat()
}

#[test]
fn a_tick_reads_the_same_samples_by_every_way() {
    let at_60_hz = SampleTicks::measured(1, TICK_NS, 16_666_667, 3_000_000);
    for way in WAYS {
        for ticks in [SampleTicks::every(1), SampleTicks::every(7), at_60_hz] {
            let mut connection = Connection::new(way, ticks, 0);
            for tick in 0..TICKS {
                connection.send_if_due(tick);
                connection.require_read(tick);
            }
        }
    }
}

/// With a delay, a reader steps before the publisher of the same tick or behind it.
#[test]
fn a_delayed_input_reads_the_same_samples_by_every_way_and_in_any_order() {
    for way in WAYS {
        for ticks in [SampleTicks::every(1), SampleTicks::every(7)] {
            for reads_first in [true, false] {
                let mut connection = Connection::new(way, ticks, 1);
                for tick in 0..TICKS {
                    if reads_first {
                        connection.require_read(tick);
                        connection.send_if_due(tick);
                    } else {
                        connection.send_if_due(tick);
                        connection.require_read(tick);
                    }
                }
            }
        }
    }
}

#[test]
fn what_may_not_be_sent_is_refused_on_every_way() {
    for way in WAYS {
        let mut connection = Connection::new(way, SampleTicks::every(1), 0);
        let unwritten = connection.publish(0).unwrap_err();
        assert!(matches!(unwritten, BusError::UnwrittenOutput { tick: 0, .. }), "{way:?}: {unwritten}");
        let not_finite =
            connection.send(0, SetPoint { altitude: f64::NAN, ..INITIAL }).unwrap_err().to_string();
        assert!(not_finite.contains("node `pilot` failed at tick 0"), "{way:?}: {not_finite}");
        assert!(
            not_finite.contains("`set_point` on /pilot/set_point holds altitude = NaN"),
            "{way:?}: {not_finite}"
        );
        // Neither refusal has left a trace.
        connection.send_if_due(0);
        connection.require_read(0);
    }
}
