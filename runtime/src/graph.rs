//! From a manifest to the plan of a run, checked before anything starts.
//!
//! - `processes`: the executable of each process, and its settings on the host
//! - `sidecars`: processes beside the ticks, and the order in which they start
//! - `outputs`, `inputs`, `wiring`: topics and edges
//! - `computing_time`: computing time of the steps
//! - `parameters`, `placeholders`, `recorders`: parameters and files of each node
//! - `periods`: nodes and outputs that compute only once, or whose ticks would overflow
//! - `samples`: samples that no reader takes, and measurements that are not sent or come too late
//! - `ranges`: ranges of numbers by their units
//! - `groups`: nodes that share a process
//! - `evaluations`: conditions and measures after the run
//! - `checkpoints`: ticks at which the nodes write their states
//! - `backups`: processes that shadow, take over or stand by
//! - `backup_ticks`: ticks of the samples of such processes

mod backup_ticks;
mod backups;
mod checkpoints;
mod computing_time;
mod evaluations;
mod groups;
mod inputs;
mod outputs;
mod parameters;
mod periods;
mod placeholders;
mod processes;
mod ranges;
mod recorders;
mod samples;
mod sidecars;
mod wiring;

pub use crate::program::BackupSpec;
use crate::program::{Origin, Program};
pub use backups::{backup_of, successor_of};

use crate::manifest::Manifest;
use crate::placement;
use bus::checkpoint::Parts;
use bus::plan::Plan;
use bus::{InputFiles, Registration};
use diagnostics::{Diagnostic, Faults, nine_decimals};
use parameters::Notes;
use processes::DeclaredNode;
use std::collections::BTreeMap;
use std::path::PathBuf;
use wiring::{Wiring, wire_apart};

/// Ticks that a fast node may be ahead of the slowest where the manifest does not say.
const DEFAULT_WINDOW_TICKS: u32 = 64;
/// Default window with groups, which compute many ticks between two waits: measured, a composed hover is a quarter
/// faster.
const GROUPS_WINDOW_TICKS: u32 = 512;
/// Largest window. A larger one would only grow the queues: shared memory must hold the samples of a window.
pub const WINDOW_TICKS_MAX: u32 = 4096;
const RATE_HZ_MAX: u32 = 1_000_000;

/// A checked manifest. Its text lists the nodes with their rates, inputs and outputs.
///
/// ```
/// use bus::Registration;
/// use runtime::{graph::Graph, manifest::ManifestBuilder, registry::Registry};
/// const COMPONENTS: Registry = Registry::new(&[Registration::of::<recorder::node::Recorder>()]);
/// let recorder = ManifestBuilder::new().set("process.recorder.kind", "recorder");
/// let manifest = recorder.set("run.duration_s", 2.0).build("a.toml".as_ref(), COMPONENTS)?;
/// let graph = Graph::build(&manifest)?;
/// assert_eq!(graph.plan.duration_ticks, 2000);
/// assert!(graph.to_string().starts_with("2000 ticks at 1000 Hz (2 s), pace free"));
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug)]
pub struct Graph {
    /// The plan, which the processes of the run read.
    pub plan: Plan,
    /// Programs to start, in the order of the plan's nodes.
    pub(crate) programs: Vec<Program>,
    /// Backups, in the order in which they join.
    pub backups: Vec<BackupSpec>,
    /// Sidecars: their names and programs.
    pub(crate) sidecars: Vec<(String, Program)>,
    /// The files that the processes name and those that belong to them, each once.
    pub(crate) models: Vec<PathBuf>,
    /// The files that the run reads, each read once.
    pub files: InputFiles,
    /// Parts of the checkpoint from which the run goes on.
    pub(crate) from: Option<Parts>,
    /// The bytes of its file.
    pub(crate) source: Option<Vec<u8>>,
    /// Origins of first processes that are not those of the manifest, by node: a run that goes on begins with them.
    pub(crate) begun: BTreeMap<usize, Origin>,
    /// Legal but unusual values; `check` and `run` print them.
    pub warnings: Vec<Diagnostic>,
}

