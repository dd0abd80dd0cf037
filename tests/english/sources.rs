//! Pages and Rust files of this repository, and the doc comments in them.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders that hold files of other projects or of builds.
const FOREIGN: [&str; 3] = ["target", "vendor", "node_modules"];

/// A file of this repository.
pub struct Source {
    /// Path from the root of the repository.
    pub path: String,
    pub text: String,
}

/// Returns the marker and the content of a line of a doc comment.
pub fn doc_line(line: &str) -> Option<(&str, &str)> {
    let (marker, content) = line.trim_start().split_at_checked(3)?;
    // A fourth slash makes an ordinary comment.
    let is_doc = matches!(marker, "///" | "//!") && !content.starts_with('/');
    is_doc.then_some((marker, content.trim()))
}

/// Reads all Rust files, in the order of their names.
pub fn rust_files() -> Vec<Source> {
    let mut files = Vec::new();
    add_files(root(), &mut files);
    assert!(files.len() > 500, "found only {} files", files.len());
    files.iter().map(|path| read(path)).collect()
}

/// Reads README, CONTRIBUTING and the pages in docs, without those of the folders in it.
pub fn pages() -> Vec<Source> {
    let mut paths: Vec<_> =
        fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "md"));
    paths.sort();
    paths.extend(["README.md", "CONTRIBUTING.md"].map(|name| root().join(name)));
    assert!(paths.len() > 30, "found only {} pages", paths.len());
    paths.iter().map(|path| read(path)).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> Source {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    Source { path: path.strip_prefix(root()).unwrap().display().to_string(), text }
}

/// Adds the Rust files in `folder` and below to `files`, in the order of their names.
fn add_files(folder: &Path, files: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(Result::unwrap).collect();
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        if entry.file_type().unwrap().is_dir() {
            if !name.starts_with('.') && !FOREIGN.contains(&&*name) {
                add_files(&path, files);
            }
        } else if name.ends_with(".rs") {
            files.push(path);
        }
    }
}
