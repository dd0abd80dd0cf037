//! The control segment: the words in shared memory by which the processes of a run pace each other.
//!
//! One cache line a slot: the run, the grant, every topic, every node, every edge. A *word* counts
//! ticks that are complete; an *edge* belongs to one reader of one word and holds the count that
//! this reader sleeps for. A writer stores its word, then looks at the edges that read it, and wakes
//! only those whose count is reached: nobody is woken for nothing, and nobody pays a system call
//! for a reader that is awake. Behind the edges every node counts its step times (`live.rs`).

use crate::error::BusError;
use crate::live::STEP_SLOTS;
use crate::plan::{InputPlan, Pace, Plan, SEATS, Wait};
use memmap2::MmapRaw;
use rustix::thread::futex;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed, Ordering::SeqCst};

const SLOT_BYTES: usize = 64;
/// Changes with the layout of the segment and the queues: processes of different versions do not fly together.
const MAGIC: u32 = 0x4855_4d37;
/// Words of a member's slot: how far it has joined, and what its seat holds.
const READY: usize = 0;
const SEAT: usize = 8;
/// Its deadlines missed, the epoch it agrees with, what it goes on from, and (a double word) its processor
/// time.
const LATE: usize = 3;
const EPOCH: usize = 9;
const HAND_OVER: usize = 10;
const CPU: usize = 2;
/// The value of an edge on which nobody sleeps.
const AWAKE: u32 = u32::MAX;
/// What stands in the place of the tick of a hold while the clock runs.
const NOT_HELD: u32 = u32::MAX;
/// How long the clock sleeps in a hold before it looks whether the run was stopped.
const HOLD_NAP: rustix::time::Timespec = rustix::time::Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
/// How long a reader with `wait = "adaptive"` polls before it sleeps: about five context switches.
const ADAPTIVE_SPIN_NS: u64 = 10_000;
/// Polls between two looks at the clock or two yields.
const POLLS: u32 = 64;

/// How far the processes of a run have come together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
#[repr(u32)]
pub enum Phase {
    /// Publishers are being created.
    Announcing = 0,
    /// Subscribers are being created.
    Connecting = 1,
    /// Ticks are granted.
    Running = 2,
}

/// A tick word of the control segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Word {
    /// Ticks that may be computed.
    Grant,
    /// Ticks of a topic whose sample has been sent.
    Topic(usize),
    /// Ticks of a topic for which its publisher's successor has sent a shadow sample.
    Shadow(usize),
    /// Ticks that a member has completed.
    Done(usize),
    /// Ticks at whose start a member has stated the state that it would hand over.
    State(usize),
}

/// An edge of the control segment: one reader of one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Edge {
    /// A member waits for the grant.
    Grant(usize),
    /// The clock waits for a member.
    Done(usize),
    /// A member waits for its predecessor or for its successor.
    Partner(usize),
    /// A member waits for an input; counted over all inputs of the run.
    Input(usize),
    /// A member waits for the shadow samples of an input; counted in the same way.
    Shadow(usize),
}

/// What a seat of a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Seat {
    /// Nobody.
    Empty = 0,
    /// A process that may make its connections.
    Joining = 1,
    /// A process that computes.
    Taken = 2,
}

/// What a successor goes on from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum HandOver {
    /// Nothing is known yet.
    Unknown = 0,
    /// The state of its predecessor: both know the same type.
    State = 1,
    /// The last sample that its predecessor sent on each output.
    LastOutput = 2,
}

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waited {
    /// The word has reached the count.
    Reached,
    /// The run is over (or aborted) and will not reach it.
    Over,
}

/// The mapped control segment of a run.
#[derive(Debug)]
pub struct Control {
    map: MmapRaw,
    topics: usize,
    members: usize,
    edges: usize,
}

/// Where the control segment of run `run_id` lies.
#[must_use]
pub fn control_path(run_id: &str) -> PathBuf {
    Path::new("/dev/shm").join(format!("{}control", shm_prefix(run_id)))
}

/// What the name of every shared-memory file of run `run_id` starts with.
#[must_use]
pub fn shm_prefix(run_id: &str) -> String {
    format!("hb_{run_id}_")
}

