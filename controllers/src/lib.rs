//! Controllers, their set points, and the allocation of their demands to the rotors.
//!
//! The rooms, pure cores first; no core knows the bus, the plant or the wall clock:
//! - [`set_points`]: the pilot's schedule of steps, ramps and doublets.
//! - [`pid_gains`]: the gains of the `pid` controller, ours beside the thesis's.
//! - [`pid_law`]: altitude and attitude PID, from set point and measurement to a wrench.
//! - [`allocation`]: from a wrench to the speeds of four rotors.
//! - [`controller`]: what all controllers share, and the node that runs any of them.
//! - [`curve`], [`minimum_snap`], [`course`]: trajectories, with their derivatives.
//! - [`flatness`]: the attitude and rates that a trajectory needs.
//! - [`motor_lag`]: what the rotors make of a demand, foreseen, and a demand that hurries them.
//! - [`disturbance`]: the acceleration that the model does not explain, observed.
//! - [`geometric_gains`], [`geometric_law`]: tracking on SE(3).
//! - [`hand_over`]: how a law takes over without a jump.
//! - [`gains_file`]: gains files, for every law.
//! - [`pid`], [`geometric`], [`pilot`], [`trajectory`], [`player`]: the nodes.
//! - [`flight_log`]: a measured flight as CSV with a column map.
//! - [`angle`]: the difference of two angles.
#![forbid(unsafe_code)]

pub mod allocation;
pub mod angle;
pub mod controller;
pub mod course;
pub mod curve;
pub mod disturbance;
pub mod flatness;
pub mod flight_log;
pub mod gains_file;
pub mod geometric;
pub mod geometric_gains;
pub mod geometric_law;
pub mod hand_over;
pub mod minimum_snap;
pub mod motor_lag;
pub mod pid;
pub mod pid_gains;
pub mod pid_law;
pub mod pilot;
pub mod player;
pub mod set_points;
pub mod trajectory;
