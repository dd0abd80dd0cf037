//! Process sets: a vehicle makes a set's processes its own.
//!
//! Inside a set, names of processes and topics are local. The vehicle `h1` makes `plant` to `h1/plant`, and
//! the topic `/plant/state` to `/h1/plant/state` where its own processes publish that, and leaves it alone
//! where not.

use super::sources::Sources;
use super::tree::{self, names};
use crate::registry::Registry;
use bus::ports::Inputs;
use diagnostics::Diagnostic;
use diagnostics::{did_you_mean, read_tree};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::borrow::Cow;
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// Largest number of vehicles of a set. More would not fit on a machine, let alone on a page of `check`.
const COUNT_MAX: u32 = 256;

/// `[[vehicle]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vehicle {
    name: Spanned<String>,
    set: Spanned<String>,
    count: Option<Spanned<u32>>,
    /// Differences from the set; merged as they stand.
    #[serde(default, rename = "process")]
    _process: IgnoredAny,
}

/// `[set.NAME]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    #[serde(rename = "process")]
    _process: BTreeMap<String, IgnoredAny>,
}

/// Replaces `[set]` and `[[vehicle]]` of `root` by the processes they stand for.
///
/// # Errors
/// A set or vehicle that is not well formed, a set that is not there, a vehicle that is there twice.
pub fn expand<'s>(root: &mut DeTable<'s>, sources: &Sources) -> Result<(), Diagnostic> {
    let explicit = take_expanded(root);
    let sets = sets(root, sources)?;
    let mut expanded = DeTable::new();
    for vehicle in vehicles(root.remove("vehicle"), sources)? {
        add_vehicle(&mut expanded, vehicle, &sets, sources)?;
    }
    for (name, process) in explicit {
        adjust(&mut expanded, &name, process, sources)?;
    }
    if expanded.is_empty() {
        return Ok(());
    }
    let place = || Spanned::new(0..0, DeValue::Table(DeTable::new()));
    let processes = root.entry(Spanned::new(0..0, Cow::Borrowed("process"))).or_insert_with(place);
    if let DeValue::Table(processes) = processes.get_mut() {
        processes.extend(expanded);
    }
    Ok(())
}

/// Takes out the processes whose names hold a `/`: they only adjust the processes of a vehicle.
fn take_expanded<'s>(root: &mut DeTable<'s>) -> Vec<(Spanned<DeString<'s>>, Spanned<DeValue<'s>>)> {
    let Some(processes) = tree::table_mut(root, "process") else { return Vec::new() };
    let names: Vec<String> = processes.keys().map(|key| key.get_ref().to_string()).collect();
    let expanded = names.iter().filter(|name| name.contains('/'));
    expanded.filter_map(|name| processes.remove_entry(name.as_str())).collect()
}

fn sets<'s>(root: &mut DeTable<'s>, sources: &Sources) -> Result<BTreeMap<String, DeTable<'s>>, Diagnostic> {
    let table = tree::take_table(root, "set")
        .map_err(|span| sources.problem(&span, "`set` is not a table", "write [set.NAME.process.PROCESS]"))?;
    let mut sets = BTreeMap::new();
    for (name, set) in table {
        read_tree::<Set>(&set).map_err(|misread| sources.refused(misread))?;
        if let DeValue::Table(mut set) = set.into_inner()
            && let Some(DeValue::Table(processes)) = set.remove("process").map(Spanned::into_inner)
        {
            sets.insert(name.into_inner().into_owned(), processes);
        }
    }
    Ok(sets)
}

/// The vehicles, each with its differences from its set.
fn vehicles<'s>(
    value: Option<Spanned<DeValue<'s>>>,
    sources: &Sources,
) -> Result<Vec<(Vehicle, DeTable<'s>)>, Diagnostic> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let span = value.span();
    let DeValue::Array(array) = value.into_inner() else {
        return Err(sources.problem(&span, "`vehicle` is not a list", "write [[vehicle]]"));
    };
    let vehicle = |value: Spanned<DeValue<'s>>| {
        let vehicle = read_tree::<Vehicle>(&value).map_err(|misread| sources.refused(misread))?;
        let DeValue::Table(mut table) = value.into_inner() else { return Ok((vehicle, DeTable::new())) };
        let differences = tree::take_table(&mut table, "process").map_err(|span| {
            sources.problem(&span, "`process` is not a table", "write process.PROCESS.KEY = …")
        })?;
        Ok((vehicle, differences))
    };
    array.into_iter().map(vehicle).collect()
}

fn add_vehicle<'s>(
    expanded: &mut DeTable<'s>,
    (vehicle, differences): (Vehicle, DeTable<'s>),
    sets: &BTreeMap<String, DeTable<'s>>,
    sources: &Sources,
) -> Result<(), Diagnostic> {
    let Some(set) = sets.get(vehicle.set.get_ref()) else {
        let name = vehicle.set.get_ref();
        let help = did_you_mean(name, sets.keys().map(String::as_str), "there is");
        return Err(sources.problem(&vehicle.set.span(), format!("there is no set `{name}`"), help));
    };
    let processes = differing(set, differences, sources)?;
    let topics: Vec<String> =
        processes.iter().flat_map(|(name, value)| published(name, value, sources.registry)).collect();
    for name in instances(&vehicle, sources)? {
        for (process, value) in processes.clone() {
            let mut value = value;
            if let DeValue::Table(table) = value.get_mut() {
                localise(table, &name, &topics);
            }
            let key = Spanned::new(process.span(), DeString::Owned(format!("{name}/{}", process.get_ref())));
            if expanded.contains_key(key.get_ref().as_ref()) {
                let message = format!("a vehicle `{name}` is there twice");
                return Err(sources.problem(&vehicle.name.span(), message, "give each another name"));
            }
            expanded.insert(key, value);
        }
    }
    Ok(())
}

