//! The part of the Python package `hummingbus` that is Rust: nodes, messages and recordings. `hummingbus/__init__.py` is what
//! people import.

mod error;
mod message;
mod node;
mod places;
mod recording;
mod simulation;
mod vehicle;

use pyo3::prelude::*;

/// The module `hummingbus._native`.
#[pymodule(name = "_native")]
fn native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Error", module.py().get_type::<error::Error>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<node::Node>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<simulation::Saved>()?;
    module.add_class::<simulation::Simulation>()?;
    module.add("REFERENCE_VEHICLE", hummingbus::vehicles::reference::HUMMINGBIRD)?;
    module.add_function(wrap_pyfunction!(message::messages, module)?)?;
    module.add_function(wrap_pyfunction!(message::message, module)?)?;
    module.add_function(wrap_pyfunction!(vehicle::motors, module)?)
}
