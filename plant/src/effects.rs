//! The effects: named pieces of physics beyond the declared vehicle, for simulating and for identifying.
//!
//! An effect is a set of pure functions of its parameters and the flight condition. The plant sums the effects that
//! the vehicle file and the scene file list, in that order; an identification evaluates the same functions on measured
//! states and fits their parameters. Each effect is one file in the folder `catalogue`, with all that is known of it,
//! and one row of [`CATALOGUE`].
//!
//! | room | what it holds |
//! |---|---|
//! | `kind`, `parameters_macro` | the facts of an effect; its parameters by name |
//! | `condition` | what the functions of effects are functions of |
//! | `catalogue` | all effects |
//! | [`entry`] | what files list, checked against the catalogue |
//! | [`page`] | the catalogue as a page of documentation |
//!
//! ```
//! use plant::effects::{CATALOGUE, Quantity, find};
//!
//! let drag = find("rotor-drag").expect("it is in the catalogue");
//! assert!(drag.needs.contains(&Quantity::Airspeed));
//! assert_eq!(drag.neutral().values[0], 0.0);
//! assert_eq!(drag.nominal().values[0], drag.parameters[0].nominal);
//! assert!(CATALOGUE.iter().all(|kind| !kind.source.is_empty()));
//! ```

// First: modules behind it see its macro without importing it from the top of the crate.
#[macro_use]
mod parameters_macro;

mod catalogue;
mod condition;
pub mod entry;
mod kind;
pub mod page;

pub use catalogue::command_delay::EFFECT as COMMAND_DELAY;
pub use catalogue::turbulence::EFFECT as TURBULENCE;
pub use catalogue::wind::EFFECT as WIND;
pub use catalogue::{CATALOGUE, find};
pub use condition::FlightCondition;
pub use kind::{
    Action, Advance, Confounder, Effect, EffectKind, FitAs, PARAMETERS_MAX, ParameterSpec, Quantity,
    Randomness, Requirement, Stage, Values, VoltageLaw,
};
