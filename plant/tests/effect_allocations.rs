//! A tick allocates nothing under any effects.

mod common;

use common::{TICK_S, hummingbird};
use nalgebra::Vector3;
use plant::effects::CATALOGUE;
use plant::{Airframe, NewtonEuler, RigidBody};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Allocations of each thread.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system's allocator with the arguments it came with.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System` with this layout, as `alloc` and `realloc` use nothing else.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as in `dealloc`; the caller's promise about `size` is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_tick_with_all_effects_allocates_nothing() {
    let vehicle = hummingbird();
    let hover = vehicle.hover_command();
    let effects = CATALOGUE.iter().map(|kind| kind.nominal()).collect();
    let model = NewtonEuler::flying(Airframe::with_effects(vehicle, effects), 2);
    let mut effects = model.airframe().initial_state(1, "plant", TICK_S);
    let mut state = model.start(RigidBody::level_at(Vector3::z()), hover);
    let before = ALLOCATIONS.get();
    for _ in 0..1000 {
        let actuation = model.airframe().begin_tick(&mut effects, &state, &[hover; 4], TICK_S);
        model.advance(&mut state, actuation, TICK_S);
    }
    assert_eq!(ALLOCATIONS.get() - before, 0);
}
