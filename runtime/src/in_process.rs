//! A run on the thread of its launcher: no processes, no shared memory, no clock service.

use crate::checkpoint::Checkpoint;
use crate::event::{Progress, RunEvent, StopToken};
use crate::graph::Graph;
use crate::host::{Host, panic_message};
use crate::host_limits::require_host;
use crate::manifest::Manifest;
use crate::outcome::Outcome;
use crate::program::Program;
use anyhow::{Context, anyhow};
use bus::checkpoint::Parts;
use bus::clock::deadline_ns;
use bus::component::Role;
use bus::host_time::monotonic_ns;
use bus::plan::Pace;
use bus::{BusError, Registration, Simulation};
use diagnostics::{ComponentFailure, Error};
use inputs::InputFiles;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Duration;

/// The file with the figures of the judge.
pub(crate) const FIGURES: &str = "figures";
/// Host time between two reports of progress, ns.
const PROGRESS_NS: u64 = 50_000_000;
/// Ticks between two looks at the host's clock in a run that is not paced.
const LOOK_TICKS: u32 = 64;
/// The longest sleep, ns, so that a stop is heard soon.
const NAP_NS: u64 = 20_000_000;

/// The nodes of `manifest` before tick 0, to be stepped by the caller; a recorder and a judge are left out.
///
/// ```
/// use bus::component::{Component, Info, StepError};
/// use bus::context::{NodeContext, StepContext};
/// use bus::messages::MotorCommand;
/// use bus::{ParameterError, Registration};
/// use runtime::{manifest::ManifestBuilder, registry::Registry};
///
/// #[derive(bus::OutputPorts)]
/// struct Outputs {
///     command: MotorCommand,
/// }
/// /// Commands that rise by one a tick.
/// struct Ramp;
/// impl Component for Ramp {
///     const INFO: Info = Info::new("ramp", "sends commands that rise");
///     type Parameters = std::collections::BTreeMap<String, f64>;
///     type Inputs<'a> = ();
///     type Outputs = Outputs;
///     type State = ();
///     fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
///         Ok(Self)
///     }
///     fn initial(&self) {}
///     fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
///         let command = [f64::from(context.tick()); 4].into();
///         Ok(Outputs { command: MotorCommand { command, ..Default::default() } })
///     }
/// }
/// const COMPONENTS: Registry = Registry::new(&[Registration::of::<Ramp>()]);
/// let manifest = ManifestBuilder::new().set("run.duration_s", 1.0).set("process.ramp.kind", "ramp");
/// let mut simulation = runtime::simulate(&manifest.build("ramp.toml".as_ref(), COMPONENTS)?)?;
/// let command = simulation.topic::<MotorCommand>("/ramp/command")?;
/// assert!(simulation.newest(command).is_none());
/// for tick in 0..10 {
///     simulation.step()?;
///     assert_eq!(simulation.newest(command).unwrap().command[0], f64::from(tick));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A problem in the manifest, or a node that needs a process of its own: an executable, a swap, a standby.
pub fn simulate(manifest: &Manifest) -> Result<Simulation, Error> {
    simulate_reading(manifest, InputFiles::default())
}

/// The same; files that `files` has read are not read again.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_reading(manifest: &Manifest, files: InputFiles) -> Result<Simulation, Error> {
    let graph = Graph::build_from(manifest, files)?;
    require_host(&Host::InProcess, manifest, &graph)?;
    let components = manifest.registry().components();
    Ok(simulation(&graph, |component| component.role == Role::Compute, components)?)
}

/// The nodes of `graph` of which `is_member` is true, in one simulation.
///
/// # Errors
/// If a node is not a component of this program, or the plan and a component do not fit.
fn simulation(
    graph: &Graph,
    is_member: impl Fn(&Registration) -> bool,
    components: &'static [Registration],
) -> anyhow::Result<Simulation> {
    let mut members = Vec::new();
    for (index, (program, node)) in graph.programs.iter().zip(&graph.plan.nodes).enumerate() {
        let component = program.component();
        let component = component.ok_or_else(|| anyhow!("process `{}` is no component", node.name))?;
        if is_member(component) {
            members.push((index, component));
        }
    }
    Ok(Simulation::new(&graph.plan, members, components, &graph.files).map_err(Error::from)?)
}

