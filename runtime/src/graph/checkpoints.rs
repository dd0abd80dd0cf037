//! Ticks of the checkpoints that a run writes.

use crate::manifest::Manifest;
use crate::program::BackupSpec;
use bus::plan::Plan;
use diagnostics::Diagnostic;
use std::ops::Range;

/// The ticks at which the nodes of `plan` write their parts of a checkpoint, ascending, each once.
///
/// # Errors
/// A tick that is none of the run's, that a node does not reach, or that lies behind a swap.
pub fn ticks(manifest: &Manifest, plan: &Plan, backups: &[BackupSpec]) -> Result<Vec<u32>, Diagnostic> {
    let run = &manifest.content.run;
    let mut ticks = Vec::new();
    for checkpoint in &manifest.content.checkpoint {
        let at = &checkpoint.get_ref().at_tick;
        require(manifest, plan, backups, *at.get_ref(), &at.span())?;
        ticks.push(*at.get_ref());
    }
    if let Some(keep) = run.checkpoint_keep.as_ref().filter(|keep| *keep.get_ref() == 0) {
        let help = "keep at least one, or leave `checkpoint_every_s` out";
        return Err(manifest.problem(&keep.span(), "`checkpoint_keep` is 0", help));
    }
    if let Some(every) = &run.checkpoint_every_s {
        let period = every.get_ref() / plan.tick_s();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be in range")]
        let period = if period >= 0.5 && period < f64::from(u32::MAX) { period.round() as u32 } else { 0 };
        if period == 0 {
            let message = format!("`checkpoint_every_s` is {} s", every.get_ref());
            let help = "choose some time of at least one tick, such as 1.0";
            return Err(manifest.problem(&every.span(), message, help));
        }
        let last = (1..).map(|number: u64| number * u64::from(period));
        let last = last.map_while(|tick| u32::try_from(tick).ok()).take_while(|&tick| !is_late(plan, tick));
        let before = ticks.len();
        ticks.extend(last);
        for &tick in &ticks[before..] {
            require(manifest, plan, backups, tick, &every.span())?;
        }
    }
    ticks.sort_unstable();
    ticks.dedup();
    Ok(ticks)
}

/// True if a node of `plan` computes nothing more from `tick` on.
fn is_late(plan: &Plan, tick: u32) -> bool {
    plan.nodes.iter().any(|node| {
        let due = u64::from(tick).next_multiple_of(u64::from(node.period_ticks.max(1)));
        due >= u64::from(plan.duration_ticks)
    })
}

fn require(
    manifest: &Manifest,
    plan: &Plan,
    backups: &[BackupSpec],
    tick: u32,
    span: &Range<usize>,
) -> Result<(), Diagnostic> {
    let at = |message: String, help: &str| Err(manifest.problem(span, message, help));
    let end = plan.duration_ticks;
    if tick == 0 || is_late(plan, tick) {
        let message = format!("a checkpoint at tick {tick} of a run of {end} ticks");
        let help = "it lies before a tick that every process still computes, and behind the first: a run goes on from it";
        return at(message, help);
    }
    let swapped = backups.iter().find(|backup| backup.take_over_tick.is_some() && backup.join_tick < tick);
    match swapped {
        Some(backup) => {
            let message = format!(
                "a checkpoint at tick {tick}, and another process joins `{}` at tick {}",
                backup.plan.name, backup.join_tick
            );
            at(
                message,
                "a checkpoint lies before the first swap: the manifest says which process a node is from its first tick on",
            )
        }
        None => Ok(()),
    }
}
