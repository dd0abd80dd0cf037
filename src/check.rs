//! Checks manifests without running them, for the command line and for other programs: editors, tests, fuzzers.

use crate::COMPONENTS;
use diagnostics::{Diagnostic, Error};
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use scenes::Scene;
use std::collections::BTreeSet;
use std::path::Path;

/// Checks the manifest at `path` and every file that it names, with `overrides` as in `--set`. The text of the graph
/// is the output of `hummingbus check`.
///
/// # Errors
/// The faults, each with its place and advice.
///
/// ```
/// # use std::path::Path;
/// let hover = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml"));
/// let checked = hummingbus::check(hover, &["run.seed=7".to_owned()])?;
/// assert!(checked.to_string().contains("/plant/state") && checked.warnings.is_empty());
///
/// let problem = hummingbus::check(hover, &["run.rate_hz=7".to_owned()]).unwrap_err();
/// assert!(problem.to_string().contains("choose a divisor"));
/// # Ok::<(), hummingbus::Diagnostic>(())
/// ```
pub fn check(path: &Path, overrides: &[String]) -> Result<Graph, Diagnostic> {
    Graph::build(&Manifest::load_readable(path, overrides, COMPONENTS)?)
}

/// As [`check()`], and asks the programs that the manifest names as a `command` for their ports: each is started once, and ends
/// where it would connect. Ports and messages are compared with the manifest and with the others. A kind that is a program,
/// such as `fmu`, is this executable, called with `node KIND`.
///
/// # Errors
/// A problem of the manifest, or of a program that would not take part in a run.
///
/// ```
/// # use std::path::Path;
/// let hover = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml"));
/// let problem = hummingbus::check_with_programs(hover, &["process.pilot={ command = [\"false\"] }".to_owned()]);
/// assert!(problem.is_err());
/// assert!(hummingbus::check_with_programs(hover, &[])?.warnings.is_empty(), "all of its processes are components");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn check_with_programs(path: &Path, overrides: &[String]) -> Result<Graph, Error> {
    let manifest = Manifest::load_readable(path, overrides, COMPONENTS)?;
    let graph = Graph::build(&manifest)?;
    runtime::check_programs(&manifest, &graph, Path::new("/proc/self/exe"))?;
    Ok(graph)
}

/// Checks `text` as the manifest at `path`, which need not exist: paths written in it start at its folder.
///
/// # Errors
/// The faults, each with its place and advice.
///
/// ```
/// # use std::path::Path;
/// let problem = hummingbus::check_text("[run]\nduration = 1.0", Path::new("new.toml"), &[]).unwrap_err();
/// assert!(problem.to_string().contains("new.toml:2:1: unknown key `run.duration`"));
/// assert!(problem.to_string().contains("did you mean `duration_s`?"));
/// ```
pub fn check_text(text: &str, path: &Path, overrides: &[String]) -> Result<Graph, Diagnostic> {
    Graph::build(&Manifest::parse(text.to_owned(), path, overrides, COMPONENTS)?)
}

/// The sizes of the meshes of a checked manifest's scenes: a line for each, with its triangles, its extent in the world and whether it is
/// closed, below the name of its scene.
///
/// ```
/// # use std::path::Path;
/// let office = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/office.toml"));
/// let lines = hummingbus::meshes(&hummingbus::check(office, &[])?);
/// assert!(lines[0].ends_with("office.toml:") && lines[1].contains("desk: ") && lines[1].contains("triangles"));
/// # Ok::<(), hummingbus::Diagnostic>(())
/// ```
#[must_use]
pub fn meshes(checked: &Graph) -> Vec<String> {
    of_scenes(checked, "meshes", |scene| scene.meshes.iter().map(ToString::to_string).collect())
}

/// The driven joints of a checked manifest's scenes: a line for each, with its gains, its limit and its schedule in SI units, below the
/// name of its scene.
///
/// ```
/// # use std::path::Path;
/// let manifest = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/driven-joints.toml"));
/// let lines = hummingbus::drives(&hummingbus::check(manifest, &[])?);
/// assert!(lines[0].ends_with("driven-joints.toml:") && lines[1].contains("spindle: speed, 0 to 2 rad/s"));
/// # Ok::<(), hummingbus::Diagnostic>(())
/// ```
#[must_use]
pub fn drives(checked: &Graph) -> Vec<String> {
    of_scenes(checked, "drives", |scene| scene.joints.iter().filter_map(scenes::Joint::driven).collect())
}

/// Lines of each scene of a checked manifest, below its name; of a scene without any, none.
fn of_scenes(checked: &Graph, title: &str, lines: impl Fn(&Scene) -> Vec<String>) -> Vec<String> {
    let scene = |node: &bus::plan::NodePlan| node.parameters.get("scene")?.as_str().map(str::to_owned);
    let files: BTreeSet<String> = checked.plan.nodes.iter().filter_map(scene).collect();
    let lines = files.into_iter().filter_map(|file| {
        let scene = Scene::load_from(&checked.files, Path::new(&file)).ok()?;
        let found: Vec<_> = lines(&scene).into_iter().map(|line| format!("  {line}")).collect();
        let title = format!("{title} of {file}:");
        (!found.is_empty()).then(|| std::iter::once(title).chain(found).collect::<Vec<_>>())
    });
    lines.flatten().collect()
}
