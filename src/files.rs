//! Files that a command reads, and writes beside what it prints.

use anyhow::{Context, Result, bail};
use recorder::reader::Recording;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

/// Checks that a file can lie at `path`, before work is done for it.
///
/// # Errors
/// If its folder is not there.
pub fn check_folder(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder.filter(|folder| !folder.is_dir()) {
        Some(folder) => bail!("cannot create {}: there is no folder {}", path.display(), folder.display()),
        None => Ok(()),
    }
}

/// Creates the file at `path` and fills it with what `write` writes; returns what `write` returns.
///
/// # Errors
/// If it cannot be written.
pub fn write<T>(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<T>) -> Result<T> {
    let file = File::create(path).with_context(|| format!("cannot create {}", path.display()))?;
    let mut out = BufWriter::new(file);
    let written = write(&mut out).and_then(|written| out.flush().map(|()| written));
    written.with_context(|| format!("cannot write {}", path.display()))
}

/// Opens a recording, or what is whole of one that was cut off, and then says so.
pub fn open_recording(path: &Path) -> Result<Recording> {
    let recording = Recording::salvage(path)?;
    if let Some(cut) = recording.cut() {
        let end = cut.last_tick.map_or("nothing of it is whole".to_owned(), |tick| {
            format!("what is whole of it ends after tick {tick}")
        });
        crate::output::say(&format!(
            "warning: {} was cut off, its writer did not finish it: {end}",
            path.display()
        ));
    }
    Ok(recording)
}
