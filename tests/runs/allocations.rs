//! Allocations of a step: none, in any component. Recording, verdict and summary take none for each tick.

use crate::components;
use crate::support::{Place, repository};
use hummingbus::{COMPONENTS, Host, Launcher};
use runtime::manifest::Manifest;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

/// Counts the allocations of each thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Ticks in which buffers may reach their sizes.
const WARM_UP_TICKS: u32 = 1000;
const TICKS: u32 = 500;

/// `bus` counts the allocations of iceoryx2, and `plant` those of the search for contacts.
#[test]
fn a_step_of_any_component_allocates_nothing() {
    let place = Place::new();
    let manifest = Manifest::load(Path::new(&components::manifest(&place)), &[], COMPONENTS).unwrap();
    let before = ALLOCATIONS.get();
    let mut simulation = hummingbus::simulate(&manifest).unwrap();
    assert!(ALLOCATIONS.get() > before + 1000, "the allocations of this thread are not counted");
    (0..WARM_UP_TICKS).for_each(|_| simulation.step().unwrap());
    for _ in 0..TICKS {
        let (tick, before) = (simulation.tick(), ALLOCATIONS.get());
        simulation.step().unwrap();
        assert_eq!(ALLOCATIONS.get() - before, 0, "allocations at tick {tick}");
    }
}

/// Allocations of a recorded hover on this thread, its verdict and its summary included.
fn allocations_of_a_hover(duration_s: f64) -> u64 {
    let place = Place::new();
    let manifest = hummingbus::load(repository("manifests/hover.toml")).unwrap();
    let manifest = manifest.set("run.duration_s", duration_s).unwrap();
    let before = ALLOCATIONS.get();
    let flown = hummingbus::fly(Launcher::new(Host::InProcess), &manifest, place.path("hover.mcap")).unwrap();
    assert!(flown.recording.is_some());
    ALLOCATIONS.get() - before
}

/// Chunks of the file, and lists that grow, take a few.
#[test]
fn a_recorded_flight_that_is_longer_takes_hardly_more_allocations() {
    let (short, long) = (allocations_of_a_hover(1.0), allocations_of_a_hover(2.0));
    assert!(long < short + 1000, "{short} allocations in 1000 ticks, {long} in 2000");
}
