//! Faults of texts that people write, as data until they are printed; and the units in which people write.
//!
//! | room | what it holds |
//! |---|---|
//! | [`Diagnostic`] | fault of a file: the place, what was expected, what was found, what to do |
//! | [`Error`] | error of the library's functions; `ComponentFailure` marks failures in flight |
//! | `nearest` | the known name that was probably meant |
//! | `number_text` | advice on numbers that are written as texts |
//! | `place` | position in a file |
//! | `digits` | numbers with the digits that people read |
//! | `plain` | messages of the system and of libraries, in words |
//! | `printable` | untrusted text as a terminal shows it |
//! | [`mod@parameter`] | parameters of components: the error, and the checks that raise it |
//! | `read` | types from JSON and TOML, whose errors carry their keys and places |
//! | [`mod@unit`] | every unit that a file may use, with its factor to SI |
//!
//! ```
//! use diagnostics::parameter::positive;
//!
//! let error = positive("mass_kg", -1.0).unwrap_err();
//! assert_eq!(error.key(), "mass_kg");
//! assert_eq!(error.to_string(), "`mass_kg` must be a finite number above 0, found -1");
//! ```
#![forbid(unsafe_code)]

mod component_failure;
mod diagnostic;
mod digits;
mod error;
mod nearest;
mod number_text;
pub mod parameter;
mod place;
mod plain;
mod printable;
mod read;
pub mod unit;

pub use component_failure::ComponentFailure;
pub use diagnostic::{Diagnostic, Faults};
pub use digits::{digits, nine_decimals};
pub use error::{Error, Result, find_diagnostic, has_text_of};
pub use nearest::{did_you_mean, nearest, suggestion, typo_of};
pub use number_text::leading_number;
pub use parameter::ParameterError;
pub use place::Place;
pub use plain::plain;
pub use printable::{
    NotOneLine, is_printable, printable, printable_json, printable_line, require_line, short_lines, shortened,
};
pub use read::{Misread, parse_toml, read, read_toml, read_tree};
pub use unit::{Dimension, convert};
