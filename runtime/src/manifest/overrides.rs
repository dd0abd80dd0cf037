//! `--set key.path=value`.

use super::file_edits;
use super::replacement;
use super::sources::{Source, Sources};
use super::tree;
use crate::registry::Registry;
use diagnostics::{Diagnostic, did_you_mean};
use std::borrow::Cow;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Greatest depth of a key; no key of a manifest lies as deep.
const DEPTH_MAX: usize = 32;

/// A value and the path of keys at which it belongs.
#[derive(Debug)]
pub struct Override<'s> {
    keys: Vec<Spanned<&'s str>>,
    value: Spanned<DeValue<'s>>,
}

/// Reason why a value has no place in the manifest, and advice.
type Misplaced = (String, &'static str);

/// Values given with `--set`: kinds of processes first, then the others, each in their order.
pub fn all(sources: &Sources) -> Result<Vec<Override<'_>>, Diagnostic> {
    let parsed = sources.overrides().map(|source| Override::parse(source, sources));
    let mut all = parsed.collect::<Result<Vec<_>, _>>()?;
    all.sort_by_key(|change| !change.is_of_kind());
    Ok(all)
}

impl<'s> Override<'s> {
    /// Reads a `--set`.
    pub fn parse(source: &'s Source, sources: &Sources) -> Result<Self, Diagnostic> {
        let refused = |message: &str| {
            let help = "write --set run.seed=3, for example";
            sources.problem(&(source.base..source.base), message, help)
        };
        let (path, value) = source.text.split_once('=').ok_or_else(|| refused("expected KEY=VALUE"))?;
        let keys = keys(path, source.base);
        if keys.iter().any(|key| key.get_ref().is_empty()) || keys.len() > DEPTH_MAX {
            return Err(refused("expected keys with dots between them before the `=`"));
        }
        if let Some((key, other)) = keys.iter().find_map(|key| Some((key, with_dot(key.get_ref())?))) {
            let message = format!("`{}`: an element of a list is a key of its own", key.get_ref());
            return Err(sources.problem(&key.span(), message, format!("write `{other}`")));
        }
        Ok(Self { keys, value: value_of(value, source.base + path.len() + 1) })
    }

    /// True if it changes a process that comes from a vehicle's set: such names hold a `/`.
    pub fn is_of_an_expanded_process(&self) -> bool {
        matches!(self.names().as_slice(), ["process", name, ..] if name.contains('/'))
    }

    /// True if it states the kind of a process: other values are of that one.
    pub fn is_of_kind(&self) -> bool {
        matches!(self.names().as_slice(), ["process", _, "kind"])
    }

    /// True if it changes a value in a file of a process, as `file_edits` has it for the components of `registry`.
    pub fn is_of_a_file(&self, registry: Registry) -> bool {
        file_edits::split(&self.names(), registry).is_some()
    }

    /// The keys of the path.
    fn names(&self) -> Vec<&'s str> {
        self.keys.iter().map(|key| *key.get_ref()).collect()
    }

    /// Puts the value into `root`; tables that are missing on the way are made.
    pub fn apply(self, root: &mut DeTable<'s>, sources: &Sources) -> Result<(), Diagnostic> {
        if self.is_of_an_expanded_process() {
            require_process(root, &self.keys[1], sources)?;
        }
        if self.is_of_kind()
            && let Some(process) = tree::table_mut(root, "process")
            && let Some(process) = tree::table_mut(process, self.keys[1].get_ref())
        {
            // As the successor in a swap.
            let key = Spanned::new(self.keys[2].span(), Cow::Borrowed(*self.keys[2].get_ref()));
            let mut with = DeTable::new();
            with.insert(key, self.value);
            replacement::succeed(process, with, sources);
            return Ok(());
        }
        let Some((last, parents)) = self.keys.split_last() else { return Ok(()) };
        let mut whole = DeValue::Table(std::mem::take(root));
        let put = put(&mut whole, parents, last, self.value);
        if let DeValue::Table(table) = whole {
            *root = table;
        }
        put.map_err(|(message, help)| sources.problem(&last.span(), message, help))
    }
}

/// The keys between the dots, with their places.
fn keys(path: &str, base: usize) -> Vec<Spanned<&str>> {
    let mut start = base;
    let key = |text| {
        let begin = start + (str::len(text) - text.trim_start().len());
        start += text.len() + 1;
        Spanned::new(begin..begin + text.trim().len(), text.trim())
    };
    path.split('.').map(key).collect()
}

/// The keys that are meant by a `key` such as `centre[0]`: `centre.0`.
fn with_dot(key: &str) -> Option<String> {
    let (list, index) = key.strip_suffix(']')?.split_once('[')?;
    index.parse::<usize>().is_ok().then(|| format!("{list}.{index}"))
}

/// A value as TOML; any other text is a string: a path needs no quotes on the command line.
fn value_of(text: &str, base: usize) -> Spanned<DeValue<'_>> {
    let base = base + (text.len() - text.trim_start().len());
    let text = text.trim();
    tree::parse_value(text, base)
        .unwrap_or_else(|| Spanned::new(base..base + text.len(), DeValue::String(Cow::Borrowed(text))))
}

fn require_process(root: &DeTable<'_>, name: &Spanned<&str>, sources: &Sources) -> Result<(), Diagnostic> {
    let known = || tree::table(root, "process").into_iter().flat_map(tree::names);
    if known().any(|known| known == *name.get_ref()) {
        return Ok(());
    }
    let help = did_you_mean(name.get_ref(), known(), "the processes are");
    Err(sources.problem(&name.span(), format!("there is no process `{}`", name.get_ref()), help))
}

