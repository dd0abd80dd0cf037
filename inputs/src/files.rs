//! The files of a run or a fit.

use crate::content::Content;
use crate::read::{read_bytes, read_text_bytes, require_text_length};
use crate::store;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A file that was read: the path by which it was asked for, and its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// Path, as the reader gave it.
    pub path: PathBuf,
    /// SHA-256 of the bytes, in hexadecimal.
    pub sha256: String,
    /// Number of bytes.
    pub bytes: u64,
}

/// The files that a run or a fit reads, each read once. A clone gives the same bytes.
///
/// ```
/// use inputs::InputFiles;
/// let folder = tempfile::tempdir()?;
/// let (scene, store) = (folder.path().join("scene.toml"), folder.path().join("store"));
/// std::fs::write(&scene, "name = \"hall\"")?;
///
/// // The launcher reads the file, and stores what it has read.
/// let launcher = InputFiles::default();
/// launcher.text(&scene)?;
/// launcher.store(&store, &launcher.used())?;
/// std::fs::write(&scene, "name = \"yard\"")?;
///
/// // Another process reads the stored copy, by the path of the original.
/// let process = InputFiles::stored(&store, &launcher.used());
/// assert_eq!(process.text(&scene)?, "name = \"hall\"");
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct InputFiles {
    source: Source,
    /// Contents by the paths that this clone was asked for.
    used: Arc<Mutex<BTreeMap<PathBuf, Content>>>,
}

/// Origin of the bytes.
#[derive(Clone, Debug)]
enum Source {
    /// The disk, at the first request.
    Disk(Arc<Mutex<Contents>>),
    /// The stored copies of the listed files, and nothing else.
    Store { folder: PathBuf, files: Arc<[InputFile]> },
}

/// Contents that were read: by the absolute path that was asked for, and by the path without links and `..`.
#[derive(Clone, Debug, Default)]
struct Contents {
    by_path: BTreeMap<PathBuf, Content>,
    by_real_path: BTreeMap<PathBuf, Content>,
}

impl Default for InputFiles {
    fn default() -> Self {
        Self::of(Source::Disk(Arc::default()))
    }
}

impl InputFiles {
    /// The `files` whose copies [`InputFiles::store`] wrote into `folder`. Other files are refused.
    #[must_use]
    pub fn stored(folder: &Path, files: &[InputFile]) -> Self {
        Self::of(Source::Store { folder: folder.to_owned(), files: files.into() })
    }

    fn of(source: Source) -> Self {
        Self { source, used: Arc::default() }
    }

    /// The same files with a list of its own of those that were asked for.
    #[must_use]
    pub fn listing_anew(&self) -> Self {
        Self::of(self.source.clone())
    }

    /// The files read so far, in a collection of its own: what it reads later is read again by others.
    ///
    /// ```
    /// let fit = inputs::InputFiles::default();
    /// fit.keep("vehicle.toml".as_ref(), b"mass = 1".to_vec());
    /// let run = fit.branch();
    /// run.keep("flight.csv".as_ref(), b"t,x".to_vec());
    /// assert_eq!(run.text("vehicle.toml".as_ref())?, "mass = 1");
    /// assert!(fit.text("flight.csv".as_ref()).is_err());
    /// # Ok::<(), std::io::Error>(())
    /// ```
    #[must_use]
    pub fn branch(&self) -> Self {
        Self::of(match &self.source {
            Source::Disk(contents) => Source::Disk(Arc::new(Mutex::new(locked(contents).clone()))),
            store @ Source::Store { .. } => store.clone(),
        })
    }

    /// Gives `bytes` as the content of `path` from now on, for a file that this program wrote or has already read.
    pub fn keep(&self, path: &Path, bytes: Vec<u8>) {
        if let Source::Disk(contents) = &self.source {
            locked(contents).add(path, Content::new(bytes));
        }
    }

    /// Returns the bytes of the file at `path`, of any length.
    ///
    /// # Errors
    /// If the file cannot be read, is not a regular file, or is not among the stored ones.
    pub fn bytes(&self, path: &Path) -> Result<Arc<[u8]>> {
        self.content(path, read_bytes).map(|content| content.bytes())
    }

    /// Returns the text of the file at `path`.
    ///
    /// # Errors
    /// As [`InputFiles::bytes`], and if the file is not UTF-8 or longer than [`TEXT_BYTES_MAX`](crate::TEXT_BYTES_MAX).
    pub fn text(&self, path: &Path) -> Result<String> {
        let bytes = self.content(path, read_text_bytes)?.bytes();
        require_text_length(&bytes)?;
        let text = std::str::from_utf8(&bytes);
        let not_utf8 = |_| Error::new(ErrorKind::InvalidData, "stream did not contain valid UTF-8");
        text.map(str::to_owned).map_err(not_utf8)
    }

    /// Returns the files that this clone and its clones were asked for, by path.
    #[must_use]
    pub fn used(&self) -> Vec<InputFile> {
        let used = locked(&self.used).clone();
        let file = |(path, content): (PathBuf, Content)| InputFile {
            path,
            sha256: content.sha256().to_owned(),
            bytes: content.bytes().len() as u64,
        };
        used.into_iter().map(file).collect()
    }

