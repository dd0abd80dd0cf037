//! Backups: processes that shadow a node, take over from it, or stand by for it.

use super::backup_ticks::Backup;
use super::parameters::{self, Notes};
use super::processes::{DeclaredNode, declared_nodes, irreplaceable, program};
use super::wiring::wire;
use crate::manifest::{Manifest, OutputSetting, Process, SwapSetting};
use crate::program::{BackupSpec, Executable};
use crate::supervisor::replacement::{next_take_over, take_over_stride};
use bus::Registration;
use bus::plan::{INPUTS_RESERVED, NodePlan, Plan};
use bus::ports::{Inputs, PortSpec};
use diagnostics::{Diagnostic, nine_decimals};
use inputs::InputFiles;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;

/// Largest number of swaps of one kind, beyond the use of any run.
const REPEAT_MAX: u32 = 100_000;
/// Ticks between a take-over and the next joining, beside two of the longest periods: until then the process
/// before has left.
const SETTLE_TICKS: u64 = 2;

/// The run that the backups join.
struct Run<'m> {
    manifest: &'m Manifest,
    plan: &'m Plan,
    declared_nodes: &'m [DeclaredNode<'m>],
}

/// A backup and the place in the manifest that declares it.
type Placed = (BackupSpec, Range<usize>);

/// Every backup that the manifest asks for, in the order in which they join.
///
/// # Errors
/// One that cannot join, or cannot have the declared purpose.
pub fn all(
    manifest: &Manifest,
    plan: &Plan,
    declared_nodes: &[DeclaredNode<'_>],
    notes: &mut Notes,
) -> Result<Vec<BackupSpec>, Diagnostic> {
    let run = Run { manifest, plan, declared_nodes };
    let mut placed: Vec<Placed> = Vec::new();
    for (node, declared) in declared_nodes.iter().enumerate() {
        if let Some(standby) = &declared.process.standby {
            let backup = run.resolve(node, standby.get_ref(), &standby.span(), notes)?;
            run.require_state(&backup, &standby.span())?;
            placed.push((BackupSpec { is_standby: true, ..backup }, standby.span()));
        }
    }
    for shadow in &manifest.content.shadow {
        let node = run.node(&shadow.get_ref().process)?;
        placed.push((run.resolve(node, &shadow.get_ref().with, &shadow.span(), notes)?, shadow.span()));
    }
    for swap in &manifest.content.swap {
        let node = run.node(&swap.get_ref().process)?;
        let backup = run.resolve(node, &swap.get_ref().with, &swap.span(), notes)?;
        run.require_state(&backup, &swap.span())?;
        placed.extend(run.times(node, swap)?.into_iter().map(|(join_tick, at_tick)| {
            (BackupSpec { join_tick, take_over_tick: Some(at_tick), ..backup.clone() }, swap.span())
        }));
    }
    placed.sort_by_key(|(backup, _)| (backup.join_tick, backup.node));
    run.require_one_at_a_time(&placed)?;
    Ok(placed.into_iter().map(|(backup, _)| backup).collect())
}

/// As [`backup_of`], for a backup that takes over; with its legal but unusual values.
///
/// # Errors
/// As [`backup_of`], or if the backup does not go on from the state of its process, and has to.
pub fn successor_of(
    manifest: &Manifest,
    plan: &Plan,
    files: &InputFiles,
    process: &str,
    with_text: &str,
) -> Result<(BackupSpec, Vec<Diagnostic>), Diagnostic> {
    noted_backup_of(manifest, plan, files, (process, with_text), Purpose::TakeOver)
}

/// The backup of `process` in a run of `manifest` by `plan` that is under way; `with_text` is TOML with its
/// differences, as in `with`. The ticks at which it joins and takes over are left open. It reads the run's `files`;
/// one that the run has not read yet is read now.
///
/// # Errors
/// If there is no such process, or the backup cannot succeed it.
pub fn backup_of(
    manifest: &Manifest,
    plan: &Plan,
    files: &InputFiles,
    process: &str,
    with_text: &str,
) -> Result<BackupSpec, Diagnostic> {
    noted_backup_of(manifest, plan, files, (process, with_text), Purpose::Any).map(|(backup, _)| backup)
}

/// Purpose of a requested backup.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// It takes over.
    TakeOver,
    /// It takes over or shadows.
    Any,
}

/// The backup for this `purpose` of a process by the text with its differences, and its legal but unusual values. A fault has the warnings
/// that may explain it.
fn noted_backup_of(
    manifest: &Manifest,
    plan: &Plan,
    files: &InputFiles,
    (process, with_text): (&str, &str),
    purpose: Purpose,
) -> Result<(BackupSpec, Vec<Diagnostic>), Diagnostic> {
    let (manifest, name, whole) = manifest.succeed(process, with_text)?;
    let declared_nodes = declared_nodes(&manifest, files)?;
    let run = Run { manifest: &manifest, plan, declared_nodes: &declared_nodes };
    let mut notes = Notes::default();
    let backup = run.requested(&name, &whole, purpose, &mut notes).map_err(|fault| notes.explain(fault))?;
    Ok((BackupSpec { with: Some(with_text.to_owned()), ..backup }, notes.warnings))
}