impl Control {
    /// Creates the control segment of `plan`, readable and writable by this user alone.
    ///
    /// # Errors
    /// If the segment exists already or shared memory cannot be had.
    pub fn create(plan: &Plan) -> Result<Self, BusError> {
        use std::os::unix::fs::OpenOptionsExt;
        let path = control_path(&plan.run_id);
        let fail = |source| BusError::File { action: "create", path: path.clone(), source };
        let file = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&path)
            .map_err(fail)?;
        crate::room::reserve(&file, &path, control_bytes(plan) as u64)?;
        let control = Self::map(plan, &file).map_err(fail)?;
        control.word(0, 2).store(plan.duration_ticks, SeqCst);
        control.set_pace(plan.pace);
        control.set_hold_tick(u32::MAX);
        control.set_join_tick(u32::MAX);
        control.word(1, 3).store(NOT_HELD, SeqCst);
        // Generation 0 of every node is there from the start.
        (0..plan.nodes.len()).for_each(|member| control.set_seat(member, Seat::Taken));
        (0..control.edge_slots()).for_each(|edge| control.edge_at(edge).store(AWAKE, SeqCst));
        // Last: who opens the segment earlier finds no segment rather than half of one.
        control.word(0, 0).store(MAGIC, SeqCst);
        Ok(control)
    }

    /// Opens the control segment of `plan`.
    ///
    /// # Errors
    /// If it does not exist or belongs to another plan.
    pub fn open(plan: &Plan) -> Result<Self, BusError> {
        let path = control_path(&plan.run_id);
        let fail = |source| BusError::File { action: "open", path: path.clone(), source };
        let file = crate::own_file::open(&path, true).map_err(fail)?;
        let length = file.metadata().map_err(fail)?.len();
        if length != control_bytes(plan) as u64 {
            return Err(BusError::Content {
                path,
                expected: "the control segment of this run",
                found: format!("{length} bytes instead of {}", control_bytes(plan)),
            });
        }
        let control = Self::map(plan, &file).map_err(fail)?;
        if control.word(0, 0).load(SeqCst) == MAGIC {
            Ok(control)
        } else {
            Err(BusError::Content { path, expected: "a control segment", found: "other data".to_owned() })
        }
    }

    fn map(plan: &Plan, file: &std::fs::File) -> std::io::Result<Self> {
        let map = MmapRaw::map_raw(file)?;
        let (topics, members, edges) = (plan.topics.len(), members(plan), SEATS * plan.edge_count());
        Ok(Self { map, topics, members, edges })
    }

    /// Word `index` (0…15) of slot `slot`.
    pub(crate) fn word(&self, slot: usize, index: usize) -> &AtomicU32 {
        let offset = slot * SLOT_BYTES + index * 4;
        assert!(index < 16 && offset + 4 <= self.map.len(), "slot {slot} is outside the control segment");
        // SAFETY: the mapping lives as long as `self`, the offset is inside it (asserted) and a
        // multiple of 4 from a page-aligned start; every process accesses these bytes as atomics only.
        unsafe { AtomicU32::from_ptr(self.map.as_mut_ptr().add(offset).cast()) }
    }

    /// Double word `index` (0…7) of slot `slot`.
    fn double_word(&self, slot: usize, index: usize) -> &AtomicU64 {
        let offset = slot * SLOT_BYTES + index * 8;
        assert!(index < 8 && offset + 8 <= self.map.len(), "slot {slot} is outside the control segment");
        // SAFETY: as in `word`; the offset is a multiple of 8, and no slot uses the same bytes both
        // as a word and as a double word.
        unsafe { AtomicU64::from_ptr(self.map.as_mut_ptr().add(offset).cast()) }
    }

    fn tick_word(&self, word: Word) -> &AtomicU32 {
        match word {
            Word::Grant => self.word(1, 0),
            Word::Topic(topic) => self.word(self.topic_slot(topic), 0),
            Word::Shadow(topic) => self.word(2 + self.topics + topic, 0),
            Word::Done(member) => self.word(self.member_slot(member), 1),
            Word::State(member) => self.word(self.member_slot(member), 2),
        }
    }

    pub(crate) fn topic_slot(&self, topic: usize) -> usize {
        2 + topic
    }

    pub(crate) fn member_slot(&self, member: usize) -> usize {
        2 + 2 * self.topics + member
    }

    /// The first of the slots that count the step times of `member`: behind those of the edges.
    pub(crate) fn step_slot(&self, member: usize) -> usize {
        2 + 2 * self.topics + self.members + self.edge_slots() + member * STEP_SLOTS
    }

    fn edge_slots(&self) -> usize {
        3 * self.members + 2 * self.edges
    }

    fn edge_at(&self, index: usize) -> &AtomicU32 {
        self.word(2 + 2 * self.topics + self.members + index, 0)
    }

    fn edge_word(&self, edge: Edge) -> &AtomicU32 {
        self.edge_at(match edge {
            Edge::Grant(member) => member,
            Edge::Done(member) => self.members + member,
            Edge::Partner(member) => 2 * self.members + member,
            Edge::Input(edge) => 3 * self.members + edge,
            Edge::Shadow(edge) => 3 * self.members + self.edges + edge,
        })
    }

    /// The count of `word`.
    pub(crate) fn count(&self, word: Word) -> u32 {
        self.tick_word(word).load(SeqCst)
    }

    /// Stores `count` in `word` and wakes those of its readers whose count is reached.
    pub(crate) fn advance(&self, word: Word, count: u32, readers: &[Edge]) {
        self.tick_word(word).store(count, SeqCst);
        for &reader in readers {
            let edge = self.edge_word(reader);
            // Both sides are sequentially consistent: either the reader sees the new count before it
            // sleeps, or this load sees what it sleeps for.
            if edge.load(SeqCst) <= count {
                wake_edge(edge);
            }
        }
    }

    /// Waits until `word` reaches `count`, or `is_over` says that it never will.
    pub(crate) fn wait(
        &self,
        word: Word,
        count: u32,
        edge: Edge,
        wait: Wait,
        is_over: impl Fn(&Self) -> bool,
    ) -> Waited {
        let word = self.tick_word(word);
        let spin = wait != Wait::Block;
        let asleep_after_ns =
            if wait == Wait::Adaptive { monotonic_ns() + ADAPTIVE_SPIN_NS } else { u64::MAX };
        loop {
            if word.load(SeqCst) >= count {
                return Waited::Reached;
            }
            if self.is_aborted() || is_over(self) {
                return Waited::Over;
            }
            if crate::process::is_terminated() {
                self.request_stop();
            }
            if spin && (wait == Wait::Spin || monotonic_ns() < asleep_after_ns) {
                poll(word, count);
            } else {
                self.sleep(word, count, self.edge_word(edge), &is_over);
            }
        }
    }

    fn sleep(&self, word: &AtomicU32, count: u32, edge: &AtomicU32, is_over: impl Fn(&Self) -> bool) {
        edge.store(count, SeqCst);
        if word.load(SeqCst) < count && !self.is_aborted() && !is_over(self) {
            // An interrupted or spurious return is caught by the caller's loop.
            let _ = futex::wait(edge, futex::Flags::empty(), count, None);
        }
        // Nothing is ordered by this store: a writer that misses it wakes somebody who is awake.
        edge.store(AWAKE, Relaxed);
    }

    /// Wakes every sleeper, so that it looks whether the run is over. A process that died may have noted that it
    /// wakes somebody and not have done it any more: so what the edges say does not count.
    fn wake_everybody(&self) {
        for edge in 0..self.edge_slots() {
            self.edge_at(edge).store(AWAKE, SeqCst);
            wake_all(self.edge_at(edge));
        }
        wake_all(self.word(0, 1));
        wake_all(self.word(1, 9));
        for member in 0..self.members {
            [READY, SEAT].into_iter().for_each(|index| wake_all(self.word(self.member_slot(member), index)));
        }
    }

    /// The phase of the run.
    #[must_use]
    pub fn phase(&self) -> Phase {
        match self.word(0, 1).load(SeqCst) {
            0 => Phase::Announcing,
            1 => Phase::Connecting,
            _ => Phase::Running,
        }
    }

    /// Moves the run to `phase` and wakes those who wait for it.
    pub(crate) fn set_phase(&self, phase: Phase) {
        self.word(0, 1).store(phase as u32, SeqCst);
        wake_all(self.word(0, 1));
    }

    /// Waits until the run has reached `phase`.
    pub(crate) fn wait_phase(&self, phase: Phase) -> Waited {
        self.wait_plain(self.word(0, 1), phase as u32)
    }

    /// Notes that `member` is ready for `phase`.
    pub(crate) fn set_ready(&self, member: usize, phase: Phase) {
        let word = self.word(self.member_slot(member), READY);
        word.store(phase as u32, SeqCst);
        wake_all(word);
        self.tell_supervisor();
    }

    /// Waits until `member` is ready for `phase`; only for joining, where nobody counts microseconds.
    pub(crate) fn wait_ready(&self, member: usize, phase: Phase) -> Waited {
        self.wait_plain(self.word(self.member_slot(member), READY), phase as u32)
    }

    /// Whether `member` has reached `phase`.
    #[must_use]
    pub fn is_ready(&self, member: usize, phase: Phase) -> bool {
        self.word(self.member_slot(member), READY).load(SeqCst) >= phase as u32
    }

    fn wait_plain(&self, word: &AtomicU32, value: u32) -> Waited {
        loop {
            let found = word.load(SeqCst);
            if found >= value {
                return Waited::Reached;
            }
            if self.is_aborted() {
                return Waited::Over;
            }
            // The timeout covers an abort that falls between the look at the flag and the sleep.
            let timeout = rustix::time::Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
            let _ = futex::wait(word, futex::Flags::empty(), found, Some(&timeout));
        }
    }

    /// The tick at which the run ends; it shrinks when the run is stopped.
    #[must_use]
    pub fn end_tick(&self) -> u32 {
        self.word(0, 2).load(SeqCst)
    }

    /// Ends the run at `tick`, which nobody may have passed.
    pub(crate) fn set_end_tick(&self, tick: u32) {
        self.word(0, 2).store(tick, SeqCst);
        self.wake_everybody();
    }

    /// Ends the run at once: every wait returns.
    pub fn abort(&self) {
        self.word(0, 3).store(1, SeqCst);
        // A sleeper stores its edge before it looks at the flag, so this wakes it or it sees the flag.
        self.wake_everybody();
    }

    /// Whether the run was aborted.
    #[must_use]
    pub fn is_aborted(&self) -> bool {
        self.word(0, 3).load(SeqCst) != 0
    }

    /// Asks the clock to end the run at the next tick boundary.
    pub fn request_stop(&self) {
        self.word(0, 4).store(1, SeqCst);
    }

    /// Whether a stop was asked for.
    #[must_use]
    pub fn is_stop_requested(&self) -> bool {
        self.word(0, 4).load(SeqCst) != 0
    }

    /// What a seat holds.
    #[must_use]
    pub fn seat(&self, member: usize) -> Seat {
        match self.word(self.member_slot(member), SEAT).load(SeqCst) {
            0 => Seat::Empty,
            1 => Seat::Joining,
            _ => Seat::Taken,
        }
    }

    /// States what a seat holds, and wakes the process that waits for it.
    pub fn set_seat(&self, member: usize, seat: Seat) {
        let word = self.word(self.member_slot(member), SEAT);
        word.store(seat as u32, SeqCst);
        wake_all(word);
    }

    /// Empties a seat, for another process.
    pub fn clear_seat(&self, member: usize) {
        self.set_seat(member, Seat::Empty);
        for word in [READY, LATE, EPOCH, HAND_OVER] {
            self.word(self.member_slot(member), word).store(0, SeqCst);
        }
        self.set_cpu_ns(member, 0);
        self.tick_word(Word::Done(member)).store(0, SeqCst);
        self.tick_word(Word::State(member)).store(0, SeqCst);
    }

    /// Has the process in a seat begin at `tick`.
    pub fn set_first_tick(&self, member: usize, tick: u32) {
        self.tick_word(Word::Done(member)).store(tick, SeqCst);
    }

    /// Has the shadow samples of `topic` begin at `tick`.
    pub fn start_shadow(&self, topic: usize, tick: u32) {
        self.tick_word(Word::Shadow(topic)).store(tick, SeqCst);
    }

    /// Waits until the seat of `member` is as far as `seat`.
    pub(crate) fn wait_seat(&self, member: usize, seat: Seat) -> Waited {
        self.wait_plain(self.word(self.member_slot(member), SEAT), seat as u32)
    }

    /// The number of the newest roster.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.word(1, 6).load(SeqCst)
    }

    /// Makes the roster number `epoch` the newest one, and wakes everybody to look at it.
    pub fn set_epoch(&self, epoch: u32) {
        self.word(1, 6).store(epoch, SeqCst);
        self.wake_everybody();
    }

    /// Notes that `member` agrees with the roster number `epoch`.
    pub(crate) fn agree(&self, member: usize, epoch: u32) {
        self.word(self.member_slot(member), EPOCH).store(epoch, SeqCst);
        self.tell_supervisor();
    }

    /// Ticks that may be computed.
    #[must_use]
    pub fn granted_ticks(&self) -> u32 {
        self.count(Word::Grant)
    }

    /// The newest roster with which `member` agrees.
    #[must_use]
    pub fn agreed_epoch(&self, member: usize) -> u32 {
        self.word(self.member_slot(member), EPOCH).load(SeqCst)
    }

    /// Notes what `member` goes on from.
    pub(crate) fn set_hand_over(&self, member: usize, hand_over: HandOver) {
        self.word(self.member_slot(member), HAND_OVER).store(hand_over as u32, SeqCst);
    }

    /// What `member` goes on from.
    #[must_use]
    pub fn hand_over(&self, member: usize) -> HandOver {
        match self.word(self.member_slot(member), HAND_OVER).load(SeqCst) {
            0 => HandOver::Unknown,
            1 => HandOver::State,
            _ => HandOver::LastOutput,
        }
    }

    /// Whether `member`, whose inputs are `inputs`, has all it needs for its next tick: if it does not come on
    /// then, it is at fault itself. A member that sleeps does not count: nobody has come as far as it waits for, or it
    /// would have been woken. A recorder sleeps until samples have gathered that the tick alone does not need.
    #[must_use]
    pub fn can_compute(&self, plan: &Plan, member: usize, inputs: &[InputPlan]) -> bool {
        let tick = self.done(member);
        let has = |input: &InputPlan| {
            self.count(Word::Topic(input.topic)) >= (tick.saturating_add(1)).saturating_sub(input.delay_ticks)
        };
        tick < self.end_tick()
            && self.count(Word::Grant) > tick
            && inputs.iter().all(has)
            && self.awaited_topic(plan, member, inputs).is_none()
            && !self.awaits_partner(member)
    }

    /// Ticks that `member` has completed, also those after the end of the run.
    #[must_use]
    pub fn done(&self, member: usize) -> u32 {
        self.count(Word::Done(member))
    }

    /// The tick boundary at which a user wants the clock to wait; `u32::MAX` if nobody does.
    #[must_use]
    pub fn hold_tick(&self) -> u32 {
        self.word(1, 2).load(SeqCst)
    }

    /// Has the clock wait at the boundary before `tick`, or where it is if it has come further; `u32::MAX`
    /// lets it run.
    pub fn set_hold_tick(&self, tick: u32) {
        self.word(1, 2).store(tick, SeqCst);
        self.tell_clock();
    }

    /// The same for the supervisor, who holds the clock where a process joins.
    pub fn set_join_tick(&self, tick: u32) {
        if self.word(1, 8).swap(tick, SeqCst) != tick {
            self.tell_clock();
        }
    }

    /// The boundary beyond which no tick is granted now.
    pub(crate) fn boundary(&self) -> u32 {
        self.hold_tick().min(self.word(1, 8).load(SeqCst))
    }

    fn tell_clock(&self) {
        self.word(1, 9).fetch_add(1, SeqCst);
        wake_all(self.word(1, 9));
    }

    /// The boundary at which the clock waits now: every node has completed the ticks before it, and none
    /// has begun the next.
    #[must_use]
    pub fn held_at(&self) -> Option<u32> {
        Some(self.word(1, 3).load(SeqCst)).filter(|&tick| tick != NOT_HELD)
    }

    /// Whether the clock has to act next: every tick that it granted is completed, and no hold keeps it from granting
    /// more, or it is still in a hold that was lifted.
    #[must_use]
    pub fn awaits_clock(&self) -> bool {
        let granted = self.granted_ticks();
        match self.held_at() {
            Some(tick) => self.boundary() > tick,
            None => granted < self.end_tick() && self.computing().all(|member| self.done(member) >= granted),
        }
    }

    /// Waits in the hold at `tick` until it is lifted or the run is stopped.
    pub(crate) fn hold(&self, tick: u32, is_over: impl Fn() -> bool) {
        let is_lifted = || self.boundary() > tick || self.is_aborted() || is_over();
        loop {
            self.word(1, 3).store(tick, SeqCst);
            self.tell_supervisor();
            loop {
                let changes = self.word(1, 9).load(SeqCst);
                if is_lifted() {
                    break;
                }
                let _ = futex::wait(self.word(1, 9), futex::Flags::empty(), changes, Some(&HOLD_NAP));
            }
            self.word(1, 3).store(NOT_HELD, SeqCst);
            // Who asked for another hold before this store may have taken the lifted one for it: so it is kept.
            if is_lifted() {
                return;
            }
        }
    }

    /// The pace at which the clock grants ticks.
    #[must_use]
    pub fn pace(&self) -> Pace {
        let factor = f64::from_bits(self.double_word(1, 2).load(SeqCst));
        if factor > 0.0 { Pace::Factor(factor) } else { Pace::Free }
    }

    /// Changes the pace; the clock follows at its next grant.
    pub fn set_pace(&self, pace: Pace) {
        let factor = if let Pace::Factor(factor) = pace { factor } else { 0.0 };
        self.double_word(1, 2).store(factor.to_bits(), SeqCst);
    }

    /// Wakes the supervisor, which looks at the run.
    pub(crate) fn tell_supervisor(&self) {
        self.word(1, 7).fetch_add(1, SeqCst);
        wake_all(self.word(1, 7));
    }

    /// The count of what the supervisor was told: to be read before a look at the run, and waited on after it.
    #[must_use]
    pub fn news(&self) -> u32 {
        self.word(1, 7).load(SeqCst)
    }

    /// Sleeps until there is something to look at since `news`, at most `timeout`.
    pub fn await_news(&self, news: u32, timeout: std::time::Duration) {
        let timeout = rustix::time::Timespec {
            tv_sec: i64::try_from(timeout.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: timeout.subsec_nanos().into(),
        };
        let _ = futex::wait(self.word(1, 7), futex::Flags::empty(), news, Some(&timeout));
    }

    /// Deadlines that were missed: a node had not finished the tick before, or the clock itself was more than
    /// a tick late.
    #[must_use]
    pub fn missed_deadlines(&self) -> u32 {
        self.word(0, 5).load(SeqCst)
    }

    /// Counts a missed deadline, and the members that were late; none where the clock itself was.
    pub(crate) fn count_missed_deadline(&self, late: impl Iterator<Item = usize>) {
        self.word(0, 5).fetch_add(1, SeqCst);
        late.for_each(|member| {
            self.word(self.member_slot(member), LATE).fetch_add(1, SeqCst);
        });
    }

    /// Deadlines at which `member` was late.
    #[must_use]
    pub fn late_count(&self, member: usize) -> u32 {
        self.word(self.member_slot(member), LATE).load(SeqCst)
    }

    /// Ticks that `member` has completed.
    #[must_use]
    pub fn completed_by(&self, member: usize) -> u32 {
        self.count(Word::Done(member)).min(self.end_tick())
    }

    /// Whether `member` has completed the run.
    #[must_use]
    pub fn has_completed(&self, member: usize) -> bool {
        self.count(Word::Done(member)) >= self.end_tick()
    }

    /// The members that compute, in ascending order.
    pub fn computing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.members).filter(|&member| self.seat(member) == Seat::Taken)
    }

    /// Ticks that every node has completed.
    #[must_use]
    pub fn completed_ticks(&self) -> u32 {
        let fewest = self.computing().map(|member| self.count(Word::Done(member))).min();
        fewest.unwrap_or(0).min(self.end_tick())
    }

    /// The topic for which `member`, whose inputs are `inputs`, sleeps; `None` for one that computes, spins, or
    /// waits for something else.
    #[must_use]
    pub fn awaited_topic(&self, plan: &Plan, member: usize, inputs: &[InputPlan]) -> Option<usize> {
        let sleeps = |edge: Edge| self.edge_word(edge).load(SeqCst) != AWAKE;
        let mut inputs = inputs.iter().enumerate();
        let awaited = inputs.find(|(index, _)| {
            let edge = plan.edge(member, *index);
            sleeps(Edge::Input(edge)) || sleeps(Edge::Shadow(edge))
        });
        awaited.map(|(_, input)| input.topic)
    }

    /// Whether `member` sleeps until its predecessor or its successor has come as far as it must.
    #[must_use]
    pub fn awaits_partner(&self, member: usize) -> bool {
        self.edge_word(Edge::Partner(member)).load(SeqCst) != AWAKE
    }

    /// Whether `member` sleeps until the clock grants its next tick.
    #[must_use]
    pub fn awaits_grant(&self, member: usize) -> bool {
        self.edge_word(Edge::Grant(member)).load(SeqCst) != AWAKE
    }

    /// Host time at which the first and the last tick was granted and completed, in nanoseconds of the
    /// monotonic clock; zero until then.
    #[must_use]
    pub fn host_span_ns(&self) -> (u64, u64) {
        (self.double_word(0, 4).load(SeqCst), self.double_word(0, 5).load(SeqCst))
    }

    pub(crate) fn set_host_start(&self) {
        self.double_word(0, 4).store(monotonic_ns(), SeqCst);
    }

    pub(crate) fn set_host_end(&self) {
        self.double_word(0, 5).store(monotonic_ns(), SeqCst);
    }

    /// Processor time that `member` used between tick 0 and its last tick, in nanoseconds.
    #[must_use]
    pub fn cpu_ns(&self, member: usize) -> u64 {
        self.double_word(self.member_slot(member), CPU).load(SeqCst)
    }

    pub(crate) fn set_cpu_ns(&self, member: usize, ns: u64) {
        self.double_word(self.member_slot(member), CPU).store(ns, SeqCst);
    }

    /// Processor time of the clock service, in nanoseconds.
    #[must_use]
    pub fn clock_cpu_ns(&self) -> u64 {
        self.double_word(0, 6).load(SeqCst)
    }

    pub(crate) fn set_clock_cpu_ns(&self, ns: u64) {
        self.double_word(0, 6).store(ns, SeqCst);
    }
}

