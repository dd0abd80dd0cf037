//! Kinds of files.

use crate::files::InputFiles;
use std::path::{Path, PathBuf};

/// A kind of file that a parameter names. Whoever prepares a run learns from it which further files such a file needs.
///
/// ```
/// use inputs::{FileKind, InputFiles};
///
/// const PLAYLIST: FileKind = FileKind {
///     others: |files, path| {
///         let text = files.text(path).unwrap_or_default();
///         text.lines().map(|name| path.with_file_name(name)).collect()
///     },
/// };
/// let files = InputFiles::default();
/// files.keep("/flights/all.txt".as_ref(), b"a.csv\nb.csv".to_vec());
/// let others = (PLAYLIST.others)(&files, "/flights/all.txt".as_ref());
/// assert_eq!(others, ["/flights/a.csv", "/flights/b.csv"].map(std::path::PathBuf::from));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// The files that the file at a path names itself; its faults are reported where it is read.
    pub others: fn(&InputFiles, &Path) -> Vec<PathBuf>,
}
