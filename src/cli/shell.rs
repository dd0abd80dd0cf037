//! Command lines that a shell understands.

use std::path::{Path, PathBuf};

/// A command line of this program that a shell understands: the program as it was called, a subcommand, and a file.
pub fn command(subcommand: &str, path: &Path) -> String {
    let program = std::env::args_os().next().map_or_else(|| PathBuf::from("hummingbus"), PathBuf::from);
    let folder = std::env::current_dir().unwrap_or_default();
    let path = path.strip_prefix(folder).unwrap_or(path);
    format!("{} {subcommand} {}", quoted(&program), quoted(path))
}

/// A path as one word of a shell.
pub fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@".contains(c);
    if text.chars().all(is_plain) { text.into_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::quoted;
    use std::path::Path;

    #[test]
    fn a_path_is_one_word_of_a_shell() {
        assert_eq!(quoted(Path::new("manifests/hover.mcap")), "manifests/hover.mcap");
        assert_eq!(quoted(Path::new("my flights/a'b.mcap")), "'my flights/a'\\''b.mcap'");
    }
}
