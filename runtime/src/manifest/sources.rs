//! The texts a manifest is made of, laid end to end: one offset names a place in any of them.

use super::tree;
use crate::registry::Registry;
use diagnostics::{Diagnostic, Misread, ParameterError, Place};
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Origin of a text.
#[derive(Clone, Debug)]
pub enum Origin {
    /// A file.
    File(PathBuf),
    /// A `--set`.
    Override,
    /// An option of a launcher, written as a `--set` of its key.
    Option,
    /// The value of another argument.
    Argument(&'static str),
    /// The name of a process of a live run, as a command gives it.
    Process,
}

/// A text and where it begins among all.
#[derive(Clone, Debug)]
pub struct Source {
    pub origin: Origin,
    pub text: String,
    pub base: usize,
}

impl Source {
    /// The file that it is.
    fn path(&self) -> Option<&Path> {
        match &self.origin {
            Origin::File(path) => Some(path),
            Origin::Override | Origin::Option | Origin::Argument(_) | Origin::Process => None,
        }
    }
}

/// The texts of a manifest; the first is the manifest's own file.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    /// The texts.
    pub all: Vec<Source>,
    /// The files in the order in which they are merged: an included file goes before the one that includes it.
    pub order: Vec<usize>,
    /// The components that they may name.
    pub registry: Registry,
    /// Keys that a file sets in place of `--set`, such as a campaign file, and their places.
    pub set_places: Vec<(String, Place)>,
}

impl Sources {
    /// No texts yet, which may name the components of `registry`.
    pub fn of(registry: Registry) -> Self {
        Self { registry, ..Self::default() }
    }

    /// Adds a text behind the others.
    pub fn add(&mut self, origin: Origin, text: String) {
        // One more than the text is long: its very end is a place of its own.
        let base = self.all.last().map_or(0, |last| last.base + last.text.len() + 1);
        self.all.push(Source { origin, text, base });
    }

    /// The text that was added last.
    pub fn last(&self) -> &Source {
        &self.all[self.all.len() - 1]
    }

    /// Place of the text that was added last.
    pub fn last_span(&self) -> Range<usize> {
        let last = self.last();
        last.base..last.base + last.text.len()
    }

