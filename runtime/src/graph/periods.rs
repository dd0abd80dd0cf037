//! Periods against the length of the run: periods that would overflow the count of ticks, and nodes that compute only
//! once.

use super::parameters::Notes;
use super::processes::DeclaredNode;
use crate::manifest::Manifest;
use bus::plan::Plan;
use diagnostics::Diagnostic;
use std::ops::Range;

/// Refuses periods with which the tick behind the last cannot be counted, and warns of those as long as the run.
///
/// # Errors
/// The process or output, and its period.
pub fn check(
    manifest: &Manifest,
    declared_nodes: &[DeclaredNode<'_>],
    plan: &Plan,
    notes: &mut Notes,
) -> Result<(), Diagnostic> {
    for (declared, node) in declared_nodes.iter().zip(&plan.nodes) {
        let name = &declared.name;
        let written = declared.process.period_ticks.as_ref();
        let span = written.map_or_else(|| name.span(), toml::Spanned::span);
        let who = format!("`period_ticks` of `{}`", name.get_ref());
        check_one(manifest, &span, &who, node.period_ticks, plan.duration_ticks, notes)?;
        for output in &node.outputs {
            let mut stated = declared.process.outputs.iter();
            let stated = stated.find(|(port, _)| *port.get_ref() == output.port);
            let Some((port, every)) = stated.and_then(|(port, stated)| Some((port, stated.every_ticks?)))
            else {
                continue;
            };
            if every == node.period_ticks {
                continue;
            }
            let who = format!("`every_ticks` of the output `{}` of `{}`", output.port, name.get_ref());
            check_one(manifest, &port.span(), &who, every, plan.duration_ticks, notes)?;
        }
    }
    Ok(())
}

fn check_one(
    manifest: &Manifest,
    span: &Range<usize>,
    who: &str,
    ticks: u32,
    end: u32,
    notes: &mut Notes,
) -> Result<(), Diagnostic> {
    let message = format!("{who} is {ticks}, and the run has {end} ticks");
    if end.checked_add(ticks).is_none_or(|behind| behind >= u32::MAX - 1) {
        let help = "both together stay below 4 294 967 294: ticks have 32 bits";
        return Err(manifest.problem(span, message, help));
    }
    if ticks >= end && end > 1 && !notes.is_cut(manifest, span) {
        let message = format!("{message}: it is due at tick 0 alone");
        notes.warnings.push(manifest.problem(span, message, "lower it, or fly longer"));
    }
    Ok(())
}
