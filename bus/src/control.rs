//! The control segment: the words in shared memory by which the processes of a run pace each other.
//!
//! One cache line a slot: the run, the grant, every topic, every node, every waiter. A *word* counts
//! ticks that are complete; an *waiter* belongs to one reader of one word and holds the count that
//! this reader sleeps for. A writer stores its word, then looks at the waiters that read it, and wakes
//! only those whose count is reached: nobody is woken for nothing, and nobody pays a system call
//! for a reader that is awake. Behind the waiters every node counts its step times (`live.rs`).

use crate::error::BusError;
use crate::live::STEP_LINES;
use crate::plan::{InputPlan, Pace, Plan, SLOTS_PER_NODE, Wait};
use memmap2::MmapRaw;
use rustix::thread::futex;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed, Ordering::SeqCst};

const LINE_BYTES: usize = 64;
/// Changes with the layout of the segment and the queues: processes of different versions do not fly together.
const MAGIC: u32 = 0x4855_4d37;
/// Words of a slot: how far its process has joined, and what it holds.
const READY: usize = 0;
const STATE: usize = 8;
/// Its deadlines missed, the epoch it agrees with, what it goes on from, and (a double word) its processor
/// time.
const LATE: usize = 3;
const EPOCH: usize = 9;
const TRANSFER: usize = 10;
const CPU: usize = 2;
/// The value of a waiter on which nobody sleeps.
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
pub(crate) enum Sequence {
    /// Ticks that may be computed.
    Grant,
    /// Ticks of a topic whose sample has been sent.
    Topic(usize),
    /// Ticks of a topic for which its publisher's successor has sent a shadow sample.
    Shadow(usize),
    /// Ticks that a slot has completed.
    Done(usize),
    /// Ticks at whose start a slot has stated the state that it would hand over.
    State(usize),
}

/// A waiter of the control segment: one reader of one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waiter {
    /// A slot waits for the grant.
    Grant(usize),
    /// The clock waits for a slot.
    Done(usize),
    /// A slot waits for its predecessor or for its successor.
    Replacement(usize),
    /// A slot waits for an input; counted over all inputs of the run.
    Input(usize),
    /// A slot waits for the shadow samples of an input; counted in the same way.
    Shadow(usize),
}

