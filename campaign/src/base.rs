//! The manifest that all flights have in common, and the files it reads: read once.

use crate::declaration::{Campaign, DURATION, Meaning, Start, Varied};
use crate::draw::rounded;
use crate::measures::changed;
use crate::row::{columns, require_different, units, verdict_columns};
use anyhow::{Context, Result, bail};
use diagnostics::{Diagnostic, Error, Faults, ParameterError, did_you_mean};
use inputs::{InputFiles, sha256};
use runtime::checkpoint::Checkpoint;
use runtime::graph::Graph;
use runtime::manifest::{Manifest, NO_RECORDING};
use runtime::registry::Registry;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The manifest of a campaign, not recorded, with the files that its flights read.
#[derive(Debug)]
pub struct Base {
    /// The manifest with the overrides of all flights.
    pub manifest: Manifest,
    /// The checkpoint that all flights go on from, if there is one.
    pub from: Option<Checkpoint>,
    /// Files that were read.
    pub files: InputFiles,
    /// Names of the figures of a row.
    pub figures: Vec<String>,
    /// Units of the figures.
    pub units: Vec<String>,
    /// Names of the verdicts of a row.
    pub verdicts: Vec<String>,
    /// Indices of the figures that table and report keep.
    pub kept: Vec<usize>,
    /// Digest of all texts and files that a flight depends on, and of the meaning of the varied values.
    pub fingerprint: String,
    /// Declared numbers by key: the manifest is not read again for each flight.
    declared: Mutex<BTreeMap<String, Option<f64>>>,
}

impl Base {
    /// Reads the manifest of `campaign` and all files that it names.
    ///
    /// # Errors
    /// A problem in the manifest or a file, a request that needs a process of its own, or two columns with one name.
    pub fn read(campaign: &Campaign, registry: Registry) -> Result<Self> {
        let forced = [format!("run.record={NO_RECORDING}"), "run.pace=free".to_owned()];
        let overrides = [&campaign.set[..], &forced].concat();
        let files = InputFiles::default();
        // Of the manifest's own text, behind which the measures stand.
        let (mut lines, mut length) = (0, 0);
        let (manifest, from) = match &campaign.start {
            Start::Manifest(path) => {
                let read = || format!("cannot read the manifest {}", path.display());
                let text = files.text(path).with_context(read)?;
                (lines, length) = (text.matches('\n').count() + 1, text.len());
                let places = campaign.set_places.clone();
                let text = campaign.measures.behind(text);
                let manifest = Manifest::parse_placed(text, path, &overrides, places, registry);
                let placed = |error: Diagnostic| in_place(campaign, path, lines, error.into());
                (manifest.map_err(placed)?, None)
            }
            Start::Checkpoint(path) => {
                let from = Checkpoint::read(path)?;
                let about = || format!("cannot go on from {}", path.display());
                let manifest = from.load_manifest(&overrides, registry).with_context(about)?;
                (manifest.placing(campaign.set_places.clone()), Some(from))
            }
        };
        let is_measured = !campaign.measures.is_empty() && !campaign.varies(DURATION);
        let graph = runtime::require_flyable(&manifest, files, from.as_ref())
            .map_err(anyhow::Error::from)
            .and_then(|graph| {
                if is_measured {
                    graph.require_samples(&manifest, length)?;
                }
                Ok(graph)
            })
            .map_err(|error| in_place(campaign, &manifest.path, lines, error));
        let (figures, verdicts) = (columns(&manifest.content), verdict_columns(&manifest.content));
        let different = require_different(&campaign.vary, &[&figures[..], &verdicts].concat());
        let (mut errors, path) = (Vec::new(), &campaign.path);
        let graph = keep(graph, &mut errors);
        keep(require_judgement(&manifest), &mut errors);
        keep(different.map_err(Into::into), &mut errors);
        let kept = keep(kept(campaign, &figures).map_err(Into::into), &mut errors);
        let (graph, kept) = together(graph.zip(kept), errors, path)?;
        let fingerprint = fingerprint(campaign, &manifest, from.as_ref(), &graph);
        let (units, declared) = (units(&manifest.content), Mutex::default());
        Ok(Self { manifest, from, files: graph.files, figures, units, verdicts, kept, fingerprint, declared })
    }

    /// The campaign in `text`, which stands at `path`, and its base.
    ///
    /// # Errors
    /// The faults of the campaign file, and beside them those of its manifest.
    pub fn of_campaign(path: &Path, text: &str, registry: Registry) -> Result<(Campaign, Self)> {
        let (campaign, faults) = Campaign::parse_partly(path, text)?;
        let mut errors = Vec::new();
        let base = campaign.as_ref().and_then(|campaign| keep(Self::read(campaign, registry), &mut errors));
        if !faults.is_empty() {
            keep(faults.finish(None::<()>).map_err(Into::into), &mut errors);
            // The file that was named comes first.
            errors.rotate_right(1);
        }
        together(campaign.zip(base), errors, path)
    }

