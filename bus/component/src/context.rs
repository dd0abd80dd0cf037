//! Information for a component: about its run when it is made, and about the tick when it steps.

use crate::ports::{InputSamples, OutputNumber, OutputPorts, SampleSource};
use crate::sample_ticks::SampleTicks;
use inputs::InputFiles;
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::path::Path;

/// Information about a component's node and run, and the list of its warnings.
///
/// ```
/// let context = component::context::NodeContext::new("imu", &["state"]).timed(1_000_000, 4, 30_000).seeded(7);
/// assert!(context.has("state") && !context.has("wind"));
/// assert_eq!((context.rate_hz(), context.period_s(), context.duration_s()), (1000, 0.004, 30.0));
///
/// context.warn("noise", "there is none");
/// assert_eq!(context.into_warnings()[0].key, "noise");
/// ```
#[derive(Clone, Debug)]
pub struct NodeContext<'a> {
    /// The node's name in the run.
    pub name: &'a str,
    /// The seed of the run: with the node's name it makes the node's random stream ([`crate::random`]).
    pub seed: u64,
    /// The wired inputs.
    pub inputs: &'a [&'a str],
    /// The outputs that the manifest names.
    pub outputs: &'a [&'a str],
    /// Messages of the wired inputs, as far as a check of the manifest knows them; a run reports them once it has
    /// connected.
    pub messages: &'a [InputMessage<'a>],
    /// Nanoseconds a tick.
    pub tick_ns: u64,
    /// Ticks between two computations of the node.
    pub period_ticks: u32,
    /// Length of the run.
    pub duration_ticks: u32,
    /// Files of the run: a component reads the files that its parameters name with these, and with nothing else.
    pub files: InputFiles,
    /// Directory of the run; `None` in a check, and in a run on one thread.
    pub run_dir: Option<&'a Path>,
    warnings: RefCell<Vec<Warning>>,
    times: Cell<SampleTimes>,
}

/// Message type of an input.
///
/// ```
/// use component::context::{InputMessage, NodeContext};
/// let inputs = ["estimate"];
/// let messages = [InputMessage { port: "estimate", bytes: 96, period_ticks: 4.0, initial: None }];
/// let context = NodeContext::new("down", &inputs).reading(&messages);
/// assert_eq!(context.messages[0].bytes, 96);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputMessage<'a> {
    /// The input.
    pub port: &'a str,
    /// The most bytes that a message has.
    pub bytes: usize,
    /// Mean number of ticks between two messages.
    pub period_ticks: f64,
    /// Fields of the message before the first one is sent, as the manifest gives them.
    pub initial: Option<&'a serde_json::Value>,
}

impl InputMessage<'_> {
    /// Number of values that the initial message has in its array `field`; `None` without an initial message.
    ///
    /// ```
    /// # use component::context::InputMessage;
    /// let initial = serde_json::json!({ "command": [76.5, 76.5, 76.5, 76.5] });
    /// let input = InputMessage { port: "command", bytes: 112, period_ticks: 1.0, initial: Some(&initial) };
    /// assert_eq!(input.initial_count("command"), Some(4));
    /// ```
    #[must_use]
    pub fn initial_count(&self, field: &str) -> Option<usize> {
        let initial = self.initial?;
        Some(initial.get(field).and_then(|values| values.as_array()).map_or(0, Vec::len))
    }

    /// Numbers that the initial message has in its array `field`; empty without an initial message.
    #[must_use]
    pub fn initial_numbers(&self, field: &str) -> Vec<f64> {
        let values = self.initial.and_then(|initial| initial.get(field)?.as_array());
        values.into_iter().flatten().filter_map(serde_json::Value::as_f64).collect()
    }
}

/// Times of a node's samples, as far as its component states them: a check of the manifest compares them with the nodes
/// around it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleTimes {
    /// Time between two measurements; `None` for components that do not measure.
    pub measured_every_s: Option<f64>,
    /// Least time from a measurement, or from the arrival of a message, to its sending.
    pub delay_s: f64,
    /// Greatest age of a measurement that the component uses; `None` if it uses any.
    pub remembered_s: Option<f64>,
}

/// Legal but unusual value of a node in its run.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// Its parameter; empty if it is about none in particular.
    pub key: String,
    /// Description of the value.
    pub message: String,
    /// True if it is unusual only because the run ends so early.
    pub is_behind_end: bool,
}

impl<'a> NodeContext<'a> {
    /// The node `name` with these `inputs`, in a run with seed 1 that lasts an hour: it computes at 1 kHz, once a tick.
    /// It reads files from the disk.
    #[must_use]
    pub fn new(name: &'a str, inputs: &'a [&'a str]) -> Self {
        let (seed, tick_ns, period_ticks, duration_ticks) = (1, 1_000_000, 1, 3_600_000);
        let (outputs, warnings) = (&[] as &[_], RefCell::default());
        let (messages, files) = (&[] as &[_], InputFiles::default());
        let times = Cell::default();
        Self {
            name,
            seed,
            inputs,
            outputs,
            messages,
            tick_ns,
            period_ticks,
            duration_ticks,
            files,
            run_dir: None,
            warnings,
            times,
        }
    }

    /// The same node where the manifest names these `outputs`.
    #[must_use]
    pub fn naming(self, outputs: &'a [&'a str]) -> Self {
        Self { outputs, ..self }
    }

