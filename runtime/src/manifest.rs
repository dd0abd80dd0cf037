//! The manifest: a user's description of a run, read with the place of every value.
//!
//! - `sources`: the texts it is made of, laid end to end, so that one offset names a place in any of them
//! - `mod@include`: reads the file and the files it includes
//! - `overrides`: the values given with `--set`
//! - `repair`: a faulty manifest is repaired, so that all of its faults are told at once
//! - `tree`: tables with the places of their values, merged
//! - `sets`: vehicles of process sets become processes
//! - `replacement`: a backup's differences become a whole process
//! - `file_edits`: values of files of processes, given with `--set`
//! - `finite`: no number is infinite or none
//! - `composition`: which nodes share a process
//! - `judging`: the process that judges a run that is not recorded
//! - `put`: values put into the text of a TOML file
//! - `builder`: a manifest that is built in code
//! - `content`: the types that the whole is read into

mod builder;
mod composition;
mod content;
mod file_edits;
mod finite;
mod include;
mod judging;
mod overrides;
mod put;
mod recorded;
mod repair;
mod replacement;
mod sets;
mod sources;
mod tree;

pub use builder::ManifestBuilder;
pub use composition::Composition;
pub use content::{
    Comparison, Conditions, Content, NO_RECORDING, PaceSetting, PassCondition, Reference, Statistic,
};
pub(crate) use content::{ComputingTimeSetting, InputSetting, OutputSetting, Process, SwapSetting};

pub(crate) use sets::is_name;

use crate::registry::Registry;
use diagnostics::parameter::FileFault;
use diagnostics::{Diagnostic, ParameterError, Place, read_tree};
use file_edits::FileEdit;
use inputs::InputFiles;
use repair::Repairs;
use sources::{Origin, Source, Sources};
use std::fmt::Display;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A manifest with the texts it was read from.
///
/// ```
/// use runtime::{manifest::Manifest, registry::Registry};
/// let text = "[run]\nduration_s = 2.0\n[process.plant]\nkind = \"plant\"".to_owned();
/// let manifest = Manifest::parse(text, "hover.toml".as_ref(), &[], Registry::default())?;
/// assert_eq!(manifest.name(), "hover");
///
/// let problem = manifest.set("run.duration_s", "long").unwrap_err();
/// assert!(problem.to_string().contains("--set"), "{problem}");
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Clone, Debug)]
pub struct Manifest {
    /// The file.
    pub path: PathBuf,
    /// The file's text that goes into the recording: with every `--set` but those of host-only keys.
    pub recorded_text: String,
    /// Content of the file with its includes and overrides.
    pub content: Content,
    pub(crate) sources: Sources,
    /// Values of files that `--set` replaces.
    file_edits: Vec<FileEdit>,
    /// Faults of a manifest that was read for a check, and its gaps.
    pub(crate) repairs: Repairs,
}

impl Manifest {
    /// Reads the manifest at `path` with its includes, and applies `overrides` (`key.path=value`).
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the place.
    pub fn load(path: &Path, overrides: &[String], registry: Registry) -> Result<Self, Diagnostic> {
        Self::parse(include::text(path)?, path, overrides, registry)
    }

    /// As [`Manifest::load`] for a check that tells every fault: a faulty manifest is repaired, and [`Graph::build`] tells its faults with
    /// those that it finds.
    ///
    /// [`Graph::build`]: crate::graph::Graph::build
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the place, where the rest cannot be read.
    pub fn load_readable(path: &Path, overrides: &[String], registry: Registry) -> Result<Self, Diagnostic> {
        let mut sources = include::read(path, include::text(path)?, registry)?;
        overrides.iter().for_each(|text| sources.add(Origin::Override, text.clone()));
        Self::readable(path.to_owned(), sources)
    }

    /// Reads `text` as the manifest at `path`, which need not exist, as [`Manifest::load`] does.
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the place.
    pub fn parse(
        text: String,
        path: &Path,
        overrides: &[String],
        registry: Registry,
    ) -> Result<Self, Diagnostic> {
        Self::parse_placed(text, path, overrides, Vec::new(), registry)
    }

