//! Launches runs: from a checked manifest to the outcome of its run.

use crate::attachment_names::attachment_names;
use crate::checkpoint::{Checkpoint, Written};
use crate::checkpoint_writer::{Collector, Writer, WrittenFiles};
use crate::ctl::control::ControlServer;
use crate::ctl::{Asked, Remote};
use crate::descendants::{Descendants, Place};
use crate::event::{RunEvent, StopToken};
use crate::executed::{self, Executed};
use crate::flight::Flight;
use crate::graph::Graph;
use crate::host::Host;
use crate::host_limits::require_host;
use crate::host_world::{HostWorld, store_files};
use crate::in_process::{self, FIGURES};
use crate::instances::Instances;
use crate::manifest::{Composition, Manifest};
use crate::options::Options;
pub use crate::outcome::Outcome;
use crate::outputs::Outputs;
use crate::program::Program;
use crate::rewind::{self, Rewinds};
use crate::run_dir::RunDir;
use crate::supervisor::Supervisor;
pub use crate::supervisor::replacement::{Purpose, Report};
use crate::world::Spent;
use anyhow::Context;
use bus::lockstep::SupervisorView;
use bus::plan::{Pace, Plan};
use bus::remark::Remark;
use bus::watch::WatchFiles;
use diagnostics::Error;
use inputs::InputFiles;
use recorder::reader::Recording;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

/// Launches a run. By itself it takes no signal of this process and changes nothing else of it either: several runs may
/// fly in one process, also at the same time.
///
/// ```
/// use bus::component::{Component, Info, StepError};
/// use bus::context::{NodeContext, StepContext};
/// use bus::messages::MotorCommand;
/// use bus::{ParameterError, Registration};
/// use runtime::event::RunEvent;
/// use runtime::{host::Host, launcher::Launcher, manifest::ManifestBuilder, registry::Registry};
///
/// #[derive(bus::OutputPorts)]
/// struct Outputs {
///     command: MotorCommand,
/// }
/// struct Constant;
/// impl Component for Constant {
///     const INFO: Info = Info::new("constant", "sends one command for ever");
///     type Parameters = std::collections::BTreeMap<String, f64>;
///     type Inputs<'a> = ();
///     type Outputs = Outputs;
///     type State = ();
///     fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
///         Ok(Self)
///     }
///     fn initial(&self) {}
///     fn step(&self, _: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
///         Ok(Outputs { command: MotorCommand { command: [76.5; 4].into(), ..Default::default() } })
///     }
/// }
/// const COMPONENTS: Registry = Registry::new(&[
///     Registration::of::<Constant>(),
///     Registration::of::<recorder::node::Recorder>(),
/// ]);
///
/// let folder = tempfile::tempdir()?;
/// let manifest = ManifestBuilder::new()
///     .set("run.rate_hz", 1000)
///     .set("run.duration_s", 0.05)
///     .set("process.source.kind", "constant")
///     .set("process.recorder.kind", "recorder")
///     .build(&folder.path().join("constant.toml"), COMPONENTS)?;
/// let mut farthest = 0;
/// let launcher = Launcher::new(Host::InProcess).followed_by(|event| {
///     if let RunEvent::Progress(now) = event {
///         farthest = now.ticks;
///     }
/// });
/// let (outcome, recording) = launcher.fly(&manifest, &folder.path().join("constant.mcap"))?;
/// assert_eq!((outcome.ticks, farthest), (50, 50));
/// let commands = recording.unwrap().series(&[("/source/command", "command[0]")])?;
/// assert!(commands[0].value.iter().all(|&count| count == 76.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Launcher<'a> {
    host: Host,
    stop: StopToken,
    adopts_orphans: bool,
    is_part: bool,
    on: Box<dyn FnMut(RunEvent<'_>) + 'a>,
    remote: Remote,
    requests: Receiver<Asked>,
    files: InputFiles,
    from: Option<Checkpoint>,
    options: Options,
}

impl<'a> Launcher<'a> {
    /// A launcher of a run whose nodes live in `host`.
    #[must_use]
    pub fn new(host: Host) -> Self {
        let (sender, requests) = channel();
        Self {
            host,
            stop: StopToken::new(),
            adopts_orphans: false,
            is_part: false,
            on: Box::new(|_| {}),
            remote: Remote::new(sender),
            requests,
            files: InputFiles::default(),
            from: None,
            options: Options::default(),
        }
    }

