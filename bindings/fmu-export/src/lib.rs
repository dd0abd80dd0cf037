//! The library of FMUs that hold a simulation: `hummingbus export-fmu` puts it into them.
//!
//! | room | content |
//! |---|---|
//! | `simulation` | a simulation with variables: what both versions of the standard offer |
//! | `handle` | instances as pointers; errors and panics become a status and a message |
//! | `fmi2`, `fmi3` | the functions of the standard |

mod fmi2;
mod fmi3;
mod handle;
mod simulation;