fn members(plan: &Plan) -> usize {
    SEATS * plan.nodes.len()
}

/// The size of the control segment of `plan`.
pub(crate) fn control_bytes(plan: &Plan) -> usize {
    let edges = 3 * members(plan) + 2 * SEATS * plan.edge_count();
    SLOT_BYTES * (2 + 2 * plan.topics.len() + members(plan) + edges + STEP_SLOTS * members(plan))
}

fn wake_edge(edge: &AtomicU32) {
    if edge.swap(AWAKE, SeqCst) != AWAKE {
        wake_all(edge);
    }
}

fn wake_all(word: &AtomicU32) {
    let _ = futex::wake(word, futex::Flags::empty(), i32::MAX as u32);
}

/// Polls `word` a few times, then lets another process have the core.
fn poll(word: &AtomicU32, count: u32) {
    for _ in 0..POLLS {
        if word.load(SeqCst) >= count {
            return;
        }
        std::hint::spin_loop();
    }
    rustix::thread::sched_yield();
}

/// The host's monotonic clock in nanoseconds.
#[must_use]
pub fn monotonic_ns() -> u64 {
    clock_ns(rustix::time::ClockId::Monotonic)
}

/// Processor time of this process in nanoseconds.
pub(crate) fn process_cpu_ns() -> u64 {
    clock_ns(rustix::time::ClockId::ProcessCPUTime)
}

