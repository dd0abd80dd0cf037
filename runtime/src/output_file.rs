//! A file that a command writes: it takes the place of one that the same kind of command wrote before, or of nothing,
//! and only once it is whole.

use crate::file_lock;
use crate::location::{self, Location, Unlocated};
use anyhow::{Context, anyhow, bail};
use bus::host_time::monotonic_ns;
use diagnostics::Error;
use rustix::fs::OFlags;
use std::fs::{File, Metadata};
use std::io::{self, BufWriter, ErrorKind, Read as _, Write as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Bytes at the start of a file within which its kind is looked for.
const START_BYTES: u64 = 512;
/// Names that are tried for a draft before its folder is given up.
const DRAFTS_MAX: u32 = 100;
/// A kind of file that hummingbus writes, and how one is known that it has written: no other file is replaced.
///
/// ```
/// use runtime::output_file::{self, Kind, Mark};
/// use std::io::Write as _;
/// const PAGE: Kind = Kind { name: "page", mark: Mark::Start(b"<!-- hummingbus -->") };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.html");
///
/// std::fs::write(&path, "a letter")?;
/// let error = output_file::write(&path, &PAGE, |out| out.write_all(b"")).unwrap_err();
/// assert!(error.to_string().contains("no page of hummingbus, and would be lost"));
///
/// std::fs::write(&path, "<!-- hummingbus --> of yesterday")?;
/// output_file::write(&path, &PAGE, |out| out.write_all(b"<!-- hummingbus --> of today"))?;
/// assert_eq!(std::fs::read_to_string(path)?, "<!-- hummingbus --> of today");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Kind {
    /// Name of the kind, in messages.
    pub name: &'static str,
    /// Mark that every file of the kind has.
    pub mark: Mark,
}