    /// As [`Manifest::parse`]; errors of overrides of the keys of `set_places` are shown there instead of as `--set`.
    ///
    /// # Errors
    /// As [`Manifest::parse`].
    pub fn parse_placed(
        text: String,
        path: &Path,
        overrides: &[String],
        set_places: Vec<(String, Place)>,
        registry: Registry,
    ) -> Result<Self, Diagnostic> {
        let mut sources = include::read(path, text, registry)?;
        sources.set_places = set_places;
        overrides.iter().for_each(|text| sources.add(Origin::Override, text.clone()));
        Self::of(path.to_owned(), sources)
    }

    /// This manifest; errors of further overrides of the keys of `set_places` are shown there instead of as `--set`.
    #[must_use]
    pub fn placing(mut self, set_places: Vec<(String, Place)>) -> Self {
        self.sources.set_places = set_places;
        self
    }

    /// This manifest with another value at `key`, such as `process.controller.parameters.gains.altitude_p`.
    ///
    /// # Errors
    /// A [`Diagnostic`] if there is no such key, or the value does not fit it.
    pub fn set(self, key: &str, value: impl Into<toml::Value>) -> Result<Self, Diagnostic> {
        let mut sources = self.sources;
        sources.add(Origin::Override, format!("{key}={}", value.into()));
        Self::of(self.path, sources)
    }

    /// This manifest with further `overrides` (`key.path=value`), as [`Manifest::load`] takes them.
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the place.
    pub fn overridden(&self, overrides: &[String]) -> Result<Self, Diagnostic> {
        let mut sources = self.sources.clone();
        overrides.iter().for_each(|text| sources.add(Origin::Override, text.clone()));
        Self::of(self.path.clone(), sources)
    }

    /// Notes `value` of `key`, an option of a launcher; returns its place, for errors. The content does not change.
    pub(crate) fn note_option(&mut self, key: &str, value: impl Display) -> Range<usize> {
        self.sources.add(Origin::Option, format!("{key}={value}"));
        self.sources.last_span()
    }

    /// The number at `key`, a key of this manifest or of a file that a process names, as `--set` takes it; `None` if there is
    /// no number.
    ///
    /// # Errors
    /// A [`Diagnostic`] if the manifest cannot be read.
    pub fn number(&self, files: &InputFiles, key: &str) -> Result<Option<f64>, Diagnostic> {
        let tree = whole_tree(&self.sources)?;
        let find = |process: &str, file: &str| {
            let path = self.resolve(self.file_of(process, file)?).ok()?;
            self.with_edits(files, process, file, path).ok()
        };
        Ok(file_edits::number(files, key, self.registry(), find).or_else(|| tree::number(tree, key)))
    }

    /// The texts that a recording depends on: the manifest's own file, those that it includes, and the values of `--set` without those
    /// that change no byte of a recording.
    pub fn simulated_texts(&self) -> impl Iterator<Item = &str> {
        let is_of_host = |source: &Source| {
            let is_set = matches!(source.origin, Origin::Override);
            matches!(source.origin, Origin::Option) || (is_set && !Self::is_of_simulation(&source.text))
        };
        let simulated = self.sources.all.iter().filter(move |source| !is_of_host(source));
        simulated.map(|source| source.text.as_str())
    }

    fn of(path: PathBuf, sources: Sources) -> Result<Self, Diagnostic> {
        let manifest = Self::readable(path, sources)?;
        manifest.repairs.faults.clone().map_or(Ok(manifest), Err)
    }

    /// The manifest, repaired.
    fn readable(path: PathBuf, sources: Sources) -> Result<Self, Diagnostic> {
        let tree = whole_tree(&sources)?;
        let (content, repairs) = repair::readable(&sources, tree)?;
        let edits = file_edits::all(&sources, &content);
        let texts = edits.and_then(|edits| Ok((edits, recorded::text(&sources, &content.process)?)));
        let (file_edits, recorded_text) = texts.map_err(|fault| repairs.explain(fault))?;
        Ok(Self { path, recorded_text, content, sources, file_edits, repairs })
    }

