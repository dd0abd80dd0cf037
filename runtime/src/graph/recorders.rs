//! Recorders: one, and it takes every sample.

use super::processes::DeclaredNode;
use crate::manifest::Manifest;
use bus::plan::NodePlan;
use diagnostics::Diagnostic;

/// A second recorder would write to the same file.
pub fn require_one_recorder(
    manifest: &Manifest,
    declared_nodes: &[DeclaredNode<'_>],
) -> Result<(), Diagnostic> {
    let mut recorders =
        declared_nodes.iter().filter(|declared| declared.program.is_recorder()).map(|declared| declared.name);
    match (recorders.next(), recorders.next()) {
        (Some(first), Some(second)) => Err(manifest.problem(
            &second.span(),
            format!("`{}` is a second recorder beside `{}`", second.get_ref(), first.get_ref()),
            "a run has one recording: give all topics to one recorder",
        )),
        _ => Ok(()),
    }
}

/// A recorder that ran less often, or looked back, would leave samples out.
pub fn require_whole_recording(
    manifest: &Manifest,
    declared_nodes: &[DeclaredNode<'_>],
    nodes: &[NodePlan],
) -> Result<(), Diagnostic> {
    let recorders = declared_nodes.iter().zip(nodes).filter(|(declared, _)| declared.program.is_recorder());
    for (DeclaredNode { name, .. }, node) in recorders {
        if node.period_ticks != 1 || node.inputs.iter().any(|input| input.delay_ticks != 0) {
            return Err(manifest.problem(
                &name.span(),
                format!("the recorder `{}` would leave samples out", name.get_ref()),
                "leave `period_ticks` and `delay_ticks` out: a recorder takes every sample",
            ));
        }
    }
    Ok(())
}
