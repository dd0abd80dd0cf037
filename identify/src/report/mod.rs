//! Reports: the verdict with its intervals, the errors of its predictions, and the files that are written.
//!
//! | file | contents |
//! |---|---|
//! | `past_wind` | the wind of a test flight as its past shows it |
//! | `horizons` | tables of prediction errors |
//! | `loss` | predictions that lose to the declared vehicle or to persistence |
//! | `misfit` | forces and torques that are predicted worse than by no model |
//! | `limits` | the parts of the squared error of predictions |
//! | `whiteness` | whiteness of a residual |
//! | `trim` | trims that differ between flights |
//! | `regressor` | quantities that residuals are plotted against |
//! | `envelope` | ranges of the test flights |
//! | `flight_report` | a flight in the report |
//! | `proposal` | the next flight |
//! | `results` | results for programs, and as text |
//! | `effect_reports` | each effect as it was judged |
//! | `wind_reports` | winds of the fit flights |
//! | `brief` | the first page |
//! | `vehicle_file` | the new vehicle file |
//! | `clock_words` | clocks of the flights in the text of a report |

pub mod brief;
pub(crate) mod clock_words;
pub mod effect_reports;
pub(crate) mod envelope;
pub(crate) mod flight_report;
pub(crate) mod horizons;
pub(crate) mod limits;
pub(crate) mod loss;
pub(crate) mod misfit;
pub(crate) mod past_wind;
pub mod proposal;
pub(crate) mod regressor;
pub(crate) mod results;
pub(crate) mod trim;
pub mod vehicle_file;
pub(crate) mod whiteness;
pub(crate) mod wind_reports;

pub use results::{
    BeforeAfter, Change, Changes, EffectReport, Estimate, FlightReport, FlightWind, Noise, Report,
    Unexplained,
};
