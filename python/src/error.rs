//! Errors of hummingbus as Python's.

use pyo3::PyErr;

pyo3::create_exception!(hummingbus, Error, pyo3::exceptions::PyRuntimeError, "What went wrong, in words.");

/// An error of hummingbus as Python's.
pub(crate) fn raised(error: impl ToString) -> PyErr {
    Error::new_err(error.to_string())
}
