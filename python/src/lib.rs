//! The part of the Python package `hummingbus` that is Rust: nodes, messages and recordings. `hummingbus/__init__.py` is what
//! people import.

mod message;
mod node;
mod recording;

use pyo3::prelude::*;

pyo3::create_exception!(hummingbus, Error, pyo3::exceptions::PyRuntimeError, "What went wrong, in words.");

/// An error of hummingbus as Python's.
pub(crate) fn raised(error: impl ToString) -> PyErr {
    Error::new_err(error.to_string())
}

/// The module `hummingbus._native`.
#[pymodule(name = "_native")]
fn native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Error", module.py().get_type::<Error>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<node::Node>()?;
    module.add_class::<recording::Recording>()?;
    module.add_function(wrap_pyfunction!(message::messages, module)?)?;
    module.add_function(wrap_pyfunction!(message::message, module)?)
}