#[allow(clippy::cast_sign_loss, reason = "these clocks start at zero and only grow")]
fn clock_ns(clock: rustix::time::ClockId) -> u64 {
    let time = rustix::time::clock_gettime(clock);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::{Control, Edge, Waited, Word, control_path};
    use crate::plan::{InputPlan, NodePlan, Pace, Plan, TopicPlan, Wait};

    fn plan() -> Plan {
        let input = InputPlan { port: "in".to_owned(), topic: 0, delay_ticks: 0, initial: None };
        let node = NodePlan {
            name: "node".to_owned(),
            period_ticks: 1,
            wait: Wait::Block,
            cpu: None,
            inputs: vec![input],
            outputs: vec![],
            parameters: serde_json::Value::Null,
            restarts: false,
        };
        let topic = TopicPlan { name: "/t".to_owned(), type_name: "a/msg/B".to_owned(), period_ticks: 1 };
        Plan {
            run_id: format!("control-{:x}-{:x}", std::process::id(), super::monotonic_ns()),
            seed: 0,
            tick_ns: 1,
            duration_ticks: 100,
            window_ticks: 1,
            pace: Pace::Free,
            clock_cpu: None,
            profile: false,
            lock_memory: false,
            topics: vec![topic],
            nodes: vec![node],
        }
    }

    fn with_control(test: impl FnOnce(&Control)) {
        let plan = plan();
        let control = Control::create(&plan).unwrap();
        assert!(Control::create(&plan).is_err(), "two runs never share a segment");
        test(&control);
        std::fs::remove_file(control_path(&plan.run_id)).unwrap();
    }

    #[test]
    fn a_sleeper_is_woken_when_its_count_is_reached_however_it_waits() {
        with_control(|control| {
            for (round, wait) in [Wait::Block, Wait::Spin, Wait::Adaptive].into_iter().enumerate() {
                let target = 1000 * (round as u32 + 1);
                std::thread::scope(|scope| {
                    let sleeper =
                        scope.spawn(|| control.wait(Word::Topic(0), target, Edge::Input(0), wait, |_| false));
                    let start = control.count(Word::Topic(0));
                    (start + 1..=target).for_each(|n| control.advance(Word::Topic(0), n, &[Edge::Input(0)]));
                    assert_eq!(sleeper.join().unwrap(), Waited::Reached);
                });
            }
        });
    }

    #[test]
    fn two_sides_hand_over_a_hundred_thousand_times_without_losing_a_wake_up() {
        with_control(|control| {
            let rounds = 100_000;
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    for round in 1..=rounds {
                        control.wait(Word::Topic(0), round, Edge::Input(0), Wait::Block, |_| false);
                        control.advance(Word::Done(0), round, &[Edge::Done(0)]);
                    }
                });
                for round in 1..=rounds {
                    control.advance(Word::Topic(0), round, &[Edge::Input(0)]);
                    control.wait(Word::Done(0), round, Edge::Done(0), Wait::Block, |_| false);
                }
            });
            assert_eq!(control.count(Word::Done(0)), rounds);
        });
    }

    #[test]
    fn an_abort_and_an_earlier_end_wake_everybody() {
        with_control(|control| {
            std::thread::scope(|scope| {
                let over = |control: &Control| control.end_tick() <= 50;
                let sleeper =
                    scope.spawn(move || control.wait(Word::Grant, 60, Edge::Grant(0), Wait::Block, over));
                control.set_end_tick(50);
                assert_eq!(sleeper.join().unwrap(), Waited::Over);
                let sleeper =
                    scope.spawn(|| control.wait(Word::Topic(0), 1, Edge::Input(0), Wait::Block, |_| false));
                control.abort();
                assert_eq!(sleeper.join().unwrap(), Waited::Over);
            });
        });
    }
}
