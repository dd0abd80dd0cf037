//! Tests of identification of parameters and effects, in one program, which builds sooner than one for each file.

mod simulated;
#[path = "../../tests/runs/skipped.rs"]
mod skipped;

mod attribution;
mod battery;
mod clocks;
mod commands;
mod coverage;
mod feedback;
mod flight_faults;
mod hexacopter;
mod modes;
mod real;
mod recorded;
mod rig;
mod roles;
mod rotor;
mod rotor_flights;
mod statistics;
mod steps_ahead;
mod torques_of_the_air;
mod winds;
mod yaw_gain;
