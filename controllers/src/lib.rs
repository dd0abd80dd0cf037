//! Controllers, their set points, and the allocation of their demands to the rotors.
//!
//! A control law is a type that implements [`law::Law`]; [`controller::Controller`] makes a component of it, and
//! [`bumpless`] lets any law go on after any other. The rooms, pure cores first:
//! - [`set_points`]: a pilot's schedule of steps, ramps and doublets; [`sticks`]: a recording of sticks.
//! - [`allocation`]: from a wrench to the speeds of the rotors; [`wrench_part`]: names of its parts; `bounded`: the same
//!   beyond their limits; [`airframe`]: the vehicle that a law knows.
//! - [`law_inputs`]: ports of laws; [`control`]: the estimated motion, and what a law answers.
//! - `gains_file`: gains with units and sources; a law's gains are beside it, ours and the thesis's.
//! - `altitude_loop`: the part that all laws about hover share.
//! - [`pid`]: altitude and attitude PID.
//! - [`cascade`]: command filter, attitude loop, rate loop: the inner loops of all that follows.
//! - [`velocity`]: velocity PD around the cascade; `approach`: how fast to come near a wall.
//! - [`wall_stop`], [`wall_follow`]: guidance by range finders, around the velocity PD; `legs`: the states along the walls;
//!   [`room`]: where the walls must be although other vehicles stand in the beams.
//! - [`wall_stop_thesis`], [`wall_follow_thesis`]: the thesis's own versions; `free_flight`: its tilt by
//!   distance.
//! - [`position_hold`]: holds the place between the pilot's commands, around a law about hover.
//! - [`rc`]: raw channels of a remote control, by a script, a recording of a receiver, or a `gamepad`; `pulses`: their ranges.
//! - [`remote_control`]: turns set points into the sticks and switches of a remote control.
//! - `flatness`: the attitude and rates that a trajectory needs; `motor_lag`: what the rotors make of a demand, foreseen,
//!   and a demand that hurries them; `disturbance`: the acceleration that the model does not explain, observed;
//!   [`foresight`]: what the laws that foresee remember.
//! - [`geometric`]: tracking on SE(3).
//! - `riccati`, `lqr_model`, [`lqr`]: the linear-quadratic regulator.
//! - [`controller_state`]: what is transferred from one law to another.
//! - `rehearsal`: a law tried before a run, so that `check` finds numbers that do not go together.
//! - `curve`, `minimum_snap`, [`trajectory`]: trajectories, with their derivatives.
//! - [`pilot`], [`trajectory_node`], [`player`]: the components that controllers follow; `flight_log`: a measured flight
//!   as CSV with a column map.
#![forbid(unsafe_code)]
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame that a vector is written in, _WB a rotation between the two, _N a unit"
)]

// First: modules behind it see its macro without importing it.
#[macro_use]
mod gains_file;

pub mod airframe;
pub mod allocation;
mod altitude_loop;
mod angle;
mod approach;
mod bounded;
pub mod bumpless;
pub mod cascade;
pub mod cascade_gains;
pub mod control;
pub mod controller;
pub mod controller_state;
mod curve;
mod disturbance;
mod flatness;
mod flight_log;
pub mod foresight;
mod free_flight;
mod gamepad;
pub mod geometric;
pub mod geometric_gains;
pub mod law;
pub mod law_inputs;
mod legs;
pub mod lqr;
pub mod lqr_gains;
mod lqr_model;
mod minimum_snap;
mod motor_lag;
pub mod pid;
pub mod pid_gains;
pub mod pilot;
pub mod player;
pub mod position_hold;
mod pulses;
pub mod rc;
mod rehearsal;
pub mod remote_control;
mod riccati;
pub mod room;
pub mod set_points;
pub mod sticks;
pub mod trajectory;
pub mod trajectory_node;
pub mod velocity;
pub mod wall_follow;
pub mod wall_follow_thesis;
pub mod wall_stop;
pub mod wall_stop_thesis;
pub mod wrench_part;
