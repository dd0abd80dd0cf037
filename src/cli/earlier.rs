//! Checkpoints that an earlier run has left beside the recording which a run replaces.

use super::shell::quoted;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Files that the warning names at most.
const NAMED_MAX: usize = 10;

/// Checkpoints that lay beside a recording before its run began, by tick, with the time of their last change.
pub struct Earlier(Vec<(u32, PathBuf, SystemTime)>);

impl Earlier {
    /// Those beside `recording`.
    pub fn beside(recording: &Path) -> Self {
        let stem = recording.with_extension("");
        let name = stem.file_name().unwrap_or_default().to_string_lossy();
        let folder = stem.parent().unwrap_or(Path::new("."));
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let files = entries.filter_map(|entry| {
            let tick = tick(&entry.file_name().to_string_lossy(), &name)?;
            let path = entry.path();
            let changed = changed(&path)?;
            Some((tick, path, changed))
        });
        let mut files: Vec<_> = files.collect();
        files.sort();
        Self(files)
    }

    /// The warning of those that are still the same, now that the run has ended.
    pub fn warning(&self) -> Option<String> {
        let is_left = |(_, path, time): &&(u32, PathBuf, SystemTime)| changed(path) == Some(*time);
        let left: Vec<&Path> = self.0.iter().filter(is_left).map(|(_, path, _)| path.as_path()).collect();
        let (count, lie) = match left.len() {
            0 => return None,
            1 => ("1 checkpoint".to_owned(), "lies"),
            more => (format!("{more} checkpoints"), "lie"),
        };
        let folder = std::env::current_dir().unwrap_or_default();
        let word = |path: &&Path| quoted(path.strip_prefix(&folder).unwrap_or(path));
        let words: Vec<String> = left.iter().take(NAMED_MAX).map(word).collect();
        let more = match left.len().saturating_sub(NAMED_MAX) {
            0 => String::new(),
            more => format!(" (and {more} more)"),
        };
        Some(format!(
            "warning: {count} of an earlier run {lie} beside those of this run; if nothing is to go on from there: rm {}{more}",
            words.join(" ")
        ))
    }
}

/// The tick in `name`, if it is that of a checkpoint beside the recording `stem`.
fn tick(name: &str, stem: &str) -> Option<u32> {
    let tick = name.strip_prefix(stem)?.strip_prefix('.')?.strip_suffix(".ckpt")?;
    tick.parse().ok().filter(|_| !tick.starts_with('+'))
}

/// Time of the last change of the file at `path`.
fn changed(path: &Path) -> Option<SystemTime> {
    let metadata = std::fs::symlink_metadata(path).ok()?;
    metadata.modified().ok().filter(|_| metadata.is_file())
}

#[cfg(test)]
mod tests {
    use super::tick;

    #[test]
    fn a_checkpoint_is_named_after_its_recording_and_its_tick() {
        assert_eq!(tick("a.b.9000.ckpt", "a.b"), Some(9000));
        for other in ["a.9000.ckpt", "a.b.from-6000.7000.ckpt", "a.b.+1.ckpt", "a.b..ckpt", "a.b.9000.mcap"] {
            assert_eq!(tick(other, "a.b"), None, "{other}");
        }
    }
}