/// The processes of a set with the differences of a vehicle.
fn differing<'s>(
    set: &DeTable<'s>,
    differences: DeTable<'s>,
    sources: &Sources,
) -> Result<DeTable<'s>, Diagnostic> {
    let mut processes = set.clone();
    for (name, _) in &differences {
        if !processes.contains_key(name.get_ref().as_ref()) {
            let message = format!("the vehicle's set has no process `{}`", name.get_ref());
            let help = did_you_mean(name.get_ref(), names(set), "there is");
            return Err(sources.problem(&name.span(), message, help));
        }
    }
    tree::merge_processes(&mut processes, differences);
    Ok(processes)
}

/// The names of the vehicles: one, or `count` of them numbered from 1.
fn instances(vehicle: &Vehicle, sources: &Sources) -> Result<Vec<String>, Diagnostic> {
    let name = vehicle.name.get_ref();
    if !is_name(name) {
        let help = "use lower-case letters, digits, `-` and `_`";
        return Err(sources.problem(&vehicle.name.span(), format!("`{name}` cannot name a vehicle"), help));
    }
    let Some(count) = &vehicle.count else { return Ok(vec![name.clone()]) };
    if !(1..=COUNT_MAX).contains(count.get_ref()) {
        let message = format!("`count` is {}", count.get_ref());
        let help = format!("a run has 1 to {COUNT_MAX} of a vehicle");
        return Err(sources.problem(&count.span(), message, help));
    }
    Ok((1..=*count.get_ref()).map(|number| format!("{name}{number}")).collect())
}

/// True if `text` is a valid name of a process or a vehicle.
pub fn is_name(text: &str) -> bool {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    !text.is_empty() && text.chars().all(fits)
}

/// The local topics that a process of a set publishes.
fn published(
    name: &Spanned<DeString<'_>>,
    process: &Spanned<DeValue<'_>>,
    registry: Registry,
) -> Vec<String> {
    let Some(process) = process.get_ref().as_table() else { return Vec::new() };
    let outputs = tree::table(process, "outputs");
    let stated =
        outputs.into_iter().flat_map(|outputs| outputs.keys().map(|port| port.get_ref().to_string()));
    let kind = tree::string(process, "kind").and_then(|kind| registry.find(kind));
    let forwards = kind.is_some_and(|kind| matches!(kind.inputs, Inputs::Forwarded { .. }));
    let forwarded = tree::table(process, "inputs").filter(|_| forwards);
    let forwarded = forwarded.into_iter().flat_map(tree::names).map(str::to_owned);
    let built_in = kind.into_iter().flat_map(|kind| kind.outputs);
    let required = built_in.filter(|port| port.required).map(|port| port.name.to_owned());
    let topic = |port: String| {
        let setting = outputs.and_then(|outputs| tree::table(outputs, &port));
        let stated = setting.and_then(|setting| tree::string(setting, "topic")).map(str::to_owned);
        stated.unwrap_or_else(|| format!("/{}/{port}", name.get_ref()))
    };
    stated.chain(required).chain(forwarded).map(topic).collect()
}

/// Makes the topics in a process of a set those of the vehicle `name`; `local` are the ones it publishes.
fn localise(process: &mut DeTable<'_>, name: &str, local: &[String]) {
    let absolute = |topic: &str| format!("/{name}{topic}");
    for (_, output) in tree::table_mut(process, "outputs").into_iter().flatten() {
        if let DeValue::Table(output) = output.get_mut() {
            rename(output.get_mut("topic"), |topic| topic.starts_with('/').then(|| absolute(topic)));
        }
    }
    let rename_local = |topic: &str| local.iter().any(|local| local == topic).then(|| absolute(topic));
    localise_inputs(process, rename_local);
    if let Some(standby) = tree::table_mut(process, "standby") {
        localise_inputs(standby, rename_local);
    }
}

fn localise_inputs(process: &mut DeTable<'_>, rename_local: impl Fn(&str) -> Option<String>) {
    for (_, input) in tree::table_mut(process, "inputs").into_iter().flatten() {
        match input.get_mut() {
            DeValue::Table(table) => rename(table.get_mut("topic"), &rename_local),
            _ => rename(Some(input), &rename_local),
        }
    }
}

fn rename(value: Option<&mut Spanned<DeValue<'_>>>, name: impl Fn(&str) -> Option<String>) {
    let Some(DeValue::String(text)) = value.map(Spanned::get_mut) else { return };
    if let Some(renamed) = name(text) {
        *text = Cow::Owned(renamed);
    }
}

/// Puts the content of a table `[process."h1/plant"]` on top of the vehicle's process.
fn adjust<'s>(
    expanded: &mut DeTable<'s>,
    name: &Spanned<DeString<'s>>,
    process: Spanned<DeValue<'s>>,
    sources: &Sources,
) -> Result<(), Diagnostic> {
    match (tree::table_mut(expanded, name.get_ref()), process.into_inner()) {
        (Some(below), DeValue::Table(above)) => {
            tree::merge_process(below, above);
            Ok(())
        }
        _ => {
            let message = format!("no vehicle makes a process `{}`", name.get_ref());
            let help = did_you_mean(name.get_ref(), names(expanded), "there is");
            Err(sources.problem(&name.span(), message, help))
        }
    }
}