/// What a slot of a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum SlotState {
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
pub enum Transfer {
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
    slots: usize,
    waiters: usize,
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
        (0..plan.nodes.len()).for_each(|slot| control.set_slot_state(slot, SlotState::Taken));
        (0..control.waiter_count()).for_each(|waiter| control.waiter_at(waiter).store(AWAKE, SeqCst));
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
        let file = crate::user_file::open(&path, true).map_err(fail)?;
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
        let (topics, slots, waiters) =
            (plan.topics.len(), slots(plan), SLOTS_PER_NODE * plan.input_waiters());
        Ok(Self { map, topics, slots, waiters })
    }

    /// Word `index` (0…15) of slot `slot`.
    pub(crate) fn word(&self, slot: usize, index: usize) -> &AtomicU32 {
        let offset = slot * LINE_BYTES + index * 4;
        assert!(index < 16 && offset + 4 <= self.map.len(), "slot {slot} is outside the control segment");
        // SAFETY: the mapping lives as long as `self`, the offset is inside it (asserted) and a
        // multiple of 4 from a page-aligned start; every process accesses these bytes as atomics only.
        unsafe { AtomicU32::from_ptr(self.map.as_mut_ptr().add(offset).cast()) }
    }

    /// Double word `index` (0…7) of slot `slot`.
    fn double_word(&self, slot: usize, index: usize) -> &AtomicU64 {
        let offset = slot * LINE_BYTES + index * 8;
        assert!(index < 8 && offset + 8 <= self.map.len(), "slot {slot} is outside the control segment");
        // SAFETY: as in `word`; the offset is a multiple of 8, and no slot uses the same bytes both
        // as a word and as a double word.
        unsafe { AtomicU64::from_ptr(self.map.as_mut_ptr().add(offset).cast()) }
    }

    fn tick_word(&self, word: Sequence) -> &AtomicU32 {
        match word {
            Sequence::Grant => self.word(1, 0),
            Sequence::Topic(topic) => self.word(self.topic_line(topic), 0),
            Sequence::Shadow(topic) => self.word(2 + self.topics + topic, 0),
            Sequence::Done(slot) => self.word(self.slot_line(slot), 1),
            Sequence::State(slot) => self.word(self.slot_line(slot), 2),
        }
    }

    pub(crate) fn topic_line(&self, topic: usize) -> usize {
        2 + topic
    }

    pub(crate) fn slot_line(&self, slot: usize) -> usize {
        2 + 2 * self.topics + slot
    }

    /// The first of the slots that count the step times of `slot`: behind those of the waiters.
    pub(crate) fn step_line(&self, slot: usize) -> usize {
        2 + 2 * self.topics + self.slots + self.waiter_count() + slot * STEP_LINES
    }

    fn waiter_count(&self) -> usize {
        3 * self.slots + 2 * self.waiters
    }

    fn waiter_at(&self, index: usize) -> &AtomicU32 {
        self.word(2 + 2 * self.topics + self.slots + index, 0)
    }

    fn waiter_word(&self, waiter: Waiter) -> &AtomicU32 {
        self.waiter_at(match waiter {
            Waiter::Grant(slot) => slot,
            Waiter::Done(slot) => self.slots + slot,
            Waiter::Replacement(slot) => 2 * self.slots + slot,
            Waiter::Input(waiter) => 3 * self.slots + waiter,
            Waiter::Shadow(waiter) => 3 * self.slots + self.waiters + waiter,
        })
    }

    /// The count of `word`.
    pub(crate) fn count(&self, word: Sequence) -> u32 {
        self.tick_word(word).load(SeqCst)
    }

    /// Stores `count` in `word` and wakes those of its readers whose count is reached.
    pub(crate) fn advance(&self, word: Sequence, count: u32, readers: &[Waiter]) {
        self.tick_word(word).store(count, SeqCst);
        for &reader in readers {
            let waiter = self.waiter_word(reader);
            // Both sides are sequentially consistent: either the reader sees the new count before it
            // sleeps, or this load sees what it sleeps for.
            if waiter.load(SeqCst) <= count {
                wake_waiter(waiter);
            }
        }
    }

    /// Waits until `word` reaches `count`, or `is_over` says that it never will.
    pub(crate) fn wait(
        &self,
        word: Sequence,
        count: u32,
        waiter: Waiter,
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
                self.sleep(word, count, self.waiter_word(waiter), &is_over);
            }
        }
    }

    fn sleep(&self, word: &AtomicU32, count: u32, waiter: &AtomicU32, is_over: impl Fn(&Self) -> bool) {
        waiter.store(count, SeqCst);
        if word.load(SeqCst) < count && !self.is_aborted() && !is_over(self) {
            // An interrupted or spurious return is caught by the caller's loop.
            let _ = futex::wait(waiter, futex::Flags::empty(), count, None);
        }
        // Nothing is ordered by this store: a writer that misses it wakes somebody who is awake.
        waiter.store(AWAKE, Relaxed);
    }

    /// Wakes every sleeper, so that it looks whether the run is over. A process that died may have noted that it
    /// wakes somebody and not have done it any more: so what the waiters say does not count.
    fn wake_everybody(&self) {
        for waiter in 0..self.waiter_count() {
            self.waiter_at(waiter).store(AWAKE, SeqCst);
            wake_all(self.waiter_at(waiter));
        }
        wake_all(self.word(0, 1));
        wake_all(self.word(1, 9));
        for slot in 0..self.slots {
            [READY, STATE].into_iter().for_each(|index| wake_all(self.word(self.slot_line(slot), index)));
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

    /// Notes that `slot` is ready for `phase`.
    pub(crate) fn set_ready(&self, slot: usize, phase: Phase) {
        let word = self.word(self.slot_line(slot), READY);
        word.store(phase as u32, SeqCst);
        wake_all(word);
        self.notify_supervisor();
    }

    /// Waits until `slot` is ready for `phase`; only for joining, where nobody counts microseconds.
    pub(crate) fn wait_ready(&self, slot: usize, phase: Phase) -> Waited {
        self.wait_plain(self.word(self.slot_line(slot), READY), phase as u32)
    }

    /// Whether `slot` has reached `phase`.
    #[must_use]
    pub fn is_ready(&self, slot: usize, phase: Phase) -> bool {
        self.word(self.slot_line(slot), READY).load(SeqCst) >= phase as u32
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
        // A sleeper stores its waiter before it looks at the flag, so this wakes it or it sees the flag.
        self.wake_everybody();
    }

    /// Whether the run was aborted.
    #[must_use]
    pub fn is_aborted(&self) -> bool {
        self.word(0, 3).load(SeqCst) != 0 || crate::hosted::is_cancelled()
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

    /// What a slot holds.
    #[must_use]
    pub fn slot_state(&self, slot: usize) -> SlotState {
        match self.word(self.slot_line(slot), STATE).load(SeqCst) {
            0 => SlotState::Empty,
            1 => SlotState::Joining,
            _ => SlotState::Taken,
        }
    }

    /// States what a slot holds, and wakes the process that waits for it.
    pub fn set_slot_state(&self, slot: usize, state: SlotState) {
        let word = self.word(self.slot_line(slot), STATE);
        word.store(state as u32, SeqCst);
        wake_all(word);
    }

    /// Empties a slot, for another process.
    pub fn clear_slot(&self, slot: usize) {
        self.set_slot_state(slot, SlotState::Empty);
        for word in [READY, LATE, EPOCH, TRANSFER] {
            self.word(self.slot_line(slot), word).store(0, SeqCst);
        }
        self.set_cpu_ns(slot, 0);
        self.tick_word(Sequence::Done(slot)).store(0, SeqCst);
        self.tick_word(Sequence::State(slot)).store(0, SeqCst);
    }

    /// Has the process in a slot begin at `tick`.
    pub fn set_first_tick(&self, slot: usize, tick: u32) {
        self.tick_word(Sequence::Done(slot)).store(tick, SeqCst);
    }

    /// Has the shadow samples of `topic` begin at `tick`.
    pub fn start_shadow(&self, topic: usize, tick: u32) {
        self.tick_word(Sequence::Shadow(topic)).store(tick, SeqCst);
    }

    /// Waits until `slot` is as far as `state`.
    pub(crate) fn wait_slot(&self, slot: usize, state: SlotState) -> Waited {
        self.wait_plain(self.word(self.slot_line(slot), STATE), state as u32)
    }

    /// The number of the newest membership.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.word(1, 6).load(SeqCst)
    }

    /// Makes the membership number `epoch` the newest one, and wakes everybody to look at it.
    pub fn set_epoch(&self, epoch: u32) {
        self.word(1, 6).store(epoch, SeqCst);
        self.wake_everybody();
    }

    /// Notes that `slot` agrees with the membership number `epoch`.
    pub(crate) fn acknowledge(&self, slot: usize, epoch: u32) {
        self.word(self.slot_line(slot), EPOCH).store(epoch, SeqCst);
        self.notify_supervisor();
    }

    /// Ticks that may be computed.
    #[must_use]
    pub fn granted_ticks(&self) -> u32 {
        self.count(Sequence::Grant)
    }

    /// The newest membership with which `slot` agrees.
    #[must_use]
    pub fn acknowledged_epoch(&self, slot: usize) -> u32 {
        self.word(self.slot_line(slot), EPOCH).load(SeqCst)
    }

    /// Notes what `slot` goes on from.
    pub(crate) fn set_transfer(&self, slot: usize, transfer: Transfer) {
        self.word(self.slot_line(slot), TRANSFER).store(transfer as u32, SeqCst);
    }

    /// What `slot` goes on from.
    #[must_use]
    pub fn transfer(&self, slot: usize) -> Transfer {
        match self.word(self.slot_line(slot), TRANSFER).load(SeqCst) {
            0 => Transfer::Unknown,
            1 => Transfer::State,
            _ => Transfer::LastOutput,
        }
    }

    /// Whether `slot`, whose inputs are `inputs`, has all it needs for its next tick: if it does not come on
    /// then, it is at fault itself. A slot that sleeps does not count: nobody has come as far as it waits for, or it
    /// would have been woken. A recorder sleeps until samples have gathered that the tick alone does not need.
    #[must_use]
    pub fn can_compute(&self, plan: &Plan, slot: usize, inputs: &[InputPlan]) -> bool {
        let tick = self.done(slot);
        let has = |input: &InputPlan| {
            self.count(Sequence::Topic(input.topic))
                >= (tick.saturating_add(1)).saturating_sub(input.delay_ticks)
        };
        tick < self.end_tick()
            && self.count(Sequence::Grant) > tick
            && inputs.iter().all(has)
            && self.awaited_topic(plan, slot, inputs).is_none()
            && !self.awaits_replacement(slot)
    }

    /// Ticks that `slot` has completed, also those after the end of the run.
    #[must_use]
    pub fn done(&self, slot: usize) -> u32 {
        self.count(Sequence::Done(slot))
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
        self.notify_clock();
    }

    /// The same for the supervisor, who holds the clock where a process joins.
    pub fn set_join_tick(&self, tick: u32) {
        if self.word(1, 8).swap(tick, SeqCst) != tick {
            self.notify_clock();
        }
    }

    /// The boundary beyond which no tick is granted now.
    pub(crate) fn boundary(&self) -> u32 {
        self.hold_tick().min(self.word(1, 8).load(SeqCst))
    }

    fn notify_clock(&self) {
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
            None => granted < self.end_tick() && self.computing().all(|slot| self.done(slot) >= granted),
        }
    }

    /// Waits in the hold at `tick` until it is lifted or the run is stopped.
    pub(crate) fn hold(&self, tick: u32, is_over: impl Fn() -> bool) {
        let is_lifted = || self.boundary() > tick || self.is_aborted() || is_over();
        loop {
            self.word(1, 3).store(tick, SeqCst);
            self.notify_supervisor();
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
    pub(crate) fn notify_supervisor(&self) {
        self.word(1, 7).fetch_add(1, SeqCst);
        wake_all(self.word(1, 7));
    }

    /// The count of what the supervisor was told: to be read before a look at the run, and waited on after it.
    #[must_use]
    pub fn notifications(&self) -> u32 {
        self.word(1, 7).load(SeqCst)
    }

    /// Sleeps until there is something to look at since `notifications`, at most `timeout`.
    pub fn await_notification(&self, notifications: u32, timeout: std::time::Duration) {
        let timeout = rustix::time::Timespec {
            tv_sec: i64::try_from(timeout.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: timeout.subsec_nanos().into(),
        };
        let _ = futex::wait(self.word(1, 7), futex::Flags::empty(), notifications, Some(&timeout));
    }

    /// Deadlines that were missed: a node had not finished the tick before, or the clock itself was more than
    /// a tick late.
    #[must_use]
    pub fn missed_deadlines(&self) -> u32 {
        self.word(0, 5).load(SeqCst)
    }

    /// Counts a missed deadline, and the slots that were late; none where the clock itself was.
    pub(crate) fn count_missed_deadline(&self, late: impl Iterator<Item = usize>) {
        self.word(0, 5).fetch_add(1, SeqCst);
        late.for_each(|slot| {
            self.word(self.slot_line(slot), LATE).fetch_add(1, SeqCst);
        });
    }

    /// Deadlines at which `slot` was late.
    #[must_use]
    pub fn late_count(&self, slot: usize) -> u32 {
        self.word(self.slot_line(slot), LATE).load(SeqCst)
    }

    /// Ticks that `slot` has completed.
    #[must_use]
    pub fn completed_by(&self, slot: usize) -> u32 {
        self.count(Sequence::Done(slot)).min(self.end_tick())
    }

    /// Whether `slot` has completed the run.
    #[must_use]
    pub fn has_completed(&self, slot: usize) -> bool {
        self.count(Sequence::Done(slot)) >= self.end_tick()
    }

    /// The slots that compute, in ascending order.
    pub fn computing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.slots).filter(|&slot| self.slot_state(slot) == SlotState::Taken)
    }

    /// Ticks that every node has completed.
    #[must_use]
    pub fn completed_ticks(&self) -> u32 {
        let fewest = self.computing().map(|slot| self.count(Sequence::Done(slot))).min();
        fewest.unwrap_or(0).min(self.end_tick())
    }

    /// The topic for which `slot`, whose inputs are `inputs`, sleeps; `None` for one that computes, spins, or
    /// waits for something else.
    #[must_use]
    pub fn awaited_topic(&self, plan: &Plan, slot: usize, inputs: &[InputPlan]) -> Option<usize> {
        let sleeps = |waiter: Waiter| self.waiter_word(waiter).load(SeqCst) != AWAKE;
        let mut inputs = inputs.iter().enumerate();
        let awaited = inputs.find(|(index, _)| {
            let waiter = plan.input_waiter(slot, *index);
            sleeps(Waiter::Input(waiter)) || sleeps(Waiter::Shadow(waiter))
        });
        awaited.map(|(_, input)| input.topic)
    }

    /// Whether `slot` sleeps until its predecessor or its successor has come as far as it must.
    #[must_use]
    pub fn awaits_replacement(&self, slot: usize) -> bool {
        self.waiter_word(Waiter::Replacement(slot)).load(SeqCst) != AWAKE
    }

    /// Whether `slot` sleeps until the clock grants its next tick.
    #[must_use]
    pub fn awaits_grant(&self, slot: usize) -> bool {
        self.waiter_word(Waiter::Grant(slot)).load(SeqCst) != AWAKE
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

    /// Processor time that `slot` used between tick 0 and its last tick, in nanoseconds.
    #[must_use]
    pub fn cpu_ns(&self, slot: usize) -> u64 {
        self.double_word(self.slot_line(slot), CPU).load(SeqCst)
    }

    pub(crate) fn set_cpu_ns(&self, slot: usize, ns: u64) {
        self.double_word(self.slot_line(slot), CPU).store(ns, SeqCst);
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

fn slots(plan: &Plan) -> usize {
    SLOTS_PER_NODE * plan.nodes.len()
}

/// The size of the control segment of `plan`.
pub(crate) fn control_bytes(plan: &Plan) -> usize {
    let waiters = 3 * slots(plan) + 2 * SLOTS_PER_NODE * plan.input_waiters();
    LINE_BYTES * (2 + 2 * plan.topics.len() + slots(plan) + waiters + STEP_LINES * slots(plan))
}

fn wake_waiter(waiter: &AtomicU32) {
    if waiter.swap(AWAKE, SeqCst) != AWAKE {
        wake_all(waiter);
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
    clock_ns(if crate::hosted::is_hosted() {
        rustix::time::ClockId::ThreadCPUTime
    } else {
        rustix::time::ClockId::ProcessCPUTime
    })
}

#[allow(clippy::cast_sign_loss, reason = "these clocks start at zero and only grow")]
fn clock_ns(clock: rustix::time::ClockId) -> u64 {
    let time = rustix::time::clock_gettime(clock);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::{Control, Sequence, Waited, Waiter, control_path};
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
                    let sleeper = scope.spawn(|| {
                        control.wait(Sequence::Topic(0), target, Waiter::Input(0), wait, |_| false)
                    });
                    let start = control.count(Sequence::Topic(0));
                    (start + 1..=target)
                        .for_each(|n| control.advance(Sequence::Topic(0), n, &[Waiter::Input(0)]));
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
                        control.wait(Sequence::Topic(0), round, Waiter::Input(0), Wait::Block, |_| false);
                        control.advance(Sequence::Done(0), round, &[Waiter::Done(0)]);
                    }
                });
                for round in 1..=rounds {
                    control.advance(Sequence::Topic(0), round, &[Waiter::Input(0)]);
                    control.wait(Sequence::Done(0), round, Waiter::Done(0), Wait::Block, |_| false);
                }
            });
            assert_eq!(control.count(Sequence::Done(0)), rounds);
        });
    }

    #[test]
    fn an_abort_and_an_earlier_end_wake_everybody() {
        with_control(|control| {
            std::thread::scope(|scope| {
                let over = |control: &Control| control.end_tick() <= 50;
                let sleeper = scope
                    .spawn(move || control.wait(Sequence::Grant, 60, Waiter::Grant(0), Wait::Block, over));
                control.set_end_tick(50);
                assert_eq!(sleeper.join().unwrap(), Waited::Over);
                let sleeper = scope
                    .spawn(|| control.wait(Sequence::Topic(0), 1, Waiter::Input(0), Wait::Block, |_| false));
                control.abort();
                assert_eq!(sleeper.join().unwrap(), Waited::Over);
            });
        });
    }
}