    /// Keeps the processes that `is_kept` accepts, for a simulation of a part of the manifest. Groups, conditions and checkpoints go,
    /// and so do the inputs whose topic `is_sent` does not accept. Returns their names.
    pub fn retain(&mut self, is_kept: impl Fn(&str) -> bool, is_sent: impl Fn(&str) -> bool) -> Vec<String> {
        let content = &mut self.content;
        content.process.retain(|name, _| is_kept(name.get_ref()));
        content.swap.retain(|swap| is_kept(swap.get_ref().process.get_ref()));
        content.shadow.retain(|shadow| is_kept(shadow.get_ref().process.get_ref()));
        content.group.clear();
        content.checkpoint.clear();
        (content.run.compose, content.run.checkpoint_every_s) = (None, None);
        content.pass.clear();
        content.measure.clear();
        content.compare.clear();
        let mut cut = Vec::new();
        for (name, process) in &mut content.process {
            process.inputs.retain(|port, input| {
                let is_sent = is_sent(&input.topic);
                if !is_sent {
                    cut.push(format!("{}.{}", name.get_ref(), port.get_ref()));
                }
                is_sent
            });
        }
        cut
    }

    /// The manifest's name: its file name without `.toml`.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The text of the file itself.
    pub(crate) fn text(&self) -> &str {
        self.sources.all.first().map_or("", |source| source.text.as_str())
    }

    /// The values of `--set`.
    pub(crate) fn overrides(&self) -> impl Iterator<Item = &str> {
        self.sources.overrides().map(|source| source.text.as_str())
    }

    /// True for a value of `--set` that may change the results, not only the host and the speed.
    pub(crate) fn is_of_simulation(text: &str) -> bool {
        !recorded::is_host_only(text)
    }

    /// The files it includes, each once: their paths and texts.
    pub(crate) fn included(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.sources.included()
    }

    /// The components that it may name.
    pub(crate) fn registry(&self) -> Registry {
        self.sources.registry
    }

    /// A problem at `span` of this manifest.
    pub(crate) fn problem(
        &self,
        span: &Range<usize>,
        error: impl Into<ParameterError>,
        help: impl Into<String>,
    ) -> Diagnostic {
        self.sources.problem(span, error, help)
    }

    /// Places of the key and the value at `path` within the key or the value at `span`. Where a value of `--set` may be meant, whose
    /// key begins with `set`, it is `span` twice.
    pub(crate) fn inside(&self, span: &Range<usize>, path: &[&str], set: &str) -> [Range<usize>; 2] {
        let is_set = self.overrides().any(|text| text.trim_start().starts_with(set));
        if is_set { [span.clone(), span.clone()] } else { self.sources.inside(span, path) }
    }

    /// Places of the key and the value at the dotted `key` of the differences of a live swap; `None` if they do not state it.
    pub(crate) fn in_argument(&self, key: &str) -> Option<[Range<usize>; 2]> {
        self.sources.in_argument(key)
    }

    /// Refuses `value` where it is stated and does not fit.
    pub(crate) fn require<T>(
        &self,
        value: &Option<Spanned<T>>,
        fits: impl Fn(&T) -> bool,
        message: impl Fn(&T) -> String,
        help: impl Into<String>,
    ) -> Result<(), Diagnostic> {
        match value {
            Some(value) if !fits(value.get_ref()) => {
                Err(self.problem(&value.span(), message(value.get_ref()), help))
            }
            _ => Ok(()),
        }
    }

    /// The number at `key`, where it is stated; refused where it is not within `range`.
    pub(crate) fn within<N: Copy + PartialOrd + Display>(
        &self,
        key: &str,
        value: &Option<Spanned<N>>,
        range: RangeInclusive<N>,
        help: impl Into<String>,
    ) -> Result<Option<N>, Diagnostic> {
        self.require(value, |number| range.contains(number), |number| format!("`{key}` is {number}"), help)?;
        Ok(value.as_ref().map(|number| *number.get_ref()))
    }

    /// A path written in the manifest: `${NAME:-default}` is the environment's NAME, and a relative path
    /// starts at the folder of the file it is written in.
    pub fn resolve(&self, written: &Spanned<String>) -> Result<PathBuf, Diagnostic> {
        self.sources.resolve(written)
    }

