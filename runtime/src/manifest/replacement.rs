//! Backups: the changes of `with` and `standby` are put on top of the process that they succeed.

use super::sources::Sources;
use super::tree;
use bus::FileRole;
use diagnostics::{Diagnostic, did_you_mean};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Keys that a backup has in common with the process it succeeds.
const FIXED: [&str; 5] = ["lockstep", "on_exit", "outputs", "period_ticks", "standby"];

/// Makes every `with` of `[[swap]]` and `[[shadow]]`, and every `standby`, a whole process.
///
/// # Errors
/// A process that is not there, or a key in which a backup cannot differ.
pub fn complete(root: &mut DeTable<'_>, sources: &Sources) -> Result<(), Diagnostic> {
    for list in ["swap", "shadow"] {
        let Some((key, mut value)) = root.remove_entry(list) else { continue };
        if let DeValue::Array(array) = value.get_mut() {
            for item in array.iter_mut() {
                let span = item.span();
                if let DeValue::Table(item) = item.get_mut() {
                    complete_item(item, span, root, sources)?;
                }
            }
        }
        root.insert(key, value);
    }
    complete_standbys(root, sources)
}

fn complete_item<'s>(
    item: &mut DeTable<'s>,
    span: Range<usize>,
    root: &DeTable<'s>,
    sources: &Sources,
) -> Result<(), Diagnostic> {
    let Some(name) = item.get("process").filter(|name| name.get_ref().is_str()) else { return Ok(()) };
    let process = Spanned::new(name.span(), name.get_ref().as_str().unwrap_or_default().to_owned());
    let whole = whole(sources, root, &process, taken(item, "with", sources)?)?;
    item.insert(Spanned::new(span.clone(), "with".into()), Spanned::new(span, DeValue::Table(whole)));
    Ok(())
}

/// Takes the table at `key`: the keys in which a backup differs from its process.
fn taken<'s>(table: &mut DeTable<'s>, key: &str, sources: &Sources) -> Result<DeTable<'s>, Diagnostic> {
    tree::take_table(table, key).map_err(|span| {
        let help = format!("write {key} = {{ parameters = {{ … }} }}, for example");
        sources.problem(&span, format!("`{key}` is not a table of keys of a process"), help)
    })
}

fn complete_standbys(root: &mut DeTable<'_>, sources: &Sources) -> Result<(), Diagnostic> {
    for (_, process) in tree::table_mut(root, "process").into_iter().flatten() {
        let DeValue::Table(process) = process.get_mut() else { continue };
        let is_standby = tree::string(process, "on_exit") == Some("standby");
        let place = process.get(if is_standby { "on_exit" } else { "standby" }).map(Spanned::span);
        let differences = taken(process, "standby", sources)?;
        let Some(span) = place else { continue };
        if !is_standby {
            let help = "add on_exit = \"standby\"";
            return Err(sources.problem(&span, "`standby` is described, but nothing stands by", help));
        }
        let whole = differing(process, differences, sources)?;
        let key = Spanned::new(span.clone(), "standby".into());
        process.insert(key, Spanned::new(span, DeValue::Table(whole)));
    }
    Ok(())
}

/// The process `name` of `root` as its backup is, which differs by `with`.
///
/// # Errors
/// If there is no such process, or it cannot have these differences.
pub fn whole<'s>(
    sources: &Sources,
    root: &DeTable<'s>,
    name: &Spanned<String>,
    with: DeTable<'s>,
) -> Result<DeTable<'s>, Diagnostic> {
    let processes = tree::table(root, "process");
    match processes.and_then(|processes| tree::table(processes, name.get_ref())) {
        Some(process) => differing(process, with, sources),
        None => {
            let known = processes.into_iter().flat_map(tree::names);
            let help = did_you_mean(name.get_ref(), known, "the processes are");
            Err(sources.problem(&name.span(), format!("there is no process `{}`", name.get_ref()), help))
        }
    }
}

fn differing<'s>(
    process: &DeTable<'s>,
    with: DeTable<'s>,
    sources: &Sources,
) -> Result<DeTable<'s>, Diagnostic> {
    if let Some(key) = with.keys().find(|key| FIXED.contains(&key.get_ref().as_ref())) {
        let message = format!("a backup cannot have another `{}`", key.get_ref());
        let help = "what reads its topics must find them as they were; leave the key out";
        return Err(sources.problem(&key.span(), message, help));
    }
    let mut whole = process.clone();
    whole.remove("on_exit");
    whole.remove("standby");
    // Values over a file of settings are of that file: another one is taken as it is.
    if let Some(parameters) = tree::table_mut(&mut whole, "parameters") {
        let is_settings = |key: &str| sources.registry.file_role(key) == Some(FileRole::Settings);
        let settings = tree::names(&with).filter(|key| is_settings(key));
        settings.for_each(|key| drop(parameters.remove(key)));
    }
    succeed(&mut whole, with, sources);
    Ok(whole)
}

/// Puts the keys of `with` in place of those of `process`. Another kind keeps none of the keys of a kind but the models that it
/// reads.
pub fn succeed<'s>(process: &mut DeTable<'s>, with: DeTable<'s>, sources: &Sources) {
    // They describe what is flown and where, not how a kind works.
    let is_model = |key: &str| sources.registry.file_role(key) == Some(FileRole::Model);
    let models = process.iter().filter(|(key, _)| is_model(key.get_ref()));
    let before: Vec<_> = models.map(|(key, value)| (key.clone(), value.clone())).collect();
    tree::replace_keys(process, with);
    let kind = tree::string(process, "kind").and_then(|kind| sources.registry.find(kind));
    for (key, value) in before {
        // A change of the kind has removed it: the new kind reads the same model, if it reads one.
        if kind.is_some_and(|kind| kind.has_parameter(key.get_ref())) {
            process.entry(key).or_insert(value);
        }
    }
}
