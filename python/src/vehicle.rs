//! Facts of a vehicle file.

use crate::error::raised;
use hummingbus::vehicles::Vehicle;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Number of rotors of the vehicle file at `path`; the command at which it hovers, the least and the greatest command, in the
/// file's unit.
#[pyfunction]
pub fn motors(path: PathBuf) -> PyResult<(usize, f64, f64, f64)> {
    let vehicle = Vehicle::load(&path).map_err(raised)?;
    let range = &vehicle.command;
    Ok((vehicle.rotors.len(), vehicle.hover_command(), range.min, range.max))
}
