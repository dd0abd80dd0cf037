//! The wake-up protocol under a model checker: `loom` runs each model in every order that its threads, their caches and
//! the kernel's futexes allow, with up to three parties. A wake-up that is lost leaves a thread asleep for ever, which
//! `loom` reports as a deadlock.
//!
//! Models that must fail stand beside those that must hold: without the fence between a store and the load after it,
//! a thread sleeps for ever, and a tick is granted in a hold. So the models find the errors that they are made for.
//!
//! The larger models explore only the orders in which threads are interrupted at most twice against their will.

use super::wake::{AWAKE, NEVER, Word, advance, ask_for_hold, hold, notify, sleep, wake_everybody};
use loom::sync::atomic::{self, AtomicU32};
use loom::sync::{Arc, Condvar, Mutex};
use loom::thread;
use std::sync::atomic::Ordering::{self, Acquire, Relaxed, Release};
use std::time::Duration;

/// A futex of the model: the kernel compares the word and falls asleep in one step, under a lock that the waking
/// thread takes too. Timeouts never come, so that nothing rests on them.
struct Futex<const HAS_FENCES: bool> {
    word: AtomicU32,
    lock: Mutex<()>,
    sleepers: Condvar,
}

/// The protocol with its fences.
type Fenced = Futex<true>;

impl<const HAS_FENCES: bool> Futex<HAS_FENCES> {
    fn new(value: u32) -> Arc<Self> {
        Arc::new(Self { word: AtomicU32::new(value), lock: Mutex::new(()), sleepers: Condvar::new() })
    }
}

impl<const HAS_FENCES: bool> Word for Futex<HAS_FENCES> {
    fn load(&self, order: Ordering) -> u32 {
        self.word.load(order)
    }

    fn store(&self, value: u32, order: Ordering) {
        self.word.store(value, order);
    }

    fn swap(&self, value: u32, order: Ordering) -> u32 {
        self.word.swap(value, order)
    }

    fn increment(&self, order: Ordering) {
        self.word.fetch_add(1, order);
    }

    fn fence() {
        if HAS_FENCES {
            atomic::fence(Ordering::SeqCst);
        }
    }

    fn sleep(&self, seen: u32, _timeout: Option<Duration>) {
        let lock = self.lock.lock().unwrap();
        if self.word.load(Relaxed) == seen {
            drop(self.sleepers.wait(lock).unwrap());
        }
    }

    fn wake(&self) {
        let _lock = self.lock.lock().unwrap();
        self.sleepers.notify_all();
    }
}

/// Explores the orders in which threads are interrupted at most twice.
fn model(parties: impl Fn() + Sync + Send + 'static) {
    let mut model = loom::model::Builder::new();
    model.preemption_bound = Some(2);
    model.check(parties);
}

/// As a process waits: until the count is reached, or the wait is over.
fn wait<const F: bool>(sequence: &Futex<F>, count: u32, waiter: &Futex<F>, is_over: impl Fn() -> bool) {
    while sequence.load(Acquire) < count && !is_over() {
        sleep(sequence, count, waiter, &is_over);
    }
}

/// One party sends, the other waits for it.
fn send_and_wait<const F: bool>() {
    let (sequence, waiter) = (Futex::<F>::new(0), Futex::<F>::new(AWAKE));
    let (sent, reader) = (sequence.clone(), waiter.clone());
    let sender = thread::spawn(move || advance(&*sent, 1, [&*reader]));
    wait(&sequence, 1, &waiter, || false);
    sender.join().unwrap();
}

#[test]
fn two_parties_no_wake_up_is_lost() {
    loom::model(send_and_wait::<true>);
}

#[test]
#[should_panic(expected = "deadlock")]
fn without_the_fences_a_wake_up_is_lost() {
    loom::model(send_and_wait::<false>);
}

#[test]
fn what_was_written_before_a_count_is_found_after_it() {
    loom::model(|| {
        let (sample, sequence, waiter) = (Fenced::new(0), Fenced::new(0), Fenced::new(AWAKE));
        let (written, sent, reader) = (sample.clone(), sequence.clone(), waiter.clone());
        let sender = thread::spawn(move || {
            written.store(7, Relaxed);
            advance(&*sent, 1, [&*reader]);
        });
        wait(&sequence, 1, &waiter, || false);
        assert_eq!(sample.load(Relaxed), 7);
        sender.join().unwrap();
    });
}

#[test]
fn two_parties_that_wait_for_each_other_go_on() {
    loom::model(|| {
        let [sent, done] = [0, 0].map(Fenced::new);
        let [reader, clock] = [AWAKE, AWAKE].map(Fenced::new);
        let node = {
            let (sent, reader, done, clock) = (sent.clone(), reader.clone(), done.clone(), clock.clone());
            thread::spawn(move || {
                wait(&sent, 1, &reader, || false);
                advance(&*done, 1, [&*clock]);
            })
        };
        advance(&*sent, 1, [&*reader]);
        wait(&done, 1, &clock, || false);
        node.join().unwrap();
    });
}

#[test]
fn three_parties_readers_of_one_sequence_are_woken_at_their_own_counts() {
    model(|| {
        let (sequence, waiters) = (Fenced::new(0), [AWAKE, AWAKE].map(Fenced::new));
        let readers = [1, 2].map(|count| {
            let (sequence, waiter) = (sequence.clone(), waiters[count as usize - 1].clone());
            thread::spawn(move || wait(&sequence, count, &waiter, || false))
        });
        (1..=2).for_each(|count| advance(&*sequence, count, waiters.iter().map(|waiter| &**waiter)));
        readers.into_iter().for_each(|reader| reader.join().unwrap());
    });
}

