//! Tables whose keys and values know their places, and how two of them become one.

use super::content::Process;
use diagnostics::Misread;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// Keys that identify a process: a new value for one of them removes the other.
const IDENTITY: [&str; 2] = ["kind", "command"];
/// Keys that have a meaning only together with those, as the files of a process have.
const PARAMETERS: [&str; 2] = ["computing_time", "parameters"];

/// Table of `text`; its places start at `base`.
///
/// # Errors
/// The place at which it is not TOML, and the reason.
pub fn parse(text: &str, base: usize) -> Result<DeTable<'_>, Misread> {
    let table = diagnostics::parse_toml(text).map_err(|misread| misread.shifted(base))?;
    Ok(shifted_table(table.into_inner(), base))
}

/// A single value; its places start at `base`.
pub fn parse_value(text: &str, base: usize) -> Option<Spanned<DeValue<'_>>> {
    DeValue::parse(text).ok().map(|value| shifted(value, base))
}

/// The value at `span`, or of the key at `span`, within `value`.
pub fn find<'v, 't>(value: &'v DeValue<'t>, span: &Range<usize>) -> Option<&'v Spanned<DeValue<'t>>> {
    let is_it = |value: &Spanned<DeValue<'_>>| value.span() == *span;
    match value {
        DeValue::Table(table) => table.iter().find_map(|(key, value)| {
            if key.span() == *span {
                return Some(value);
            }
            // A list of tables has the place of its first table.
            find(value.get_ref(), span).or_else(|| is_it(value).then_some(value))
        }),
        DeValue::Array(array) => array
            .iter()
            .find_map(|value| if is_it(value) { Some(value) } else { find(value.get_ref(), span) }),
        _ => None,
    }
}

/// Places of the key and of the value at `path` within `value`, whose own key or value lies at `span`; of the deepest part of
/// the path that there is.
pub fn deepest(span: &Range<usize>, value: &Spanned<DeValue<'_>>, path: &[&str]) -> [Range<usize>; 2] {
    let (mut places, mut value) = ([span.clone(), span.clone()], value);
    for name in path {
        let next = match value.get_ref() {
            DeValue::Table(table) => table.get_key_value(*name).map(|(key, value)| (key.span(), value)),
            DeValue::Array(array) => {
                let item = name.parse().ok().and_then(|index: usize| array.get(index));
                item.map(|item| (item.span(), item))
            }
            _ => None,
        };
        let Some((key, inner)) = next else { break };
        (places, value) = ([key, inner.span()], inner);
    }
    places
}

/// Gives the value of the unknown key at `span` to the key that is `meant`, if that is absent, and removes it otherwise. True if the
/// value has moved; `None` if there is no key at `span`.
pub fn repair(value: &mut DeValue<'_>, span: &Range<usize>, meant: Option<&str>) -> Option<bool> {
    match value {
        DeValue::Table(table) => {
            let Some(key) = table.keys().find(|key| key.span() == *span).map(|key| key.get_ref().to_string())
            else {
                return table.iter_mut().find_map(|(_, value)| repair(value.get_mut(), span, meant));
            };
            let value = table.remove(key.as_str())?;
            let meant = meant.filter(|meant| !table.contains_key(*meant));
            if let Some(meant) = meant {
                table.insert(Spanned::new(span.clone(), meant.to_owned().into()), value);
            }
            Some(meant.is_some())
        }
        DeValue::Array(array) => array.iter_mut().find_map(|value| repair(value.get_mut(), span, meant)),
        _ => None,
    }
}

/// Removes the key whose value lies at `span` within `value`, or is a list with an entry there; false if there is none.
pub fn remove(value: &mut DeValue<'_>, span: &Range<usize>) -> bool {
    match value {
        DeValue::Table(table) => {
            // A list of tables has the place of its first table.
            if table.iter_mut().any(|(_, value)| remove(value.get_mut(), span)) {
                return true;
            }
            let is_it = |value: &Spanned<DeValue<'_>>| value.span() == *span || lists(value.get_ref(), span);
            let key = table.iter().find(|(_, value)| is_it(value)).map(|(key, _)| key.get_ref().to_string());
            key.is_some_and(|key| table.remove(key.as_str()).is_some())
        }
        DeValue::Array(array) => array.iter_mut().any(|value| remove(value.get_mut(), span)),
        _ => false,
    }
}

/// True if `value` is a list with an entry at `span`.
fn lists(value: &DeValue<'_>, span: &Range<usize>) -> bool {
    let entries = value.as_array();
    entries.is_some_and(|entries| {
        entries.iter().any(|entry| entry.span() == *span || lists(entry.get_ref(), span))
    })
}

