//! Controllers, their set points, and the allocation of their demands to the rotors.
//!
//! The rooms, pure cores first; no core knows the bus, the plant or the wall clock:
//! - [`set_points`]: the pilot's schedule of steps, ramps and doublets; [`sticks`]: a recording of sticks.
//! - [`gains_file`]: gains with units and sources; [`pid_gains`], [`cascade_gains`] and, with their laws, those of
//!   the others, ours beside the thesis's.
//! - [`pid_law`]: altitude and attitude PID; [`altitude_loop`]: its part that all laws share.
//! - [`cascade_law`]: command filter, attitude loop, rate loop: the inner loops of all that follows.
//! - [`velocity_law`]: velocity PD around the cascade; [`approach`]: how fast to come near a wall.
//! - [`wall_stop_law`], [`wall_follow_law`]: guidance by range finders, around the velocity PD; [`room`]: where
//!   the walls must be although other vehicles stand in the beams.
//! - [`allocation`]: from a wrench to the speeds of four rotors.
//! - [`controller`]: what all controllers share, and the node that runs any of them.
//! - [`rehearsal`]: a law tried before a run, so that `check` finds numbers that do not go together.
//! - [`curve`], [`minimum_snap`], [`course`]: trajectories, with their derivatives.
//! - [`flatness`]: the attitude and rates that a trajectory needs.
//! - [`motor_lag`]: what the rotors make of a demand, foreseen, and a demand that hurries them.
//! - [`disturbance`]: the acceleration that the model does not explain, observed.
//! - [`geometric_gains`], [`geometric_law`]: tracking on SE(3).
//! - [`riccati`], [`lqr_model`], [`lqr_gains`], [`lqr_law`]: the linear-quadratic regulator.
//! - [`foresight`]: what the laws that foresee remember of both.
//! - [`pid`], [`cascade`], [`velocity`], [`wall_stop`], [`wall_follow`], [`lqr`], [`geometric`], [`pilot`], [`trajectory`],
//!   [`player`]: the nodes.
//! - [`flight_log`]: a measured flight as CSV with a column map.
//! - [`angle`]: the difference of two angles.
#![forbid(unsafe_code)]

pub mod airframe;
pub mod allocation;
pub mod altitude_loop;
pub mod angle;
pub mod approach;
pub mod bumpless;
pub mod cascade;
pub mod cascade_gains;
pub mod cascade_law;
pub mod control;
pub mod controller;
pub mod controller_state;
pub mod curve;
pub mod disturbance;
pub mod flatness;
pub mod flight_log;
pub mod foresight;
pub mod gains_file;
pub mod geometric;
pub mod geometric_gains;
pub mod geometric_law;
pub mod law;
pub mod lqr;
pub mod lqr_gains;
pub mod lqr_law;
pub mod lqr_model;
pub mod minimum_snap;
pub mod motor_lag;
pub mod pid;
pub mod pid_gains;
pub mod pid_law;
pub mod pilot;
pub mod player;
pub mod rehearsal;
pub mod riccati;
pub mod room;
pub mod set_points;
pub mod sticks;
pub mod trajectory;
pub mod trajectory_node;
pub mod velocity;
pub mod velocity_law;
pub mod wall_follow;
pub mod wall_follow_law;
pub mod wall_stop;
pub mod wall_stop_law;