    /// Writes `files`, which were read before, into `folder`. Those that are there already stay.
    ///
    /// # Errors
    /// If a file was not read before, or the folder cannot be written to.
    pub fn store(&self, folder: &Path, files: &[InputFile]) -> Result<()> {
        for file in files {
            store::put(folder, &file.sha256, &self.bytes(&file.path)?)?;
        }
        Ok(())
    }

    fn content(&self, path: &Path, read: fn(&Path) -> Result<Vec<u8>>) -> Result<Content> {
        let content = match &self.source {
            Source::Disk(contents) => locked(contents).get_or_read(path, read)?,
            Source::Store { folder, files } => stored(folder, files, path)?,
        };
        locked(&self.used).insert(path.to_owned(), content.clone());
        Ok(content)
    }
}

fn stored(folder: &Path, files: &[InputFile], path: &Path) -> Result<Content> {
    let listed = files.iter().find(|file| file.path == path).ok_or_else(|| {
        Error::new(
            ErrorKind::NotFound,
            "it was not read when the run began; name it in the manifest with vehicle, scene, gains, data or fmu",
        )
    })?;
    store::get(folder, &listed.sha256).map(Content::new)
}

impl Contents {
    fn get_or_read(&mut self, path: &Path, read: fn(&Path) -> Result<Vec<u8>>) -> Result<Content> {
        if let Some(content) = self.by_path.get(&absolute(path)) {
            return Ok(content.clone());
        }
        let known = path.canonicalize().ok().and_then(|real| self.by_real_path.get(&real).cloned());
        let content = known.map_or_else(|| read(path).map(Content::new), Ok)?;
        self.add(path, content.clone());
        Ok(content)
    }

    fn add(&mut self, path: &Path, content: Content) {
        if let Ok(real) = path.canonicalize() {
            self.by_real_path.insert(real, content.clone());
        }
        self.by_path.insert(absolute(path), content);
    }
}

/// The path from the root on, with its links and `..`; the empty path has none.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// A reader that panicked has left the list whole.
fn locked<T>(list: &Mutex<T>) -> MutexGuard<'_, T> {
    list.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::InputFiles;
    use std::fs;

    #[test]
    fn two_spellings_of_a_path_give_the_bytes_of_one_reading() {
        let folder = tempfile::tempdir().unwrap();
        let (plain, link) = (folder.path().join("a.toml"), folder.path().join("link.toml"));
        fs::create_dir(folder.path().join("below")).unwrap();
        fs::write(&plain, "old").unwrap();
        std::os::unix::fs::symlink(&plain, &link).unwrap();
        let files = InputFiles::default();
        assert_eq!(files.text(&plain).unwrap(), "old");
        fs::write(folder.path().join("new"), "new").unwrap();
        fs::rename(folder.path().join("new"), &plain).unwrap();
        for spelling in [plain, link, folder.path().join("below/../a.toml")] {
            assert_eq!(&*files.bytes(&spelling).unwrap(), b"old", "{}", spelling.display());
        }
    }

    #[test]
    fn each_list_has_what_was_asked_for_through_it() {
        let files = InputFiles::default();
        files.keep("a".as_ref(), b"1".to_vec());
        files.keep("b".as_ref(), b"22".to_vec());
        let (first, second) = (files.listing_anew(), files.listing_anew());
        first.bytes("b".as_ref()).unwrap();
        second.bytes("b".as_ref()).unwrap();
        second.clone().bytes("a".as_ref()).unwrap();
        let lengths = |files: &InputFiles| files.used().iter().map(|file| file.bytes).collect::<Vec<_>>();
        assert_eq!((lengths(&first), lengths(&second), lengths(&files)), (vec![2], vec![1, 2], vec![]));
    }

    #[test]
    fn a_store_gives_its_own_files_and_refuses_others_and_changed_ones() {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("inputs");
        let files = InputFiles::default();
        files.keep("a".as_ref(), b"one".to_vec());
        files.bytes("a".as_ref()).unwrap();
        let listed = files.used();
        files.store(&store, &listed).unwrap();
        files.store(&store, &listed).unwrap();
        let stored = InputFiles::stored(&store, &listed);
        assert_eq!(stored.text("a".as_ref()).unwrap(), "one");
        let refused = stored.bytes("b".as_ref()).unwrap_err().to_string();
        assert!(refused.contains("not read when the run began"), "{refused}");
        fs::write(store.join(&listed[0].sha256), "two").unwrap();
        let changed = stored.text("a".as_ref()).unwrap_err().to_string();
        assert!(changed.contains("was changed"), "{changed}");
        fs::remove_file(store.join(&listed[0].sha256)).unwrap();
        assert!(stored.text("a".as_ref()).unwrap_err().to_string().contains("cannot be read"));
        assert_eq!(fs::read_dir(&store).unwrap().count(), 0);
    }

    #[test]
    fn a_text_is_utf_8_and_short() {
        let files = InputFiles::default();
        files.keep("a".as_ref(), vec![0xff]);
        files.keep("b".as_ref(), vec![b' '; 16 << 20]);
        files.keep("c".as_ref(), vec![b' '; (16 << 20) + 1]);
        assert!(files.text("a".as_ref()).unwrap_err().to_string().contains("UTF-8"));
        assert!(files.text("b".as_ref()).is_ok());
        assert!(files.text("c".as_ref()).unwrap_err().to_string().contains("longer than 16 MiB"));
        assert_eq!(files.bytes("c".as_ref()).unwrap().len(), (16 << 20) + 1);
    }
}
