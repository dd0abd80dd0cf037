//! Names of vehicles in tables.

use std::path::Path;

/// Names of the vehicles in reports: those of their files, or the whole paths if the names are the same.
pub fn labels(vehicles: &[&Path]) -> Vec<String> {
    let stem = |path: &&Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stems: Vec<String> = vehicles.iter().map(stem).collect();
    match &stems[..] {
        [one, other] if one == other => vehicles.iter().map(|path| path.display().to_string()).collect(),
        _ => stems,
    }
}

#[cfg(test)]
mod tests {
    use super::labels;
    use std::path::Path;

    #[test]
    fn vehicles_of_the_same_name_are_told_apart_by_their_paths() {
        let label = |paths: [&str; 2]| labels(&paths.map(Path::new));
        assert_eq!(label(["a/old.toml", "a/new.toml"]), ["old", "new"]);
        assert_eq!(label(["a/h.toml", "b/h.toml"]), ["a/h.toml", "b/h.toml"]);
    }
}