impl Graph {
    /// The component that each node is, where it is one of the registry.
    pub fn components(&self) -> impl Iterator<Item = Option<&'static Registration>> {
        self.programs.iter().map(Program::component)
    }

    /// Programs that take part in the ticks, with the names of their nodes: those of the plan, then those of backups.
    pub(crate) fn ticking_programs(&self) -> Vec<(&str, &Program)> {
        let first = self.plan.nodes.iter().map(|node| &*node.name).zip(&self.programs);
        let backups = self.backups.iter().map(|backup| (&*backup.plan.name, &backup.program));
        first.chain(backups).collect()
    }

    /// Checks `manifest` and resolves it. Files that it names are read from the disk, now and never again.
    ///
    /// # Errors
    /// Every fault of the manifest with its place, except those that another fault hides.
    pub fn build(manifest: &Manifest) -> Result<Self, Diagnostic> {
        Self::build_from(manifest, InputFiles::default())
    }

    /// As [`Graph::build`]; files that `files` has read already are not read again.
    ///
    /// # Errors
    /// As [`Graph::build`].
    pub fn build_from(manifest: &Manifest, files: InputFiles) -> Result<Self, Diagnostic> {
        let mut notes = Notes::default();
        Self::noting(manifest, files, &mut notes).map_err(|fault| notes.explain(fault))
    }

    /// Adds a shadow of `process`, which computes from the first tick to the last. `with_text` is TOML with the keys in which it
    /// differs, as `with` of `[[shadow]]`. `manifest` is that of this graph, and stays as it is.
    ///
    /// # Errors
    /// As [`backup_of`], or if the process has a backup already.
    pub fn add_shadow(
        &mut self,
        manifest: &Manifest,
        process: &str,
        with_text: &str,
    ) -> Result<(), Diagnostic> {
        let shadow = backup_of(manifest, &self.plan, &self.files, process, with_text)?;
        if self.backups.iter().any(|other| other.node == shadow.node) {
            let message = format!("`{process}` has a swap, a standby or a shadow in this manifest already");
            let help = "a process has one backup at a time: leave one of them out";
            return Err(Diagnostic::in_file(manifest.path.display().to_string(), message).help(help));
        }
        let place = (shadow.join_tick, shadow.node);
        let index = self.backups.partition_point(|other| (other.join_tick, other.node) < place);
        self.backups.insert(index, shadow);
        Ok(())
    }

    /// Refuses measures that see no sample since the run ends first: those in the own text of `manifest`, this graph's, from byte
    /// `start` on. [`Graph::build`] warns of them only, if `--set` states the duration.
    ///
    /// # Errors
    /// Every such measure, with its place.
    pub fn require_samples(&self, manifest: &Manifest, start: usize) -> Result<(), Diagnostic> {
        evaluations::require_samples(manifest, &self.plan, start)
    }

    fn noting(manifest: &Manifest, files: InputFiles, notes: &mut Notes) -> Result<Self, Diagnostic> {
        manifest.included().for_each(|(path, text)| files.keep(path, text.as_bytes().to_vec()));
        // A fault does not hide those of other keys, so that one look shows all of them.
        let mut faults = Faults::default();
        faults.keep(manifest.repairs.faults.clone().map_or(Ok(()), Err));
        let declared_nodes = checkable_nodes(manifest, &files, &mut faults);
        // A sidecar with a gap may seem to be a node.
        let sidecars = match manifest.repairs.processes.is_empty() {
            true => faults.keep(sidecars::sidecars(manifest)),
            false => None,
        };
        faults.keep(processes::require_own_logs(manifest));
        let wired = declared_nodes.as_deref().and_then(|nodes| faults.keep(wire_apart(nodes, None)));
        let planned =
            wired.and_then(|(wiring, faulty)| faults.keep(plan(manifest, wiring)).zip(Some(faulty)));
        let (Some(declared_nodes), Some((mut plan, faulty))) = (declared_nodes, planned) else {
            return faults.finish(None);
        };
        let clock_cpu = &manifest.content.run.clock_cpu;
        faults.keep(processes::require_core(manifest, clock_cpu, "clock_cpu"));
        placement::place(&mut plan, clock_cpu.as_ref().map(|cpu| *cpu.get_ref()));
        let is_whole = declared_nodes.iter().all(|declared| !declared.is_unchecked);
        let groups = match is_whole {
            true => faults.keep(groups::of(manifest, &declared_nodes, &plan.nodes)),
            false => None,
        };
        let groups = groups.map(|groups| placement::place_groups(&mut plan, groups));
        if manifest.content.run.window_ticks.is_none() && groups.as_ref().is_some_and(|it| !it.is_empty()) {
            plan.window_ticks = GROUPS_WINDOW_TICKS;
        }
        let has_times = !manifest.repairs.is_timeless;
        let periods = has_times.then(|| periods::check(manifest, &declared_nodes, &plan, notes));
        if faults.keep(periods.unwrap_or(Ok(()))).is_some() {
            set_parameters(&declared_nodes, &mut plan, &faulty, notes, &mut faults);
        }
        faults.keep(recorders::check(&declared_nodes, &plan.nodes));
        let programs: Vec<Program> = declared_nodes.iter().map(|declared| declared.program.clone()).collect();
        faults.keep(evaluations::check(manifest, &plan, &programs, notes, is_whole));
        if faults.is_empty() {
            samples::check(&declared_nodes, &plan, notes);
        }
        // A backup is wired as its node is: those of faulty nodes would repeat their faults.
        let backups = match faults.is_empty() {
            true => faults.keep(backups::all(manifest, &plan, &declared_nodes, notes)),
            false => None,
        };
        let (Some(groups), Some(backups), Some(sidecars)) = (groups, backups, sidecars) else {
            return faults.finish(None);
        };
        let (models, mut warnings) = std::mem::take(notes).into_parts(manifest);
        plan.groups = groups;
        faults.keep(checkpoints::add(manifest, &mut plan, &programs, &backups, &mut warnings));
        let begun = BTreeMap::new();
        faults.finish(Some(Self {
            plan,
            programs,
            backups,
            sidecars,
            models,
            files,
            from: None,
            source: None,
            begun,
            warnings,
        }))
    }
}