    /// Values of `varied` for a drawn number: by key.
    ///
    /// # Errors
    /// If a factor or an offset has no declared number to act on.
    pub fn values(&self, varied: &Varied, drawn: f64) -> Result<Vec<(String, f64)>> {
        let value = |key: &String| {
            if varied.meaning == Meaning::Value {
                return Ok((key.clone(), drawn));
            }
            let declared = self.declared(key)?.ok_or_else(|| {
                // Its reader may say more about a key that does not exist.
                let set = format!("{key}=1");
                if let Err(refusal) = self.check(std::slice::from_ref(&set)) {
                    return without_value(refusal, &set, key);
                }
                let message = format!("`{key}` has no declared number, which a factor or an offset needs");
                let error = ParameterError::conflict("key", message);
                varied.problem(error, "write as = \"value\", or vary a key with a number").into()
            })?;
            let value = if varied.meaning == Meaning::Factor { declared * drawn } else { declared + drawn };
            Ok((key.clone(), rounded(value)))
        };
        varied.keys.iter().map(value).collect()
    }

    fn declared(&self, key: &str) -> Result<Option<f64>, Diagnostic> {
        let mut declared = self.declared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = declared.get(key) {
            return Ok(*known);
        }
        let number = self.manifest.number(&self.files, key)?;
        declared.insert(key.to_owned(), number);
        Ok(number)
    }

    /// Checks the manifest of one flight, without flying it.
    ///
    /// # Errors
    /// The override or the file that does not fit, or the state in the checkpoint that does not fit the flight.
    pub fn check(&self, sets: &[String]) -> Result<()> {
        runtime::require_flyable(&self.of_flight(sets)?, self.files.branch(), self.from.as_ref())?;
        Ok(())
    }

    /// The manifest of one flight.
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the override that does not fit.
    pub fn of_flight(&self, sets: &[String]) -> Result<Manifest, Diagnostic> {
        match &self.from {
            Some(from) => from.fork_manifest(&self.manifest, sets),
            None => self.manifest.overridden(sets),
        }
    }
}

/// The value that was read; the error is added to `errors`, if there is one.
fn keep<T>(read: Result<T>, errors: &mut Vec<anyhow::Error>) -> Option<T> {
    read.map_err(|error| errors.push(error)).ok()
}

/// `value`, which is there unless there are `errors`. An error without a place is one of the file at `path`.
///
/// # Errors
/// The only error, or the faults of all errors as one.
///
/// # Panics
/// If there is neither a value nor an error.
pub fn together<T>(value: Option<T>, mut errors: Vec<anyhow::Error>, path: &Path) -> Result<T> {
    if errors.len() == 1 {
        return Err(errors.remove(0));
    }
    let mut faults = Faults::default();
    for error in errors.into_iter().map(Error::from) {
        let whole = || Diagnostic::in_file(path.display().to_string(), error.with_causes());
        let fault = error.diagnostic().cloned().unwrap_or_else(whole);
        faults.keep(Err::<(), _>(fault));
    }
    Ok(faults.finish(value)?)
}

/// The error of the override `set` of `key`, whose value nobody chose: without the value.
fn without_value(error: anyhow::Error, set: &str, key: &str) -> anyhow::Error {
    let reword = |text: &str| text.replace(set, key);
    changed(error, |mut fault| {
        fault.help = reword(&fault.help);
        fault.error = fault.error.reworded(reword);
        fault
    })
}

/// The error with the place of a measure in the campaign file.
fn in_place(campaign: &Campaign, manifest: &Path, lines: usize, error: anyhow::Error) -> anyhow::Error {
    campaign.measures.placed(error, &manifest.display().to_string(), lines)
}

/// Indices of the figures that the campaign file chooses, in its order.
fn kept(campaign: &Campaign, figures: &[String]) -> Result<Vec<usize>, Diagnostic> {
    let Some(chosen) = &campaign.figures else { return Ok((0..figures.len()).collect()) };
    let mut kept = Vec::new();
    for (name, place) in chosen {
        let refused = |message: String, help: String| {
            Err(Diagnostic::at(place.clone(), ParameterError::conflict("figures", message)).help(help))
        };
        match figures.iter().position(|figure| figure == name) {
            Some(index) if kept.contains(&index) => {
                return refused(format!("the figure `{name}` stands twice"), "leave it out once".to_owned());
            }
            Some(index) => kept.push(index),
            None => {
                let known = figures.iter().map(String::as_str);
                let help = did_you_mean(name, known, "the figures are");
                return refused(format!("no flight has a figure `{name}`"), help);
            }
        }
    }
    Ok(kept)
}

/// Digest of everything but the drawn numbers that a row depends on.
fn fingerprint(campaign: &Campaign, manifest: &Manifest, from: Option<&Checkpoint>, graph: &Graph) -> String {
    let texts: Vec<&str> = manifest.simulated_texts().collect();
    // Each node lists the files that it reads.
    let files: Vec<&str> =
        graph.plan.nodes.iter().flat_map(|node| &node.files).map(|file| file.sha256.as_str()).collect();
    let varied: Vec<_> = campaign
        .vary
        .iter()
        .map(|varied| (&varied.name, &varied.keys, varied.meaning, varied.distribution.choices()))
        .collect();
    let from = from.map_or(String::new(), Checkpoint::sha256);
    sha256(format!("{texts:?}{files:?}{varied:?}{from}").as_bytes())
}

fn require_judgement(manifest: &Manifest) -> Result<()> {
    if manifest.content.conditions().topics().is_empty() {
        bail!(
            "{}: the manifest has neither [[pass]] nor [[measure]], so that its flights have no figures; add one, or \
             [[measure]] tables to the campaign file",
            manifest.path.display()
        );
    }
    Ok(())
}
