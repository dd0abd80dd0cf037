//! Many seeded cases, two at a time; one that fails says how to repeat it.
//!
//! Quick tests take the first sixth of the cases, and at least six. `HUMMINGBUS_KILL_POINTS` says how many, `HUMMINGBUS_SEED` which, `HUMMINGBUS_KILL_POINT` picks one of them to repeat
//! it, and `HUMMINGBUS_LOAD` keeps cores busy beside them with this many threads.

use crate::skipped::{is_thorough, leave};
use crate::support::Load;
use std::fmt::Debug;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Draws `count` cases from the seed and their numbers, by default, and tries each. `name` is that of the calling
/// module.
pub fn run<Case: Debug>(
    name: &str,
    count: u64,
    draw: impl Fn(u64, u64) -> Case + Sync,
    attempt: impl Fn(&Case) + Sync,
) {
    let seed = number("HUMMINGBUS_SEED").unwrap_or(1);
    let first = number("HUMMINGBUS_KILL_POINT");
    let asked = first.map(|_| 1).or_else(|| number("HUMMINGBUS_KILL_POINTS"));
    let count = asked.unwrap_or_else(|| share(name, count));
    let _load = number("HUMMINGBUS_LOAD").map(|threads| Load::of_threads(usize::try_from(threads).unwrap()));
    let next = AtomicU64::new(first.unwrap_or(0));
    let end = next.load(Ordering::SeqCst) + count;
    let has_failed = AtomicBool::new(false);
    let work = || {
        while !has_failed.load(Ordering::SeqCst) {
            let index = next.fetch_add(1, Ordering::SeqCst);
            if index >= end {
                return;
            }
            let case = draw(seed, index);
            let _witness = Witness { name, seed, index, case: &case, has_failed: &has_failed };
            attempt(&case);
        }
    };
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(work))));
    println!("seed {seed}, {count} cases of {name}");
}

/// The cases of `count` that the running test takes where no number is asked for.
fn share(name: &str, count: u64) -> u64 {
    if is_thorough() {
        return count;
    }
    let share = count.div_ceil(6).max(6).min(count);
    leave((count - share) as usize, &format!("cases of {name}"));
    share
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect(name))
}

/// Says which case failed, so that exactly this one can be repeated, and has the others not go on.
struct Witness<'a, Case: Debug> {
    name: &'a str,
    seed: u64,
    index: u64,
    case: &'a Case,
    has_failed: &'a AtomicBool,
}

impl<Case: Debug> Drop for Witness<'_, Case> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.has_failed.store(true, Ordering::SeqCst);
            let Self { name, seed, index, case, .. } = self;
            eprintln!(
                "FAILED: {case:#?}\nrepeat it: HUMMINGBUS_SEED={seed} HUMMINGBUS_KILL_POINT={index} cargo test \
                 --test faults {name}"
            );
        }
    }
}