    /// Table of the text that was added last.
    pub fn last_table(&self) -> Result<DeTable<'_>, Diagnostic> {
        self.table(self.last())
    }

    /// Table of one of the texts, with places among all texts.
    pub fn table<'s>(&self, source: &'s Source) -> Result<DeTable<'s>, Diagnostic> {
        tree::parse(&source.text, source.base).map_err(|misread| {
            let (span, first) = (misread.span(), misread.first());
            // The two places of a key that is there twice say it all.
            let help = match first {
                Some(_) => "",
                None => "docs/manifest.md shows how a manifest is written",
            };
            let mut problem = self.problem(&span, misread.error, help);
            if let Some(first) = first {
                let first = first.start - source.base..first.end - source.base;
                problem.place = problem.place.map(|place| place.after(&source.text, &first));
            }
            problem
        })
    }

    /// The texts that are files.
    pub fn files(&self) -> impl Iterator<Item = &Source> {
        self.all.iter().filter(|source| source.path().is_some())
    }

    /// The files beside the manifest's own: their paths and texts.
    pub fn included(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.all.iter().skip(1).filter_map(|source| Some((source.path()?, source.text.as_str())))
    }

    /// The values given with `--set`.
    pub fn overrides(&self) -> impl Iterator<Item = &Source> {
        self.all.iter().filter(|source| matches!(source.origin, Origin::Override))
    }

    /// Place of the last `--set` that states the value at the dotted `key`.
    pub fn set_at(&self, key: &str) -> Option<Range<usize>> {
        let is_of = |source: &&Source| {
            source
                .text
                .split_once('=')
                .is_some_and(|(path, _)| path.split('.').map(str::trim).eq(key.split('.')))
        };
        let found = self.overrides().filter(is_of).last()?;
        Some(found.base..found.base + found.text.len())
    }

    /// True if the place `offset` lies in a `--set`.
    pub fn is_override(&self, offset: usize) -> bool {
        matches!(self.at(offset).origin, Origin::Override)
    }

    /// True if two places lie in one text.
    pub fn is_one_text(&self, a: usize, b: usize) -> bool {
        self.at(a).base == self.at(b).base
    }

    /// A problem at `span`.
    pub fn problem(
        &self,
        span: &Range<usize>,
        error: impl Into<ParameterError>,
        help: impl Into<String>,
    ) -> Diagnostic {
        let source = self.at(span.start);
        let span = span.start - source.base..span.end.max(span.start) - source.base;
        let file = match &source.origin {
            Origin::File(path) => path.display().to_string(),
            Origin::Argument(name) if !source.text.is_empty() => (*name).to_owned(),
            // The manifest has the process; no text has the fault.
            Origin::Argument(_) | Origin::Process => {
                return Diagnostic::in_file(self.file().display().to_string(), error).help(help);
            }
            Origin::Option => {
                let error: ParameterError = error.into();
                let message = format!("{}: {error}", option(&source.text));
                let error = ParameterError::conflict(error.key(), message);
                return Diagnostic::in_file(self.file().display().to_string(), error).help(help);
            }
            Origin::Override => {
                let error: ParameterError = error.into();
                if let Some(place) = self.set_place(&source.text) {
                    let error = ParameterError::conflict(error.key(), format!("{}: {error}", source.text));
                    return Diagnostic::at(place.clone(), error).help(help);
                }
                let message = format!("--set {}: {error}", source.text);
                let error = ParameterError::conflict(error.key(), message);
                return Diagnostic::in_file(self.file().display().to_string(), error).help(help);
            }
        };
        Diagnostic::at(Place::of(file, &source.text, &span), error).help(help)
    }

    /// The value of `--set` at `span`, as the user knows it.
    pub fn value(&self, span: &Range<usize>) -> String {
        let text = &self.at(span.start).text;
        match self.set_place(text) {
            Some(place) => format!("{text} of {place}"),
            None => format!("--set {text}"),
        }
    }

    /// Argument that states the value at `span`, as the user knows it; `None` if a file of the manifest states it.
    pub fn argument(&self, span: &Range<usize>) -> Option<String> {
        match &self.at(span.start).origin {
            Origin::Override => Some(self.value(span)),
            Origin::Option => Some(option(&self.at(span.start).text)),
            Origin::Argument(name) => Some((*name).to_owned()),
            Origin::File(_) | Origin::Process => None,
        }
    }

    /// Place of the value of `--set` at `span`, as the user knows it.
    pub fn value_place(&self, span: &Range<usize>) -> String {
        let text = &self.at(span.start).text;
        self.set_place(text).map_or_else(|| format!("--set {text}"), Place::to_string)
    }

    /// Place of the value `text` in the file that sets it in place of `--set`.
    pub fn set_place(&self, text: &str) -> Option<&Place> {
        let key = text.split('=').next().unwrap_or_default().trim();
        self.set_places.iter().find(|(known, _)| known.trim() == key).map(|(_, place)| place)
    }

    /// Places of the key and the value at `path` within the key or the value at `span`: of the deepest part of the path that the text
    /// has; `span` twice if it has none.
    pub fn inside(&self, span: &Range<usize>, path: &[&str]) -> [Range<usize>; 2] {
        let source = self.at(span.start);
        let table = tree::parse(&source.text, source.base).ok();
        let root = table.map(|table| Spanned::new(span.clone(), DeValue::Table(table)));
        let found = root.as_ref().and_then(|root| tree::find(root.get_ref(), span));
        found.map_or([span.clone(), span.clone()], |value| tree::deepest(span, value, path))
    }

    /// Places of the key and the value at the dotted `key` in the argument that was added last; `None` if it does not state them.
    pub fn in_argument(&self, key: &str) -> Option<[Range<usize>; 2]> {
        let source = self.all.iter().rfind(|source| matches!(source.origin, Origin::Argument(_)))?;
        let mut inside = DeValue::Table(tree::parse(&source.text, source.base).ok()?);
        let mut places = None;
        for name in key.split('.') {
            let DeValue::Table(mut table) = inside else { return None };
            let (key, value) = table.remove_entry(name)?;
            places = Some([key.span(), value.span()]);
            inside = value.into_inner();
        }
        places
    }

    /// Diagnostic for a value that could not be read, at its place.
    pub fn refused(&self, misread: Misread) -> Diagnostic {
        let help = match misread.error {
            ParameterError::Unknown { .. } | ParameterError::Missing { .. } => misread
                .error
                .suggestion()
                .unwrap_or_else(|| "docs/manifest-reference.md lists every key".to_owned()),
            _ => misread.error.suggestion().unwrap_or_default(),
        };
        self.problem(&misread.span(), misread.error, help)
    }

    /// A path as written: `${NAME:-default}` is the environment's NAME. A relative path starts at the folder of the
    /// file it is written in, or of the manifest if it was given as an argument.
    pub fn path(&self, written: &Spanned<String>) -> Result<PathBuf, Diagnostic> {
        let expanded = self.expand(written, "the path is")?;
        Ok(self.folder(written.span().start).join(expanded))
    }

    /// The text `written` with its variables replaced by those of the environment; `what` begins the fault of one that is not set.
    pub fn expand(&self, written: &Spanned<String>, what: &str) -> Result<String, Diagnostic> {
        let expanded = inputs::variables::expand(written.get_ref(), |name| std::env::var(name).ok());
        expanded.map_err(|message| {
            let message = format!("{what} {message}");
            self.problem(&written.span(), message, "set the variable, or give a default: ${NAME:-path}")
        })
    }

    /// The path from the root on; the processes of a run get it as text.
    pub fn resolve(&self, written: &Spanned<String>) -> Result<PathBuf, Diagnostic> {
        let path = self.path(written)?;
        let path = std::path::absolute(&path).unwrap_or(path);
        // As messages show it.
        let path = inputs::tidy(&path);
        if path.to_str().is_none() {
            let message = format!("the path {} is not UTF-8", path.display());
            let help = "move the files into a folder whose name is UTF-8: processes are given paths as text";
            return Err(self.problem(&written.span(), message, help));
        }
        Ok(path)
    }

    /// The folder at which a relative path written at `offset` starts.
    fn folder(&self, offset: usize) -> &Path {
        self.at(offset).path().unwrap_or(self.file()).parent().unwrap_or(Path::new(""))
    }

    /// The manifest's own file.
    fn file(&self) -> &Path {
        self.all[0].path().unwrap_or(Path::new(""))
    }

    fn at(&self, offset: usize) -> &Source {
        &self.all[self.all.partition_point(|source| source.base <= offset).saturating_sub(1)]
    }
}

