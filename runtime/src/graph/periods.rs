//! Periods against the length of the run: what would overflow the count of ticks, and what computes only once.

use super::parameters::Notes;
use super::processes::DeclaredNode;
use crate::manifest::Manifest;
use bus::plan::Plan;
use diagnostics::Diagnostic;
use std::ops::Range;

/// Refuses periods with which the tick behind the last cannot be counted, and tells those as long as the run.
///
/// # Errors
/// The process or output, and its period.
pub fn check(
    manifest: &Manifest,
    declared_nodes: &[DeclaredNode<'_>],
    plan: &Plan,
    notes: &mut Notes,
) -> Result<(), Diagnostic> {
    let end = plan.duration_ticks;
    for (declared, node) in declared_nodes.iter().zip(&plan.nodes) {
        let name = &declared.name;
        let written = declared.process.period_ticks.as_ref();
        let span = written.map_or_else(|| name.span(), toml::Spanned::span);
        let who = format!("`period_ticks` of `{}`", name.get_ref());
        note(manifest, &span, checked(manifest, &span, &who, node.period_ticks, end)?, notes);
        for output in &node.outputs {
            let every = plan.topics[output.topic].period_ticks;
            if every == node.period_ticks {
                continue;
            }
            let port = declared.process.outputs.keys().find(|port| *port.get_ref() == output.port);
            let span = port.unwrap_or(name).span();
            let who = format!("`every_ticks` of the output `{}` of `{}`", output.port, name.get_ref());
            note(manifest, &span, checked(manifest, &span, &who, every, end)?, notes);
        }
    }
    Ok(())
}

fn note(manifest: &Manifest, span: &Range<usize>, warning: Option<Diagnostic>, notes: &mut Notes) {
    if let Some(warning) = warning
        && !notes.is_cut(manifest, span)
    {
        notes.warnings.push(warning);
    }
}

fn checked(
    manifest: &Manifest,
    span: &Range<usize>,
    who: &str,
    ticks: u32,
    end: u32,
) -> Result<Option<Diagnostic>, Diagnostic> {
    if end.checked_add(ticks).is_none_or(|behind| behind >= u32::MAX - 1) {
        let message = format!("{who} is {ticks}, and the run has {end} ticks");
        return Err(manifest.problem(
            span,
            message,
            "both together stay below 4 294 967 294: ticks have 32 bits",
        ));
    }
    let message = format!("{who} is {ticks}, and the run has {end} ticks: it is due at tick 0 alone");
    Ok((ticks >= end && end > 1).then(|| manifest.problem(span, message, "lower it, or fly longer")))
}
