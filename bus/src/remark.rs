//! Remarks of components on a run, for its summary. A process leaves those of its nodes as files of the run directory.

use crate::error::BusError;
use crate::json_file;
use diagnostics::printable_line;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

/// Remark of a component on the run, as [`Component::remark`](crate::Component::remark) returns it. Its text is a part of
/// the summary.
///
/// ```
/// use bus::remark::Remark;
///
/// let remark = Remark { node: "plant".to_owned(), text: "free bodies gained 0.4 J".to_owned() };
/// assert_eq!(remark.to_string(), "`plant`: free bodies gained 0.4 J");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remark {
    /// Name of the node.
    pub node: String,
    /// The remark, in one line.
    pub text: String,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: {}", printable_line(&self.node), printable_line(&self.text))
    }
}

impl Remark {
    /// Writes it to `path`, as [`path`] returns it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn store(&self, path: &Path) -> Result<(), BusError> {
        json_file::store(path, self)
    }

    /// The remarks that the processes of a run left in `run_dir`, by the numbers of their nodes and generations. The
    /// processes must have ended.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn all_of(run_dir: &Path) -> Result<Vec<Self>, BusError> {
        let failed = |source| BusError::File { action: "list", path: run_dir.to_owned(), source };
        let mut found: Vec<([u32; 2], Self)> = Vec::new();
        for entry in std::fs::read_dir(run_dir).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if let Some(place) = place_of(&path) {
                found.push((place, json_file::load(&path, "a remark on a run")?));
            }
        }
        found.sort_by_key(|(place, _)| *place);
        Ok(found.into_iter().map(|(_, remark)| remark).collect())
    }
}

/// File of the remark of generation `generation` of `node`, in `run_dir`.
pub(crate) fn path(run_dir: &Path, node: usize, generation: u32) -> PathBuf {
    run_dir.join(format!("remark-{node}.{generation}.json"))
}

/// Node and generation whose remark is at `path`; `None` of another file.
fn place_of(path: &Path) -> Option<[u32; 2]> {
    let place = path.file_name()?.to_str()?.strip_prefix("remark-")?.strip_suffix(".json")?;
    let (node, generation) = place.split_once('.')?;
    Some([node.parse().ok()?, generation.parse().ok()?])
}

#[cfg(test)]
mod tests {
    use super::{Remark, path};

    #[test]
    fn the_remarks_of_a_run_are_found_in_the_order_of_its_nodes() {
        let run_dir = tempfile::tempdir().unwrap();
        std::fs::write(run_dir.path().join("topic-0.json"), "{}").unwrap();
        assert_eq!(Remark::all_of(run_dir.path()).unwrap(), []);
        let places = [(10, 0), (2, 1), (2, 0)];
        for (node, generation) in places {
            let remark = Remark { node: format!("n{node}"), text: format!("generation {generation}") };
            remark.store(&path(run_dir.path(), node, generation)).unwrap();
        }
        let found = Remark::all_of(run_dir.path()).unwrap();
        let found: Vec<String> = found.iter().map(Remark::to_string).collect();
        assert_eq!(found, ["`n2`: generation 0", "`n2`: generation 1", "`n10`: generation 0"]);
    }

    #[test]
    fn a_damaged_remark_is_told_with_its_file() {
        let run_dir = tempfile::tempdir().unwrap();
        std::fs::write(path(run_dir.path(), 3, 0), "{\"node\": 1}").unwrap();
        let error = Remark::all_of(run_dir.path()).unwrap_err().to_string();
        assert!(error.contains("remark-3.0.json") && error.contains("a remark on a run"), "{error}");
    }

    #[test]
    fn a_terminal_obeys_no_remark() {
        let remark = Remark { node: "a\x1b[2J".to_owned(), text: "b\nc".to_owned() };
        assert!(!remark.to_string().contains(['\x1b', '\n']), "{remark}");
    }
}