/// Flies `graph` to its end, or to a stop.
///
/// # Errors
/// If a step fails, or a component panics.
pub(crate) fn fly(
    graph: &Graph,
    components: &'static [Registration],
    stop: &StopToken,
    on: &mut dyn FnMut(RunEvent<'_>),
    save: &mut dyn FnMut(Parts) -> Vec<String>,
) -> anyhow::Result<Outcome> {
    let mut simulation = simulation(graph, |_| true, components)?;
    if let Some(parts) = &graph.from {
        simulation.restore(parts).map_err(Error::from)?;
    }
    let start_ns = monotonic_ns();
    let mut run = Run {
        graph,
        stop,
        on,
        save,
        start_ns,
        reported_ns: start_ns,
        missed_deadlines: 0,
        active: Active::Run,
    };
    let end = catch_unwind(AssertUnwindSafe(|| run.fly(&mut simulation)));
    let end = end.map_err(|panic| match (run.active, panicked(run.active, &*panic)) {
        (Active::Component, error) => ComponentFailure::new(simulation.next_node(), error).into(),
        (_, error) => error,
    })?;
    let (ticks, overruns) = (simulation.tick(), simulation.overruns());
    let finish = || {
        let remarks = simulation.remarks();
        simulation.finish(end).map(|()| remarks)
    };
    let remarks = match catch_unwind(AssertUnwindSafe(finish)) {
        Ok(finished) => finished.map_err(failed)?,
        Err(panic) => {
            return Err(ComponentFailure::new(None, panicked(Active::Component, &*panic)).into());
        }
    };
    Ok(Outcome {
        first_tick: graph.plan.first_tick,
        ticks,
        was_stopped: ticks < graph.plan.duration_ticks,
        host_s: seconds(monotonic_ns() - start_ns),
        missed_deadlines: run.missed_deadlines,
        processes: Vec::new(),
        overruns,
        remarks,
        replacements: Vec::new(),
        flight: None,
        figures: None,
        checkpoints: Vec::new(),
        missed_checkpoints: Vec::new(),
        rewinds: Vec::new(),
    })
}

/// The failure of the component that `error` names, unless the system is at fault.
fn failed(error: BusError) -> Error {
    if error.is_system() {
        return error.into();
    }
    let node = error.node().map(str::to_owned);
    ComponentFailure::new(node.as_deref(), error).into()
}

fn panicked(active: Active, panic: &(dyn Any + Send)) -> anyhow::Error {
    anyhow!("{} panicked: {}", active.name(), panic_message(panic))
}

/// Code that is active on the thread of a run, to be named if it panics.
#[derive(Clone, Copy)]
enum Active {
    Run,
    Component,
    Listener,
    CheckpointWriter,
}

impl Active {
    fn name(self) -> &'static str {
        match self {
            Self::Run => "the run",
            Self::Component => "a component",
            Self::Listener => "the listener of the run's events",
            Self::CheckpointWriter => "the writer of checkpoints",
        }
    }
}

/// A run under way.
struct Run<'a> {
    graph: &'a Graph,
    stop: &'a StopToken,
    on: &'a mut dyn FnMut(RunEvent<'_>),
    /// Takes the parts of a checkpoint, and returns messages for the user.
    save: &'a mut dyn FnMut(Parts) -> Vec<String>,
    start_ns: u64,
    /// Host time of the last report.
    reported_ns: u64,
    missed_deadlines: u32,
    active: Active,
}

/// Checks that [`fly_unrecorded`] can fly `manifest`, and go on `from` a checkpoint; flies nothing. Returns the graph.
///
/// # Errors
/// As [`fly_unrecorded`], except for errors in flight.
pub fn require_flyable(
    manifest: &Manifest,
    files: InputFiles,
    from: Option<&Checkpoint>,
) -> Result<Graph, Error> {
    let graph = graph_of(manifest, files, Path::new(FIGURES), from)?;
    if let Some(parts) = &graph.from {
        simulation(&graph, |_| true, manifest.registry().components())?.restore(parts)?;
    }
    Ok(graph)
}

