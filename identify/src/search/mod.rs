//! The search: clocks and channels that are believed, fits, candidates, and their judgement.
//!
//! | file | contents |
//! |---|---|
//! | `align` | offsets between the clocks of a flight |
//! | `rotor_clock` | lateness of rotor speeds |
//! | `faults` | tests for faults, flight by flight and channel by channel |
//! | `candidate` | effects that the flights can show |
//! | `fit_result` | the result of a fit |
//! | `fit` | generalised least squares over blocks of time |
//! | `near` | fits near a solution |
//! | `instruments` | fits by instrumental variables |
//! | `lever` | torques of forces that no effect explains |
//! | `weigh` | noise of the equations when all candidates have taken their part |
//! | `worth` | errors of predictions with and without an effect |
//! | `foresight` | predictions as a judge of effects |
//! | `refine` | parameters moved to where predictions are best |
//! | `logging` | timing errors that slowly logged commands make |
//! | `judgement` | one candidate beside the accepted effects |
//! | `wind_start` | winds at which a fit of several winds starts |
//! | `wind_search` | several winds, found at once |
//! | `simpler` | one effect in place of two |
//! | `revision` | revision of a search by predictions |
//! | `select` | the stepwise search |
//! | `ratios` | what flights determine that show rotation alone |
//! | `confounded` | rivals of accepted effects |
//! | `excerpt` | the parts of long flights in which effects are searched |
//! | `questions` | open questions of an identification |
//! | `evidence` | evidence of a simulated flight on open questions |
//! | `at_limit` | estimates at the limit of their meaning |
//! | `unnamed` | effects that were found and are not named |

pub mod align;
pub mod at_limit;
pub mod candidate;
pub mod confounded;
pub mod evidence;
pub mod excerpt;
pub mod faults;
pub mod fit;
pub mod fit_result;
pub mod foresight;
pub mod instruments;
pub mod judgement;
pub mod lever;
pub mod logging;
pub mod near;
pub mod questions;
pub mod ratios;
pub mod refine;
pub mod revision;
pub mod rotor_clock;
pub mod select;
pub mod simpler;
pub mod unnamed;
pub mod weigh;
pub mod wind_search;
pub mod wind_start;
pub mod worth;
