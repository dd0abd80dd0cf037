//! A simulation that Python steps, on its own thread, without processes.

use crate::error::raised;
use bus::checkpoint::Parts;
use hummingbus::agent::{Action, Actions, registry};
use hummingbus::runtime::manifest::Manifest;
use hummingbus::runtime::simulate;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use std::path::Path;

/// Ticks after which Python may end a step by a signal, and run its other threads: some milliseconds.
const TICKS_BETWEEN_SIGNALS: u32 = 1000;

/// A simulation; `hummingbus/_simulations.py` has what people use.
#[pyclass(unsendable)]
pub struct Simulation {
    simulation: bus::Simulation,
    actions: Actions,
}

/// State of a simulation before a tick, from which it goes on.
#[pyclass(unsendable)]
pub struct Saved {
    parts: Parts,
    actions: Actions,
}

#[pymethods]
impl Simulation {
    /// The manifest `text` as if it stood in the file `path`, with overrides as `--set` has them.
    #[new]
    fn new(text: String, path: &str, overrides: Vec<String>) -> PyResult<Self> {
        let manifest = Manifest::parse(text, Path::new(path), &overrides, registry()).map_err(raised)?;
        let simulation = simulate(&manifest).map_err(|error| raised(error.with_causes()))?;
        Ok(Self { simulation, actions: Actions::new() })
    }

    /// The next tick.
    #[getter]
    fn tick(&self) -> u32 {
        self.simulation.tick()
    }

    /// Simulation time at the start of the next tick, s.
    #[getter]
    fn time_s(&self) -> f64 {
        self.simulation.time_s()
    }

    /// Computes so many ticks. Ctrl-C ends it with the exception that Python has for it.
    fn step(&mut self, py: Python<'_>, ticks: u32) -> PyResult<()> {
        let Self { simulation, actions } = self;
        let mut left = ticks;
        while left > 0 {
            let some = left.min(TICKS_BETWEEN_SIGNALS);
            (0..some).try_for_each(|_| simulation.step_given(&*actions)).map_err(raised)?;
            py.check_signals()?;
            left -= some;
            if left > 0 {
                // Other threads of the program go on here, as between two ticks of a node.
                py.detach(|| {});
            }
        }
        Ok(())
    }

    /// Sets the message that the agent `node` sends on `output` from now on.
    fn act(&mut self, node: &str, output: &str, message: &[u8]) -> PyResult<()> {
        if !self.actions.contains_key(node) {
            self.actions.insert(node.to_owned(), Action::default());
        }
        let action = self.actions.get_mut(node).ok_or_else(|| raised("the agent is gone"))?;
        action.set(output, message).map_err(raised)
    }

    /// Type of `topic`, and its newest message.
    fn newest<'py>(
        &self,
        py: Python<'py>,
        topic: &str,
    ) -> PyResult<(String, Option<Bound<'py, PyByteArray>>)> {
        let (type_name, message) = self.simulation.newest_bytes(topic).map_err(raised)?;
        Ok((type_name.to_owned(), message.map(|message| PyByteArray::new(py, message))))
    }

    /// The state before the next tick.
    fn save(&mut self) -> Saved {
        Saved { parts: self.simulation.save(), actions: self.actions.clone() }
    }

    /// Goes on from a saved state of the same manifest.
    fn restore(&mut self, saved: &Saved) -> PyResult<()> {
        self.simulation.restore(&saved.parts).map_err(raised)?;
        self.actions.clone_from(&saved.actions);
        Ok(())
    }
}
