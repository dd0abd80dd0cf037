//! Autopilot firmware as nodes: a process of the firmware's own, in lockstep with the run, with motors, axes and units converted.
//!
//! - [`autopilot`]: the trait that each firmware implements, and its inputs
//! - [`bridge`]: the component that holds a firmware: its ports, its start before tick 0, an exchange a tick
//! - [`process`]: a firmware's process: its scratch folder, its log, what it ended with
//! - [`stream`]: a firmware that speaks over a socket at its standard input
//! - [`datagrams`]: a firmware that speaks by datagrams (UDP)
//! - [`rest`]: the rest on the ground before tick 0, in which a firmware is armed
//! - [`settings`]: parameters and files that firmwares have in common
//! - [`parameter_lines`]: a file of parameters
//! - [`axes`]: axes of ArduPilot and PX4
//! - [`atmosphere`]: pressure and temperature by altitude
//! - [`layout`]: which motor output drives which rotor
//! - [`origin`]: the place on the earth at which the world's origin lies
//! - [`mod@betaflight`]: Betaflight's software in the loop (SITL)
//! - [`mod@ardupilot`]: ArduCopter's software in the loop, by its JSON interface
//! - [`mod@px4`]: PX4's software in the loop, by its simulator's MAVLink interface
//!
//! ```
//! use autopilots::betaflight::mixers::MIXERS;
//! use autopilots::layout::Layout;
//!
//! let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
//! let layout = Layout::of(&vehicle.rotors, &MIXERS).unwrap();
//! assert_eq!((layout.frame, layout.motors.as_slice()), ("QUADP", &[2, 1, 3, 0][..]), "rear, right, left, front");
//! ```

#![allow(
    non_snake_case,
    reason = "a trailing _B or _W names the frame that a vector is written in, and units keep their letters"
)]

pub mod ardupilot;
pub mod atmosphere;
pub mod autopilot;
pub mod axes;
pub mod betaflight;
pub mod bridge;
pub mod datagrams;
pub mod layout;
pub mod origin;
pub mod parameter_lines;
pub mod process;
pub mod px4;
pub mod rest;
pub mod settings;
pub mod stream;

/// ArduCopter's SITL as a component.
pub type ArduPilot = bridge::Bridge<ardupilot::ArduPilot>;

/// Betaflight's SITL as a component.
pub type Betaflight = bridge::Bridge<betaflight::Betaflight>;

/// PX4's SITL as a component.
pub type Px4 = bridge::Bridge<px4::Px4>;
