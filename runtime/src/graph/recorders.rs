//! Recorders: one, and it takes every sample.

use super::processes::DeclaredNode;
use bus::plan::NodePlan;
use diagnostics::Diagnostic;

/// Refuses a second recorder, which would write to the same file, and one that ran less often, or looked back: it would
/// leave samples out.
pub fn check(declared_nodes: &[DeclaredNode<'_>], nodes: &[NodePlan]) -> Result<(), Diagnostic> {
    let recorders = declared_nodes.iter().zip(nodes).filter(|(declared, _)| declared.program.is_recorder());
    let mut first = None;
    for (DeclaredNode { manifest, name, .. }, node) in recorders {
        let at = |message: String, help: &str| Err(manifest.problem(&name.span(), message, help));
        let who = name.get_ref();
        if let Some(first) = first.replace(who) {
            let message = format!("`{who}` is a second recorder beside `{first}`");
            return at(message, "a run has one recording: give all topics to one recorder");
        }
        if node.period_ticks != 1 || node.inputs.iter().any(|input| input.delay_ticks != 0) {
            let help = "leave `period_ticks` and `delay_ticks` out: a recorder takes every sample";
            return at(format!("the recorder `{who}` would leave samples out"), help);
        }
    }
    Ok(())
}
