//! Closing the loop: effects that real flights show and that the declared model lacks.
//!
//! Measurement and model are put into the same equations of motion, seen through the same smooth window
//! (`window`, `prepared`, `model`). The residual is regressed on the candidates' effects (`fit`), and judged on
//! flights that nothing was fitted on (`select`).
//!
//! | room | what it holds |
//! |---|---|
//! | [`run`], `error` | the whole way, from flights to a report; reasons why it is not gone |
//! | `clock`, `track` | measured channels on a grid of instants |
//! | `rotor_track`, `spinning` | the rotors on that grid, and those that follow from commands |
//! | `parts`, `excerpt` | pieces of long flights; those in which effects are looked for |
//! | `window` | the window, and differences that lose nothing |
//! | `prepared`, `rows` | a flight, the equations that it allows, and their rows |
//! | `model`, `memo` | the model's side of the equations, and what was computed of it lately |
//! | [`steps_ahead`], [`accelerations`] | errors of multi-step predictions; accelerations at every sample, for benchmarks |
//! | `parameter`, `sensor_effects` | what may be changed of the model; sensors' errors as effects beside the plant's |
//! | `logged_voltage` | voltages of the battery that flights have logged, and the parameters that they determine |
//! | `candidate` | which effects these flights can show |
//! | `flight_wind`, `wind_search`, `wind_start`, `wind_reports`, `past_wind` | one wind for each flight; the search for several; where a fit of it starts; its report; that of a test flight as its past shows it |
//! | `noise_model`, `whitening` | the noise of a residual: autoregressive within a flight, trims between flights |
//! | `problem`, `normal`, `fit`, `fit_result` | an estimation problem; generalised least squares over blocks of time, and their result |
//! | `logging` | timing errors that slowly logged commands make |
//! | `select`, `judgement`, `revision`, `simpler`, `confounded` | the stepwise search for the effects that the flights ask for, its revision by predictions, one effect instead of two, and their rivals |
//! | `ratios`, `instruments` | what flights determine that show rotation alone, and its fit by instrumental variables |
//! | `questions`, `evidence`, `log_rates` | open questions, and what a simulated flight would say on them |
//! | [`proposal`] | the next flight, as reports hold it |
//! | `rig` | flights of vehicles that a rig holds |
//! | `align`, `fault`, `faults`, `trim` | clocks, sensors and trims, before anything is fitted; a fault and its consequence |
//! | `clock_words` | clocks in the text of a report |
//! | `sensing` | the sensors' delays and biases, and a flight without them |
//! | `whiteness`, `noise`, [`statistics`] | what is left, and what noise alone would leave |
//! | `measured`, `predict`, `forecast`, `horizons` | measured states of a flight; prediction over horizons, and tables of its errors |
//! | `disturbance`, `limits` | disturbances as they were seen before a window; what predictions are limited by |
//! | `foresight`, `loss`, `misfit` | predictions, and residuals of each moment, as a judge of effects and of the verdict |
//! | `refine` | parameters moved to where predictions are best |
//! | `regressor` | what residuals are looked at against |
//! | `envelope` | the ranges of the test flights, in which the verdict was judged |
//! | `at_limit`, `unnamed` | effects whose parameters end at the limit of their meaning; names of all effects that are found and not named |
//! | [`effect_reports`], [`worth`] | each effect as it was judged, and what predictions gain by it |
//! | [`report`], `flight_report`, [`brief`], [`vehicle_file`] | what is written down |
//! | `digits` | numbers in texts for people |
//! | [`rotor`] | rotors and motors from a thrust stand or from flights |
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

pub mod accelerations;
mod align;
mod at_limit;
pub mod brief;
mod candidate;
mod clock;
mod clock_words;
mod confounded;
mod digits;
mod disturbance;
pub mod effect_reports;
mod envelope;
mod error;
mod evidence;
mod excerpt;
mod fault;
mod faults;
mod fit;
mod fit_result;
mod flight_report;
mod flight_wind;
mod forecast;
mod foresight;
mod horizons;
mod instruments;
mod judgement;
mod lever;
mod limits;
mod log_rates;
mod logged_voltage;
mod logging;
mod loss;
mod measured;
mod memo;
mod misfit;
mod model;
mod near;
mod noise;
mod noise_model;
mod normal;
mod offset;
mod parameter;
mod parts;
mod past_wind;
mod predict;
mod prepared;
mod problem;
pub mod proposal;
mod questions;
mod ratios;
mod refine;
mod regressor;
pub mod report;
mod revision;
mod rig;
pub mod rotor;
mod rotor_clock;
mod rotor_track;
mod rows;
pub mod run;
mod select;
mod sensing;
mod sensor_effects;
mod simpler;
#[cfg(test)]
#[path = "../tests/simulated/mod.rs"]
mod simulated;
mod spinning;
pub mod statistics;
pub mod steps_ahead;
#[cfg(test)]
mod test_flights;
mod track;
mod trim;
mod unnamed;
mod unusable;
pub mod vehicle_file;
mod weigh;
mod whiteness;
mod whitening;
mod wind_reports;
mod wind_search;
mod wind_start;
mod window;
pub mod worth;

pub use clock::Lateness;
pub use envelope::Reached;
pub use evidence::Evidence;
pub use fault::Fault;
pub use log_rates::LogRates;
pub use prepared::Equation;
pub use questions::{OpenQuestions, Question};
pub use ratios::{Ratio, Ratios};
pub use regressor::Regressor;
pub use sensing::SensorErrors;
pub use unusable::Unusable;

/// Parts for tests that look between the steps of an identification.
#[doc(hidden)]
pub mod steps {
    pub use crate::fit::Problem;
    pub use crate::measured::Measured;
    pub use crate::parameter::{Parameter, Parameters};
    pub use crate::sensor_effects::{
        ACCELEROMETER_BIAS, GYROSCOPE_BIAS, POSE_DELAY, SENSOR_BIAS, SENSOR_DELAY,
    };
}