    /// [`Launcher::fly`] flies the bytes of the files that `files` has read already; it reads others from the disk.
    #[must_use]
    pub fn reading(mut self, files: InputFiles) -> Self {
        self.files = files;
        self
    }

    /// [`Launcher::fly`] goes on from `checkpoint`; [`Checkpoint::load_manifest`] loads the manifest for it.
    #[must_use]
    pub fn going_on_from(mut self, checkpoint: Checkpoint) -> Self {
        self.from = Some(checkpoint);
        self
    }

    /// [`Launcher::fly`] keeps `pace`, in place of `run.pace` of the manifest. A factor is in simulated seconds per second of host
    /// time. The pace changes no byte of the recording.
    ///
    /// A factor outside 0.0001 to 10000 is an error of [`Launcher::fly`], with [`Error::is_input`].
    ///
    /// ```
    /// # use bus::Registration;
    /// # use runtime::{host::Host, launcher::Launcher, manifest::Manifest, registry::Registry};
    /// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<controllers::pilot::Pilot>()]);
    /// # let folder = tempfile::tempdir()?;
    /// # let text = "[run]\nduration_s = 0.05\n[process.pilot]\nkind = \"pilot\"\nparameters.initial_altitude_m = 1.0\n";
    /// # let manifest = Manifest::parse(text.to_owned(), &folder.path().join("a.toml"), &[], COMPONENTS)?;
    /// # let path = folder.path().join("a.mcap");
    /// use bus::plan::Pace;
    /// let launcher = Launcher::new(Host::InProcess).paced(Pace::REAL_TIME);
    /// let (outcome, _) = launcher.fly(&manifest, &path)?;
    /// assert!(outcome.host_s > 0.04, "50 ms of simulated time took {} s", outcome.host_s);
    ///
    /// let refused = Launcher::new(Host::InProcess).paced(Pace::Factor(0.0)).fly(&manifest, &path).unwrap_err();
    /// assert!(refused.is_input() && refused.to_string().contains("`0` is not a pace"), "{refused}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn paced(mut self, pace: Pace) -> Self {
        self.options.pace = Some(pace);
        self
    }

    /// [`Launcher::fly`] lets a fast node be `ticks` ahead of the slowest, in place of `run.window_ticks` of the manifest. Without
    /// both, the window has 64 ticks, and 512 in a run with groups. It changes no byte of the recording.
    /// [`Host::InProcess`] needs none.
    ///
    /// A window outside 1 to [`WINDOW_TICKS_MAX`](crate::graph::WINDOW_TICKS_MAX) ticks is an error of [`Launcher::fly`], with
    /// [`Error::is_input`].
    ///
    /// ```
    /// # use bus::Registration;
    /// # use runtime::{host::Host, launcher::Launcher, manifest::Manifest, registry::Registry};
    /// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<controllers::pilot::Pilot>()]);
    /// # let folder = tempfile::tempdir()?;
    /// # let text = "[run]\nduration_s = 0.05\n[process.pilot]\nkind = \"pilot\"\nparameters.initial_altitude_m = 1.0\n";
    /// # let manifest = Manifest::parse(text.to_owned(), &folder.path().join("a.toml"), &[], COMPONENTS)?;
    /// # let path = folder.path().join("a.mcap");
    /// let (graph, ..) = Launcher::new(Host::Threads).with_window(16).fly_planned(&manifest, &path)?;
    /// assert_eq!(graph.plan.window_ticks, 16);
    ///
    /// let refused = Launcher::new(Host::Threads).with_window(0).fly(&manifest, &path).unwrap_err();
    /// assert!(refused.to_string().contains("`window_ticks` is 0"), "{refused}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_window(mut self, ticks: u32) -> Self {
        self.options.window_ticks = Some(ticks);
        self
    }

    /// [`Launcher::fly`] groups the nodes by `composition`, in place of `run.compose` and the `[group]` tables of the manifest. It
    /// changes no byte of the recording. [`Host::InProcess`] has all nodes in one thread, whatever their groups.
    ///
    /// A group that names an unknown node, or one that needs a process of its own, is an error of [`Launcher::fly`], with
    /// [`Error::is_input`].
    ///
    /// ```
    /// # use bus::Registration;
    /// # use runtime::{host::Host, launcher::Launcher, manifest::Manifest, registry::Registry};
    /// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<controllers::pilot::Pilot>()]);
    /// # let folder = tempfile::tempdir()?;
    /// # let pilot = |name: &str| format!("[process.{name}]\nkind = \"pilot\"\nparameters.initial_altitude_m = 1.0\n");
    /// # let text = format!("[run]\nduration_s = 0.05\n{}{}", pilot("a"), pilot("b"));
    /// # let manifest = Manifest::parse(text, &folder.path().join("a.toml"), &[], COMPONENTS)?;
    /// # let path = folder.path().join("a.mcap");
    /// use runtime::manifest::Composition;
    /// let launcher = Launcher::new(Host::Threads).composed(Composition::All);
    /// let (graph, ..) = launcher.fly_planned(&manifest, &path)?;
    /// assert_eq!(graph.plan.groups[0].members.len(), 2);
    ///
    /// let unknown = Composition::Groups(vec![vec!["a".to_owned(), "c".to_owned()]]);
    /// let refused = Launcher::new(Host::Threads).composed(unknown).fly(&manifest, &path).unwrap_err();
    /// assert!(refused.is_input() && refused.to_string().contains("names `c`"), "{refused}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn composed(mut self, composition: Composition) -> Self {
        self.options.composition = Some(composition);
        self
    }

    /// [`Launcher::fly`] notes the host times of every tick, as `run.profile = true` does; [`Outcome::flight`] has them. It changes
    /// no byte of the recording.
    ///
    /// [`Launcher::fly`] refuses a profile with [`Host::InProcess`].
    ///
    /// ```
    /// # use bus::Registration;
    /// # use runtime::{host::Host, launcher::Launcher, manifest::Manifest, registry::Registry};
    /// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<controllers::pilot::Pilot>()]);
    /// # let folder = tempfile::tempdir()?;
    /// # let text = "[run]\nduration_s = 0.05\n[process.pilot]\nkind = \"pilot\"\nparameters.initial_altitude_m = 1.0\n";
    /// # let manifest = Manifest::parse(text.to_owned(), &folder.path().join("a.toml"), &[], COMPONENTS)?;
    /// # let path = folder.path().join("a.mcap");
    /// let (outcome, _) = Launcher::new(Host::Threads).profiled().fly(&manifest, &path)?;
    /// assert!(outcome.flight.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn profiled(mut self) -> Self {
        self.options.is_profiled = true;
        self
    }

    /// [`Launcher::fly`] flies a shadow of `process` beside it, from the first tick to the last; it never takes over. `with` has the
    /// keys of a process in which it differs, as `with` of `[[shadow]]`. The shadow sends on `/shadow/<topic>`, which is recorded.
    /// The text of the manifest in the recording does not name it. Shadows of several processes may be asked for.
    ///
    /// These are errors of [`Launcher::fly`], with [`Error::is_input`]: an unknown process, keys that do not fit it, and a process
    /// with a swap, a standby or a shadow. [`Launcher::fly`] refuses shadows with [`Host::InProcess`], too.
    ///
    /// ```
    /// # use bus::Registration;
    /// # use runtime::{host::Host, launcher::Launcher, manifest::Manifest, registry::Registry};
    /// # const COMPONENTS: Registry = Registry::new(&[
    /// #     Registration::of::<controllers::pilot::Pilot>(),
    /// #     Registration::of::<recorder::node::Recorder>(),
    /// # ]);
    /// # let folder = tempfile::tempdir()?;
    /// # let text = "[run]\nduration_s = 0.05\n[process.pilot]\nkind = \"pilot\"\nparameters.initial_altitude_m = 1.0\n\
    /// #             [process.recorder]\nkind = \"recorder\"\n";
    /// # let manifest = Manifest::parse(text.to_owned(), &folder.path().join("a.toml"), &[], COMPONENTS)?;
    /// # let path = folder.path().join("a.mcap");
    /// let higher = toml::toml! { parameters.initial_altitude_m = 2.0 };
    /// let launcher = Launcher::new(Host::Threads).shadowing("pilot", higher);
    /// let (_, recording) = launcher.fly(&manifest, &path)?;
    /// let shadow = recording.unwrap().series(&[("/shadow/pilot/set_point", "altitude")])?;
    /// assert!(shadow[0].value.iter().all(|&altitude| altitude == 2.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn shadowing(mut self, process: &str, with: toml::Table) -> Self {
        self.options.shadows.push((process.to_owned(), with));
        self
    }

    /// The run ends when `token` is used.
    #[must_use]
    pub fn stopped_by(mut self, token: &StopToken) -> Self {
        self.stop = token.clone();
        self
    }

    /// Calls `listener` for every event of the run, on the thread that flies it.
    #[must_use]
    pub fn followed_by(mut self, listener: impl FnMut(RunEvent<'_>) + 'a) -> Self {
        self.on = Box::new(listener);
        self
    }

    /// Ends with the run every process that the nodes' processes start, however it was detached. While the run flies,
    /// this process is the parent of orphans (`PR_SET_CHILD_SUBREAPER`). It may start no other children meanwhile:
    /// those would be ended with the run. While such a run flies, the launch of another in this process is refused.
    #[must_use]
    pub fn adopting_orphans(mut self) -> Self {
        self.adopts_orphans = true;
        self
    }

    /// The run is a flight that a longer command flies for itself, such as one of `identify`. While another run of this user is alive,
    /// `top`, `ctl`, `swap` and `view` find this one by `--run` alone.
    ///
    /// ```
    /// # use bus::Registration;
    /// # use runtime::{host::Host, launcher::Launcher, manifest::Manifest, registry::Registry};
    /// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<controllers::pilot::Pilot>()]);
    /// # let folder = tempfile::tempdir()?;
    /// # let text = "[run]\nduration_s = 0.05\n[process.pilot]\nkind = \"pilot\"\nparameters.initial_altitude_m = 1.0\n";
    /// # let manifest = Manifest::parse(text.to_owned(), &folder.path().join("a.toml"), &[], COMPONENTS)?;
    /// # let path = folder.path().join("a.mcap");
    /// use runtime::run_dir::run_of_launcher;
    /// let mut is_part = false;
    /// let launcher = Launcher::new(Host::InProcess).as_part().followed_by(|_| {
    ///     is_part |= run_of_launcher(std::process::id()).is_some_and(|run| run.entry.is_part);
    /// });
    /// launcher.fly(&manifest, &path)?;
    /// assert!(is_part);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn as_part(mut self) -> Self {
        self.is_part = true;
        self
    }

    /// Steers the run from another thread.
    #[must_use]
    pub fn remote(&self) -> Remote {
        self.remote.clone()
    }

    /// Checks `manifest`, flies it, and records to `recording` if it has a recorder; returns when everything that was
    /// started has ended.
    ///
    /// # Errors
    /// A problem in the manifest or in an option of this launcher, or as [`Launcher::launch`].
    pub fn fly(self, manifest: &Manifest, recording: &Path) -> Result<(Outcome, Option<Recording>), Error> {
        self.fly_planned(manifest, recording).map(|(_, outcome, recording)| (outcome, recording))
    }

    /// As [`Launcher::fly`]; returns the checked graph of the run too.
    ///
    /// # Errors
    /// As [`Launcher::fly`].
    pub fn fly_planned(
        mut self,
        manifest: &Manifest,
        recording: &Path,
    ) -> Result<(Graph, Outcome, Option<Recording>), Error> {
        let stated = self.options.stated_in(manifest)?;
        let manifest = &*stated;
        let mut graph = Graph::build_from(manifest, self.files.clone())?;
        self.options.add_shadows(manifest, &mut graph)?;
        if let Some(from) = self.from.take() {
            from.resume(manifest, &mut graph, true)?;
        }
        let mut outputs = Outputs::of(manifest, &graph, recording, Vec::new())?;
        let outcome = self.launch(manifest, &mut graph, &mut outputs)?;
        Ok((graph, outcome, outputs.finish()?))
    }

    /// Flies `graph`, the checked `manifest`, and claims `outputs` for it; returns when everything that was started has
    /// ended. `graph` has the pace, the window, the groups, the profile and the shadows: those of this launcher are for
    /// [`Launcher::fly`].
    ///
    /// # Errors
    /// If another run writes to one of its files, or a process fails, stalls, or cannot be started; the error holds
    /// the last lines that the process wrote.
    pub fn launch(
        mut self,
        manifest: &Manifest,
        graph: &mut Graph,
        outputs: &mut Outputs,
    ) -> Result<Outcome, Error> {
        require_host(&self.host, manifest, graph)?;
        if self.host != Host::InProcess {
            Host::require_proc()?;
        }
        let place = Place::take(self.adopts_orphans)?;
        let mut run_dir = RunDir::create(&manifest.path, self.is_part)?;
        let run_id = run_dir.run_id().to_owned();
        let mut on = std::mem::replace(&mut self.on, Box::new(|_| {}));
        let (rewinds, files, mut executed) =
            (Rewinds::default(), WrittenFiles::default(), Executed::default());
        loop {
            let number = rewinds.done().len() + 1;
            rewinds.keep_at(outputs.place_aside(number));
            let flown = self.launch_in(
                &run_dir,
                &place,
                manifest,
                graph,
                outputs,
                &rewinds,
                &files,
                &mut executed,
                &mut *on,
            );
            let flown = flown.map_err(|error| run_dir.blame_room(error));
            run_dir.remove().iter().for_each(|left| on(RunEvent::Note(left)));
            let outcome = flown?;
            let Some((rewind, next)) = rewinds.take_asked() else {
                return Ok(Outcome { rewinds: rewinds.done().clone(), ..outcome });
            };
            let recording = outputs.set_aside(number)?;
            *graph = next;
            files.go_back(rewind.to_tick, &rewind.path);
            rewinds.begin(rewind, recording);
            run_dir = RunDir::create_again(&manifest.path, &run_id, self.is_part)?;
        }
    }

    #[allow(clippy::too_many_arguments, reason = "each is one thing of a run")]
    fn launch_in(
        &self,
        run_dir: &RunDir,
        place: &Place,
        manifest: &Manifest,
        graph: &mut Graph,
        outputs: &mut Outputs,
        rewinds: &Rewinds,
        files: &WrittenFiles,
        executed: &mut Executed,
        on: &mut dyn FnMut(RunEvent<'_>),
    ) -> anyhow::Result<Outcome> {
        // Before anything is touched that an earlier run left.
        if self.host != Host::InProcess {
            bus::room::require(&graph.plan, &manifest.registry().messages()).map_err(Error::from)?;
        }
        outputs.claim(run_dir)?;
        if let Some(kept) = outputs.kept() {
            on(RunEvent::Note(&format!("what an earlier run left unfinished is kept as {}", kept.display())));
        }
        let programs = graph.ticking_programs();
        let sidecars = graph.sidecars.iter().map(|(name, program)| (&**name, program));
        let all: Vec<_> = programs.iter().copied().chain(sidecars).collect();
        executed.begin(&all).iter().for_each(|warning| on(RunEvent::Note(warning)));
        let mark = rewinds.mark().map(|mark| (rewind::MARK, mark));
        let record = executed.record(&programs)?.map(|record| (executed::RECORD, record));
        let written: Vec<_> = mark.into_iter().chain(record).collect();
        prepare(manifest, graph, outputs.partial(), run_dir, written)?;
        graph.plan.run_id = run_dir.run_id().to_owned();
        graph.plan.store(run_dir.path())?;
        if let Some(parts) = &graph.from {
            parts.store_for_run(run_dir.path())?;
        }
        let graph = &*graph;
        let (run_path, stem) = (run_dir.path(), &outputs.stem);
        let instances = &Instances::default();
        let writer = Writer { manifest, graph, run_dir: run_path, stem, files, instances };
        let mut checkpoints = Collector::new(writer, self.host != Host::InProcess);
        let flown = self.fly_in(run_dir, place, manifest, graph, &mut checkpoints, rewinds, executed, on);
        if flown.is_ok() {
            executed.end(&graph.ticking_programs()).iter().for_each(|warning| on(RunEvent::Note(warning)));
        }
        // A user goes back to those of a run that broke.
        let (written, missed) = checkpoints.finish();
        if flown.is_err() || rewinds.is_asked() {
            // No summary says so.
            missed.iter().for_each(|missed| on(RunEvent::Note(missed)));
        }
        if let (Err(_), Some(Written { tick, path })) = (&flown, written.last()) {
            let path = path.display();
            on(RunEvent::Note(&format!(
                "the last checkpoint is {path}, of tick {tick}; to go on from it: hummingbus run --from {path}"
            )));
        }
        let mut outcome = flown?;
        (outcome.checkpoints, outcome.missed_checkpoints) = (written, missed);
        Ok(outcome)
    }

    #[allow(clippy::too_many_arguments, reason = "each is one thing of a run")]
    fn fly_in(
        &self,
        run_dir: &RunDir,
        place: &Place,
        manifest: &Manifest,
        graph: &Graph,
        checkpoints: &mut Collector<'_>,
        rewinds: &Rewinds,
        executed: &mut Executed,
        on: &mut dyn FnMut(RunEvent<'_>),
    ) -> anyhow::Result<Outcome> {
        if self.host == Host::InProcess {
            let components = manifest.registry().components();
            let mut save = |parts| {
                checkpoints.add(parts);
                checkpoints.take_notes()
            };
            let mut outcome = in_process::fly(graph, components, &self.stop, on, &mut save)?;
            if !outcome.was_stopped {
                outcome.figures = figures(graph, run_dir.path())?;
            }
            return Ok(outcome);
        }
        let control = Arc::new(SupervisorView::create(&graph.plan).map_err(Error::from)?);
        let (plan, dir) = (&graph.plan, run_dir.path());
        // Dropped behind the supervisor, which ends the processes.
        let descendants = self.adopts_orphans.then(|| Descendants::of_run(place));
        let world = HostWorld {
            host: self.host.clone(),
            manifest,
            plan,
            files: &graph.files,
            control_server: ControlServer::open(
                dir,
                plan,
                &control,
                self.remote.clone(),
                &self.requests,
                checkpoints.writer,
                rewinds,
            )?,
            control: control.clone(),
            run_dir: dir,
            descendants: descendants.as_ref(),
            instances: checkpoints.writer.instances,
            sockets: BTreeMap::new(),
            groups: BTreeMap::new(),
            executed,
            warnings: Vec::new(),
        };
        let mut on = |event: RunEvent<'_>| {
            if let RunEvent::Progress(_) = event {
                checkpoints.collect();
                checkpoints.take_notes().iter().for_each(|note| on(RunEvent::Note(note)));
            }
            on(event);
        };
        let mut supervisor = Supervisor::new(graph, world, &self.stop, &mut on);
        supervisor.fly(manifest.content.run.start_order_seed)?;
        let mut outcome = outcome(plan, &control, &supervisor);
        outcome.replacements = supervisor.decisions.replacements.into_reports();
        let nodes: Vec<&str> = plan.nodes.iter().map(|node| &*node.name).collect();
        outcome.remarks = Remark::all_of(dir, &nodes)?;
        if plan.profile {
            outcome.flight = Some(Flight::open(plan, dir, outcome.ticks, &outcome.replacements)?);
        }
        if !outcome.was_stopped {
            outcome.figures = figures(graph, dir)?;
        }
        Ok(outcome)
    }
}