#[test]
fn three_parties_a_reader_of_two_sequences_is_woken_for_both() {
    model(|| {
        let (sequences, waiters) = ([0, 0].map(Fenced::new), [AWAKE, AWAKE].map(Fenced::new));
        let senders = [0, 1].map(|topic| {
            let (sequence, waiter): (Arc<Fenced>, _) = (sequences[topic].clone(), waiters[topic].clone());
            thread::spawn(move || advance(&*sequence, 1, [&*waiter]))
        });
        for topic in [0, 1] {
            wait(&sequences[topic], 1, &waiters[topic], || false);
        }
        senders.into_iter().for_each(|sender| sender.join().unwrap());
    });
}

#[test]
fn an_abort_wakes_a_sleeper_whatever_it_waits_for() {
    loom::model(|| {
        let (sequence, waiter, is_aborted) = (Fenced::new(0), Fenced::new(AWAKE), Fenced::new(0));
        let supervisor = {
            let (waiter, is_aborted) = (waiter.clone(), is_aborted.clone());
            thread::spawn(move || {
                is_aborted.store(1, Release);
                wake_everybody([&*waiter]);
            })
        };
        wait(&sequence, 1, &waiter, || is_aborted.load(Relaxed) != 0);
        supervisor.join().unwrap();
    });
}

/// The last that a writer does that is killed while it advances a sequence.
#[derive(Clone, Copy)]
enum LastStep {
    None,
    Store,
    Look,
}

/// A writer dies, a reader sleeps for it, and the supervisor, which notices, raises the epoch.
fn writer_dies(last: LastStep) {
    let (sequence, waiter, epoch) = (Fenced::new(0), Fenced::new(AWAKE), Fenced::new(0));
    let reader = {
        let (sequence, waiter, epoch) = (sequence.clone(), waiter.clone(), epoch.clone());
        thread::spawn(move || wait(&sequence, 1, &waiter, || epoch.load(Relaxed) != 0))
    };
    let writer = {
        let waiter = waiter.clone();
        thread::spawn(move || match last {
            LastStep::None => {}
            LastStep::Store => sequence.store(1, Release),
            LastStep::Look => {
                sequence.store(1, Release);
                Fenced::fence();
                if waiter.load(Relaxed) <= 1 {
                    waiter.swap(AWAKE, Relaxed);
                }
            }
        })
    };
    writer.join().unwrap();
    epoch.store(1, Release);
    wake_everybody([&*waiter]);
    reader.join().unwrap();
}

#[test]
fn three_parties_the_next_epoch_wakes_whom_a_dead_writer_left_asleep() {
    for last in [LastStep::None, LastStep::Store, LastStep::Look] {
        model(move || writer_dies(last));
    }
}

#[test]
fn three_parties_the_supervisor_hears_of_everything() {
    model(|| {
        let (notices, states) = (Fenced::new(0), [0, 0].map(Fenced::new));
        let nodes = [0, 1].map(|node| {
            let (notices, state): (Arc<Fenced>, Arc<Fenced>) = (notices.clone(), states[node].clone());
            thread::spawn(move || {
                state.store(1, Release);
                notify(&*notices);
            })
        });
        loop {
            let seen = notices.load(Acquire);
            if states.iter().all(|state| state.load(Relaxed) == 1) {
                break;
            }
            notices.sleep(seen, None);
        }
        nodes.into_iter().for_each(|node| node.join().unwrap());
    });
}

/// The clock, in a hold from the start, grants two ticks. A user lifts the hold, asks for it again at once, and looks
/// whether the clock is in it: if it is, it stays there until the user lifts the hold for good.
fn hold_and_grant<const F: bool>() {
    let [granted, hold_tick, changes] = [0, 0, 0].map(Futex::<F>::new);
    let held_at = Futex::<F>::new(NEVER);
    let clock = {
        let (granted, held_at) = (granted.clone(), held_at.clone());
        let (hold_tick, changes) = (hold_tick.clone(), changes.clone());
        thread::spawn(move || {
            for tick in 0..2 {
                if hold_tick.load(Acquire) <= tick {
                    hold(&*held_at, tick, &*changes, || hold_tick.load(Acquire) > tick, || {});
                }
                granted.store(tick + 1, Release);
            }
        })
    };
    ask_for_hold(&*hold_tick, NEVER, &*changes);
    ask_for_hold(&*hold_tick, 0, &*changes);
    let held = held_at.load(Acquire);
    if held != NEVER {
        // The newest value: a plain load may find an older one.
        assert_eq!(granted.word.fetch_add(0, Acquire), held, "a tick was granted in a hold");
    }
    ask_for_hold(&*hold_tick, NEVER, &*changes);
    clock.join().unwrap();
}

#[test]
fn no_tick_is_granted_in_a_hold_and_whoever_lifts_it_is_heard() {
    model(hold_and_grant::<true>);
}

#[test]
#[should_panic(expected = "a tick was granted in a hold")]
fn without_the_fences_a_tick_is_granted_in_a_hold() {
    loom::model(hold_and_grant::<false>);
}

/// A reader waits twice. More than four preemptions find nothing more and take seconds.
#[test]
fn two_parties_two_counts() {
    let mut exploration = loom::model::Builder::new();
    exploration.preemption_bound = Some(4);
    exploration.check(|| {
        let (sequence, waiter) = (Fenced::new(0), Fenced::new(AWAKE));
        let (sent, reader) = (sequence.clone(), waiter.clone());
        let sender = thread::spawn(move || (1..=2).for_each(|count| advance(&*sent, count, [&*reader])));
        (1..=2).for_each(|count| wait(&sequence, count, &waiter, || false));
        sender.join().unwrap();
    });
}
