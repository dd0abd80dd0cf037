//! Kinds of files.

use crate::files::InputFiles;
use std::path::{Path, PathBuf};

/// Kind of the file that a parameter names. A launcher treats the file by its kind.
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
    /// Role in a run.
    pub role: FileRole,
    /// Function that lists the files which the file at a path names. It skips faults: the component that reads the file reports them.
    pub others: fn(&InputFiles, &Path) -> Vec<PathBuf>,
    /// True if a refused file is reported with the warnings about it, which may explain the refusal.
    pub has_explaining_warnings: bool,
}

/// Role of a file in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileRole {
    /// Model of a vehicle or of its surroundings, in TOML. A component of another kind that takes over reads the same file.
    Model,
    /// Settings of the component, in TOML. A table in the parameters replaces values of the file.
    Settings,
    /// Program, which reads files beside it.
    Program,
    /// Data over time, such as a recorded flight. The recording of a run does not hold the file. A command opens a device or a folder in
    /// its place itself.
    Data,
}

impl FileKind {
    /// Kind of data over time.
    pub const DATA: Self = Self::of(FileRole::Data);

    /// Kind of files that name no other files.
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
