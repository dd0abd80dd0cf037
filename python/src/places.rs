//! Arrays of numpy over the samples of a port.

use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyMemoryView, PyTuple};
use std::collections::BTreeMap;

/// `PyBUF_READ` and `PyBUF_WRITE` of Python's header, part of its stable interface.
const READ_ONLY: std::ffi::c_int = 0x100;
const WRITABLE: std::ffi::c_int = 0x200;

/// Largest number of places for which a port keeps arrays: the samples of a usual window.
const PLACES_MAX: usize = 1024;

/// References to an array between two steps: of its place, and of the arguments of the step.
const ARRAY_REFERENCES: ffi::Py_ssize_t = 2;
/// References to a view between two steps: of its place, and of the array.
const VIEW_REFERENCES: ffi::Py_ssize_t = 2;

/// Maker of arrays over memory of the bus.
pub(crate) struct Arrays {
    ndarray: Py<PyAny>,
    /// `()`: the shape of a message. As an array of no dimension its fields are read 20 times as fast as those of a record.
    no_dimension: Py<PyTuple>,
}

/// Arrays of a port. Its samples lie in a few places of shared memory by turns: one array serves all samples of a place.
pub(crate) struct Places {
    is_writable: bool,
    /// Type of numpy of the messages.
    dtype: Py<PyAny>,
    places: Vec<Place>,
    /// Indices of the places by their addresses.
    by_address: BTreeMap<usize, usize>,
    /// Index of the place that the step got last; absent if it got no message.
    current: Option<usize>,
}

/// A place of shared memory.
struct Place {
    view: Py<PyMemoryView>,
    array: Py<PyAny>,
}

impl Arrays {
    pub(crate) fn new(py: Python<'_>) -> PyResult<Self> {
        let ndarray = py.import("numpy")?.getattr("ndarray")?.unbind();
        Ok(Self { ndarray, no_dimension: PyTuple::empty(py).unbind() })
    }

    /// Array of the message of `size` bytes at `start`, and the view that it stands on.
    ///
    /// # Safety
    /// As for [`memory_view`].
    pub(crate) unsafe fn over<'py>(
        &self,
        py: Python<'py>,
        start: *mut u8,
        size: usize,
        is_writable: bool,
        dtype: &Py<PyAny>,
    ) -> PyResult<(Bound<'py, PyMemoryView>, Bound<'py, PyAny>)> {
        // SAFETY: the caller's promise.
        let view = unsafe { memory_view(py, start, size, is_writable) }?;
        let array = self.ndarray.bind(py).call1((&self.no_dimension, dtype, &view))?;
        Ok((view, array))
    }
}

impl Arrays {
    /// Array of a copy of the message in `bytes`.
    pub(crate) fn copied<'py>(
        &self,
        py: Python<'py>,
        bytes: &[u8],
        dtype: &Py<PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.ndarray.bind(py).call1((&self.no_dimension, dtype, PyBytes::new(py, bytes)))
    }
}

impl Places {
    /// Type of numpy of the messages.
    pub(crate) fn dtype(&self) -> &Py<PyAny> {
        &self.dtype
    }

    pub(crate) fn new(dtype: Py<PyAny>, is_writable: bool) -> Self {
        Self { is_writable, dtype, places: Vec::new(), by_address: BTreeMap::new(), current: None }
    }

    /// Array of the message of `size` bytes at `start`: the same one at each tick with a message there.
    ///
    /// # Safety
    /// The message is there and does not change until the step ends.
    pub(crate) unsafe fn message(
        &mut self,
        py: Python<'_>,
        arrays: &Arrays,
        start: *mut u8,
        size: usize,
    ) -> PyResult<&Py<PyAny>> {
        let found = self.by_address.get(&start.addr()).copied();
        let index = if let Some(index) = found {
            index
        } else {
            // SAFETY: the step gets the array only while a message lies there, and `is_kept` finds a step that keeps it.
            let (view, array) = unsafe { arrays.over(py, start, size, self.is_writable, &self.dtype) }?;
            self.add(start.addr(), Place { view: view.unbind(), array: array.unbind() })
        };
        self.current = Some(index);
        Ok(&self.places[index].array)
    }

    /// Adds the place at `address`; returns its index. A port with too many of them begins anew.
    fn add(&mut self, address: usize, place: Place) -> usize {
        if self.places.len() == PLACES_MAX {
            self.places.clear();
            self.by_address.clear();
        }
        self.places.push(place);
        self.by_address.insert(address, self.places.len() - 1);
        self.places.len() - 1
    }

    /// Notes that the step gets no message.
    pub(crate) fn skip(&mut self) {
        self.current = None;
    }

    /// True if the program still refers to the message that the step got. Fields of the array refer to the
    /// array. Other arrays over its `base` refer to the view (numpy does not hold the view's buffer).
    pub(crate) fn is_kept(&self, _: Python<'_>) -> bool {
        let Some(Place { view, array }) = self.current.map(|index| &self.places[index]) else { return false };
        // SAFETY: the objects live, and this thread is attached to the interpreter.
        let references = unsafe { (ffi::Py_REFCNT(array.as_ptr()), ffi::Py_REFCNT(view.as_ptr())) };
        references != (ARRAY_REFERENCES, VIEW_REFERENCES)
    }
}

/// A view of `size` bytes at `start`.
///
/// # Safety
/// As long as anybody reads the view or what is made of it, the memory is there and nobody else changes it.
unsafe fn memory_view(
    py: Python<'_>,
    start: *mut u8,
    size: usize,
    is_writable: bool,
) -> PyResult<Bound<'_, PyMemoryView>> {
    let flags = if is_writable { WRITABLE } else { READ_ONLY };
    let size = isize::try_from(size).map_err(crate::error::raised)?;
    // SAFETY: the caller's promise; the call returns a new reference or an error.
    let view =
        unsafe { Bound::from_owned_ptr_or_err(py, ffi::PyMemoryView_FromMemory(start.cast(), size, flags)) }?;
    Ok(view.cast_into::<PyMemoryView>()?)
}
