//! Values that a run from a checkpoint must share with the run before: those that count at the start alone.

use crate::manifest::Manifest;
use diagnostics::Diagnostic;
use std::ops::Range;

/// Refuses values of `now` that count at the start alone and differ from those of `before`; the run goes on from `tick`.
///
/// # Errors
/// A [`Diagnostic`] that names the key.
pub(crate) fn require_effective(before: &Manifest, now: &Manifest, tick: u32) -> Result<(), Diagnostic> {
    let refused = |span: &Range<usize>, key: String| {
        let message =
            format!("`{key}` counts at the start of a run alone, and this one goes on from tick {tick}");
        let help =
            "fly from the start with this value, or change what the vehicle does from the checkpoint on";
        Err(now.problem(span, message, help))
    };
    for (name, process) in &now.content.process {
        let Some((_, other)) =
            before.content.process.iter().find(|(other, _)| other.get_ref() == name.get_ref())
        else {
            continue;
        };
        let kinds = [process, other].map(|process| process.kind.as_ref().map(|kind| kind.get_ref().as_str()));
        // A node of another kind begins with its own parameters.
        if kinds[0] != kinds[1] {
            continue;
        }
        let component = kinds[0].and_then(|kind| now.registry().find(kind));
        for (key, value) in &process.parameters {
            let is_initial = component.is_some_and(|component| component.is_initial(key.get_ref()));
            if is_initial && other.parameters.get(key) != Some(value) {
                return refused(
                    &key.span(),
                    format!("process.{}.parameters.{}", name.get_ref(), key.get_ref()),
                );
            }
        }
        for (port, input) in &process.inputs {
            let is_other = |before: &crate::manifest::InputSetting| before.initial != input.initial;
            if input.initial.is_some() && other.inputs.get(port).is_some_and(is_other) {
                return refused(
                    &port.span(),
                    format!("process.{}.inputs.{}.initial", name.get_ref(), port.get_ref()),
                );
            }
        }
    }
    Ok(())
}
