//! Remarks of components on a run, for its summary. A process leaves those of its nodes as files of the run directory.
//!
//! A flight and its recording are whole without them: a run does not fail because a remark is lost. Its summary says so.

use crate::error::BusError;
use crate::json_file;
use crate::names::process_name;
use diagnostics::printable_line;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::{File, Metadata};
use std::path::{Path, PathBuf};

/// Remark of a component on the run, as [`Component::remark`](crate::Component::remark) returns it. Its text is a part of
/// the summary.
///
/// ```
/// use bus::remark::Remark;
///
/// let remark = Remark { process: "plant".to_owned(), text: "free bodies gained 0.4 J".to_owned() };
/// assert_eq!(remark.to_string(), "`plant`: free bodies gained 0.4 J");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remark {
    /// Name of the process: that of the node, with a number if it is a standby, a shadow or a backup, such as `plant.1`.
    pub process: String,
    /// The remark, in one line.
    pub text: String,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: {}", printable_line(&self.process), printable_line(&self.text))
    }
}

impl Remark {
    /// Leaves it at `path`, as [`path`] returns it. If that fails, as in a full file system, an empty file in its place says
    /// that it is lost.
    ///
    /// # Errors
    /// If not even an empty file can be made: nothing else would say that a remark is missing.
    pub(crate) fn leave(&self, path: &Path) -> Result<(), BusError> {
        json_file::store(path, self).or_else(|error| File::create(path).map(drop).map_err(|_| error))
    }

    /// The remarks that the processes of a run left in `run_dir`, by the numbers of their nodes and generations. `nodes` are
    /// the names of all nodes. The processes must have ended. A remark that is lost or cannot be read has that fact as its text.
    ///
    /// # Errors
    /// If the directory cannot be listed.
    pub fn all_of(run_dir: &Path, nodes: &[&str]) -> Result<Vec<Self>, BusError> {
        let failed = |source| BusError::File { action: "list", path: run_dir.to_owned(), source };
        let mut found: Vec<((usize, u32), Self)> = Vec::new();
        for entry in std::fs::read_dir(run_dir).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let Some((node, generation)) = place_of(&path) else { continue };
            let Some(name) = nodes.get(node) else { continue };
            let remark =
                Self::at(&path).unwrap_or_else(|text| Self { process: process_name(name, generation), text });
            found.push(((node, generation), remark));
        }
        found.sort_by_key(|(place, _)| *place);
        Ok(found.into_iter().map(|(_, remark)| remark).collect())
    }

    /// The remark at `path`, or the reason why there is none.
    fn at(path: &Path) -> Result<Self, String> {
        if path.metadata().as_ref().map(Metadata::len).is_ok_and(|bytes| bytes == 0) {
            let folder = path.parent().unwrap_or(path).display();
            return Err(format!(
                "its remark on the run is lost: it could not be written to the run directory {folder}; make room in its file \
                 system, and fly again to read it"
            ));
        }
        json_file::load(path, "a remark on a run")
            .map_err(|error| format!("its remark on the run is lost: {error}"))
    }
}

/// File of the remark of generation `generation` of `node`, in `run_dir`.
pub(crate) fn path(run_dir: &Path, node: usize, generation: u32) -> PathBuf {
    run_dir.join(format!("remark-{node}.{generation}.json"))
}

/// Node and generation whose remark is at `path`; `None` of another file.
fn place_of(path: &Path) -> Option<(usize, u32)> {
    let place = path.file_name()?.to_str()?.strip_prefix("remark-")?.strip_suffix(".json")?;
    let (node, generation) = place.split_once('.')?;
    Some((node.parse().ok()?, generation.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::{Remark, path};
    use std::fs;

    fn texts(run_dir: &tempfile::TempDir) -> Vec<String> {
        let nodes: Vec<String> = (0..11).map(|node| format!("n{node}")).collect();
        let nodes: Vec<&str> = nodes.iter().map(String::as_str).collect();
        Remark::all_of(run_dir.path(), &nodes).unwrap().iter().map(Remark::to_string).collect()
    }

    fn remark(process: &str) -> Remark {
        Remark { process: process.to_owned(), text: "gained 0.4 J".to_owned() }
    }

    #[test]
    fn the_remarks_of_a_run_are_found_in_the_order_of_its_nodes() {
        let run_dir = tempfile::tempdir().unwrap();
        fs::write(run_dir.path().join("topic-0.json"), "{}").unwrap();
        assert!(texts(&run_dir).is_empty());
        for (node, generation, process) in [(10, 0, "n10"), (2, 1, "n2.1"), (2, 0, "n2")] {
            remark(process).leave(&path(run_dir.path(), node, generation)).unwrap();
        }
        assert_eq!(texts(&run_dir), ["`n2`: gained 0.4 J", "`n2.1`: gained 0.4 J", "`n10`: gained 0.4 J"]);
    }

    #[test]
    fn a_remark_that_cannot_be_written_is_told_as_lost_and_fails_nothing() {
        let run_dir = tempfile::tempdir().unwrap();
        let file = path(run_dir.path(), 3, 1);
        // The draft cannot be written, as in a full file system.
        fs::create_dir(file.with_extension("draft")).unwrap();
        remark("n3.1").leave(&file).unwrap();
        remark("n4").leave(&path(run_dir.path(), 4, 0)).unwrap();
        let told = texts(&run_dir);
        let folder = run_dir.path().display().to_string();
        assert!(
            told[0].starts_with("`n3.1`: its remark on the run is lost") && told[0].contains(&folder),
            "{told:?}"
        );
        assert_eq!(told[1], "`n4`: gained 0.4 J");
    }

    #[test]
    fn a_remark_whose_loss_cannot_be_noted_is_an_error() {
        let run_dir = tempfile::tempdir().unwrap();
        let gone = run_dir.path().join("gone");
        let error = remark("n3").leave(&path(&gone, 3, 0)).unwrap_err().to_string();
        assert!(error.contains("remark-3.0.json"), "{error}");
    }

    #[test]
    fn a_damaged_remark_is_told_with_its_file() {
        let run_dir = tempfile::tempdir().unwrap();
        fs::write(path(run_dir.path(), 3, 0), "{\"process\": 1}").unwrap();
        let told = texts(&run_dir);
        assert!(told[0].starts_with("`n3`: ") && told[0].contains("remark-3.0.json"), "{told:?}");
    }

    #[test]
    fn a_terminal_obeys_no_remark() {
        let remark = Remark { process: "a\x1b[2J".to_owned(), text: "b\nc".to_owned() };
        assert!(!remark.to_string().contains(['\x1b', '\n']), "{remark}");
    }
}
