//! A component as a node of a run: this process, or a thread of it, takes the node's part.

use crate::announcement::Announcement;
use crate::component::{Component, StateError, StepError};
use crate::context::StepContext;
use crate::error::BusError;
use crate::hand_over::Computation;
use crate::handles::Wiring;
use crate::join::Join;
use crate::node::Node;
use crate::port::{InPort, OutPort};
use crate::ports::{InputSamples, OutputSamples, SampleSink, SampleSource};
use crate::registration::{Instance, Registration};
use crate::tick::Tick;

/// Runs the component `C` as the node that the launcher started this process for: the whole `main` of an executable
/// that a manifest names as a `command`.
///
/// # Errors
/// If the process was not started by a launcher, the manifest and the component do not fit, or as the component says.
pub fn run_process<C: Component + 'static>() -> Result<(), BusError> {
    Registration::of::<C>().run(Join::from_environment()?, &[])
}

impl Registration {
    /// Runs the component as the node that `join` names, until the run ends or another process has taken its place.
    /// `components` are those of the program: what a component forwards are messages of theirs.
    ///
    /// # Errors
    /// If the manifest and the component do not fit, a step fails, or the run is aborted.
    pub fn run(&self, join: Join, components: &'static [Registration]) -> Result<(), BusError> {
        let mut node = Node::open(join)?;
        let wiring = node.declare(self, components)?;
        let (plan, node_plan) = node.plan();
        let mut instance =
            self.make_for(plan, node_plan, &node.files()).map_err(|reason| node.error(reason))?;
        let name = node.name().to_owned();
        let failed =
            |error: StepError| BusError::Parameters { node: name.clone(), reason: error.to_string() };
        let connected = node.connect()?;
        let topics: Vec<(&str, &Announcement)> =
            wiring.inputs.iter().flatten().map(|&input| connected.announced(input)).collect();
        instance.connected(&topics).map_err(failed)?;
        let end = connected.run(self.transfer, &mut Wired { instance: &mut *instance, wiring: &wiring });
        let finished = instance.finish().map_err(failed);
        match end {
            Ok(()) | Err(BusError::Aborted) => finished.and(end),
            // What made a step fail makes the end fail too: the first error counts.
            Err(error) => Err(error),
        }
    }
}

/// A component whose ports are those of a node.
struct Wired<'a> {
    instance: &'a mut dyn Instance,
    wiring: &'a Wiring,
}

impl Computation for Wired<'_> {
    fn state_size(&self) -> usize {
        self.instance.state_size()
    }

    fn save(&self, bytes: &mut [u8]) {
        self.instance.save(bytes);
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        self.instance.load(bytes)
    }

    fn step(&mut self, tick: &mut Tick<'_>) -> Result<(), String> {
        let (number, wiring) = (tick.number(), self.wiring);
        let inputs = Received { tick: number, ports: tick.inputs, wiring: &wiring.inputs };
        let predecessor = Received { tick: number, ports: tick.predecessor, wiring: &wiring.outputs };
        let context = StepContext {
            tick: number,
            time_ns: tick.time_ns,
            predecessor: (!tick.predecessor.is_empty()).then_some(&predecessor as &dyn SampleSource),
        };
        let mut sink = Loans { tick: number, node: tick.node, ports: tick.outputs, wiring: &wiring.outputs };
        let stepped = self.instance.step(&context, InputSamples(&inputs), &mut OutputSamples(&mut sink));
        stepped.map_err(|error| error.to_string())
    }
}

/// The samples that a node has received.
struct Received<'a> {
    tick: u32,
    ports: &'a [InPort],
    wiring: &'a [Option<usize>],
}

impl Received<'_> {
    fn port(&self, port: usize) -> Option<&InPort> {
        self.ports.get(self.wiring[port]?)
    }
}

impl SampleSource for Received<'_> {
    fn count(&self) -> usize {
        self.wiring.len()
    }

    fn words(&self, port: usize) -> Option<&[u64]> {
        self.port(port)?.newest()
    }

    fn sent_tick(&self, port: usize) -> Option<u64> {
        self.port(port)?.sent_tick()
    }

    fn fresh(&self, port: usize) -> Option<&[u8]> {
        Some(self.port(port)?.fresh(self.tick)?.0)
    }

    fn fresh_shadow(&self, port: usize) -> Option<&[u8]> {
        Some(self.port(port)?.fresh_shadow(self.tick)?.0)
    }
}

/// The memory that a node's samples are written to.
struct Loans<'a> {
    tick: u32,
    node: &'a str,
    ports: &'a mut [OutPort],
    wiring: &'a [Option<usize>],
}

impl SampleSink for Loans<'_> {
    fn words(&mut self, port: usize) -> Result<Option<&mut [u64]>, BusError> {
        match self.wiring[port].and_then(|index| self.ports.get_mut(index)) {
            Some(output) if output.takes(self.tick) => output.words(self.node).map(Some),
            Some(_) | None => Ok(None),
        }
    }
}
