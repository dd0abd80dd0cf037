//! The manifest that all flights have in common, and the files it reads: read once.

use crate::declaration::{Campaign, Meaning, Varied};
use crate::draw::rounded;
use anyhow::{Context, Result, bail};
use diagnostics::{Diagnostic, ParameterError};
use inputs::{InputFiles, sha256};
use runtime::graph::Graph;
use runtime::manifest::{Manifest, NO_RECORDING};
use runtime::registry::Registry;

/// The manifest of a campaign, not recorded, with the files that its flights read.
#[derive(Debug)]
pub struct Base {
    /// The manifest with the overrides of all flights.
    pub manifest: Manifest,
    /// Files that were read.
    pub files: InputFiles,
    /// Digest of all texts and files.
    pub fingerprint: String,
}

impl Base {
    /// Reads the manifest of `campaign` and all files that it names.
    ///
    /// # Errors
    /// A problem in the manifest or a file, or a varied key that no manifest has.
    pub fn read(campaign: &Campaign, registry: Registry) -> Result<Self> {
        let files = InputFiles::default();
        let path = &campaign.manifest;
        let text =
            files.text(path).with_context(|| format!("cannot read the manifest {}", path.display()))?;
        // Measures are tables: they may stand behind everything else.
        let text = if campaign.measures.is_empty() { text } else { format!("{text}\n{}", campaign.measures) };
        let overrides = [campaign.set.clone(), vec![format!("run.record={NO_RECORDING}")]].concat();
        let manifest = Manifest::parse(text, path, &overrides, registry)?;
        let graph = Graph::build_from(&manifest, files.clone())?;
        let texts: Vec<&str> = manifest.texts().collect();
        let read: Vec<String> = graph.files.used().into_iter().map(|file| file.sha256).collect();
        let fingerprint = sha256(format!("{texts:?}{read:?}").as_bytes());
        let base = Self { manifest, files: graph.files, fingerprint };
        base.require_judgement()?;
        Ok(base)
    }

    fn require_judgement(&self) -> Result<()> {
        let conditions = self.manifest.content.conditions();
        if conditions.topics().is_empty() {
            bail!(
                "{}: the manifest has neither [[pass]] nor [[measure]], so that its flights have no figures; add one, or \
                 [[measure]] tables to the campaign file",
                self.manifest.path.display()
            );
        }
        Ok(())
    }

    /// Values of `varied` for a drawn number: by key.
    ///
    /// # Errors
    /// If a factor or an offset has no declared number to act on.
    pub fn values(&self, varied: &Varied, drawn: f64) -> Result<Vec<(String, f64)>, Diagnostic> {
        let value = |key: &String| {
            if varied.meaning == Meaning::Value {
                return Ok((key.clone(), drawn));
            }
            let declared = self.manifest.number(&self.files, key)?.ok_or_else(|| {
                let message = format!("`{key}` has no declared number, which a factor or an offset needs");
                varied.problem(
                    ParameterError::conflict("key", message),
                    "write as = \"value\", or correct the key",
                )
            })?;
            let value = if varied.meaning == Meaning::Factor { declared * drawn } else { declared + drawn };
            Ok((key.clone(), rounded(value)))
        };
        varied.keys.iter().map(value).collect()
    }

    /// Checks the manifest of one flight, without flying it.
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the override or the file that does not fit.
    pub fn check(&self, sets: &[String]) -> Result<(), Diagnostic> {
        Graph::build_from(&self.of_flight(sets)?, self.files.branch()).map(drop)
    }

    /// The manifest of one flight.
    ///
    /// # Errors
    /// A [`Diagnostic`] that names the override that does not fit.
    pub fn of_flight(&self, sets: &[String]) -> Result<Manifest, Diagnostic> {
        self.manifest.overridden(sets)
    }
}
