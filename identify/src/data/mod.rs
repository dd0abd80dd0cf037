//! Data: flights as they were measured, on the grids on which a model is held against them.
//!
//! | file | contents |
//! |---|---|
//! | `clock` | the grid of instants, and clocks that are late on it |
//! | `track` | measured channels on the grid |
//! | `rotor_track` | the rotors on the grid |
//! | `window` | the window through which measurement and model are seen, and its differences |
//! | `sensing` | errors of sensors, and a flight without them |
//! | `measured` | measured states of a flight, at which predictions begin |
//! | `memo` | rows of a flight that were computed lately |
//! | `rig` | flights of vehicles that a rig holds |
//! | `unusable` | reasons why a flight cannot be compared |
//! | `prepared` | a flight with its grid and its equations |
//! | `rows` | rows of the equations, by component |
//! | `parts` | parts of long flights |
//! | `logged_voltage` | logged voltages of the battery |
//! | `log_rates` | rates at which flights were logged |
//! | `fault` | a fault of a channel or a motor, and its consequence |

pub mod clock;
pub mod fault;
pub mod log_rates;
pub mod logged_voltage;
pub mod measured;
pub mod memo;
pub mod parts;
pub mod prepared;
pub mod rig;
pub mod rotor_track;
pub mod rows;
pub mod sensing;
pub mod track;
pub mod unusable;
pub mod window;
