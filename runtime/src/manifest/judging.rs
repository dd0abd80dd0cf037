//! The process that judges a run in flight: one that is not recorded, and one that writes checkpoints, since a run that
//! goes on from one has recorded a part only.

use super::content::{Content, Process};
use super::sources::Sources;
use bus::Registration;
use bus::component::Role;
use diagnostics::Diagnostic;
use toml::Spanned;

/// Name of the process, with a number behind it if the manifest has a process of this name.
const NAME: &str = "judge";

/// Removes the recorder of a run that is not to be recorded, and adds a judge if there is something to judge.
///
/// # Errors
/// If the manifest names a judge itself.
pub fn complete(content: &mut Content, sources: &Sources) -> Result<(), Diagnostic> {
    let registry = sources.registry;
    let component = |process: &Process| registry.find(process.kind.as_ref()?.get_ref());
    let has = |process: &Process, role: Role| component(process).is_some_and(|found| found.role == role);
    if let Some(kind) =
        content.process.values().find(|process| has(process, Role::Judge)).and_then(|it| it.kind.as_ref())
    {
        let message = format!("`{}` is not a kind for a manifest", kind.get_ref());
        let help =
            "leave the process out: a run with conditions and without a recording has a judge by itself";
        return Err(sources.problem(&kind.span(), message, help));
    }
    if content.run.is_unrecorded() {
        content.process.retain(|_, process| !has(process, Role::Record));
    }
    let is_recorded = content.process.values().any(|process| has(process, Role::Record));
    let judge = registry.iter().find(|component| component.role == Role::Judge);
    if let Some(Registration { name: kind, .. }) = judge.filter(|_| {
        (!is_recorded || content.writes_checkpoints()) && !content.conditions().topics().is_empty()
    }) {
        let is_free = |name: &String| content.process.keys().all(|other| other.get_ref() != name);
        let numbered = (2..).map(|number| format!("{NAME}-{number}"));
        let name = std::iter::once(NAME.to_owned()).chain(numbered).find(is_free).unwrap_or_default();
        let kind = Some(Spanned::new(0..0, (*kind).to_owned()));
        content.process.insert(Spanned::new(0..0, name), Process { kind, ..Process::default() });
    }
    Ok(())
}
