//! A node whose step is a Python function: it gets its messages as arrays of numpy in shared memory.

use crate::error::raised;
use crate::message::declared;
use bus::BusError;
use bus::dynamic::{DynamicNode, DynamicTick};
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMemoryView, PyString, PyTuple};

/// `PyBUF_READ` and `PyBUF_WRITE` of Python's header, part of its stable interface.
const READ_ONLY: std::ffi::c_int = 0x100;
const WRITABLE: std::ffi::c_int = 0x200;

/// A node of a run, before its first tick; `hummingbus/_nodes.py` has what people use.
#[pyclass(unsendable)]
pub struct Node {
    node: Option<DynamicNode>,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    state: Option<State>,
}

/// A declared port.
struct Port {
    name: Py<PyString>,
    number: usize,
    /// Type of numpy of its messages.
    dtype: Py<PyAny>,
}

/// The state of a node, in memory of the bus.
struct State {
    memory: *mut u8,
    size: usize,
    dtype: Py<PyAny>,
}

#[pymethods]
impl Node {
    /// Joins the run that started this process.
    #[new]
    fn join(py: Python<'_>) -> PyResult<Self> {
        // A signal ends the run at a tick; Python would raise in the middle of one. What the bus does on one comes in addition.
        let signal = py.import("signal")?;
        let interrupt = signal.getattr("SIGINT")?;
        let before = signal.call_method1("signal", (&interrupt, signal.getattr("SIG_IGN")?));
        let node = DynamicNode::join().map_err(|error| {
            // Where it cannot be set, since this is no main thread, it was not set before either.
            let _ = before.and_then(|before| signal.call_method1("signal", (&interrupt, before)));
            raised(error)
        })?;
        Ok(Self { node: Some(node), inputs: Vec::new(), outputs: Vec::new(), state: None })
    }

    /// Name in the run.
    #[getter]
    fn name(&self) -> PyResult<String> {
        Ok(self.known()?.name().to_owned())
    }

    /// Simulated time between two steps, s.
    #[getter]
    fn period_s(&self) -> PyResult<f64> {
        Ok(self.known()?.period_s())
    }

    /// Seed of the run.
    #[getter]
    fn seed(&self) -> PyResult<u64> {
        Ok(self.known()?.seed())
    }

    /// Parameters as JSON.
    fn parameters(&self) -> PyResult<String> {
        Ok(self.known()?.parameters().to_string())
    }

    /// Contents of the file `path` that the parameters name, as it was when the run began.
    fn file(&self, path: &str) -> PyResult<String> {
        self.known()?.files().text(path.as_ref()).map_err(raised)
    }

    /// Inputs that the manifest wires and outputs that it names, with the types of their topics.
    fn wired(&self) -> PyResult<[Vec<(String, String)>; 2]> {
        let owned = |(port, type_name): (&str, &str)| (port.to_owned(), type_name.to_owned());
        let node = self.known()?;
        Ok([node.wired_inputs().map(owned).collect(), node.named_outputs().map(owned).collect()])
    }

    /// Declares an input with its message (JSON) and type of numpy.
    fn input(&mut self, py: Python<'_>, port: &str, message: &str, dtype: Py<PyAny>) -> PyResult<()> {
        let node = self.declaring()?;
        let schema = declared(message, false).map_err(|reason| raised(node.error(reason)))?;
        let number = node.input(port, schema).map_err(raised)?;
        self.inputs.push(Port { name: PyString::new(py, port).unbind(), number, dtype });
        Ok(())
    }

    /// Declares an output likewise.
    fn output(&mut self, py: Python<'_>, port: &str, message: &str, dtype: Py<PyAny>) -> PyResult<()> {
        let node = self.declaring()?;
        let schema = declared(message, false).map_err(|reason| raised(node.error(reason)))?;
        let number = node.output(port, schema).map_err(raised)?;
        self.outputs.push(Port { name: PyString::new(py, port).unbind(), number, dtype });
        Ok(())
    }

    /// Declares the state likewise.
    fn declare_state(&mut self, message: &str, dtype: Py<PyAny>) -> PyResult<()> {
        let node = self.declaring()?;
        let schema = declared(message, true).map_err(|reason| raised(node.error(reason)))?;
        let memory = node.state(schema).map_err(raised)?;
        self.state = Some(State { memory, size: schema.size, dtype });
        Ok(())
    }

    /// Calls `step(tick, **messages)` at every due tick until the run ends. False if the launcher ended it early.
    fn run(slf: &Bound<'_, Self>, step: Py<PyAny>) -> PyResult<bool> {
        let py = slf.py();
        // Borrowed no longer than this: a step that asks the node is answered in words.
        let mut declared = slf.try_borrow_mut()?;
        let node = declared.node.take().ok_or_else(|| raised("the node runs already"))?;
        let caller = Caller::new(py, &mut declared, step)?;
        drop(declared);
        let ended = py.detach(|| {
            // What the closure holds is used by this thread alone.
            let caller = caller;
            node.run(|tick| Python::attach(|py| caller.call(py, tick)))
        });
        match ended {
            Ok(()) => Ok(true),
            Err(BusError::Aborted) => Ok(false),
            Err(error) => Err(raised(error)),
        }
    }
}

impl Node {
    fn known(&self) -> PyResult<&DynamicNode> {
        self.node.as_ref().ok_or_else(|| raised("the node runs already"))
    }

    fn declaring(&mut self) -> PyResult<&mut DynamicNode> {
        self.node.as_mut().ok_or_else(|| raised("the node runs already"))
    }
}

