//! Allocations of a tick: none in free flight, and only rapier's where something is touched.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

mod common;

use common::parts::{Prism, keys};
use common::{TICK_S, hummingbird};
use nalgebra::Vector3;
use plant::{Backend, Neighbour, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts how often each thread takes memory.
struct Counting;

thread_local! {
    static TAKEN: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        TAKEN.set(TAKEN.get() + 1);
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

fn model() -> NewtonEuler {
    NewtonEuler::new(hummingbird(), 1)
}

fn rapier(scene: &str, start_W_m: Vector3<f64>) -> Rapier {
    let scene = Scene::parse(scene, "scene.toml").unwrap();
    common::rapier(model(), &scene, &RigidBody::level_at(start_W_m), 1.0)
}

/// Returns the number of allocations in 1000 ticks, after 1000 that may fill buffers.
fn taken(plant: &mut dyn Backend, command: f64, traffic: &[Neighbour]) -> u64 {
    plant.settle_rotors(&[command; 4]);
    (0..1_000).for_each(|_| plant.step(&[command; 4], TICK_S, traffic));
    let before = TAKEN.get();
    for _ in 0..1_000 {
        plant.step(&[command; 4], TICK_S, traffic);
        std::hint::black_box((plant.accelerations(), plant.contact()));
    }
    TAKEN.get() - before
}

#[test]
fn free_flight_takes_no_memory() {
    let mut plant = common::free_flight(hummingbird(), RigidBody::level_at(Vector3::z()));
    assert_eq!(taken(&mut plant, hummingbird().hover_command(), &[]), 0);
}

/// Rapier's search for contacts builds lists where curved shapes meet; none of these places is ours, and the number does
/// not grow with time.
#[test]
fn only_the_search_for_contacts_takes_memory() {
    let room = scenes::reference::ROOM;
    let hover = hummingbird().hover_command();
    let other =
        Neighbour { number: 1, position_W_m: Vector3::new(0.3, 0.0, 1.0), velocity_W_m_s: Vector3::zeros() };
    let counts = [
        ("flying", taken(&mut rapier(room, Vector3::z()), hover, &[])),
        ("standing", taken(&mut rapier(room, Vector3::zeros()), 1.0, &[])),
        ("among traffic", taken(&mut rapier(room, Vector3::z()), hover, &[other])),
        ("rig A", taken(&mut rapier(scenes::reference::RIG_SLIDING, Vector3::z()), 1.0, &[])),
    ];
    println!("in 1000 ticks: {counts:?}");
    // What was counted: 0, 1000, 13157 and 0, and of what is not 0 a tenth more.
    for ((name, count), most) in counts.into_iter().zip([0, 1_100, 14_500, 0]) {
        assert!(count <= most, "{name}: {count} times in 1000 ticks, expected {most} at most");
    }
}

/// Returns the number of allocations of a prism with so many sides that falls 0.1 m, bounces and stands, from a moment in the
/// air on.
fn taken_by_prism(sides: u32) -> u64 {
    let obj = Prism { sides, radius_m: 0.12, half_m: 0.1 }.obj();
    let keys = keys(&[("mass", "1", "kg"), ("position", "[0, 0, 0.2]", "m"), ("scale", "1", "m")]);
    let mesh = "[[meshes]]\nname = \"prism\"\nfile = \"prism.obj\"\nsolid = \"convex\"\n";
    let text = format!("name = \"test\"\n{mesh}{keys}");
    let scene = Scene::parse_with(&text, "test.toml", &|_| Ok(obj.clone().into_bytes())).unwrap();
    let mut plant = common::rapier(model(), &scene, &RigidBody::level_at(Vector3::z() * 20.0), 1.0);
    let hover = [hummingbird().hover_command(); 4];
    plant.settle_rotors(&hover);
    (0..100).for_each(|_| plant.step(&hover, TICK_S, &[]));
    let before = TAKEN.get();
    (0..1_000).for_each(|_| plant.step(&hover, TICK_S, &[]));
    let taken = TAKEN.get() - before;
    assert_eq!(plant.trouble(), None, "{sides} sides");
    let height_m = plant.bodies()[0].position_W_m.z;
    assert!((height_m - 0.1).abs() < 1e-5, "{sides} sides: {height_m} m");
    taken
}

/// As the vehicle on the ground, once in a search. Contacts of many corners do not fill the buffers.
#[test]
fn a_face_of_many_corners_takes_no_more_memory_than_one_of_four() {
    let counts = [4, 16, 32, 300].map(|sides| (sides, taken_by_prism(sides)));
    println!("in 1000 ticks: {counts:?}");
    for (sides, count) in counts {
        assert!(count <= 1_300, "{sides} sides: {count} times in 1000 ticks, expected 1300 at most");
    }
}

#[test]
fn what_hangs_on_a_rope_takes_memory_only_where_it_lies() {
    let mut plant = rapier(scenes::reference::SLUNG_LOAD, Vector3::z() * 20.0);
    assert_eq!(taken(&mut plant, hummingbird().hover_command() * 1.02, &[]), 0);
}

#[test]
fn driven_joints_take_no_memory() {
    let mut plant = rapier(scenes::reference::DRIVEN_JOINTS, Vector3::z() * 20.0);
    assert_eq!(taken(&mut plant, hummingbird().hover_command(), &[]), 0);
}

#[test]
fn impulses_that_are_found_directly_take_no_memory() {
    let key = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let cube = |name: &str, mass_kg: &str, centre_m: &str| {
        let (centre, size, mass) = (key(centre_m, "m"), key("[0.2, 0.2, 0.2]", "m"), key(mass_kg, "kg"));
        format!("[[boxes]]\nname = \"{name}\"\ncentre = {centre}\nsize = {size}\nmass = {mass}\n")
    };
    let [swept, direct] = ["10", "0.001"].map(|light_kg| {
        let cubes =
            [cube("light", light_kg, "[0, 0, 0.1]"), cube("heavy", "10", "[0.03, 0.02, 0.4]")].concat();
        let scene = format!("name = \"test\"\nfriction = {}\n{cubes}", key("0", "1"));
        let mut plant = rapier(&scene, Vector3::z() * 20.0);
        let taken = taken(&mut plant, hummingbird().hover_command(), &[]);
        assert_eq!(plant.trouble(), None);
        taken
    });
    // Both as often as the search for contacts does; without friction sweeps do not settle a light one below.
    assert_eq!(swept, direct);
}
