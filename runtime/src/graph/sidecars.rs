//! Sidecars: processes beside the ticks, and the order in which they start.

use super::processes::{program, takes_part};
use crate::manifest::{Manifest, Process};
use crate::program::{OnExit, Program};
use diagnostics::{Diagnostic, did_you_mean};
use toml::Spanned;

/// The processes that take no part in the ticks, by name.
///
/// # Errors
/// If one has a key that only a node may have, or cannot be started.
pub fn sidecars(manifest: &Manifest) -> Result<Vec<(String, Program)>, Diagnostic> {
    let sidecars = manifest.content.process.iter().filter(|(_, process)| !takes_part(process));
    Diagnostic::gather(sidecars.map(|(name, process)| {
        require_no_node(manifest, name, process)?;
        let after = after(manifest, name, process)?;
        Ok((name.get_ref().clone(), Program { after, ..program(manifest, name, process)? }))
    }))
    .and_then(|sidecars| require_order(manifest, &sidecars).map(|()| sidecars))
}

/// A sidecar has no ports, no place in the ticks, and no state of the run that a standby could go on from.
fn require_no_node(manifest: &Manifest, name: &Spanned<String>, process: &Process) -> Result<(), Diagnostic> {
    let who = format!("of `{}`, which has lockstep = false", name.get_ref());
    let kind = process.kind.iter().map(|kind| ("kind", kind));
    let mut stated = kind.chain(process.files()).map(|(key, file)| (key, Some(file.span()))).chain([
        ("period_ticks", process.period_ticks.as_ref().map(Spanned::span)),
        ("cpu", process.cpu.as_ref().map(Spanned::span)),
        ("wait", process.wait.map(|_| name.span())),
        ("parameters", process.parameters.keys().next().map(Spanned::span)),
        ("inputs", process.inputs.keys().next().map(Spanned::span)),
        ("outputs", process.outputs.keys().next().map(Spanned::span)),
    ]);
    if let Some((key, span)) = stated.find_map(|(key, span)| Some((key, span?))) {
        let help =
            "a sidecar is a `command` that takes no part in the ticks; leave the key or `lockstep` out";
        return Err(manifest.problem(&span, format!("`{key}` {who}"), help));
    }
    let message = |_: &OnExit| format!("`on_exit` {who}: nothing can stand by for it");
    let help = "stop (the default), restart or ignore";
    manifest.require(&process.on_exit, |on_exit| *on_exit != OnExit::Standby, message, help)
}

/// The sidecars after which `process` starts. A name is first one of the process's own vehicle.
fn after(manifest: &Manifest, name: &Spanned<String>, process: &Process) -> Result<Vec<String>, Diagnostic> {
    let processes = &manifest.content.process;
    let vehicle = name.get_ref().rsplit_once('/').map(|(vehicle, _)| vehicle);
    let found = |written: &Spanned<String>| {
        let local = vehicle.map(|vehicle| format!("{vehicle}/{}", written.get_ref()));
        let names = local.into_iter().chain([written.get_ref().clone()]);
        let known = |name: &String| processes.iter().find(|(known, _)| known.get_ref() == name);
        let Some((found, other)) = names.into_iter().find_map(|name| known(&name)) else {
            let sidecars = processes.iter().filter(|(_, process)| !takes_part(process));
            let help = did_you_mean(
                written.get_ref(),
                sidecars.map(|(name, _)| name.get_ref().as_str()),
                "the sidecars are",
            );
            let message =
                format!("`after` of `{}`: there is no process `{}`", name.get_ref(), written.get_ref());
            return Err(manifest.problem(&written.span(), message, help));
        };
        if takes_part(other) {
            let message =
                format!("`after` of `{}`: `{}` takes part in the ticks", name.get_ref(), found.get_ref());
            let help = "name sidecars (lockstep = false); tick 0 waits for them, and they start before it";
            return Err(manifest.problem(&written.span(), message, help));
        }
        Ok(found.get_ref().clone())
    };
    Diagnostic::gather(process.after.iter().map(found))
}

/// Refuses sidecars that wait for each other.
fn require_order(manifest: &Manifest, sidecars: &[(String, Program)]) -> Result<(), Diagnostic> {
    let after =
        |name: &str| sidecars.iter().find(|(other, _)| other == name).map(|(_, program)| &program.after);
    // One fault for the whole circle.
    sidecars.iter().try_for_each(|(name, _)| {
        // Each name is looked at once, behind the one that waits for it.
        let mut chain = vec![(name.as_str(), 0)];
        let mut at = 0;
        while let Some((waiting, _)) = chain.get(at).copied() {
            for other in after(waiting).into_iter().flatten() {
                if other == name {
                    return Err(circle(manifest, name, &chain, at));
                }
                if chain.iter().all(|(known, _)| known != other) {
                    chain.push((other, at));
                }
            }
            at += 1;
        }
        Ok(())
    })
}

/// The refusal of a circle from `name` to the entry `last` of `chain`, whose entries name those that wait for them.
fn circle(manifest: &Manifest, name: &str, chain: &[(&str, usize)], last: usize) -> Diagnostic {
    let mut names = vec![name];
    let mut at = last;
    while at != 0 {
        names.push(chain[at].0);
        at = chain[at].1;
    }
    names.push(name);
    names.reverse();
    let process = manifest.content.process.iter().find(|(known, _)| known.get_ref() == name);
    let span = process.map_or(0..0, |(key, process)| process.after.first().map_or(key.span(), Spanned::span));
    let message = format!("`after` of `{name}` is a circle: {}", names.join(" after "));
    manifest.problem(&span, message, "leave one of them out: each waits until the other is ready")
}
