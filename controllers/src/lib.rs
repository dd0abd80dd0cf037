//! Controllers, their set points, and the allocation of their demands to the rotors.
//!
//! The rooms, pure cores first; no core knows the bus, the plant or the wall clock:
//! - [`set_points`]: the pilot's schedule of steps, ramps and doublets.
//! - [`pid_gains`]: the gains of the `pid` controller, ours beside the thesis's.
//! - [`pid_law`]: altitude and attitude PID, from set point and measurement to a wrench.
//! - [`allocation`]: from a wrench to the speeds of four rotors.
//! - [`controller`]: what all controllers share, and the node that runs any of them.
//! - [`pid`], [`pilot`], [`player`]: the nodes.
//! - [`flight_log`]: a measured flight as CSV with a column map.
//! - [`angle`]: the difference of two angles.
#![forbid(unsafe_code)]

pub mod allocation;
pub mod angle;
pub mod controller;
pub mod flight_log;
pub mod pid;
pub mod pid_gains;
pub mod pid_law;
pub mod pilot;
pub mod player;
pub mod set_points;
