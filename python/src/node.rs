//! A node whose step is a Python function: it gets its messages as arrays of numpy in shared memory.

use crate::error::raised;
use crate::message::declared;
use crate::places::{Arrays, Places};
use bus::BusError;
use bus::dynamic::{DynamicNode, DynamicTick};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

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
    /// Interned, as the names of a function's parameters are: Python finds the parameter by its address.
    name: Py<PyString>,
    number: usize,
    places: Places,
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
        self.inputs.push(Port::new(py, port, number, Places::new(dtype, false)));
        Ok(())
    }

    /// Declares an output likewise.
    fn output(&mut self, py: Python<'_>, port: &str, message: &str, dtype: Py<PyAny>) -> PyResult<()> {
        let node = self.declaring()?;
        let schema = declared(message, false).map_err(|reason| raised(node.error(reason)))?;
        let number = node.output(port, schema).map_err(raised)?;
        self.outputs.push(Port::new(py, port, number, Places::new(dtype, true)));
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

    /// Calls `step(tick, **messages)` at every due tick until the run ends. False if the launcher ended it early. Where given, `take_over(sent)` is
    /// called before the step of a take-over without state, with copies of what the process before sent last, by output.
    #[pyo3(signature = (step, take_over=None))]
    fn run(slf: &Bound<'_, Self>, step: Py<PyAny>, take_over: Option<Py<PyAny>>) -> PyResult<bool> {
        let py = slf.py();
        // Borrowed no longer than this: a step that asks the node is answered in words.
        let mut declared = slf.try_borrow_mut()?;
        let node = declared.node.take().ok_or_else(|| raised("the node runs already"))?;
        let caller = Caller::new(py, &mut declared, step, take_over)?;
        drop(declared);
        let ended = py.detach(|| {
            // What the closure holds is used by this thread alone.
            let mut caller = caller;
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

impl Port {
    fn new(py: Python<'_>, name: &str, number: usize, places: Places) -> Self {
        Self { name: PyString::intern(py, name).unbind(), number, places }
    }

    /// The error of a step that has kept a view of the message.
    fn kept(&self) -> String {
        let port = &self.name;
        format!(
            "the step has kept a view of `{port}`, whose memory is another message's at the next tick; keep a copy: \
             {port}.copy(), float({port}[\"field\"])"
        )
    }
}

/// Steps of a Python function.
struct Caller {
    step: Py<PyAny>,
    take_over: Option<Py<PyAny>>,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    /// Arguments of the step by their names; the state, which stays where it is, is one of them.
    messages: Py<PyDict>,
    arrays: Arrays,
    format_exception: Py<PyAny>,
}

impl Caller {
    fn new(py: Python<'_>, node: &mut Node, step: Py<PyAny>, take_over: Option<Py<PyAny>>) -> PyResult<Self> {
        let (arrays, messages) = (Arrays::new(py)?, PyDict::new(py));
        if let Some(State { memory, size, dtype }) = node.state.take() {
            // SAFETY: this memory stays as long as the process lives; the bus changes it between steps only.
            let (_, state) = unsafe { arrays.over(py, memory, size, true, &dtype) }?;
            messages.set_item(PyString::intern(py, "state"), state)?;
        }
        Ok(Self {
            step,
            take_over,
            inputs: std::mem::take(&mut node.inputs),
            outputs: std::mem::take(&mut node.outputs),
            messages: messages.unbind(),
            arrays,
            format_exception: py.import("traceback")?.getattr("format_exception")?.unbind(),
        })
    }

    /// Calls the step with the messages of `tick`.
    fn call(&mut self, py: Python<'_>, tick: &mut DynamicTick<'_, '_>) -> Result<(), String> {
        self.call_with_messages(py, tick).map_err(|error| self.told(py, &error))?;
        let mut ports = self.inputs.iter().chain(&self.outputs);
        ports.find(|port| port.places.is_kept(py)).map_or(Ok(()), |port| Err(port.kept()))
    }

    /// Tells the component what the process before it sent last, where this tick knows it.
    fn call_take_over(&self, py: Python<'_>, tick: &DynamicTick<'_, '_>) -> PyResult<()> {
        let Some(take_over) = &self.take_over else { return Ok(()) };
        let sent = PyDict::new(py);
        for Port { name, number, places } in &self.outputs {
            if let Some(bytes) = tick.predecessor(*number).map_err(raised)? {
                sent.set_item(name, self.arrays.copied(py, bytes, places.dtype())?)?;
            }
        }
        if !sent.is_empty() {
            take_over.bind(py).call1((sent,))?;
        }
        Ok(())
    }

    fn call_with_messages(&mut self, py: Python<'_>, tick: &mut DynamicTick<'_, '_>) -> PyResult<()> {
        self.call_take_over(py, tick)?;
        let messages = self.messages.bind(py);
        for Port { name, number, places } in &mut self.inputs {
            let bytes = tick.input(*number).map_err(raised)?;
            // SAFETY: the message lies there until the step ends, and `is_kept` ends the run where a view outlives that; what
            // such a run has mapped stays as long as the process lives.
            let message =
                unsafe { places.message(py, &self.arrays, bytes.as_ptr().cast_mut(), bytes.len()) }?;
            messages.set_item(&*name, message)?;
        }
        for Port { name, number, places } in &mut self.outputs {
            let Some(bytes) = tick.output(*number).map_err(raised)? else {
                places.skip();
                messages.set_item(&*name, py.None())?;
                continue;
            };
            // SAFETY: as above; nobody else reads or writes the message before it is sent.
            let message = unsafe { places.message(py, &self.arrays, bytes.as_mut_ptr(), bytes.len()) }?;
            messages.set_item(&*name, message)?;
        }
        self.step.bind(py).call((tick.number(),), Some(messages))?;
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