fn shifted(value: Spanned<DeValue<'_>>, base: usize) -> Spanned<DeValue<'_>> {
    let span = value.span().start + base..value.span().end + base;
    let value = match value.into_inner() {
        DeValue::Array(array) => DeValue::Array(array.into_iter().map(|item| shifted(item, base)).collect()),
        DeValue::Table(table) => DeValue::Table(shifted_table(table, base)),
        scalar => scalar,
    };
    Spanned::new(span, value)
}

fn shifted_table<'t>(table: DeTable<'t>, base: usize) -> DeTable<'t> {
    let shift = |(key, value): (Spanned<DeString<'t>>, _)| {
        let span = key.span().start + base..key.span().end + base;
        (Spanned::new(span, key.into_inner()), shifted(value, base))
    };
    table.into_iter().map(shift).collect()
}

/// Function that puts one table on top of another.
type Merge<'t> = fn(&mut DeTable<'t>, DeTable<'t>);

/// Puts the manifest `over`, or a set of it, on top of `base`.
pub fn merge_manifests<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    for (key, value) in over {
        match key.get_ref().as_ref() {
            "process" => put(base, key, value, merge_processes),
            "set" => put(base, key, value, merge_sets),
            _ => put(base, key, value, merge),
        }
    }
}

fn merge_sets<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    over.into_iter().for_each(|(name, set)| put(base, name, set, merge_manifests));
}

/// Puts processes on top of those of the same names.
pub fn merge_processes<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    over.into_iter().for_each(|(name, process)| put(base, name, process, merge_process));
}

/// Puts the process `over` on top of `base`. If it has another `kind` or `command`, the parameters of the former one
/// are removed.
pub fn merge_process<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    forget_identity(base, &over);
    merge(base, over);
}

/// Puts the keys of the process `over` in place of those of `base`; only `parameters` merge.
pub fn replace_keys<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    forget_identity(base, &over);
    for (key, value) in over {
        if key.get_ref() == "parameters" {
            put(base, key, value, merge);
        } else {
            replace(base, key, value);
        }
    }
}

/// Puts `over` on top of `base`: tables merge, any other value of `over` replaces that of `base`.
fn merge<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    over.into_iter().for_each(|(key, value)| put(base, key, value, merge));
}

fn put<'t>(base: &mut DeTable<'t>, key: Spanned<DeString<'t>>, value: Spanned<DeValue<'t>>, how: Merge<'t>) {
    let span = value.span();
    match (table_mut(base, key.get_ref()), value.into_inner()) {
        (Some(below), DeValue::Table(above)) => how(below, above),
        (_, value) => replace(base, key, Spanned::new(span, value)),
    }
}

/// Puts `key` and `value`, with their own places, into `table`.
pub fn replace<'t>(table: &mut DeTable<'t>, key: Spanned<DeString<'t>>, value: Spanned<DeValue<'t>>) {
    table.remove(key.get_ref().as_ref());
    table.insert(key, value);
}

/// The table at `key`, if there is one.
pub fn table_mut<'v, 't>(table: &'v mut DeTable<'t>, key: &str) -> Option<&'v mut DeTable<'t>> {
    match table.get_mut(key)?.get_mut() {
        DeValue::Table(table) => Some(table),
        _ => None,
    }
}

/// The table at `key`, if there is one.
pub fn table<'v, 't>(table: &'v DeTable<'t>, key: &str) -> Option<&'v DeTable<'t>> {
    table.get(key)?.get_ref().as_table()
}

/// Takes the table at `key` out of `table`; an empty one where there is none.
///
/// # Errors
/// The place of a value that is not a table.
pub fn take_table<'t>(table: &mut DeTable<'t>, key: &str) -> Result<DeTable<'t>, Range<usize>> {
    match table.remove(key).map(|value| (value.span(), value.into_inner())) {
        None => Ok(DeTable::new()),
        Some((_, DeValue::Table(taken))) => Ok(taken),
        Some((span, _)) => Err(span),
    }
}

/// The number at the dotted `key`; the elements of lists are numbered from 0.
pub fn number(root: DeTable<'_>, key: &str) -> Option<f64> {
    let whole = DeValue::Table(root);
    let found = key.split('.').try_fold(&whole, |inside, key| {
        let found = match inside {
            DeValue::Table(table) => table.get(key.trim()),
            DeValue::Array(array) => array.get(key.trim().parse::<usize>().ok()?),
            _ => None,
        };
        found.map(Spanned::get_ref)
    })?;
    match found {
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) => {
            i64::from_str_radix(number.as_str(), number.radix()).ok().map(|it| it as f64)
        }
        _ => None,
    }
}

