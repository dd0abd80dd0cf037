//! The control segment, mapped: the cells of a run, its topics, its slots and their inputs.

use super::cells::{Head, InputCell, MAGIC, SlotCell, TopicCell};
use super::states::Abort;
use super::wake;
use crate::error::BusError;
use crate::names::shm_path;
use crate::place::Place;
use crate::plan::{Plan, SLOTS_PER_NODE};
use crate::shared_file;
use memmap2::MmapRaw;
use std::path::PathBuf;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// The mapped control segment of a run.
#[derive(Debug)]
pub(super) struct Segment {
    map: MmapRaw,
    counts: Counts,
    /// Place of the instance that waits here.
    place: Place,
}

/// Numbers of cells of each kind behind the head.
#[derive(Clone, Copy, Debug)]
struct Counts {
    topics: usize,
    slots: usize,
    inputs: usize,
}

impl Counts {
    fn of(plan: &Plan) -> Self {
        let (topics, slots) = (plan.topics.len(), SLOTS_PER_NODE * plan.nodes.len());
        Self { topics, slots, inputs: plan.input_count() }
    }

    fn topics_at(self) -> usize {
        size_of::<Head>()
    }

    fn slots_at(self) -> usize {
        self.topics_at() + self.topics * size_of::<TopicCell>()
    }

    fn inputs_at(self) -> usize {
        self.slots_at() + self.slots * size_of::<SlotCell>()
    }

    fn bytes(self) -> usize {
        self.inputs_at() + self.inputs * size_of::<InputCell>()
    }
}

/// The size of the control segment of `plan`.
pub(crate) fn segment_bytes(plan: &Plan) -> usize {
    Counts::of(plan).bytes()
}

fn path(plan: &Plan) -> PathBuf {
    shm_path(&plan.run_id, "control")
}

impl Segment {
    /// Creates the control segment of `plan`, readable and writable by this user alone. It cannot be opened before it
    /// is [published](Segment::publish).
    pub(super) fn create(plan: &Plan) -> Result<Self, BusError> {
        let counts = Counts::of(plan);
        let map = shared_file::create(&path(plan), counts.bytes())?;
        Ok(Self { map, counts, place: Place::Process })
    }

    /// Lets others find the segment: a process that opens it earlier finds no segment rather than half of one.
    pub(super) fn publish(&self) {
        self.head().run.magic.store(MAGIC, Release);
    }

    /// Opens the control segment of `plan` for an instance at `place`.
    pub(super) fn open(plan: &Plan, place: Place) -> Result<Self, BusError> {
        let (path, counts) = (path(plan), Counts::of(plan));
        let map = shared_file::open(&path, counts.bytes(), "the control segment of this run")?;
        let segment = Self { map, counts, place };
        if segment.head().run.magic.load(Acquire) == MAGIC {
            return Ok(segment);
        }
        let (expected, found) = ("a control segment", "other data".to_owned());
        Err(BusError::Content { path, expected, found })
    }

    /// Place of the instance that waits here.
    pub(super) fn place(&self) -> &Place {
        &self.place
    }

    pub(super) fn head(&self) -> &Head {
        &self.cells(0, 1)[0]
    }

    pub(super) fn topics(&self) -> &[TopicCell] {
        self.cells(self.counts.topics_at(), self.counts.topics)
    }

    pub(super) fn slots(&self) -> &[SlotCell] {
        self.cells(self.counts.slots_at(), self.counts.slots)
    }

    /// The inputs of the processes in all slots, in the order of [`Plan::input`].
    pub(super) fn inputs(&self) -> &[InputCell] {
        self.cells(self.counts.inputs_at(), self.counts.inputs)
    }

    /// `count` cells from byte `offset` on.
    fn cells<C>(&self, offset: usize, count: usize) -> &[C] {
        assert!(
            offset + count * size_of::<C>() <= self.map.len() && offset.is_multiple_of(align_of::<C>()),
            "{count} cells at {offset} are outside the control segment"
        );
        // SAFETY: the mapping lives as long as `self`; the cells are inside it and aligned (asserted, and its start is
        // a page's). All cells are made of atomics, of which every bit pattern is a value, and all processes of the run
        // access the bytes as such.
        unsafe { std::slice::from_raw_parts(self.map.as_mut_ptr().add(offset).cast(), count) }
    }

    /// Everything that a node or the clock sleeps on for a count.
    pub(super) fn waiters(&self) -> impl Iterator<Item = &AtomicU32> {
        let slots = self.slots().iter();
        let slots = slots.flat_map(|slot| [&slot.grant_waiter, &slot.done_waiter, &slot.other_waiter]);
        let inputs = self.inputs().iter().flat_map(|input| [&input.samples, &input.shadow]);
        slots.chain(inputs).map(|waiter| &waiter.word)
    }

    /// Wakes every sleeper, so that it sees a change that was stored before: the end of the run, or another
    /// membership.
    pub(super) fn wake_everybody(&self) {
        wake::wake_everybody(self.waiters());
        let words = self.slots().iter().flat_map(|slot| [&slot.ready, &slot.state]);
        let head = self.head();
        words.chain([&head.run.phase, &head.steering.changes]).for_each(wake::Word::wake);
    }

    /// True if the run was aborted, or this instance is to end: a sample that is not there yet may never come.
    pub(super) fn is_aborted(&self) -> bool {
        self.head().run.abort.load(Acquire) >= Abort::Told as u32 || self.place.is_cancelled()
    }

    /// True if the run was aborted and the senders have left, or this instance is to end: a sample that is not there
    /// yet never comes.
    pub(super) fn is_drained(&self) -> bool {
        self.head().run.abort.load(Acquire) >= Abort::Drained as u32 || self.place.is_cancelled()
    }

    /// Asks the clock to end the run at the next tick boundary.
    pub(super) fn request_stop(&self) {
        self.head().steering.is_stop_requested.store(1, Relaxed);
    }

    /// Notifies the supervisor that there is something to look at.
    pub(super) fn notify_supervisor(&self) {
        wake::notify(&self.head().notices.count);
    }
}
