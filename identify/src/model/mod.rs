//! The model: physics with parameters in one table, sensors, noise, and what all of them predict.
//!
//! | file | contents |
//! |---|---|
//! | `sensor_effects` | errors of sensors as effects beside those of the plant |
//! | `flight_wind` | one wind for each flight, as an effect |
//! | `parameter` | the table of parameters: those of all candidate effects |
//! | `spinning` | rotors that follow from commands |
//! | `physics` | the model's side of the equations, its residuals and derivatives |
//! | `noise_model` | autoregressive noise of a residual |
//! | `whitening` | covariance of a residual: noise within a flight, trims between flights |
//! | `noise` | noise of sensors, and what it adds to the errors of predictions |
//! | `problem` | flights in their roles, beside the model that they are held against |
//! | `forecast` | pushes that are expected over a window |
//! | `own_trim` | the trim that one flight alone has, by its past |
//! | `disturbance` | disturbances as they were seen before a window |
//! | `predict` | predictions over horizons |
//! | `steps_ahead` | errors of predictions over several steps, for benchmarks |
//! | `accelerations` | accelerations at every sample, for benchmarks |

pub mod accelerations;
pub mod disturbance;
pub mod flight_wind;
pub mod forecast;
pub mod noise;
pub mod noise_model;
pub mod own_trim;
pub mod parameter;
pub mod physics;
pub mod predict;
pub mod problem;
pub mod sensor_effects;
pub mod spinning;
pub mod steps_ahead;
pub mod whitening;
