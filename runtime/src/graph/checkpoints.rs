//! Ticks of the checkpoints that a run writes.

use crate::manifest::Manifest;
use crate::program::{BackupSpec, Program, unsaved};
use bus::plan::Plan;
use diagnostics::Diagnostic;
use std::ops::Range;

/// Makes the nodes of `plan` write the checkpoints of `manifest`.
///
/// # Errors
/// A tick outside the run, that a node does not reach, or that lies within a swap. A tick at which a process flies
/// whose state no checkpoint holds.
pub fn add(
    manifest: &Manifest,
    plan: &mut Plan,
    programs: &[Program],
    backups: &[BackupSpec],
) -> Result<(), Diagnostic> {
    let require_flying = |plan: &Plan, tick, span: &Range<usize>| {
        require_saved(manifest, plan, programs, backups, tick, span)?;
        require_flying(manifest, backups, tick, span)
    };
    let run = &manifest.content.run;
    for checkpoint in &manifest.content.checkpoint {
        let at = &checkpoint.get_ref().at_tick;
        require_within(manifest, plan, *at.get_ref(), &at.span())?;
        require_flying(plan, *at.get_ref(), &at.span())?;
        plan.checkpoint_ticks.push(*at.get_ref());
    }
    plan.checkpoint_ticks.sort_unstable();
    if let Some(keep) = run.checkpoint_keep.as_ref().filter(|keep| *keep.get_ref() == 0) {
        let help = "keep at least one, or leave `checkpoint_every_s` out";
        return Err(manifest.problem(&keep.span(), "`checkpoint_keep` is 0", help));
    }
    if let Some(every) = &run.checkpoint_every_s {
        let period = period(*every.get_ref() / plan.tick_s()).ok_or_else(|| {
            let message = format!("`checkpoint_every_s` is {} s", every.get_ref());
            manifest.problem(&every.span(), message, "choose some time of at least one tick, such as 1.0")
        })?;
        let ticks = (1..).map_while(|number: u32| number.checked_mul(period));
        // Without take-overs every tick is like the first.
        let count = if backups.is_empty() { 1 } else { usize::MAX };
        let mut ticks = ticks.take(count).take_while(|&tick| plan.goes_on_from(tick));
        ticks.try_for_each(|tick| require_flying(plan, tick, &every.span()))?;
        plan.checkpoint_period = Some(period);
    }
    Ok(())
}

/// A number of ticks as one, if it is at least 1.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within the range, which is checked"
)]
fn period(ticks: f64) -> Option<u32> {
    (ticks >= 0.5 && ticks < f64::from(u32::MAX)).then(|| ticks.round() as u32)
}

fn require_within(
    manifest: &Manifest,
    plan: &Plan,
    tick: u32,
    span: &Range<usize>,
) -> Result<(), Diagnostic> {
    if tick == 0 || !plan.goes_on_from(tick) {
        let message = format!("a checkpoint at tick {tick} of a run of {} ticks", plan.duration_ticks);
        let help = "it lies before a tick that every process still computes, and behind the first: a run goes on from it";
        return Err(manifest.problem(span, message, help));
    }
    Ok(())
}

/// Refuses a checkpoint at `tick`, declared at `span`, at which a process flies whose state is in another program.
fn require_saved(
    manifest: &Manifest,
    plan: &Plan,
    programs: &[Program],
    backups: &[BackupSpec],
    tick: u32,
    span: &Range<usize>,
) -> Result<(), Diagnostic> {
    let Some((node, program)) = unsaved(plan, programs, backups, tick) else { return Ok(()) };
    let message = format!(
        "a checkpoint at tick {tick}, and the state of `{node}` is in {program}, which does not tell it"
    );
    Err(manifest.problem(span, message, "leave checkpoints out: such a run flies from tick 0"))
}

/// Refuses a checkpoint at `tick`, declared at `span`, at which a process is about to take another one's place.
fn require_flying(
    manifest: &Manifest,
    backups: &[BackupSpec],
    tick: u32,
    span: &Range<usize>,
) -> Result<(), Diagnostic> {
    let joins = |backup: &&BackupSpec| {
        backup.take_over_tick.is_some_and(|take_over| backup.join_tick < tick && tick <= take_over)
    };
    let Some(backup) = backups.iter().find(joins) else { return Ok(()) };
    let message = format!(
        "a checkpoint at tick {tick}, and another process joins `{}` at tick {} and takes over at tick {}",
        backup.plan.name,
        backup.join_tick,
        backup.take_over_tick.unwrap_or_default()
    );
    Err(manifest.problem(span, message, "a checkpoint lies before the one or behind the other"))
}
