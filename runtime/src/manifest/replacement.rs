//! Backups: what `with` and `standby` change is put on top of the process they succeed.

use super::sources::Sources;
use super::tree;
use diagnostics::Diagnostic;
use diagnostics::did_you_mean;
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
        let Some(DeValue::Array(mut array)) = root.get(list).map(|value| value.get_ref().clone()) else {
            continue;
        };
        for item in array.iter_mut() {
            let span = item.span();
            if let DeValue::Table(item) = item.get_mut() {
                complete_item(item, span, root, sources)?;
            }
        }
        if let Some(value) = root.get_mut(list) {
            *value.get_mut() = DeValue::Array(array);
        }
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
    let with = match item.remove("with").map(|with| (with.span(), with.into_inner())) {
        None => DeTable::new(),
        Some((_, DeValue::Table(with))) => with,
        Some((span, _)) => return Err(no_table(sources, span, "with")),
    };
    let whole = whole(sources, root, &process, with)?;
    item.insert(Spanned::new(span.clone(), "with".into()), Spanned::new(span, DeValue::Table(whole)));
    Ok(())
}

fn complete_standbys(root: &mut DeTable<'_>, sources: &Sources) -> Result<(), Diagnostic> {
    for (_, process) in tree::table_mut(root, "process").into_iter().flatten() {
        let DeValue::Table(process) = process.get_mut() else { continue };
        let is_standby = tree::string(process, "on_exit") == Some("standby");
        let place = process.get(if is_standby { "on_exit" } else { "standby" }).map(Spanned::span);
        let differences = match process.remove("standby").map(|value| (value.span(), value.into_inner())) {
            None => DeTable::new(),
            Some((_, DeValue::Table(table))) => table,
            Some((span, _)) => return Err(no_table(sources, span, "standby")),
        };
        let Some(span) = place else { continue };
        if !is_standby {
            let help = "add on_exit = \"standby\"";
            return Err(sources.problem(&span, "`standby` is described, but nothing stands by", help));
        }
        let whole = differing(process, differences, sources)?;
        process
            .insert(Spanned::new(span.clone(), "standby".into()), Spanned::new(span, DeValue::Table(whole)));
    }
    Ok(())
}

fn no_table(sources: &Sources, span: Range<usize>, key: &str) -> Diagnostic {
    let help = format!("write {key} = {{ parameters = {{ … }} }}, for example");
    sources.problem(&span, format!("`{key}` is not a table of keys of a process"), help)
}

/// The process `name` of `root` as its backup is, which differs by `with`.
///
/// # Errors
/// If there is no such process, or it cannot differ in that.
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
    tree::replace_keys(&mut whole, with);
    Ok(whole)
}