/// The option of a launcher that states `text`, as the user knows it.
fn option(text: &str) -> String {
    format!("{text} of the launcher")
}

#[cfg(test)]
mod tests {
    use super::{Origin, Sources};

    #[test]
    fn a_key_within_a_value_has_a_place_of_its_own() {
        let mut sources = Sources::default();
        sources.add(Origin::File("b.toml".into()), "q = 1".into());
        let text = "list = [\n { a = 1 },\n { b = 2 },\n]\n[[t]]\nc = 3\n";
        sources.add(Origin::File("a.toml".into()), text.into());
        let (base, list) = (sources.last().base, text.find("list").unwrap());
        let key = base + list..base + list + 4;
        let told = |path: &[&str], part: usize| {
            sources.problem(&sources.inside(&key, path)[part], "no", "").to_string()
        };
        assert_eq!(
            (told(&["1", "b"], 0), told(&["1", "b"], 1)),
            ("a.toml:3:4: no".into(), "a.toml:3:8: no".into())
        );
        assert_eq!(told(&["1", "x"], 1), "a.toml:3:2: no", "the deepest that there is");
        assert_eq!(told(&["x"], 0), "a.toml:1:1: no");
    }

    #[test]
    fn an_offset_names_a_place_in_any_text() {
        let mut sources = Sources::default();
        sources.add(Origin::File("a.toml".into()), "x = 1\n".into());
        sources.add(Origin::File("b.toml".into()), "y = 2\nz = 3".into());
        sources.add(Origin::Override, "x=4".into());
        let base = sources.all[1].base;
        let message = |offset: usize| sources.problem(&(offset..offset), "no", "").to_string();
        assert_eq!(message(4), "a.toml:1:5: no");
        // Behind the last byte of the first text is not yet the second.
        assert_eq!(message(6), "a.toml:2:1: no");
        assert_eq!(message(base), "b.toml:1:1: no");
        assert_eq!(message(base + 10), "b.toml:2:5: no");
        let set = sources.last().base + 2;
        assert_eq!(message(set), "a.toml: --set x=4: no");
        assert_eq!(sources.argument(&(set..set)).as_deref(), Some("--set x=4"));
        assert_eq!(sources.argument(&(base..base)), None, "a file states it");
        sources.add(Origin::Option, "x=5".into());
        let option = sources.last_span();
        assert_eq!(sources.problem(&option, "no", "").to_string(), "a.toml: x=5 of the launcher: no");
        assert_eq!(sources.argument(&option).as_deref(), Some("x=5 of the launcher"));
        assert!(!sources.is_override(option.start), "no checkpoint keeps it");
    }
}
