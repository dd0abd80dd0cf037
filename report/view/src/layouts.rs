//! Layouts of scopes, which a user keeps by their names: in one file of the user's, for all recordings.

use anyhow::{Context as _, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::env::var_os;
use std::fs;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Layouts that are kept.
const LAYOUTS_MAX: usize = 200;
/// Characters of a name.
const NAME_MAX: usize = 80;

/// A layout: plots, each a list of curves.
pub type Layout = Vec<Vec<Curve>>;
/// Number of the recording, topic and field of a curve.
type Curve = (usize, String, String);

/// A request to keep a layout.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Keeping {
    /// Its name.
    pub name: String,
    /// The plots; none to forget it.
    pub plots: Option<Layout>,
}

/// The file of layouts.
#[derive(Debug)]
pub struct Layouts {
    /// `None` for a user without a home.
    path: Option<PathBuf>,
    writing: Mutex<()>,
}

impl Layouts {
    /// The layouts of this user: in `hummingbus/view-layouts.json` of `XDG_STATE_HOME`, else of `~/.local/state`.
    pub fn of_user() -> Self {
        let absolute = |name: &str| var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let state = absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")));
        Self {
            path: state.map(|state| state.join("hummingbus/view-layouts.json")),
            writing: Mutex::default(),
        }
    }

    /// All layouts by their names.
    ///
    /// # Errors
    /// If the file cannot be read, or another program has written it.
    pub fn all(&self) -> Result<BTreeMap<String, Layout>> {
        let Some(path) = &self.path else { return Ok(BTreeMap::new()) };
        match fs::read(path) {
            Ok(text) => serde_json::from_slice(&text).with_context(|| {
                format!("{} holds no layouts of scopes: mend it, or remove it", path.display())
            }),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(BTreeMap::new()),
            Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
        }
    }

    /// Keeps a layout, or forgets one. Returns all layouts.
    ///
    /// # Errors
    /// If the name is empty or too long, there are too many layouts, or the file cannot be written.
    pub fn keep(&self, keeping: Keeping) -> Result<BTreeMap<String, Layout>> {
        let Keeping { name, plots } = keeping;
        ensure!(
            !name.trim().is_empty() && name.chars().count() <= NAME_MAX,
            "the name of a layout has 1 to {NAME_MAX} characters"
        );
        let Some(path) = &self.path else {
            bail!("there is no folder for layouts: set HOME or XDG_STATE_HOME to an absolute path");
        };
        // Two pages of one command take turns. The file is replaced whole, so that none of another command is torn.
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all = self.all()?;
        match plots {
            Some(plots) => all.insert(name, plots),
            None => all.remove(&name),
        };
        ensure!(all.len() <= LAYOUTS_MAX, "{LAYOUTS_MAX} layouts are kept already: remove one first");
        store(path, &all).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(all)
    }
}

fn store(path: &Path, all: &BTreeMap<String, Layout>) -> Result<()> {
    let folder = path.parent().context("it has no folder")?;
    fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    serde_json::to_writer_pretty(&mut file, all)?;
    file.write_all(b"\n")?;
    file.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Keeping, LAYOUTS_MAX, Layouts};
    use std::fs;
    use std::sync::Mutex;

    #[test]
    fn layouts_outlive_the_program_and_a_foreign_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state/hummingbus/view-layouts.json");
        let layouts = || Layouts { path: Some(path.clone()), writing: Mutex::default() };
        let plots = vec![vec![(0, "/plant/state".to_owned(), "position.z".to_owned())]];
        let keeping = |name: &str, plots| Keeping { name: name.to_owned(), plots };
        assert!(layouts().all().unwrap().is_empty());
        layouts().keep(keeping("height", Some(plots.clone()))).unwrap();
        assert_eq!(layouts().all().unwrap()["height"], plots);
        assert!(layouts().keep(keeping("height", None)).unwrap().is_empty());
        for name in ["", "  ", &"n".repeat(81)] {
            let error = layouts().keep(keeping(name, Some(plots.clone()))).unwrap_err();
            assert!(error.to_string().contains("1 to 80"), "{error}");
        }
        for number in 0..LAYOUTS_MAX {
            layouts().keep(keeping(&number.to_string(), Some(Vec::new()))).unwrap();
        }
        let error = layouts().keep(keeping("one more", Some(Vec::new()))).unwrap_err();
        assert!(error.to_string().contains("remove one first"), "{error}");
        fs::write(&path, "something else").unwrap();
        let error = layouts().keep(keeping("height", Some(plots))).unwrap_err();
        assert!(error.to_string().contains("holds no layouts"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "something else");
    }
}
