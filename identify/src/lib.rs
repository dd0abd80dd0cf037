//! Closing the loop: effects that real flights show and that the declared model lacks.
//!
//! | room | contents | needs |
//! |---|---|---|
//! | `numbers` | [`statistics`], least squares, numbers in texts | |
//! | `data` | flights as they were measured: channels, grids, clocks, faults | `numbers` |
//! | `model` | physics, parameters, sensors, noise, predictions; [`steps_ahead`] and [`accelerations`] for benchmarks | `numbers`, `data` |
//! | `search` | clocks and channels that are believed, fits, candidates, judgement, open questions; [`worth`] | `numbers`, `data`, `model` |
//! | [`report`] | the verdict: [`effect_reports`], [`brief`], [`vehicle_file`], [`proposal`], tables of errors | `numbers`, `data`, `model`, `search` |
//! | [`rotor`] | rotors and motors from a thrust stand or from flights | `numbers`, `data`, `model` |
//! | [`run`], `error` | the way through all rooms, from flights to a report; reasons why it ends early | all but `rotor` |
//!
//! A room needs the rooms in its last column alone, and no two files need each other (`tests/layering.rs`). `mod.rs` of a room
//! lists its files.
//!
//! Measurement and model are put into the same equations of motion, seen through the same smooth window (`data::window`,
//! `data::prepared`, `model::physics`). The residual is regressed on the effects of the candidates (`search::fit`), and judged
//! on flights that nothing was fitted on (`search::select`).
//!
//! ```no_run
//! use flights::FlightSet;
//!
//! let set = FlightSet::load("flights/nanobench.toml".as_ref())?;
//! let outcome = identify::run::identify(&set, &mut |step| println!("{step}"))?;
//! println!("{}", outcome.report);
//! let vehicle_file = identify::vehicle_file::text(&set.files, &set.vehicle, &outcome.effects, &outcome.report)?;
//! # let _ = vehicle_file;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// Simulated flights of the tests name this crate, also in its own unit tests.
#[cfg(test)]
extern crate self as identify;

mod data;
mod error;
mod model;
mod numbers;
pub mod report;
pub mod rotor;
pub mod run;
mod search;
#[cfg(test)]
#[path = "../tests/simulated/mod.rs"]
mod simulated;
#[cfg(test)]
mod test_flights;

pub use data::clock::Lateness;
pub use data::fault::Fault;
pub use data::log_rates::LogRates;
pub use data::prepared::Equation;
pub use data::sensing::SensorErrors;
pub use data::unusable::Unusable;
pub use model::{accelerations, steps_ahead};
pub use numbers::statistics;
pub use report::envelope::Reached;
pub use report::regressor::Regressor;
pub use report::{brief, effect_reports, proposal, vehicle_file};
pub use search::evidence::Evidence;
pub use search::questions::{OpenQuestions, Question};
pub use search::ratios::{Ratio, Ratios};
pub use search::worth;

/// Parts for tests that look between the steps of an identification.
#[doc(hidden)]
pub mod steps {
    pub use crate::data::measured::Measured;
    pub use crate::model::parameter::{Parameter, Parameters};
    pub use crate::model::problem::Problem;
    pub use crate::model::sensor_effects::{
        ACCELEROMETER_BIAS, GYROSCOPE_BIAS, POSE_DELAY, SENSOR_BIAS, SENSOR_DELAY,
    };
}
