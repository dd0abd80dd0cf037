//! Allocations of a step: none, in any component.

use crate::components;
use crate::support::Place;
use hummingbus::COMPONENTS;
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
