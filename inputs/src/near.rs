//! The file that was probably meant, where there is none of a name.

use crate::tidy::tidy;
use diagnostics::{nearest, plain, printable_line};
use std::collections::BTreeSet;
use std::io::{Error, ErrorKind};
use std::path::Path;

/// Names of a folder that are looked through; a name in a folder of more is not guessed.
const NAMES_MAX: usize = 10_000;
/// Files that are named at most: more would be a list of the folder.
const NAMED_MAX: usize = 3;

/// The error of the file at `path` with advice, if there is no such file: the files of its folder that were probably meant.
pub(crate) fn with_advice(path: &Path, error: Error) -> Error {
    if error.kind() != ErrorKind::NotFound {
        return error;
    }
    let text = plain(&error.to_string()).into_owned();
    advice(path).map_or(error, |advice| Error::new(ErrorKind::NotFound, format!("{text} ({advice})")))
}

fn advice(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let shown = |path: &Path| printable_line(&tidy(path).display().to_string()).into_owned();
    if !folder.is_dir() {
        return Some(format!("there is no folder {}", shown(folder)));
    }
    if name.contains(['*', '?']) {
        // A shell passes a pattern on where it finds no file for it.
        return Some("no file fits this pattern: give the name of one".to_owned());
    }
    let meant = meant(name, &names(folder));
    let meant: Vec<String> =
        meant.iter().map(|name| format!("`{}`", shown(&path.with_file_name(name)))).collect();
    (!meant.is_empty()).then(|| format!("did you mean {}?", meant.join(" or ")))
}

/// Names of the regular files in `folder`, sorted; empty where there are too many.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names: BTreeSet<String> =
        entries.take(NAMES_MAX + 1).filter_map(|entry| entry.file_name().into_string().ok()).collect();
    if names.len() > NAMES_MAX {
        return Vec::new();
    }
    names.into_iter().filter(|name| folder.join(name).is_file()).collect()
}

/// The names among `names` that `name` was probably meant to be: the nearest with the same ending, then those with the same
/// stem and another ending.
fn meant(name: &str, names: &[String]) -> Vec<String> {
    let (stem, ending) = parts(name);
    let others: Vec<&String> = names.iter().filter(|other| is_other(name, other)).collect();
    // A common ending would make any two names near.
    let is_alike = |other: &&String| ending.is_empty() || parts(other).1 == ending;
    let near = nearest(stem, others.iter().copied().filter(is_alike).map(|other| parts(other).0));
    let is_near = |other: &&String| is_alike(other) && Some(parts(other).0) == near;
    let is_of_stem = |other: &&String| parts(other).0.eq_ignore_ascii_case(stem);
    let (near_ones, rest): (Vec<&String>, Vec<&String>) = others.iter().copied().partition(is_near);
    let meant: Vec<String> =
        near_ones.into_iter().chain(rest.into_iter().filter(is_of_stem)).cloned().collect();
    if meant.len() > NAMED_MAX { Vec::new() } else { meant }
}

/// True for the name of another file, which is hidden only if this one is.
fn is_other(name: &str, other: &str) -> bool {
    other != name && (name.starts_with('.') || !other.starts_with('.'))
}

/// The stem and the ending of a file's name; a name that begins with its only dot has no ending.
fn parts(name: &str) -> (&str, &str) {
    match name.rsplit_once('.') {
        Some((stem, ending)) if !stem.is_empty() => (stem, ending),
        _ => (name, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::{NAMED_MAX, with_advice};
    use std::io::{Error, ErrorKind};
    use std::path::Path;

    /// A folder with these files.
    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        names.iter().for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
        folder
    }

    /// The message on the file `name` in `folder`, which is not there.
    fn told(folder: &Path, name: &str) -> String {
        let path = folder.join(name);
        let error = with_advice(&path, path.metadata().unwrap_err());
        assert_eq!(error.kind(), ErrorKind::NotFound);
        error.to_string().replace(&format!("{}/", folder.display()), "")
    }

    #[test]
    fn a_near_name_or_another_ending_is_told() {
        let folder =
            folder(&["hover.toml", "hummingbird.toml", "flight.csv", "run.mcap", "run.toml", "notes"]);
        std::fs::create_dir(folder.path().join("rum.mcap")).unwrap();
        for (name, meant) in [
            ("hovr.toml", "`hover.toml`"),
            ("Hover.toml", "`hover.toml`"),
            ("hover.tml", "`hover.toml`"),
            ("hover", "`hover.toml`"),
            ("hummingbrid.toml", "`hummingbird.toml`"),
            ("flight.mcap", "`flight.csv`"),
            ("run.csv", "`run.mcap` or `run.toml`"),
            ("runs.mcap", "`run.mcap`"),
            ("note", "`notes`"),
        ] {
            let expected = format!("No such file or directory (did you mean {meant}?)");
            assert_eq!(told(folder.path(), name), expected, "{name}");
        }
    }

    #[test]
    fn a_name_that_is_near_to_none_is_told_alone() {
        let names = ["hover.toml", "a.csv", "a.mcap", "a.toml", "a.ulg"];
        let folder = folder(&names);
        assert!(names.iter().filter(|name| name.starts_with("a.")).count() > NAMED_MAX);
        for name in ["none.toml", "vehicle.toml", "a.log", "x"] {
            let told = told(folder.path(), name);
            assert!(
                told.starts_with("No such file or directory") && !told.contains("did you mean"),
                "{told}"
            );
        }
    }

    #[test]
    fn a_missing_folder_and_a_pattern_without_files_are_told_as_such() {
        let folder = folder(&["hover.toml"]);
        let of_folder = told(folder.path(), "manifest/hover.toml");
        assert!(
            of_folder.contains("(there is no folder ") && of_folder.ends_with("manifest)"),
            "{of_folder}"
        );
        let of_pattern = told(folder.path(), "*.mcap");
        assert!(of_pattern.ends_with("(no file fits this pattern: give the name of one)"), "{of_pattern}");
    }

    #[test]
    fn other_errors_and_names_that_terminals_obey_are_left_or_escaped() {
        let folder = folder(&["hover\u{1b}[2J.toml"]);
        assert_eq!(told(folder.path(), "hover.toml").matches('\u{1b}').count(), 0);
        let refused = with_advice(&folder.path().join("hovr.toml"), Error::other("it is a folder"));
        assert_eq!(refused.to_string(), "it is a folder");
    }
}