    /// The text `written` with the variables of the environment in place of `${NAME}` and `${NAME:-default}`; `what` begins the fault of
    /// one that is not set.
    pub(crate) fn expand(&self, written: &Spanned<String>, what: &str) -> Result<String, Diagnostic> {
        self.sources.expand(written, what)
    }

    /// Path of the file `key`, such as `gains`, of the process `name`; `None` if it names none.
    #[must_use]
    pub fn file_path(&self, name: &str, key: &str) -> Option<PathBuf> {
        self.resolve(self.file_of(name, key)?).ok()
    }

    /// The file `key` of the process `name`, as written.
    fn file_of(&self, name: &str, key: &str) -> Option<&Spanned<String>> {
        let (_, process) = self.content.process.iter().find(|(other, _)| other.get_ref() == name)?;
        process.file(key)
    }

    /// True if the process `name` is a component that reads the file `key` as TOML, and reports its faults.
    fn is_read_as_toml(&self, name: &str, key: &str) -> bool {
        let process = self.content.process.iter().find(|(other, _)| other.get_ref() == name);
        let kind = process.and_then(|(_, process)| process.kind.as_ref());
        let component = kind.and_then(|kind| self.registry().find(kind.get_ref()));
        component.and_then(|component| component.file(key)).is_some_and(|file| file.role.is_toml())
    }

    /// The file at `path`, the value of `key` of the process `name`: where `--set` changes values in it, an edited copy that
    /// `files` keeps.
    ///
    /// # Errors
    /// If a value has no place in the file.
    pub(crate) fn with_edits(
        &self,
        files: &InputFiles,
        name: &str,
        key: &str,
        path: PathBuf,
    ) -> Result<PathBuf, Diagnostic> {
        let edits: Vec<&FileEdit> = self.file_edits.iter().filter(|edit| edit.is_of(name, key)).collect();
        // A backup of the process may name another file, which is not edited.
        let original = self.file_of(name, key).and_then(|written| self.resolve(written).ok());
        let is_edited = !edits.is_empty() && original.as_ref() == Some(&path);
        // A file that cannot be read is refused by its reader.
        let Some(text) = is_edited.then(|| files.text(&path).ok()).flatten() else { return Ok(path) };
        if !self.is_read_as_toml(name, key) {
            file_edits::require_toml(&text, &edits, &self.sources)?;
        }
        let base = |base: &str| file_edits::base_text(files, &path, base);
        let text = file_edits::edited(&text, &edits, &self.registry().effects(), &base)
            .map_err(|(edit, message)| edit.problem(&self.sources, &message, &path))?;
        let edited = file_edits::edited_path(&path, name);
        files.keep(&edited, text.into_bytes());
        Ok(edited)
    }

    /// The faults `error` of the file `key` of the process `name`, whose edited copy lies at `copy`: the user knows the file at
    /// `original` and the values of `--set`, not the copy.
    pub(crate) fn without_copy(
        &self,
        files: &InputFiles,
        (name, key): (&str, &str),
        (original, copy): (&Path, &Path),
        error: ParameterError,
    ) -> ParameterError {
        let in_words = |text: &str| self.without_copy_in(files, (name, key), (original, copy), text);
        let (parameter, mut faults) = match error {
            ParameterError::File { key, faults } => (key, faults),
            conflict @ ParameterError::Conflict { .. } => return conflict.reworded(in_words),
            error => return error,
        };
        let edits: Vec<&FileEdit> = self.file_edits.iter().filter(|edit| edit.is_of(name, key)).collect();
        let text = files.text(original).unwrap_or_default();
        let (shown, copied) = (original.display().to_string(), copy.display().to_string());
        for fault in faults.each.iter_mut().filter(|fault| fault.file == copied) {
            let error = |message: String| ParameterError::conflict(fault.key.clone(), message);
            let message = in_words(&fault.message);
            let found = match edits.iter().find(|edit| edit.is_about(&fault.key, &text)) {
                Some(edit) => self.problem(edit.span(), error(message), fault.help.clone()),
                None => {
                    let values: Vec<String> =
                        edits.iter().map(|edit| self.sources.value(edit.span())).collect();
                    let error = error(format!("{message}, with {}", values.join(", ")));
                    let place = fault.place.as_ref().and_then(|place| place.in_file(&shown, &text));
                    match place {
                        Some(place) => Diagnostic::at(place, error),
                        None => Diagnostic::in_file(&shown, error),
                    }
                    .help(fault.help.clone())
                }
            };
            *fault = FileFault::from(found);
        }
        ParameterError::File { key: parameter, faults }
    }

