//! Checks manifests without running them, for the command line and for other programs: editors, tests, fuzzers.

use crate::COMPONENTS;
use diagnostics::Diagnostic;
use runtime::describe;
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use std::fmt;
use std::path::Path;

/// A manifest in which nothing is wrong. Its text is the graph that `hummingbus check` prints.
#[derive(Debug)]
pub struct Checked {
    graph: Graph,
}

impl Checked {
    /// What is odd in it, and no error.
    #[must_use]
    pub fn warnings(&self) -> &[Diagnostic] {
        &self.graph.warnings
    }

    /// The graph as JSON: topics with their types, and who publishes and reads them.
    #[must_use]
    pub fn json(&self) -> String {
        describe::graph_json(&self.graph)
    }
}

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&describe::graph(&self.graph))
    }
}

/// Checks the manifest at `path` and every file that it names, with `overrides` as `--set` has them.
///
/// # Errors
/// What is wrong, each with its place and what to do.
///
/// ```
/// # use std::path::Path;
/// let hover = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml"));
/// let checked = hummingbus::check(hover, &["run.seed=7".to_owned()])?;
/// assert!(checked.to_string().contains("/plant/state"));
///
/// let problem = hummingbus::check(hover, &["run.rate_hz=7".to_owned()]).unwrap_err();
/// assert!(problem.to_string().contains("choose a divisor"));
/// # Ok::<(), hummingbus::Diagnostic>(())
/// ```
pub fn check(path: &Path, overrides: &[String]) -> Result<Checked, Diagnostic> {
    checked(&Manifest::load(path, overrides, COMPONENTS)?)
}

/// Checks `text` as the manifest at `path`, which need not exist: paths written in it start at its folder.
///
/// # Errors
/// What is wrong, each with its place and what to do.
///
/// ```
/// # use std::path::Path;
/// let problem = hummingbus::check_text("[run]\nduration = 1.0", Path::new("new.toml"), &[]).unwrap_err();
/// assert!(problem.to_string().starts_with("new.toml:2:1: unknown key `run.duration`"));
/// assert!(problem.to_string().contains("did you mean `duration_s`?"));
/// ```
pub fn check_text(text: &str, path: &Path, overrides: &[String]) -> Result<Checked, Diagnostic> {
    checked(&Manifest::parse(text.to_owned(), path, overrides, COMPONENTS)?)
}

fn checked(manifest: &Manifest) -> Result<Checked, Diagnostic> {
    Graph::build(manifest).map(|graph| Checked { graph })
}
