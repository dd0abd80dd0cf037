//! Reads the manifest's file and the files it includes.

use super::sources::{Origin, Sources};
use super::tree;
use crate::registry::Registry;
use diagnostics::Diagnostic;
use inputs::InputFiles;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// The key that names the files to include.
const KEY: &str = "include";
/// Files that stand within one another at most: each takes a part of the stack.
const DEPTH_MAX: usize = 64;
/// Lists at the top level, to which each file adds.
pub const LISTS: [&str; 6] = ["compare", "measure", "pass", "shadow", "swap", "vehicle"];

/// Reads the manifest's own file.
///
/// # Errors
/// If it cannot be read.
pub fn text(path: &Path) -> Result<String, Diagnostic> {
    InputFiles::default().text(path).map_err(|error| {
        let file = path.display().to_string();
        let help = if path.extension().is_some_and(|extension| extension == "ckpt") {
            "go on from a checkpoint with --from"
        } else {
            "give the path of a manifest"
        };
        Diagnostic::in_file(file, format!("cannot be read: {error}")).help(help)
    })
}

/// Reads, file by file, the includes of `text`, the manifest at `path`; a file that is included twice is read once.
///
/// # Errors
/// A file that cannot be read or includes itself, at the place of the include.
pub fn read(path: &Path, text: String, registry: Registry) -> Result<Sources, Diagnostic> {
    let mut reader = Reader { sources: Sources::of(registry), read: Vec::new(), open: Vec::new() };
    reader.add(path, text)?;
    Ok(reader.sources)
}

struct Reader {
    sources: Sources,
    /// Files that are read, by their true paths.
    read: Vec<PathBuf>,
    /// The chain of files being read, from the manifest to the one that is looked at.
    open: Vec<(PathBuf, PathBuf)>,
}

impl Reader {
    fn add(&mut self, path: &Path, text: String) -> Result<(), Diagnostic> {
        let identity = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let index = self.sources.all.len();
        self.sources.add(Origin::File(path.to_owned()), text);
        let includes = includes(&self.sources)?;
        self.read.push(identity.clone());
        self.open.push((identity, path.to_owned()));
        for include in includes {
            self.include(&include)?;
        }
        self.open.pop();
        self.sources.order.push(index);
        Ok(())
    }

    fn include(&mut self, written: &Spanned<String>) -> Result<(), Diagnostic> {
        let path = self.sources.path(written)?;
        let at = |message: String, help: &str| self.sources.problem(&written.span(), message, help);
        let identity = path.canonicalize().unwrap_or_else(|_| path.clone());
        if let Some(start) = self.open.iter().position(|(open, _)| *open == identity) {
            let chain = self.open[start..].iter().map(|(_, path)| path).chain([&path]);
            let chain: Vec<String> = chain.map(|path| path.display().to_string()).collect();
            let message = format!("a cycle of includes: {}", chain.join(" → "));
            return Err(at(message, "leave one of these includes out"));
        }
        if self.read.contains(&identity) {
            return Ok(());
        }
        if self.open.len() == DEPTH_MAX {
            let message = format!("includes stand more than {DEPTH_MAX} files deep, with {}", path.display());
            return Err(at(message, "include the files side by side in one of them"));
        }
        let text = InputFiles::default().text(&path).map_err(|error| {
            let message = format!("the included file {} cannot be read: {error}", path.display());
            at(message, "a path is relative to the file that includes it")
        })?;
        self.add(&path, text)
    }
}

/// The files that the text added last includes.
fn includes(sources: &Sources) -> Result<Vec<Spanned<String>>, Diagnostic> {
    let table = sources.last_table()?;
    let Some(value) = table.get(KEY) else { return Ok(Vec::new()) };
    let refused = |span: Range<usize>| {
        let help = "write include = [\"base.toml\"], relative to this file";
        sources.problem(&span, "`include` is a list of files", help)
    };
    let list = value.get_ref().as_array().ok_or_else(|| refused(value.span()))?;
    let name = |item: &Spanned<DeValue<'_>>| match item.get_ref().as_str() {
        Some(name) => Ok(Spanned::new(item.span(), name.to_owned())),
        None => Err(refused(item.span())),
    };
    list.iter().map(name).collect()
}

/// Every file merged: the including over the included, a later include over an earlier.
///
/// # Errors
/// A text that is not TOML.
pub fn merged(sources: &Sources) -> Result<DeTable<'_>, Diagnostic> {
    let mut all = DeTable::new();
    for &file in &sources.order {
        let mut table = sources.table(&sources.all[file])?;
        table.remove(KEY);
        prepend_lists(&mut table, &mut all);
        tree::merge_manifests(&mut all, table);
    }
    Ok(all)
}

/// Puts the elements of the lists of `below` in front of those of `table`.
fn prepend_lists<'t>(table: &mut DeTable<'t>, below: &mut DeTable<'t>) {
    for list in LISTS {
        let Some(DeValue::Array(here)) = table.get_mut(list).map(Spanned::get_mut) else { continue };
        let Some(DeValue::Array(inherited)) = below.get_mut(list).map(Spanned::get_mut) else { continue };
        let [first, then] = [inherited, &mut *here].map(|list| std::mem::replace(list, DeArray::new()));
        *here = first.into_iter().chain(then).collect();
    }
}

/// Number of elements of the list `list` that the included files give.
pub fn inherited(sources: &Sources, list: &str) -> Result<usize, Diagnostic> {
    let mut count = 0;
    for &file in sources.order.iter().filter(|&&file| file != 0) {
        let table = sources.table(&sources.all[file])?;
        count += table.get(list).and_then(|value| value.get_ref().as_array()).map_or(0, |array| array.len());
    }
    Ok(count)
}
