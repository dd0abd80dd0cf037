//! Ticks of the checkpoints that a run writes.

use crate::manifest::Manifest;
use crate::program::{BackupSpec, Program, unsaved};
use bus::plan::Plan;
use diagnostics::{Diagnostic, nine_decimals};
use std::ops::Range;
use toml::Spanned;

/// Makes the nodes of `plan` write the checkpoints of `manifest`; adds what is unusual to `warnings`.
///
/// # Errors
/// A tick outside the run, or that a node does not reach. A tick at which a process flies whose state no checkpoint holds.
pub fn add(
    manifest: &Manifest,
    plan: &mut Plan,
    programs: &[Program],
    backups: &[BackupSpec],
    warnings: &mut Vec<Diagnostic>,
) -> Result<(), Diagnostic> {
    let require_saved =
        |plan: &Plan, tick, span: &Range<usize>| require_saved(manifest, plan, programs, backups, tick, span);
    let run = &manifest.content.run;
    for checkpoint in &manifest.content.checkpoint {
        let at = &checkpoint.get_ref().at_tick;
        require_within(manifest, plan, *at.get_ref(), &at.span())?;
        require_saved(plan, *at.get_ref(), &at.span())?;
        plan.checkpoint_ticks.push(*at.get_ref());
    }
    plan.checkpoint_ticks.sort_unstable();
    if let Some(keep) = run.checkpoint_keep.as_ref().filter(|keep| *keep.get_ref() == 0) {
        let help = "keep at least one, or leave `checkpoint_every_s` out";
        return Err(manifest.problem(&keep.span(), "`checkpoint_keep` is 0", help));
    }
    if let Some(every) = &run.checkpoint_every_s {
        let period = period(manifest, plan, every)?;
        let ticks = (1..).map_while(|number: u32| number.checked_mul(period));
        // Without take-overs every tick is like the first.
        let count = if backups.is_empty() { 1 } else { usize::MAX };
        let mut ticks = ticks.take(count).take_while(|&tick| plan.goes_on_from(tick));
        ticks.try_for_each(|tick| require_saved(plan, tick, &every.span()))?;
        plan.checkpoint_period = Some(period);
        if plan.checkpoint_after(0).is_none() {
            let message = format!(
                "`checkpoint_every_s` is {} s: the run ends before its first checkpoint",
                every.get_ref()
            );
            let help = format!(
                "choose a time below {} s",
                nine_decimals(f64::from(plan.duration_ticks) * plan.tick_ns as f64 / 1e9)
            );
            warnings.push(manifest.problem(&every.span(), message, help));
        }
    }
    Ok(())
}

/// Ticks of the time `every`.
///
/// # Errors
/// A time that is no whole number of ticks.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within the range, which is checked"
)]
fn period(manifest: &Manifest, plan: &Plan, every: &Spanned<f64>) -> Result<u32, Diagnostic> {
    let every_s = *every.get_ref();
    // Of times in decimal, as people write them, rather than of their quotient.
    let ticks = every_s * 1e9 / plan.tick_ns as f64;
    let is_whole = (ticks - ticks.round()).abs() <= 1e-6 * ticks.max(1.0);
    if is_whole && (1.0..f64::from(u32::MAX)).contains(&ticks.round()) {
        return Ok(ticks.round() as u32);
    }
    let (message, help) = if ticks > 0.0 && ticks < f64::from(u32::MAX) {
        let below = ticks.floor().max(1.0);
        let neighbours = [below, ticks.ceil().max(1.0)];
        let [below, above] =
            neighbours.map(|ticks| format!("{} s", nine_decimals(ticks * plan.tick_ns as f64 / 1e9)));
        let choice = if below == above { above } else { format!("{below} or {above}") };
        let message = format!("`checkpoint_every_s` is {every_s} s, which is {} ticks", nine_decimals(ticks));
        (message, format!("choose a whole number of ticks, such as {choice}"))
    } else {
        let message = format!("`checkpoint_every_s` is {every_s} s");
        (message, "choose some time of at least one tick, such as 1.0".to_owned())
    };
    Err(manifest.problem(&every.span(), message, help))
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
