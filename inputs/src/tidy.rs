//! Paths without detours.

use std::path::{Component, Path, PathBuf};

/// Returns `path` without ways down and up again, if it still leads to the same file; of a file that is not there, to the same folder.
///
/// ```
/// let path = std::path::Path::new("src/../Cargo.toml");
/// assert_eq!(inputs::tidy(path), std::path::Path::new("Cargo.toml"));
/// let absent = std::path::Path::new("src/../src/none.toml");
/// assert_eq!(inputs::tidy(absent), std::path::Path::new("src/none.toml"));
/// ```
#[must_use]
pub fn tidy(path: &Path) -> PathBuf {
    let mut short = PathBuf::new();
    for part in path.components() {
        let is_way_down =
            short.components().next_back().is_some_and(|last| matches!(last, Component::Normal(_)));
        if part == Component::ParentDir && is_way_down {
            short.pop();
        } else {
            short.push(part);
        }
    }
    let is_same = if path.exists() {
        leads_to_same(&short, path)
    } else {
        let folders = short.parent().zip(path.parent());
        short.file_name() == path.file_name() && folders.is_some_and(|(a, b)| leads_to_same(a, b))
    };
    if is_same { short } else { path.to_owned() }
}

fn leads_to_same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