/// The nodes; those that cannot be started, and those with outputs that cannot be, are left unchecked.
fn checkable_nodes<'m>(
    manifest: &'m Manifest,
    files: &'m InputFiles,
    faults: &mut Faults,
) -> Option<Vec<DeclaredNode<'m>>> {
    let declared_nodes = processes::declared_apart(manifest, files, faults);
    let mut declared_nodes = faults.keep(declared_nodes)?;
    for declared in declared_nodes.iter_mut().filter(|declared| !declared.is_unchecked) {
        declared.is_unchecked = faults.keep(outputs::require_outputs(declared)).is_none();
    }
    Some(declared_nodes)
}

/// Puts the checked parameters of all nodes into `plan`. Of a node with a `faulty` input, or with one from an unchecked node, only
/// the parameters are checked that do not depend on inputs; nor on times, if these are not known.
fn set_parameters(
    declared_nodes: &[DeclaredNode<'_>],
    plan: &mut Plan,
    faulty: &BTreeMap<usize, Diagnostic>,
    notes: &mut Notes,
    faults: &mut Faults,
) {
    for (index, declared) in declared_nodes.iter().enumerate().filter(|(_, declared)| !declared.is_unchecked)
    {
        let node = &plan.nodes[index];
        let fault = faulty.get(&index);
        faults.keep(fault.cloned().map_or(Ok(()), Err));
        let is_fed = node.inputs.iter().all(|input| !plan.topics[input.topic].type_name.is_empty());
        if fault.is_some() || !is_fed || declared.manifest.repairs.is_timeless {
            faults.keep(parameters::check_alone(declared, plan, node.period_ticks, notes));
            continue;
        }
        let of_node = parameters::of(declared, plan, node.period_ticks, notes).and_then(|of_node| {
            processes::require_replaceable(declared, node)?;
            Ok(of_node)
        });
        if let Some((parameters, files)) = faults.keep(of_node) {
            let node = &mut plan.nodes[index];
            (node.parameters, node.files) = (parameters, files);
        }
    }
}

/// In words the rates nearest to `rate_hz`, below and above, whose ticks are whole numbers of nanoseconds.
fn near_rates_hz(rate_hz: u32) -> String {
    let is_whole = |rate_hz: &u32| 1_000_000_000 % rate_hz == 0;
    let below = (1..=rate_hz.min(RATE_HZ_MAX)).rev().find(is_whole);
    let above = (rate_hz.max(1)..=RATE_HZ_MAX).find(is_whole);
    let near: Vec<String> = below.into_iter().chain(above).map(|rate_hz| rate_hz.to_string()).collect();
    near.join(" or ")
}

fn plan(manifest: &Manifest, wiring: Wiring) -> Result<Plan, Diagnostic> {
    let run = &manifest.content.run;
    let rate_hz = *run.rate_hz.get_ref();
    if !(1..=RATE_HZ_MAX).contains(&rate_hz) || 1_000_000_000 % rate_hz != 0 {
        let help = format!(
            "a tick must be a whole number of nanoseconds: choose a divisor of 1 000 000 000, here {}",
            near_rates_hz(rate_hz)
        );
        return Err(manifest.problem(&run.rate_hz.span(), format!("`rate_hz` is {rate_hz}"), help));
    }
    let ticks = run.duration_s.get_ref() * f64::from(rate_hz);
    if !(ticks >= 1.0 && ticks <= f64::from(u32::MAX - 2 * WINDOW_TICKS_MAX)) {
        let message = format!(
            "`duration_s` is {} s, which is {} ticks",
            run.duration_s.get_ref(),
            nine_decimals(ticks)
        );
        let help = "a run has between 1 and about 4.29e9 ticks";
        return Err(manifest.problem(&run.duration_s.span(), message, help));
    }
    let help = format!("a window has 1 to {WINDOW_TICKS_MAX} ticks");
    let window_ticks = manifest.within("window_ticks", &run.window_ticks, 1..=WINDOW_TICKS_MAX, help)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
    let duration_ticks = ticks.round() as u32;
    Ok(Plan {
        run_id: String::new(),
        seed: run.seed,
        tick_ns: u64::from(1_000_000_000 / rate_hz),
        duration_ticks,
        first_tick: 0,
        checkpoint_ticks: Vec::new(),
        checkpoint_period: None,
        window_ticks: window_ticks.unwrap_or(DEFAULT_WINDOW_TICKS),
        pace: run.pace.0,
        clock_cpu: None,
        profile: run.profile,
        lock_memory: run.lock_memory,
        topics: wiring.topics,
        nodes: wiring.nodes,
        groups: Vec::new(),
    })
}
