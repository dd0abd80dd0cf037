//! Kinds of files.

use crate::files::InputFiles;
use std::path::{Path, PathBuf};

/// A kind of file that a parameter names. Whoever prepares a run learns from it how to treat such a file.
///
/// ```
/// use inputs::{FileKind, FileRole, InputFiles};
///
/// const PLAYLIST: FileKind = FileKind {
///     others: |files, path| {
///         let text = files.text(path).unwrap_or_default();
///         text.lines().map(|name| path.with_file_name(name)).collect()
///     },
///     ..FileKind::of(FileRole::Settings)
/// };
/// let files = InputFiles::default();
/// files.keep("/flights/all.txt".as_ref(), b"a.csv\nb.csv".to_vec());
/// let others = (PLAYLIST.others)(&files, "/flights/all.txt".as_ref());
/// assert_eq!(others, ["/flights/a.csv", "/flights/b.csv"].map(std::path::PathBuf::from));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// Its role in a run.
    pub role: FileRole,
    /// The files that the file at a path names itself; its faults are reported where it is read.
    pub others: fn(&InputFiles, &Path) -> Vec<PathBuf>,
    /// True if warnings about such a file may explain why it is refused, so that both are shown.
    pub has_explaining_warnings: bool,
}

/// Role of a file in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileRole {
    /// Model of what moves, or of its surroundings, in TOML. A component of another kind that takes over reads the same file.
    Model,
    /// Settings of the component, in TOML. A table in the parameters replaces values of the file.
    Settings,
    /// A program, which reads files beside it.
    Program,
}

impl FileKind {
    /// Files that name no other file.
    #[must_use]
    pub const fn of(role: FileRole) -> Self {
        Self { role, others: |_, _| Vec::new(), has_explaining_warnings: false }
    }
}

impl FileRole {
    /// True for TOML, in which `--set` replaces values.
    #[must_use]
    pub const fn is_toml(self) -> bool {
        matches!(self, Self::Model | Self::Settings)
    }
}
