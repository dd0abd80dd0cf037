//! Names under which a recording has its input files.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

/// The names of the files at `paths`, absolute ones, in their order: those of the files alone. Where two files in different folders have one
/// name, the names are paths from the innermost folder that holds them all. So a file is found by the path that another one states.
pub fn attachment_names(paths: &[PathBuf]) -> Vec<String> {
    let mut places = BTreeMap::new();
    let differ = paths.iter().all(|path| *places.entry(path.file_name()).or_insert(path) == path);
    let shared = if differ { None } else { shared_folder(paths) };
    let name = |path: &PathBuf| match &shared {
        Some(folder) => with_slashes(path.strip_prefix(folder).unwrap_or(path)),
        None => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    paths.iter().map(name).collect()
}

/// The innermost folder that holds all files.
fn shared_folder(paths: &[PathBuf]) -> Option<PathBuf> {
    let (first, others) = paths.split_first()?;
    let holds_all = |folder: &&Path| others.iter().all(|path| path.starts_with(folder));
    first.ancestors().skip(1).find(holds_all).map(Path::to_owned)
}

fn with_slashes(path: &Path) -> String {
    let names = path.components().filter_map(|part| match part {
        Component::Normal(name) => Some(OsStr::to_string_lossy(name)),
        _ => None,
    });
    names.collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::attachment_names;
    use std::path::PathBuf;

    fn names(paths: &[&str]) -> Vec<String> {
        attachment_names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn names_of_files_suffice_where_they_differ() {
        assert_eq!(names(&["/flight/run.toml", "/shared/quad.toml"]), ["run.toml", "quad.toml"]);
        // One file twice.
        assert_eq!(names(&["/flight/quad.toml", "/flight/quad.toml"]), ["quad.toml", "quad.toml"]);
    }

    #[test]
    fn two_files_of_one_name_have_the_way_from_the_folder_that_holds_all() {
        let paths = ["/home/me/runs/run.toml", "/home/me/a/quad.toml", "/home/me/b/quad.toml"];
        assert_eq!(names(&paths), ["runs/run.toml", "a/quad.toml", "b/quad.toml"]);
        assert_eq!(names(&["/a/quad.toml", "/b/quad.toml"]), ["a/quad.toml", "b/quad.toml"]);
    }
}