    /// The message `text` with names that the user knows in place of lines of an edited copy, as of [`Manifest::without_copy`]: the
    /// place of a value of `--set`, or the same line of the file at `original`.
    pub(crate) fn without_copy_in(
        &self,
        files: &InputFiles,
        (name, key): (&str, &str),
        (original, copy): (&Path, &Path),
        text: &str,
    ) -> String {
        let (before, after) =
            (files.text(original).unwrap_or_default(), files.text(copy).unwrap_or_default());
        let (shown, copy) = (original.display().to_string(), copy.display().to_string());
        let edits = self.file_edits.iter().filter(|edit| edit.is_of(name, key));
        file_edits::renamed(text, &copy, |line, key| {
            if let Some(edit) = edits.clone().find(|edit| edit.is_about(key, &before)) {
                return self.sources.value_place(edit.span());
            }
            let place = line.map(|line| Place::of_line(&*copy, &after, line));
            match place.and_then(|place| place.in_file(&*shown, &before)) {
                Some(place) => format!("{shown}:{}", place.line),
                None => shown.clone(),
            }
        })
    }

    /// This manifest with one more `[[swap]]`-like backup of `process`, whose differences are the TOML
    /// `with_text`: the manifest that its places refer to, the process's name, and the whole
    /// backup.
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the place in the manifest or in `with_text`.
    pub(crate) fn succeed(
        &self,
        process: &str,
        with_text: &str,
    ) -> Result<(Self, Spanned<String>, Spanned<Process>), Diagnostic> {
        let mut sources = self.sources.clone();
        sources.add(Origin::Process, process.to_owned());
        let name = Spanned::new(sources.last_span(), process.to_owned());
        sources.add(Origin::Argument("--with"), with_text.to_owned());
        let tree = whole_tree(&sources)?;
        let with = sources.last_table()?;
        let span = sources.last_span();
        finite::require(&with, "", &sources)?;
        let whole = replacement::whole(&sources, &tree, &name, with)?;
        let whole = Spanned::new(span.clone(), DeValue::Table(whole));
        let whole = read_tree::<Process>(&whole).map_err(|misread| sources.refused(misread))?;
        let (content, repairs) = repair::readable(&sources, tree)?;
        if let Some(faults) = &repairs.faults {
            return Err(faults.clone());
        }
        let (path, recorded_text) = (self.path.clone(), self.recorded_text.clone());
        let file_edits = self.file_edits.clone();
        let manifest = Self { path, recorded_text, content, sources, file_edits, repairs };
        Ok((manifest, name, Spanned::new(span, whole)))
    }
}

/// Everything that the sources say, with sets expanded and backups made whole.
fn whole_tree(sources: &Sources) -> Result<DeTable<'_>, Diagnostic> {
    // In every file, also where another file's number replaces one that is not finite.
    sources.files().try_for_each(|file| finite::require(&sources.table(file)?, "", sources))?;
    let mut tree = include::merged(sources)?;
    let (late, early): (Vec<_>, Vec<_>) = overrides::all(sources)?
        .into_iter()
        .filter(|change| !change.is_of_a_file(sources.registry))
        .partition(overrides::Override::is_of_an_expanded_process);
    early.into_iter().try_for_each(|change| change.apply(&mut tree, sources))?;
    sets::expand(&mut tree, sources)?;
    late.into_iter().try_for_each(|change| change.apply(&mut tree, sources))?;
    replacement::complete(&mut tree, sources)?;
    finite::require(&tree, "", sources)?;
    Ok(tree)
}