    /// The same node where its inputs carry `messages`.
    #[must_use]
    pub fn reading(self, messages: &'a [InputMessage<'a>]) -> Self {
        Self { messages, ..self }
    }

    /// The same node where it computes every `period_ticks` ticks of `tick_ns`, in a run of `duration_ticks`.
    #[must_use]
    pub fn timed(self, tick_ns: u64, period_ticks: u32, duration_ticks: u32) -> Self {
        Self { tick_ns, period_ticks, duration_ticks, ..self }
    }

    /// The same node in a run with another seed.
    #[must_use]
    pub fn seeded(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The same node where the files that it reads are `files`.
    #[must_use]
    pub fn given(self, files: &InputFiles) -> Self {
        Self { files: files.clone(), ..self }
    }

    /// The same node in a run whose directory is `run_dir`.
    #[must_use]
    pub fn in_run(self, run_dir: Option<&'a Path>) -> Self {
        Self { run_dir, ..self }
    }

    /// True if `port` is a wired input or a named output.
    #[must_use]
    pub fn has(&self, port: &str) -> bool {
        self.inputs.contains(&port) || self.outputs.contains(&port)
    }

    /// Simulated time of a tick, in seconds.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        self.tick_ns as f64 * 1e-9
    }

    /// Simulated time between two computations of the node, in seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        f64::from(self.period_ticks) * self.tick_s()
    }

    /// Simulated length of the run, in seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        f64::from(self.duration_ticks) * self.tick_s()
    }

    /// Ticks per simulated second.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a tick is at least a nanosecond")]
    pub fn rate_hz(&self) -> u32 {
        (1_000_000_000 / self.tick_ns.max(1)) as u32
    }

    /// Adds a warning about the parameter `key`: its value is legal but unusual.
    pub fn warn(&self, key: &str, message: impl Into<String>) {
        self.push(key, message.into(), false);
    }

    /// Adds a warning that a longer run would not give.
    pub fn warn_behind_end(&self, key: &str, message: impl Into<String>) {
        self.push(key, message.into(), true);
    }

    fn push(&self, key: &str, message: String, is_behind_end: bool) {
        self.warnings.borrow_mut().push(Warning { key: key.to_owned(), message, is_behind_end });
    }

    /// States the times of the node's samples.
    ///
    /// ```
    /// # use component::context::{NodeContext, SampleTimes};
    /// let context = NodeContext::new("gps", &["state"]);
    /// context.state_times(SampleTimes { measured_every_s: Some(0.1), delay_s: 0.08, ..Default::default() });
    /// assert_eq!(context.times().measured_every_s, Some(0.1));
    /// ```
    pub fn state_times(&self, times: SampleTimes) {
        self.times.set(times);
    }

    /// The times that were stated last.
    #[must_use]
    pub fn times(&self) -> SampleTimes {
        self.times.get()
    }

    /// The warnings left so far.
    #[must_use]
    pub fn into_warnings(self) -> Vec<Warning> {
        self.warnings.into_inner()
    }
}

/// Information for a step about its tick, beside the inputs.
#[derive(Clone, Copy)]
pub struct StepContext<'a> {
    #[doc(hidden)]
    pub tick: u32,
    #[doc(hidden)]
    pub time_ns: u64,
    /// Ticks whose steps write a sample, by output; `None` for outputs that are not wired.
    #[doc(hidden)]
    pub sends: &'a [Option<SampleTicks>],
    /// Last samples of the predecessor, by output.
    #[doc(hidden)]
    pub predecessor: Option<&'a dyn SampleSource>,
    /// Value of the program that steps the simulation.
    #[doc(hidden)]
    pub given: Option<&'a dyn Any>,
}

impl std::fmt::Debug for StepContext<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StepContext")
            .field("tick", &self.tick)
            .field("time_ns", &self.time_ns)
            .finish_non_exhaustive()
    }
}

impl StepContext<'_> {
    /// The tick's number.
    #[must_use]
    pub fn tick(&self) -> u32 {
        self.tick
    }

    /// Simulation time in nanoseconds.
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Simulation time in seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_ns as f64 * 1e-9
    }

    /// True if this step has to write `output`: a sample of it is sent at this tick. An output that is not wired is never due.
    /// A component may leave out the work for an output that is not due, unless its state depends on this work.
    ///
    /// A node whose steps take simulated time (`computing_time`) sends a sample when the step is done. All its wired outputs
    /// are due at each step.
    ///
    /// [`Harness::sending`](crate::Harness::sending) has an example.
    #[must_use]
    pub fn is_due(&self, output: OutputNumber) -> bool {
        let ticks = self.sends.get(output.0).copied().flatten();
        ticks.is_some_and(|ticks| ticks.is_due(self.tick))
    }

    /// Last outputs of the process that this one replaces: the command to go on from without a jump. They are present
    /// only at the tick of the replacement, and only if no state was transferred. `O` are the component's outputs.
    #[must_use]
    pub fn predecessor<O: OutputPorts>(&self) -> Option<O> {
        self.predecessor.and_then(|sent| O::read(InputSamples(sent)))
    }

    /// The value that `Simulation::step_given` of the bus got; `None` in other runs, and if it is of another type.
    #[must_use]
    pub fn given<T: Any>(&self) -> Option<&T> {
        self.given?.downcast_ref()
    }
}
