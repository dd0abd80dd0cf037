//! The C interface of hummingbus: a program in C, or in any language that calls C, as a node of a run.
//!
//! `include/hummingbus/hummingbus.h` is made from this crate, and `include/hummingbus/hummingbus.hpp` stands on it. No call
//! ends the process, and none lets a panic out: each returns a status, and [`hb_last_error`] says the rest.

mod guard;
mod message;
#[cfg(test)]
mod misuse_tests;
mod node;
mod parameter_calls;
mod parameters;
mod tick;

pub use guard::{HB_ABORTED, HB_FAILED, HB_OK, hb_last_error};
pub use message::{HbField, HbKind, HbMessage, hb_message_layout_hash};
pub use node::{
    HbNode, HbStep, hb_node_free, hb_node_input, hb_node_is_wired, hb_node_join, hb_node_name,
    hb_node_output, hb_node_period_s, hb_node_run, hb_node_seed, hb_node_state,
};
pub use parameter_calls::{
    hb_node_file, hb_node_has_parameter, hb_node_numbers, hb_node_parameters_json, hb_node_text,
};
pub use tick::{
    HbTick, hb_tick_fail, hb_tick_input, hb_tick_number, hb_tick_output, hb_tick_predecessor, hb_tick_time_ns,
};
