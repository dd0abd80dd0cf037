//! Tests that launch the real binary and judge what it prints, records and leaves behind.
//!
//! - [`support`]: a folder of its own for each test, launches under a watchdog, what a run left behind
//! - [`recordings`]: recordings read back and compared
//! - [`nodes`]: the processes that the tests put into runs
//! - [`determinism`]: a run is a function of its manifest
//! - [`compose`]: nor does it depend on which nodes share a process
//! - [`processors`]: nor does it depend on the processor
//! - [`live`]: runs that are watched and steered
//! - [`campaign`]: thousands of flights with varied values
//! - [`forks`]: campaigns that go on from a checkpoint
//! - [`rewinds`]: paused runs that go back
//! - [`components`]: every component, flown and stepped
//! - [`allocations`]: a step allocates nothing
//! - [`clean`]: what dead runs left is removed, and nothing of live ones
//! - [`terminal`]: a terminal for a program under test
//! - [`loss`]: every sample is recorded
//! - [`contract`]: what a node sees and sends at a tick
//! - [`corpus`]: what fuzzers found is read once more
//! - [`failures`]: nodes that fail, in every way
//! - [`cleanup`]: runs that are stopped or killed
//! - [`refusals`], [`refused_parameters`], [`refused_conditions`], [`refused_flights`]: manifests that are wrong
//! - [`refused_files`]: files that are not there, and folders in their place
//! - [`all_faults`]: all faults of a manifest at once
//! - [`manifests`]: includes, sets, settings
//! - [`backups`]: swaps, shadows and standbys in manifests
//! - [`planted`]: links that another user has planted
//! - [`processes`]: sidecars, and how a process runs on the host
//! - [`commands`]: the other subcommands, exit codes and JSON
//! - [`outputs`]: what runs and other commands write, where something is there already
//! - [`profile`]: where the host time of a run's ticks goes
//! - [`laps`], [`plot`]: recordings that are written, and pictures of them
//! - [`slurm`]: campaigns on a Slurm cluster
//! - [`tune`]: gains that cost less
//! - [`urdf`]: bodies of vehicles for other tools
//! - [`new`]: vehicle files from models of other tools
//! - [`rights`]: rights that a run lacks are named
//! - [`autopilots`]: firmware in lockstep
//! - [`skipped`]: tests that cannot run here, and cases that are left to `scripts/dev thorough`
//! - [`sensors`]: sensors read what they should, and hand over what is under way
//! - [`surroundings`]: hosts that lack something
//! - [`untrusted`]: names and contents of files that others made
//! - [`envelope`]: flights beyond the envelope in which a model was validated
//! - [`replay`]: the measured flight
//! - [`file_keys`]: the pages of vehicle and scene files have every key
//! - [`readme`]: the test that README prints
//! - [`validate`]: measured commands flown by vehicles side by side
//! - [`scenarios`]: the thesis's scenarios and those beyond
//! - [`multirotors`]: any number of rotors, upright and tilted
//! - [`failing_rotors`]: rotors that fail in flight
//! - [`scenes`]: ground, walls, rigs and other vehicles
//! - [`judging`]: runs without a recording are judged in flight
//! - [`view`]: recordings in the browser: address, end, refusals
//! - [`foxglove`]: live runs in Foxglove
//! - [`by_hand`]: set points of a person: sent, recorded, sent again
//! - [`gamepads`]: channels of a remote control that a gamepad moves
//! - [`inputs`]: files that are edited after they were read

mod all_faults;
mod allocations;
mod as_printed;
mod autopilots;
mod backups;
mod by_hand;
mod campaign;
mod campaign_faults;
mod campaign_results;
mod checkpoints;
mod checkpoints_of_swaps;
mod clean;
mod cleanup;
mod commands;
mod components;
mod compose;
mod contract;
mod corpus;
mod determinism;
mod documentation;
mod envelope;
mod failing_rotors;
mod failures;
mod file_keys;
mod forks;
mod forks_of_effects;
mod foxglove;
mod gamepads;
mod identify;
mod in_process;
mod inputs;
mod judging;
mod laps;
mod live;
mod loss;
mod manifests;
mod multirotors;
mod new;
mod nodes;
mod outputs;
mod planted;
mod plot;
mod processes;
mod processors;
mod profile;
mod readme;
mod recordings;
mod refusals;
mod refused_conditions;
mod refused_files;
mod refused_flights;
mod refused_parameters;
mod replay;
mod rewinds;
mod rights;
mod scenarios;
mod scenes;
mod sensors;
mod skipped;
mod slurm;
#[allow(dead_code, reason = "shared with tests/faults")]
mod support;
mod surroundings;
mod swap;
mod terminal;
mod tune;
mod untrusted;
mod urdf;
mod validate;
mod view;