/// Steps of a Python function.
struct Caller {
    step: Py<PyAny>,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    /// Array of the state, which stays where it is.
    state: Option<Py<PyAny>>,
    ndarray: Py<PyAny>,
    /// `()`: the shape of a message. As an array of no dimension its fields are read 20 times as fast as those of a record.
    no_dimension: Py<PyTuple>,
    format_exception: Py<PyAny>,
}

impl Caller {
    fn new(py: Python<'_>, node: &mut Node, step: Py<PyAny>) -> PyResult<Self> {
        let mut caller = Self {
            step,
            inputs: std::mem::take(&mut node.inputs),
            outputs: std::mem::take(&mut node.outputs),
            state: None,
            ndarray: py.import("numpy")?.getattr("ndarray")?.unbind(),
            no_dimension: PyTuple::empty(py).unbind(),
            format_exception: py.import("traceback")?.getattr("format_exception")?.unbind(),
        };
        if let Some(State { memory, size, dtype }) = node.state.take() {
            // SAFETY: this memory stays as long as the process lives; the bus changes it between steps only.
            let view = unsafe { memory_view(py, memory, size, true) }?;
            caller.state = Some(caller.message(py, &view, &dtype)?.unbind());
        }
        Ok(caller)
    }

    /// The message in `view` as an array of numpy.
    fn message<'py>(
        &self,
        py: Python<'py>,
        view: &Bound<'py, PyMemoryView>,
        dtype: &Py<PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.ndarray.bind(py).call1((&self.no_dimension, dtype, view))
    }

    /// Calls the step with the messages of `tick`.
    fn call(&self, py: Python<'_>, tick: &mut DynamicTick<'_, '_>) -> Result<(), String> {
        let mut views = Vec::with_capacity(self.inputs.len() + self.outputs.len());
        let called = self.call_with_views(py, tick, &mut views);
        called.map_err(|error| self.told(py, &error))?;
        views.iter().try_for_each(|(port, view)| released(port, view))
    }

    fn call_with_views<'py>(
        &self,
        py: Python<'py>,
        tick: &mut DynamicTick<'_, '_>,
        views: &mut Vec<(Py<PyString>, Bound<'py, PyMemoryView>)>,
    ) -> PyResult<()> {
        let messages = PyDict::new(py);
        for Port { name, number, dtype } in &self.inputs {
            let bytes = tick.input(*number).map_err(raised)?;
            // SAFETY: the message lies there until the step ends, and `released` ends the run where a view outlives that; what
            // such a run has mapped stays as long as the process lives.
            let view = unsafe { memory_view(py, bytes.as_ptr().cast_mut(), bytes.len(), false) }?;
            messages.set_item(name, self.message(py, &view, dtype)?)?;
            views.push((name.clone_ref(py), view));
        }
        for Port { name, number, dtype } in &self.outputs {
            let Some(bytes) = tick.output(*number).map_err(raised)? else {
                messages.set_item(name, py.None())?;
                continue;
            };
            // SAFETY: as above; nobody else reads or writes the message before it is sent.
            let view = unsafe { memory_view(py, bytes.as_mut_ptr(), bytes.len(), true) }?;
            messages.set_item(name, self.message(py, &view, dtype)?)?;
            views.push((name.clone_ref(py), view));
        }
        if let Some(state) = &self.state {
            messages.set_item("state", state)?;
        }
        self.step.bind(py).call((tick.number(),), Some(&messages))?;
        Ok(())
    }

    /// An exception of the step with its traceback, its last line first.
    fn told(&self, py: Python<'_>, error: &PyErr) -> String {
        let whole = (error.get_type(py), error.value(py), error.traceback(py));
        let lines = self.format_exception.bind(py).call1(whole);
        let lines = lines.and_then(|lines| lines.extract::<Vec<String>>()).unwrap_or_default();
        let last = lines.last().map_or_else(|| error.to_string(), |line| line.trim_end().to_owned());
        format!("{last}\n{}", lines.concat().trim_end())
    }
}

/// Lets go of a message, of which the step may have kept no view: its memory is the next sample's. Each array on it refers to
/// `view` (numpy does not hold the buffer of it).
fn released(port: &Py<PyString>, view: &Bound<'_, PyMemoryView>) -> Result<(), String> {
    // SAFETY: the object lives, and this thread is attached to the interpreter.
    let references = unsafe { ffi::Py_REFCNT(view.as_ptr()) };
    if references == 1 {
        return Ok(());
    }
    Err(format!(
        "the step has kept a view of `{port}`, whose memory is another message's at the next tick; keep a copy: \
         {port}.copy(), float({port}[\"field\"])"
    ))
}

/// A view of `size` bytes at `start`.
///
/// # Safety
/// The memory is there, and nobody else changes it, as long as the view or what is made of it lives.
unsafe fn memory_view(
    py: Python<'_>,
    start: *mut u8,
    size: usize,
    is_writable: bool,
) -> PyResult<Bound<'_, PyMemoryView>> {
    let flags = if is_writable { WRITABLE } else { READ_ONLY };
    let size = isize::try_from(size).map_err(raised)?;
    // SAFETY: the caller's promise; the call returns a new reference or an error.
    let view =
        unsafe { Bound::from_owned_ptr_or_err(py, ffi::PyMemoryView_FromMemory(start.cast(), size, flags)) }?;
    Ok(view.cast_into::<PyMemoryView>()?)
}
