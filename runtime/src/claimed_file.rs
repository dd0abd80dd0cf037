//! Recordings and logs that one run at a time writes: claimed before it begins, locked while it writes.

use crate::file_lock;
use crate::location::Location;
use crate::output_file::{LOG, LOG_START, RECORDING, check, locate};
use anyhow::{Context, Result, anyhow, bail};
use rustix::fs::OFlags;
use std::fs::File;
use std::io::{self, ErrorKind, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

/// Part of a recording's name in front of its extension while the recording is incomplete.
const PARTIAL: &str = ".partial";

/// Result of an attempt to lock a file.
enum Attempt {
    Locked(File),
    /// Another process holds it.
    Held,
    /// The file was removed or renamed before it was locked.
    Gone,
}

fn try_lock(file: File, location: &Location) -> io::Result<Attempt> {
    Ok(match file_lock::try_exclusive(&file)? {
        true if location.holds(&file) => Attempt::Locked(file),
        true => Attempt::Gone,
        false => Attempt::Held,
    })
}

/// A recording that is being written, under another name beside its place, and locked. Dropping it leaves the file,
/// unless the file is empty.
#[derive(Debug)]
pub struct Partial {
    real: Location,
    location: Location,
    /// Path of the file while it is being written.
    pub path: PathBuf,
    /// The file, under any name.
    pub file: File,
    /// Path to which the remains of a broken run were moved, if there were any.
    pub kept: Option<PathBuf>,
}

impl Partial {
    /// Claims the place `path` of a recording; `None` if another process writes there.
    ///
    /// Remains of a broken run at that place get another name and are never lost.
    ///
    /// # Errors
    /// If something is in the way that must not be replaced, or the folder cannot be written to.
    pub fn claim(path: &Path) -> Result<Option<Self>> {
        let real = locate(path, &RECORDING)?;
        let path = partial_path(&real.path)?;
        check(&path, &RECORDING)?;
        let location = real.sibling(path.file_name().unwrap_or_default());
        let cannot = || format!("cannot create the recording {}", path.display());
        let claimed = claim_new(&location).map_err(with_advice).with_context(cannot)?;
        Ok(claimed.map(|(file, kept)| Self { real, location, path, file, kept }))
    }

    /// True if the file is still at the place where it is written.
    pub fn is_there(&self) -> bool {
        self.location.holds(&self.file)
    }

    /// True if the file is empty.
    pub fn is_empty(&self) -> bool {
        self.file.metadata().is_ok_and(|file| file.len() == 0)
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// If something came there during the run that must not be replaced, or the file was taken away.
    pub fn finish(&self) -> Result<()> {
        let cannot =
            || format!("cannot put {} in the place of {}", self.path.display(), self.real.path.display());
        if !self.is_there() {
            bail!("{}: somebody removed or replaced it during the run", cannot());
        }
        let current = self.current_path();
        if current != self.path {
            bail!(
                "{}: its folder was renamed or moved during the run; the whole recording is {} now",
                cannot(),
                current.display()
            );
        }
        check(&self.real.path, &RECORDING)?;
        self.location.rename(&self.real).with_context(cannot)
    }

    /// Puts the file beside its place, with `suffix` in its name; returns the path.
    ///
    /// # Errors
    /// If something lies there that must not be replaced, or the file was taken away.
    pub fn set_aside(&self, suffix: &str) -> Result<PathBuf> {
        let path = with_suffix(&self.real.path, suffix);
        let cannot = || format!("cannot keep what was flown as {}", path.display());
        if !self.is_there() {
            bail!("{}: somebody removed or replaced it during the run", cannot());
        }
        check(&path, &RECORDING)?;
        let aside = self.location.sibling(path.file_name().unwrap_or_default());
        self.location.rename(&aside).with_context(cannot)?;
        Ok(path)
    }

    /// Its path by now.
    pub fn current_path(&self) -> PathBuf {
        self.location.current_path()
    }

    /// Removes it.
    pub fn remove(&self) {
        let _ = self.location.remove();
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if self.is_empty() && self.is_there() {
            self.remove();
        }
    }
}

/// `hover.partial.mcap` for `hover.mcap`: where the recording is written that `real` is to be.
///
/// # Errors
/// If `real` itself has such a name.
pub fn partial_path(real: &Path) -> Result<PathBuf> {
    let is_partial = |name: &std::ffi::OsStr| name.as_encoded_bytes().ends_with(PARTIAL.as_bytes());
    if real.file_stem().is_some_and(is_partial) || real.file_name().is_some_and(is_partial) {
        bail!(
            "cannot create the recording {}: such a name is that of what a broken run leaves; name another file",
            real.display()
        );
    }
    Ok(with_suffix(real, PARTIAL))
}

/// `path` with `suffix` in its name, in front of the extension.
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(suffix);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The same error, with advice where the place may not be written to.
fn with_advice(error: io::Error) -> io::Error {
    match error.kind() {
        kind @ ErrorKind::PermissionDenied => {
            io::Error::new(kind, format!("{error}\n  help: `--record PATH` writes it elsewhere"))
        }
        _ => error,
    }
}

/// A new file at `location`, locked, and the new path of the file that lay there before; `None` if another process
/// has one there.
///
/// Exactly one of the processes that try at once gets it. Only the process that has locked the old file
/// removes it. A process that has created the file and then finds it locked or gone has lost it to another.
fn claim_new(location: &Location) -> io::Result<Option<(File, Option<PathBuf>)>> {
    let mut kept = None;
    loop {
        let old = match location.open(OFlags::RDWR) {
            Ok(old) => try_lock(old, location)?,
            Err(error) if error.kind() == ErrorKind::NotFound => Attempt::Gone,
            Err(error) => return Err(error),
        };
        match old {
            Attempt::Held => return Ok(None),
            Attempt::Gone => {}
            // Locked until its name is gone: no process removes the file that came after it.
            Attempt::Locked(old) => {
                RECORDING.require(&old)?;
                kept = keep_aside(&old, location)?.or(kept);
            }
        }
        match location.open(OFlags::RDWR | OFlags::CREATE | OFlags::EXCL) {
            Ok(new) => match try_lock(new, location)? {
                Attempt::Locked(new) => return Ok(Some((new, kept))),
                Attempt::Held => return Ok(None),
                Attempt::Gone => {}
            },
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// Gives the locked recording `old` at `location` the first free name of `NAME-2.mcap`, `NAME-3.mcap`, …; one that is
/// empty is removed.
fn keep_aside(old: &File, location: &Location) -> io::Result<Option<PathBuf>> {
    if old.metadata()?.len() == 0 {
        return location.remove().map(|()| None);
    }
    for number in 2_u32.. {
        let path = with_suffix(&location.path, &format!("-{number}"));
        let aside = location.sibling(path.file_name().unwrap_or_default());
        // A second name first, which is never given to two files: no moment has none.
        match location.link(&aside) {
            Ok(()) => return location.remove().map(|()| Some(path)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // Not every file system has second names.
            Err(_) if aside.stat()?.is_none() => return location.rename(&aside).map(|()| Some(path)),
            Err(_) => {}
        }
    }
    Err(io::Error::other("no name is free"))
}

/// A log that this run alone writes to, while this lives.
#[derive(Debug)]
pub struct LogClaim {
    file: File,
    location: Location,
    is_new: bool,
}

impl LogClaim {
    /// Claims the log at `path`, which keeps its content for now; `None` if another run writes to it.
    ///
    /// # Errors
    /// If something is there that must not be replaced, or the file cannot be created.
    pub fn claim(path: &Path) -> Result<Option<Self>> {
        let location = locate(path, &LOG)?;
        let cannot = || format!("cannot create the log {}", path.display());
        loop {
            let is_new = location.stat().with_context(cannot)?.is_none();
            let file = location.open(OFlags::RDWR | OFlags::CREATE).with_context(cannot)?;
            match try_lock(file, &location).with_context(cannot)? {
                Attempt::Held => return Ok(None),
                Attempt::Gone => {}
                Attempt::Locked(file) => {
                    LOG.require(&file).map_err(|error| anyhow!("{}: {error}", cannot()))?;
                    return Ok(Some(Self { file, location, is_new }));
                }
            }
        }
    }

    /// Removes the content of an earlier run.
    ///
    /// # Errors
    /// If it cannot be written to.
    pub fn begin(&mut self) -> Result<()> {
        self.is_new = false;
        self.file
            .set_len(0)
            .and_then(|()| self.file.write_all_at(LOG_START.as_bytes(), 0))
            .with_context(|| format!("cannot write the log {}", self.location.path.display()))
    }
}

impl Drop for LogClaim {
    fn drop(&mut self) {
        if self.is_new && self.location.holds(&self.file) {
            let _ = self.location.remove();
        }
    }
}

/// Opens the log at `path` to write at its end, one that was claimed or one that a backup brings with it.
///
/// # Errors
/// If something else is there.
pub fn append_to_log(path: &Path) -> Result<File> {
    let cannot = || format!("cannot open the log {}", path.display());
    let location = locate(path, &LOG)?;
    let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::APPEND;
    let mut file = location.open(flags).with_context(cannot)?;
    if file.metadata().with_context(cannot)?.len() == 0 {
        file.write_all(LOG_START.as_bytes()).with_context(cannot)?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::{Partial, partial_path};
    use std::io::Write as _;
    use std::path::Path;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Locks of one process exclude each other as those of two do: they belong to open files.
    #[test]
    fn a_place_that_may_not_be_written_to_has_advice() {
        let denied = super::with_advice(std::io::ErrorKind::PermissionDenied.into()).to_string();
        assert!(denied.ends_with("help: `--record PATH` writes it elsewhere"), "{denied}");
        let missing = super::with_advice(std::io::ErrorKind::NotFound.into()).to_string();
        assert!(!missing.contains("help"), "{missing}");
    }

    #[test]
    fn a_place_is_claimed_by_one_at_a_time_whatever_the_others_leave() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flown.mcap");
        let holders = AtomicU32::new(0);
        // It ends in order, breaks, or does not begin.
        let claim_once = |end: u32| {
            let partial = loop {
                match Partial::claim(&path).unwrap() {
                    Some(partial) => break partial,
                    None => std::thread::yield_now(),
                }
            };
            assert_eq!(holders.fetch_add(1, Ordering::SeqCst), 0, "two hold one place");
            let mut file = &partial.file;
            if end != 0 {
                file.write_all(recorder::writer::START).unwrap();
            }
            assert_eq!(holders.fetch_sub(1, Ordering::SeqCst), 1);
            if end == 1 {
                partial.finish().unwrap();
            }
        };
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let claim_once = &claim_once;
                drop(scope.spawn(move || (0..300).for_each(|round| claim_once((thread + round) % 3))));
            }
        });
        assert!(path.exists());
    }

    #[test]
    fn recordings_of_different_names_are_written_under_different_names() {
        let partial = |name: &str| partial_path(Path::new(name)).map(|path| path.display().to_string());
        assert_eq!(partial("/a/hover.mcap").unwrap(), "/a/hover.partial.mcap");
        assert_eq!(partial("/a/hover").unwrap(), "/a/hover.partial");
        assert_eq!(partial("/a/hover.2.mcap").unwrap(), "/a/hover.2.partial.mcap");
        for taken in ["/a/hover.partial.mcap", "/a/hover.partial"] {
            assert!(partial(taken).unwrap_err().to_string().contains("what a broken run leaves"));
        }
    }
}