/// Puts the files that the nodes read into the run directory. Gives the recorders their attachments: the manifest,
/// its includes, the models, and the texts that the launcher has `written`, with their names.
fn prepare(
    manifest: &Manifest,
    graph: &mut Graph,
    recording: Option<&Path>,
    run_dir: &RunDir,
    written: Vec<(&str, String)>,
) -> anyhow::Result<()> {
    let (files, recorded) = (graph.files.listing_anew(), run_dir.path().join("manifest.toml"));
    let whole = (manifest.path.as_path(), manifest.recorded_text.as_str(), recorded.as_path());
    let texts = manifest.included().map(|(path, text)| (path, text, path));
    let (mut paths, mut keys) = (Vec::new(), Vec::new());
    for (path, text, key) in std::iter::once(whole).chain(texts) {
        let key = PathBuf::from(key.to_string_lossy().into_owned());
        files.keep(&key, text.into());
        files.bytes(&key)?;
        paths.push(absolute(path));
        keys.push(key);
    }
    for path in &graph.models {
        files.bytes(path).with_context(|| format!("cannot attach {}", path.display()))?;
        paths.push(absolute(path));
        keys.push(path.clone());
    }
    let mut attachments: Vec<_> =
        attachment_names(&paths).iter().zip(&keys).map(|(name, key)| attachment(name, key)).collect();
    for (name, text) in written {
        let key = run_dir.path().join(name);
        files.keep(&key, text.into_bytes());
        attachments.push(attachment(name, &key));
        files.bytes(&key)?;
    }
    for (program, node) in graph.programs.iter().zip(&mut graph.plan.nodes) {
        if program.is_recorder() {
            let watch = WatchFiles::of(run_dir.path(), run_dir.run_id());
            node.parameters =
                serde_json::json!({ "path": recording, "attachments": attachments, "watch": watch });
            node.files = files.used();
        }
    }
    let judges = graph.programs.iter().zip(&mut graph.plan.nodes).filter(|(program, _)| program.is_judge());
    for (_, judge) in judges {
        judge.parameters["path"] = serde_json::json!(run_dir.path().join(FIGURES));
    }
    let mut nodes = graph.plan.nodes.iter().chain(graph.backups.iter().map(|backup| &backup.plan));
    Ok(nodes.try_for_each(|node| store_files(&files, run_dir.path(), node))?)
}