/// Mark by which a file is recognized.
#[derive(Debug)]
pub enum Mark {
    /// The file starts with these bytes, or with the first of them if its writer was cut off.
    Start(&'static [u8]),
    /// These bytes are within its first ones.
    Within(&'static [u8]),
}

/// The recording of a run.
pub(crate) const RECORDING: Kind = Kind { name: "recording", mark: Mark::Start(recorder::writer::START) };
/// Output of a process.
pub(crate) const LOG: Kind = Kind { name: "log", mark: Mark::Start(LOG_START.as_bytes()) };
/// The first line of a log that a manifest names.
pub(crate) const LOG_START: &str = "# What a process of a run said. Written by hummingbus.\n";

impl Kind {
    fn is_start(&self, start: &[u8]) -> bool {
        match self.mark {
            Mark::Start(mark) => start.starts_with(mark) || mark.starts_with(start),
            Mark::Within(mark) => start.is_empty() || start.windows(mark.len()).any(|bytes| bytes == mark),
        }
    }

    /// Refuses a `file` that must not be replaced: that is neither empty nor of this kind.
    pub(crate) fn require(&self, file: &File) -> io::Result<()> {
        if !file.metadata()?.is_file() {
            return Err(io::Error::other(NOT_REGULAR));
        }
        let mut start = Vec::new();
        file.take(START_BYTES).read_to_end(&mut start)?;
        if self.is_start(&start) {
            return Ok(());
        }
        let name = self.name;
        let message =
            format!("it is a file that is no {name} of hummingbus, and would be lost; name another file");
        Err(io::Error::other(message))
    }
}

const NOT_REGULAR: &str = "it exists and is not a regular file; name another file";

/// The file that `path` names, by its path without links: all spellings of one file become one path.
///
/// # Errors
/// If its folder is not there, or a link on the way is not to be trusted.
pub(crate) fn real_path(path: &Path) -> anyhow::Result<PathBuf> {
    Ok(located(path)?.path)
}

fn located(path: &Path) -> anyhow::Result<Location> {
    Location::find(path).map_err(|reason| reason.told(format!("cannot create {}", path.display())))
}

/// Refuses a file of `kind` at `path` if it would replace another kind of file.
///
/// # Errors
/// If its folder is missing, or a link on the way cannot be trusted. If the file in its place is neither
/// empty nor of this kind.
pub fn check(path: &Path, kind: &Kind) -> Result<(), Error> {
    locate(path, kind)?;
    Ok(())
}

/// The location of the file of `kind` at `path`.
///
/// # Errors
/// As [`check`].
pub(crate) fn locate(path: &Path, kind: &Kind) -> anyhow::Result<Location> {
    let cannot = || format!("cannot create the {} {}", kind.name, path.display());
    let found = Location::find(path);
    if let Err(planted @ Unlocated::Planted { .. }) = &found {
        bail!("{}: {planted}", cannot());
    }
    // Before it is opened: to open a pipe or a device is to do something to it.
    if let Ok(old) = std::fs::metadata(path) {
        if !old.is_file() {
            bail!("{}: {NOT_REGULAR}", cannot());
        }
        if is_standard_stream(&old) {
            bail!("{}: it is where this command prints; name another file", cannot());
        }
    }
    let location = located(path)?;
    match location.open(OFlags::RDONLY) {
        // Another run has just put it in its place, or removed it.
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        // An empty one may be one that this user may only write to.
        Err(_) if location.stat().is_ok_and(|old| old.is_some_and(|old| old.st_size == 0)) => {}
        opened => opened.and_then(|file| kind.require(&file)).map_err(|error| told(&error, cannot()))?,
    }
    Ok(location)
}

/// `error` behind `text` in one message. A refusal of the system stays one; a file of another kind is none.
fn told(error: &io::Error, text: String) -> anyhow::Error {
    match error.raw_os_error() {
        Some(_) => io::Error::new(error.kind(), format!("{text}: {error}")).into(),
        None => anyhow!("{text}: {error}"),
    }
}

/// True if standard output or standard error goes to this file.
fn is_standard_stream(file: &Metadata) -> bool {
    let streams = ["/proc/self/fd/1", "/proc/self/fd/2"].map(std::fs::metadata);
    streams.iter().flatten().any(|stream| (stream.dev(), stream.ino()) == (file.dev(), file.ino()))
}

/// True if two paths name one file, by any spelling, link, or second name of it.
pub fn is_same(a: &Path, b: &Path) -> bool {
    let is_same_path = matches!((real_path(a), real_path(b)), (Ok(a), Ok(b)) if a == b);
    let identity = |path: &Path| std::fs::metadata(path).map(|file| (file.dev(), file.ino()));
    is_same_path || matches!((identity(a), identity(b)), (Ok(a), Ok(b)) if a == b)
}

/// Fills a file beside `path` with the output of `write` and puts it in the place of the file of `kind` that is
/// there; returns the result of `write`.
///
/// # Errors
/// If it cannot be written: the file that was there is then unchanged.
pub fn write<T>(
    path: &Path,
    kind: &Kind,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<T>,
) -> Result<T, Error> {
    let location = locate(path, kind)?;
    let mut draft = Draft::beside(&location).with_context(|| format!("cannot create {}", path.display()))?;
    let cannot = || format!("cannot write {}", path.display());
    let mut out = BufWriter::new(&mut draft.file);
    let written = write(&mut out).and_then(|written| out.flush().map(|()| written)).with_context(cannot)?;
    drop(out);
    draft.put(&location).with_context(cannot)?;
    Ok(written)
}

/// A file that is not whole yet, beside its location; dropping it removes it.
struct Draft {
    file: File,
    location: Location,
    is_put: bool,
}

impl Draft {
    fn beside(location: &Location) -> io::Result<Self> {
        for number in 0..DRAFTS_MAX {
            let name = format!(".hummingbus-{:x}-{:x}-{number}", std::process::id(), monotonic_ns());
            let draft = location.sibling(name.as_ref());
            match draft.open(OFlags::RDWR | OFlags::CREATE | OFlags::EXCL) {
                Ok(file) => return Ok(Self { file, location: draft, is_put: false }),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::Error::other("no name is free"))
    }

    fn put(&mut self, location: &Location) -> io::Result<()> {
        self.location.rename(location)?;
        self.is_put = true;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.is_put {
            let _ = self.location.remove();
        }
    }
}

/// Makes the folder `folder` and those above it where they are missing; returns its path without links.
///
/// # Errors
/// If that is not possible, or a link on the way is not to be trusted.
pub fn make_folder(folder: &Path) -> Result<PathBuf, Error> {
    let cannot = || format!("cannot make the folder {}", folder.display());
    // No path at all is the working directory.
    let made = location::make_folder(&folder.join("."));
    Ok(made.map_err(|reason| reason.told(cannot()))?)
}

/// Holds the folder `folder` for one command that fills it.
///
/// # Errors
/// If another command does.
pub fn lock_folder(folder: &Path) -> Result<File, Error> {
    let cannot = || format!("cannot write to the folder {}", folder.display());
    let file = File::open(folder).with_context(cannot)?;
    if !file_lock::try_exclusive(&file).with_context(cannot)? {
        let other = "another hummingbus writes to it now; name another folder, or wait";
        return Err(anyhow!("{}: {other}", cannot()).into());
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::{LOG, LOG_START, RECORDING, check, real_path, write};
    use std::io::Write as _;
    use std::path::Path;

    #[test]
    fn what_is_not_whole_is_known_by_its_beginning() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let checked = |content: &[u8], kind| {
            std::fs::write(&path, content).unwrap();
            check(&path, kind).is_ok()
        };
        for length in 0..recorder::writer::START.len() {
            assert!(checked(&recorder::writer::START[..length], &RECORDING));
        }
        assert!(!checked(b"\x89MCAP0\r\n\x01\x16of another", &RECORDING));
        assert!(checked(LOG_START.as_bytes(), &LOG) && !checked(b"[run]\n", &LOG));
    }

    #[test]
    fn what_cannot_be_written_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.log");
        std::fs::write(&path, LOG_START).unwrap();
        let full = |out: &mut std::io::BufWriter<&mut std::fs::File>| {
            out.write_all(&[b'x'; 100_000])?;
            Err::<(), _>(std::io::Error::from(std::io::ErrorKind::StorageFull))
        };
        let error = write(&path, &LOG, full).unwrap_err().with_causes();
        assert!(error.contains("cannot write") && error.contains("a.log"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), LOG_START);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn links_that_go_round_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink(&a, &b).unwrap();
        std::os::unix::fs::symlink(&b, &a).unwrap();
        assert!(real_path(&a).unwrap_err().to_string().contains("more than 40 symbolic links"));
        assert!(real_path(Path::new("/")).unwrap_err().to_string().contains("it names a folder"));
    }
}