impl Run<'_> {
    /// The backup `whole` of the process `name`, for this `purpose`.
    fn requested(
        &self,
        name: &Spanned<String>,
        whole: &Spanned<Process>,
        purpose: Purpose,
        notes: &mut Notes,
    ) -> Result<BackupSpec, Diagnostic> {
        let backup = self.resolve(self.node(name)?, whole.get_ref(), &whole.span(), notes)?;
        if purpose == Purpose::TakeOver {
            self.require_state(&backup, &whole.span())?;
        }
        Ok(backup)
    }

    /// The node named `process`, if another process can go on in its place.
    fn node(&self, process: &Spanned<String>) -> Result<usize, Diagnostic> {
        let name = process.get_ref();
        let at = |message: String, help: &str| Err(self.manifest.problem(&process.span(), message, help));
        let Some(node) = self.declared_nodes.iter().position(|declared| declared.name.get_ref() == name)
        else {
            return at(
                format!("`{name}` takes no part in the ticks"),
                "only a process that takes part in the ticks can be replaced",
            );
        };
        match irreplaceable(&self.declared_nodes[node], &self.plan.nodes[node]) {
            Some(reason) => at(format!("`{name}` cannot be replaced: {reason}"), "name another process"),
            None => Ok(node),
        }
    }

    /// The backup `whole` of `node`: it computes from the first tick on and does not take over by the clock.
    fn resolve(
        &self,
        node: usize,
        whole: &Process,
        span: &Range<usize>,
        notes: &mut Notes,
    ) -> Result<BackupSpec, Diagnostic> {
        let name = Spanned::new(span.clone(), self.plan.nodes[node].name.clone());
        let program = program(self.manifest, &name, whole)?;
        if let Executable::Component(kind) = &program.executable {
            self.require_same_outputs(node, kind, whole, span)?;
        }
        let process = Process {
            outputs: self.outputs(node, span),
            period_ticks: Some(Spanned::new(span.clone(), self.plan.nodes[node].period_ticks)),
            ..whole.clone()
        };
        let mut declared_nodes = self.declared_nodes.to_vec();
        let files = declared_nodes[node].files;
        declared_nodes[node] = DeclaredNode {
            manifest: self.manifest,
            files,
            name: &name,
            process: &process,
            program,
            is_unchecked: false,
        };
        let mut wiring = wire(&declared_nodes, Some(node))?;
        let mut plan = wiring.nodes.swap_remove(node);
        let declared = &declared_nodes[node];
        (plan.parameters, plan.files) = parameters::of(declared, self.plan, plan.period_ticks, notes)?;
        self.require_room(node, &plan, span)?;
        if let Some(kind) = declared.program.component() {
            let (manifest, present) = (self.manifest, self.declared_nodes[node].process);
            let backup = Backup { manifest, plan: self.plan, node, present, whole, kind };
            notes.warnings.extend(backup.other_ticks(span)?);
        }
        for input in &mut plan.inputs {
            // The same topics, but perhaps in another order.
            let topic = &wiring.topics[input.topic].name;
            input.topic = self.plan.topics.iter().position(|known| known.name == *topic).unwrap_or_default();
        }
        let present = &self.plan.nodes[node];
        plan.outputs.clone_from(&present.outputs);
        plan.cpu = plan.cpu.or(present.cpu);
        let program = declared_nodes.swap_remove(node).program;
        let (take_over_tick, with) = (None, None);
        Ok(BackupSpec { node, join_tick: 0, take_over_tick, is_standby: false, with, program, plan })
    }

    /// The outputs of `node` as they are, written out.
    fn outputs(&self, node: usize, span: &Range<usize>) -> BTreeMap<Spanned<String>, OutputSetting> {
        let output = |output: &bus::plan::OutputPlan| {
            let topic = &self.plan.topics[output.topic];
            let setting = OutputSetting {
                topic: Some(topic.name.clone()),
                every_ticks: topic.ticks.period(),
                type_name: Some(topic.type_name.clone()),
            };
            (Spanned::new(span.clone(), output.port.clone()), setting)
        };
        self.plan.nodes[node].outputs.iter().map(output).collect()
    }

    /// Refuses a kind that does not publish the outputs of `node`.
    fn require_same_outputs(
        &self,
        node: usize,
        kind: &Registration,
        whole: &Process,
        span: &Range<usize>,
    ) -> Result<(), Diagnostic> {
        let forwards = matches!(kind.inputs, Inputs::Forwarded { .. });
        let forwarded: Vec<&str> =
            whole.inputs.keys().filter(|_| forwards).map(|port| port.get_ref().as_str()).collect();
        let present = self.plan.nodes[node].outputs.iter();
        let present: Vec<(&str, &str)> = present
            .map(|output| (output.port.as_str(), self.plan.topics[output.topic].type_name.as_str()))
            .collect();
        let offered = |port: &PortSpec| (port.name, port.schema.type_name);
        let knows = |output: &(&str, &str)| {
            kind.outputs.iter().any(|port| offered(port) == *output) || forwarded.contains(&output.0)
        };
        let adds = |port: &PortSpec| port.required && !present.contains(&offered(port));
        let adds_forwarded = |name: &&str| present.iter().all(|(port, _)| port != name);
        let adds_any = kind.outputs.iter().any(adds) || forwarded.iter().any(adds_forwarded);
        if present.iter().all(knows) && !adds_any {
            return Ok(());
        }
        let list = |outputs: Vec<(&str, &str)>| {
            let ports: Vec<String> = outputs.iter().map(|(port, of)| format!("`{port}` [{of}]")).collect();
            if ports.is_empty() { "nothing".to_owned() } else { ports.join(", ") }
        };
        let message = format!(
            "the kind `{}` publishes {}, but `{}`, which it would replace, publishes {}",
            kind.name,
            list(kind.outputs.iter().map(offered).collect()),
            self.plan.nodes[node].name,
            list(present),
        );
        Err(self.manifest.problem(span, message, "a backup publishes the same messages on the same ports"))
    }

    /// Refuses a `backup` that takes over, declared at `span`, if it has to go on from the state of its process and does not.
    fn require_state(&self, backup: &BackupSpec, span: &Range<usize>) -> Result<(), Diagnostic> {
        let declared = &self.declared_nodes[backup.node];
        let Some(component) = backup.program.component() else { return Ok(()) };
        let (Some(reason), Some(before)) = (component.needs_state, declared.program.component()) else {
            return Ok(());
        };
        let (before, files) = ((before, &self.plan.nodes[backup.node]), declared.files.listing_anew());
        // A component that cannot be made is refused elsewhere, with its place.
        if bus::goes_on_from((component, &backup.plan), before, self.plan, &files).unwrap_or(true) {
            return Ok(());
        }
        let message = format!("the backup of `{}` does not go on from its state", backup.plan.name);
        Err(self.manifest.problem(span, message, reason))
    }

    fn require_room(&self, node: usize, plan: &NodePlan, span: &Range<usize>) -> Result<(), Diagnostic> {
        let (found, most) = (plan.inputs.len(), self.plan.nodes[node].inputs_max());
        if found <= most {
            return Ok(());
        }
        let message = format!("the backup of `{}` has {found} inputs", plan.name);
        let help =
            format!("it may have {most}: as many as the process that it replaces, or {INPUTS_RESERVED}");
        Err(self.manifest.problem(span, message, help))
    }

    /// Ticks at which a swap's backups join and take over.
    fn times(&self, node: usize, swap: &Spanned<SwapSetting>) -> Result<Vec<(u32, u32)>, Diagnostic> {
        let setting = swap.get_ref();
        let (at_tick, span) = self.at_tick(swap)?;
        let repeat = self.repeat(setting)?;
        let every_ticks = setting.every_ticks.as_ref().map_or(0, |every| *every.get_ref());
        let at = |message: String, help: String| self.manifest.problem(&span, message, help);
        let last = u64::from(at_tick) + u64::from(repeat - 1) * u64::from(every_ticks);
        let end = self.plan.duration_ticks;
        if last >= u64::from(end) {
            let message = format!("the take-over at tick {last} lies beyond the run, which has {end} ticks");
            return Err(at(message, format!("the last tick is {}", end - 1)));
        }
        let Some(join_tick) = at_tick.checked_sub(setting.shadow_ticks).filter(|join| *join >= 1) else {
            let message = format!(
                "it takes over at tick {at_tick} and would join {} ticks before, ahead of tick 1",
                setting.shadow_ticks
            );
            return Err(at(message, "take over later, or lower `shadow_ticks`".to_owned()));
        };
        let (period, stride) = (self.plan.nodes[node].period_ticks, take_over_stride(self.plan, node));
        let computes = (period, "computes", "");
        let sends = (stride, "sends", ": a backup sends on every output at once");
        for (what, tick, (of, does, why)) in [
            ("takes over at", at_tick, computes),
            ("joins at", join_tick, computes),
            ("repeats after", every_ticks, computes),
            ("takes over at", at_tick, sends),
            ("repeats after", every_ticks, sends),
        ] {
            if !tick.is_multiple_of(of) {
                let name = &self.plan.nodes[node].name;
                let message = format!("it {what} tick {tick}, but `{name}` {does} every {of} ticks");
                return Err(at(message, format!("choose multiples of {of}{why}")));
            }
        }
        let all = (0..repeat).map(|n| (join_tick + n * every_ticks, at_tick + n * every_ticks));
        all.clone().try_for_each(|(_, at_tick)| self.require_sent(node, at_tick, &span))?;
        Ok(all.collect())
    }

    /// Refuses a take-over at `tick` if `node` is a sensor of which no measurement arrives there.
    fn require_sent(&self, node: usize, tick: u32, span: &Range<usize>) -> Result<(), Diagnostic> {
        let next = next_take_over(self.plan, node, tick);
        if next == Some(tick) {
            return Ok(());
        }
        let name = &self.plan.nodes[node].name;
        let message = format!("it takes over at tick {tick}, at which no measurement of `{name}` arrives");
        let help = match next {
            Some(next) => format!("choose tick {next}: a backup sends on every output at once"),
            None => "choose an earlier tick: no measurement arrives before the end of the run".to_owned(),
        };
        Err(self.manifest.problem(span, message, help))
    }

    /// The first tick at which a swap takes over, and its place.
    fn at_tick(&self, swap: &Spanned<SwapSetting>) -> Result<(u32, Range<usize>), Diagnostic> {
        let at = |span: Range<usize>, message: &str, help: &str| self.manifest.problem(&span, message, help);
        if swap.get_ref().shadow_ticks == 0 {
            let help = "a backup computes at least one tick beside the process that it replaces";
            return Err(at(swap.span(), "`shadow_ticks` is 0", help));
        }
        match (&swap.get_ref().at_tick, &swap.get_ref().at_s) {
            (Some(tick), None) => Ok((*tick.get_ref(), tick.span())),
            (None, Some(time)) => {
                let ticks = time.get_ref() / self.plan.tick_s();
                let is_whole = (ticks - ticks.round()).abs() < 1e-6;
                if is_whole && (0.0..=f64::from(u32::MAX)).contains(&ticks) {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
                    return Ok((ticks.round() as u32, time.span()));
                }
                let message =
                    format!("`at_s` is {} s, which is {} ticks", time.get_ref(), nine_decimals(ticks));
                Err(at(time.span(), &message, "give the time of a tick"))
            }
            (None, None) => Err(at(swap.span(), "the swap has no time", "add at_tick = … or at_s = …")),
            (Some(_), Some(time)) => {
                Err(at(time.span(), "the swap has both `at_tick` and `at_s`", "leave one of them out"))
            }
        }
    }

    fn repeat(&self, swap: &SwapSetting) -> Result<u32, Diagnostic> {
        let at = |key: &Spanned<u32>, message: &str, help: &str| {
            Err(self.manifest.problem(&key.span(), message, help))
        };
        match (&swap.repeat, &swap.every_ticks) {
            (Some(repeat), None) => at(repeat, "`repeat` without `every_ticks`", "add every_ticks = …"),
            (None, Some(every)) => at(every, "`every_ticks` without `repeat`", "add repeat = …"),
            _ => {
                let help = "a swap happens 1 to 100 000 times";
                Ok(self.manifest.within("repeat", &swap.repeat, 1..=REPEAT_MAX, help)?.unwrap_or(1))
            }
        }
    }

    /// Refuses a backup that joins while another one of the same node is there; `placed` is in order.
    fn require_one_at_a_time(&self, placed: &[Placed]) -> Result<(), Diagnostic> {
        let longest = self.plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
        let gap = SETTLE_TICKS + 2 * u64::from(longest);
        let mut before: BTreeMap<usize, &Placed> = BTreeMap::new();
        for next in placed {
            let (BackupSpec { node, join_tick, .. }, span) = next;
            let Some((earlier, _)) = before.insert(*node, next) else { continue };
            let name = &self.plan.nodes[*node].name;
            let at = |message: String, help: String| Err(self.manifest.problem(span, message, help));
            let Some(take_over) = earlier.take_over_tick else {
                let what = if earlier.is_standby { "standby" } else { "shadow" };
                let message = format!("`{name}` has a {what} already, which is there until the end");
                return at(message, "a process has one shadow at a time: leave one of them out".to_owned());
            };
            let earliest = u64::from(take_over) + gap;
            if u64::from(*join_tick) < earliest {
                let message = format!(
                    "a backup of `{name}` would join at tick {join_tick}, too soon after the take-over at \
                     tick {take_over}"
                );
                let help = format!(
                    "it can join at tick {earliest} or later; lower `shadow_ticks`, or take over later"
                );
                return at(message, help);
            }
        }
        Ok(())
    }
}
