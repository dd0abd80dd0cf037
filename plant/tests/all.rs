//! Tests of the plant, in one program, which builds sooner than one for each file.

mod common;
#[path = "../../tests/runs/skipped.rs"]
mod skipped;

mod any_contact;
mod closed_forms;
mod contacts;
mod drives;
mod effect_files;
mod effect_names;
mod effect_physics;
mod effects;
mod failed_rotors;
mod free_bodies;
mod free_flight;
mod golden;
mod motors;
mod pivots;
mod prisms;
mod rigs;
mod signs;
mod snapshots;
mod stacks;
mod transfer;
