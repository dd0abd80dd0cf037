//! FMUs in a run: `kind = "fmu"` of a manifest is a co-simulation FMU of FMI 2.0 or 3.0.
//!
//! The process that holds an FMU holds nothing else, since an FMU is a library of others that may crash. At each due tick its
//! mapped input variables are set from the newest samples, and it steps over one period. Its mapped output variables become
//! the samples of this tick.
//!
//! | room | content |
//! |---|---|
//! | `archive` | the FMU's file, unpacked |
//! | `description` | `modelDescription.xml`: variables, units, what the FMU can do |
//! | `values` | values of variables, by type |
//! | `units` | units of variables against those of fields |
//! | `fields` | places of numbers in a message |
//! | `wiring` | which variable is which field of which port |
//! | `instance` | an instance behind one interface: `fmi2` and `fmi3` |
//! | `library` | the shared library for this machine |
//! | `functions` | loading of its functions, and those of its state |
//! | `proof` | whether a saved state is one: a replay |
//! | `host` | the node: parameters, steps, state |
//! | [`export`] | simulations as FMUs |
//! | `said` | messages of the FMU |

mod archive;
mod description;
pub mod export;
mod fields;
mod fmi2;
mod fmi3;
mod functions;
mod host;
mod instance;
mod library;
mod proof;
mod said;
mod units;
mod values;
mod wiring;

pub use description::Version;
pub use fields::Field;
pub use host::{PARAMETERS, run};
pub use values::Number;