/// Figures that the judge of a run without a recording has written, if there is one.
fn figures(graph: &Graph, run_dir: &Path) -> anyhow::Result<Option<Vec<u8>>> {
    let has_judge = graph.programs.iter().any(Program::is_judge);
    let read = || std::fs::read(run_dir.join(FIGURES)).context("cannot read the figures of the judge");
    has_judge.then(read).transpose()
}

/// The absolute path, without ways down and up again.
fn absolute(path: &Path) -> PathBuf {
    inputs::tidy(&std::path::absolute(path).unwrap_or_else(|_| path.to_owned()))
}

/// Content that a recorder attaches as `name`: the file `key` among those of the run.
fn attachment(name: &str, key: &Path) -> serde_json::Value {
    serde_json::json!({ "name": name, "path": key })
}

fn outcome(plan: &Plan, control: &SupervisorView, supervisor: &Supervisor<'_, HostWorld<'_>>) -> Outcome {
    let (start_ns, end_ns) = control.host_span_ns();
    let host_s = end_ns.saturating_sub(start_ns) as f64 * 1e-9;
    let share = |cpu_ns: u64| if host_s > 0.0 { cpu_ns as f64 * 1e-9 / host_s } else { 0.0 };
    let clock = ("clock".to_owned(), share(control.clock_cpu_ns()), 0);
    let nodes = plan.nodes.iter().enumerate();
    let nodes = nodes.map(|(index, node)| {
        let Spent { cpu_ns, late, .. } = supervisor.spent_by(index);
        (node.name.clone(), share(cpu_ns), late)
    });
    let overruns = plan.nodes.iter().enumerate().filter_map(|(index, node)| {
        let Spent { overruns, skipped_steps, .. } = supervisor.spent_by(index);
        // A process that took over may have a computing time where the first one has none.
        let is_timed = node.computing_time.is_some() || overruns > 0 || skipped_steps > 0;
        is_timed.then(|| (node.name.clone(), overruns, skipped_steps))
    });
    Outcome {
        first_tick: plan.first_tick,
        ticks: control.completed_ticks(),
        was_stopped: control.end_tick() < plan.duration_ticks,
        host_s,
        missed_deadlines: control.missed_deadlines(),
        processes: std::iter::once(clock).chain(nodes).collect(),
        overruns: overruns.collect(),
        remarks: Vec::new(),
        replacements: Vec::new(),
        flight: None,
        figures: None,
        checkpoints: Vec::new(),
        missed_checkpoints: Vec::new(),
        rewinds: Vec::new(),
    }
}
