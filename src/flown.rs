//! A flight with its verdict.

use diagnostics::Error;
use recorder::reader::Recording;
use report::beyond::with_envelope;
use report::profile::Profile;
use report::summary::Summary;
use runtime::launcher::Launcher;
use runtime::manifest::Manifest;
use std::path::Path;

/// A flight that was flown and judged.
#[derive(Debug)]
pub struct Flown {
    /// Verdicts, measures, comparisons and the warnings of the manifest; `passed` if all conditions hold. Its text is the summary of
    /// `hummingbus run`.
    pub summary: Summary,
    /// The recording; `None` if the manifest has no recorder.
    pub recording: Option<Recording>,
    /// Host time of the run, part by part; `None` without `run.profile = true` in the manifest and without [`Launcher::profiled`].
    pub profile: Option<Profile>,
}

/// Flies `manifest`, records it to `recording` if it has a recorder, and judges its conditions as `hummingbus run` does.
///
/// # Errors
/// A problem in the manifest or in an option of the launcher, or as [`Launcher::launch`]. A condition that does not hold is a verdict and no error.
///
/// ```
/// use hummingbus::{Host, Launcher};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("hover.mcap");
/// let manifest = hummingbus::load(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml"))?;
/// let flown = hummingbus::fly(Launcher::new(Host::InProcess), &manifest, &path)?;
/// assert!(flown.summary.passed, "{}", flown.summary);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fly(launcher: Launcher<'_>, manifest: &Manifest, recording: impl AsRef<Path>) -> Result<Flown, Error> {
    let (graph, mut outcome, recording) = launcher.fly_planned(manifest, recording.as_ref())?;
    let (flight, figures) = (outcome.flight.take(), outcome.figures.take());
    let path = recording.as_ref().map(Recording::path);
    let profile = flight.as_ref().map(|flight| Profile::of(flight, outcome.missed_deadlines, path));
    let mut summary = Summary::new(manifest.name(), outcome, graph.plan.tick_s());
    summary.judge_flight(recording.as_ref(), figures.as_deref(), &graph.plan, &manifest.content)?;
    if recording.is_none() {
        summary.unevaluated = with_envelope(&graph.plan, &|path| graph.files.text(path).ok());
    }
    summary.warnings = graph.warnings;
    Ok(Flown { summary, recording, profile })
}