/// The keys of `table`.
pub fn names<'v>(table: &'v DeTable<'_>) -> impl Iterator<Item = &'v str> {
    table.keys().map(|key| key.get_ref().as_ref())
}

/// The string at `key`, if there is one.
pub fn string<'v>(table: &'v DeTable<'_>, key: &str) -> Option<&'v str> {
    table.get(key)?.get_ref().as_str()
}

/// Removes the identity and parameters of a process, if `over` has another identity.
fn forget_identity(process: &mut DeTable<'_>, over: &DeTable<'_>) {
    let is_changed = |key: &str| over.contains_key(key) && !is_same(process.get(key), over.get(key));
    if IDENTITY.iter().any(|key| is_changed(key)) {
        let keys = IDENTITY.into_iter().chain(PARAMETERS).chain(Process::file_keys());
        keys.for_each(|key| drop(process.remove(key)));
    }
    forget_distribution(process, over);
}

/// Removes a computing time if `over` states one of another distribution, whose numbers are others.
fn forget_distribution(process: &mut DeTable<'_>, over: &DeTable<'_>) {
    let of =
        |process: &DeTable<'_>| string(table(process, "computing_time")?, "distribution").map(str::to_owned);
    if of(over).is_some() && of(over) != of(process) {
        process.remove("computing_time");
    }
}

fn is_same(a: Option<&Spanned<DeValue<'_>>>, b: Option<&Spanned<DeValue<'_>>>) -> bool {
    let (Some(a), Some(b)) = (a.map(Spanned::get_ref), b.map(Spanned::get_ref)) else { return false };
    match (a.as_array(), b.as_array()) {
        (Some(a), Some(b)) => {
            a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| is_same(Some(a), Some(b)))
        }
        _ => a.is_str() && a.as_str() == b.as_str(),
    }
}

#[cfg(test)]
mod tests {
    use super::{merge, merge_manifests, merge_process, parse, replace_keys};
    use serde::Deserialize as _;
    use toml::Spanned;
    use toml::de::DeTable;

    fn merged(
        base: &'static str,
        over: &'static str,
        how: impl Fn(&mut DeTable<'static>, DeTable<'static>),
    ) -> serde_json::Value {
        let mut base = parse(base, 0).unwrap();
        how(&mut base, parse(over, 100).unwrap());
        serde_json::Value::deserialize(toml::Deserializer::from(Spanned::new(0..0, base))).unwrap()
    }

    #[test]
    fn tables_merge_and_other_values_are_replaced() {
        let found = merged("a = 1\nb.c = [1]\nb.d = 2", "b.c = [3, 4]\ne = 5", merge);
        assert_eq!(found, serde_json::json!({ "a": 1, "b": { "c": [3, 4], "d": 2 }, "e": 5 }));
    }

    #[test]
    fn a_process_that_becomes_something_else_keeps_no_parameters() {
        let base = "kind = \"pid\"\nvehicle = \"x\"\nparameters.a = 1\ninputs.i = \"/t\"";
        let found = merged(base, "command = [\"y\"]", merge_process);
        assert_eq!(found, serde_json::json!({ "command": ["y"], "inputs": { "i": "/t" } }));
        let found = merged(base, "kind = \"pid\"\nparameters.b = 2", merge_process);
        assert_eq!(found["parameters"], serde_json::json!({ "a": 1, "b": 2 }));
    }

    #[test]
    fn a_port_is_no_process() {
        let base = "process.a.inputs = { command = \"/x\", kind = \"/y\" }";
        let found = merged(base, "process.a.inputs.command = \"/z\"", merge_manifests);
        assert_eq!(found["process"]["a"]["inputs"], serde_json::json!({ "command": "/z", "kind": "/y" }));
    }

    #[test]
    fn a_backup_replaces_keys_and_merges_parameters() {
        let base = "kind = \"pid\"\nparameters.a = 1\ninputs.i = \"/t\"";
        let found = merged(base, "parameters.b = 2\ninputs.j = \"/u\"", replace_keys);
        let expected =
            serde_json::json!({ "kind": "pid", "parameters": { "a": 1, "b": 2 }, "inputs": { "j": "/u" } });
        assert_eq!(found, expected);
    }

    #[test]
    fn places_are_those_of_the_text_that_won() {
        let mut base = parse("a = 1\nb = 2", 0).unwrap();
        merge(&mut base, parse("b = 3", 100).unwrap());
        let (key, value) = base.get_key_value("b").unwrap();
        assert_eq!((key.span(), value.span()), (100..101, 104..105));
    }
}
