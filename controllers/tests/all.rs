//! Tests of control laws, in one program, which builds sooner than one for each file.

mod common;
mod flight;
#[allow(dead_code, reason = "the generator's own main is not used here")]
#[path = "../examples/random_pilot.rs"]
mod random_pilot;
#[path = "../../tests/runs/skipped.rs"]
mod skipped;

mod bumpless_transfer;
mod cascade;
mod components;
mod hover_and_doublet;
mod played_battery;
mod sticks;
mod tracking;
mod trajectory;
mod two_backends;
mod walls;