/// Flies `manifest`, which is not recorded, on the calling thread, `from` a checkpoint if there is one. Files that
/// `files` has read are not read again. Its judge writes into `folder`, and nothing else is written.
///
/// # Errors
/// A problem in the manifest, a checkpoint that does not fit, a step that fails, or a component that panics. Also a
/// request that needs a process of its own: an executable, a swap, a standby.
pub fn fly_unrecorded(
    manifest: &Manifest,
    files: InputFiles,
    folder: &Path,
    from: Option<&Checkpoint>,
) -> Result<Outcome, Error> {
    let path = folder.join(FIGURES);
    let graph = graph_of(manifest, files, &path, from)?;
    let stop = StopToken::new();
    let mut outcome = fly(&graph, manifest.registry().components(), &stop, &mut |_| {}, &mut |_| Vec::new())?;
    let has_judge = graph.programs.iter().any(Program::is_judge);
    let read = || std::fs::read(&path).context("cannot read the figures of the judge");
    outcome.figures = has_judge.then(read).transpose()?;
    Ok(outcome)
}

/// The graph of `manifest` for one thread, without checkpoints, whose judge writes its figures to `path`.
fn graph_of(
    manifest: &Manifest,
    files: InputFiles,
    path: &Path,
    from: Option<&Checkpoint>,
) -> anyhow::Result<Graph> {
    let mut graph = Graph::build_from(manifest, files)?;
    if let Some(from) = from {
        from.resume(manifest, &mut graph, true)?;
    }
    require_host(&Host::InProcess, manifest, &graph)?;
    graph.plan.checkpoint_ticks.clear();
    graph.plan.checkpoint_period = None;
    if let Some(judge) = graph.programs.iter().position(Program::is_judge) {
        graph.plan.nodes[judge].parameters["path"] = serde_json::json!(path);
    }
    Ok(graph)
}

impl Run<'_> {
    /// Steps to the end, or to a stop; a failed step ends it too.
    fn fly(&mut self, simulation: &mut Simulation) -> Result<(), BusError> {
        let end = self.step_all(simulation);
        self.active = Active::Run;
        self.tell(simulation.tick());
        end
    }

    fn step_all(&mut self, simulation: &mut Simulation) -> Result<(), BusError> {
        let plan = &self.graph.plan;
        let mut next_checkpoint = plan.checkpoint_after(plan.first_tick);
        while simulation.tick() < plan.duration_ticks && self.stop.count() == 0 {
            let tick = simulation.tick();
            match plan.pace {
                Pace::Factor(factor) if !self.await_deadline(tick, factor) => break,
                Pace::Factor(_) => {}
                Pace::Free if !tick.is_multiple_of(LOOK_TICKS) => {}
                Pace::Free => self.report(tick),
            }
            if next_checkpoint == Some(tick) {
                let parts = simulation.save();
                self.active = Active::CheckpointWriter;
                let notes = (self.save)(parts);
                self.active = Active::Listener;
                notes.iter().for_each(|note| (self.on)(RunEvent::Note(note)));
                self.active = Active::Run;
                next_checkpoint = plan.checkpoint_after(tick);
            }
            self.active = Active::Component;
            simulation.step()?;
            self.active = Active::Run;
        }
        Ok(())
    }

    /// Sleeps until tick `tick` is due; false if a stop was requested meanwhile. A tick whose predecessor was done
    /// behind its own deadline is a missed one.
    fn await_deadline(&mut self, tick: u32, factor: f64) -> bool {
        let due_ns =
            self.start_ns + deadline_ns(tick - self.graph.plan.first_tick, self.graph.plan.tick_ns, factor);
        if tick > self.graph.plan.first_tick && monotonic_ns() > due_ns {
            self.missed_deadlines += 1;
        }
        self.report(tick);
        loop {
            let left_ns = due_ns.saturating_sub(monotonic_ns());
            if self.stop.count() > 0 || left_ns == 0 {
                return self.stop.count() == 0;
            }
            std::thread::sleep(Duration::from_nanos(left_ns.min(NAP_NS)));
        }
    }

    fn report(&mut self, ticks: u32) {
        let now_ns = monotonic_ns();
        if now_ns < self.reported_ns + PROGRESS_NS {
            return;
        }
        self.reported_ns = now_ns;
        self.tell(ticks);
    }

    fn tell(&mut self, ticks: u32) {
        let (plan, host_s) = (&self.graph.plan, seconds(monotonic_ns() - self.start_ns));
        let (duration_ticks, tick_s) = (plan.duration_ticks, plan.tick_s());
        self.active = Active::Listener;
        (self.on)(RunEvent::Progress(Progress { ticks, duration_ticks, tick_s, host_s }));
        self.active = Active::Run;
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
