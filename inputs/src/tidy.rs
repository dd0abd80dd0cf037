//! Paths without detours.

use std::path::{Component, Path, PathBuf};

/// Returns `path` without ways down and up again, if it still leads to the same file.
///
/// ```
/// let path = std::path::Path::new("src/../Cargo.toml");
/// assert_eq!(inputs::tidy(path), std::path::Path::new("Cargo.toml"));
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
    match (short.canonicalize(), path.canonicalize()) {
        (Ok(a), Ok(b)) if a == b => short,
        _ => path.to_owned(),
    }
}