/// Puts `value` at `key` of the value at `path` below `inside`.
fn put<'s>(
    mut inside: &mut DeValue<'s>,
    path: &[Spanned<&'s str>],
    key: &Spanned<&'s str>,
    value: Spanned<DeValue<'s>>,
) -> Result<(), Misplaced> {
    let mut name = "the manifest";
    for key in path {
        inside = slot(inside, name, key)?.get_mut();
        name = key.get_ref();
    }
    if let DeValue::Table(table) = inside {
        // With the value comes the place of its key.
        table.remove(*key.get_ref());
    }
    *slot(inside, name, key)? = value;
    Ok(())
}

/// Value at `key` of `inside`, which is called `name`; a new table if there is none.
fn slot<'v, 's>(
    inside: &'v mut DeValue<'s>,
    name: &str,
    key: &Spanned<&'s str>,
) -> Result<&'v mut Spanned<DeValue<'s>>, Misplaced> {
    let (span, key) = (key.span(), *key.get_ref());
    match inside {
        DeValue::Table(table) => {
            let empty = || Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
            Ok(table.entry(Spanned::new(span.clone(), Cow::Borrowed(key))).or_insert_with(empty))
        }
        DeValue::Array(array) => match key.parse::<usize>() {
            Ok(index) if index < array.len() => Ok(&mut array.as_mut()[index]),
            _ => {
                let message = format!("`{name}` is a list of {}, and `{key}` is none of them", array.len());
                Err((message, "its elements are numbered from 0"))
            }
        },
        _ => Err((format!("`{name}` is not a table"), "docs/manifest-reference.md lists every key")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::sources::{Origin, Sources};
    use diagnostics::Diagnostic;
    use serde::Deserialize as _;
    use toml::Spanned;

    /// Content of `text` with `change` applied, or the error.
    fn changed(text: &str, change: &str) -> Result<serde_json::Value, Diagnostic> {
        let mut sources = Sources::default();
        sources.add(Origin::File("a.toml".into()), text.to_owned());
        sources.add(Origin::Override, change.to_owned());
        let mut table = sources.table(&sources.all[0]).unwrap();
        for change in super::all(&sources)? {
            change.apply(&mut table, &sources)?;
        }
        Ok(serde_json::Value::deserialize(toml::Deserializer::from(Spanned::new(0..0, table))).unwrap())
    }

    #[test]
    fn a_key_is_replaced_or_added() {
        assert_eq!(changed("[run]\nseed = 1", "run.seed = 2").unwrap()["run"]["seed"], 2);
        let data = changed("", "process.player.data=/a/b.csv").unwrap();
        assert_eq!(data["process"]["player"]["data"], "/a/b.csv");
        assert_eq!(changed("a = 1", "a=[1, 2]").unwrap()["a"], serde_json::json!([1, 2]));
    }

    #[test]
    fn an_element_of_a_list_is_replaced() {
        let text = "[[swap]]\nat_tick = 1\n[[swap]]\nat_tick = 2";
        let found = changed(text, "swap.1.at_tick=5").unwrap();
        assert_eq!(found["swap"], serde_json::json!([{ "at_tick": 1 }, { "at_tick": 5 }]));
        let error = changed(text, "swap.2.at_tick=5").unwrap_err().to_string();
        assert!(error.contains("`swap` is a list of 2, and `2` is none of them"), "{error}");
        assert_eq!(changed("a = [1, 2]", "a.0=7").unwrap()["a"], serde_json::json!([7, 2]));
    }

    #[test]
    fn another_kind_forgets_the_keys_of_the_former_one_and_keeps_its_own() {
        let text =
            "[process.a]\nkind = 'old'\ngains = 'g.toml'\nparameters = { b = 1 }\ninputs = { c = '/d' }";
        let found = changed(text, "process.a.kind=new").unwrap();
        assert_eq!(found["process"]["a"], serde_json::json!({ "kind": "new", "inputs": { "c": "/d" } }));
        let found = changed(text, "process.a.kind=old").unwrap();
        assert_eq!(found["process"]["a"]["gains"], "g.toml");
        // In whichever order they are given.
        let mut sources = Sources::default();
        sources.add(Origin::File("a.toml".into()), text.to_owned());
        for change in ["process.a.parameters.e=2", "process.a.kind=new"] {
            sources.add(Origin::Override, change.to_owned());
        }
        let mut table = sources.table(&sources.all[0]).unwrap();
        super::all(&sources)
            .unwrap()
            .into_iter()
            .for_each(|change| change.apply(&mut table, &sources).unwrap());
        let found =
            serde_json::Value::deserialize(toml::Deserializer::from(Spanned::new(0..0, table))).unwrap();
        assert_eq!(found["process"]["a"]["parameters"], serde_json::json!({ "e": 2 }));
    }

    #[test]
    fn what_is_no_path_of_tables_is_refused() {
        for (change, message) in [
            ("run", "expected KEY=VALUE"),
            ("run.seed.low=1", "`seed` is not a table"),
            ("run..seed=1", "expected keys with dots"),
            ("process.h1/plant.cpu=1", "there is no process `h1/plant`"),
        ] {
            let error = changed("run.seed = 1", change).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("a.toml: --set {change}: ")) && error.contains(message),
                "{error}"
            );
        }
    }
}
