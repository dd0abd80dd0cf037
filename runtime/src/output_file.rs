//! A file that a command writes: it takes the place of one that the same kind of command wrote before, or of nothing,
//! and only once it is whole.
//!
//! What is written by one process at a time (a recording, a log) is locked with `flock`: the kernel gives the lock back
//! when the process dies, however it dies.

use anyhow::{Context, Result, bail};
use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::io::Errno;
use std::fs::{File, Metadata, OpenOptions, Permissions};
use std::io::{self, BufWriter, ErrorKind, Write as _};
use std::os::unix::fs::{FileExt as _, MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};

/// Bytes at the start of a file within which its kind is looked for.
const START_BYTES: usize = 512;
/// Symbolic links that are followed, as many as the kernel follows.
const LINKS_MAX: usize = 40;
/// What stands in the name of a recording in front of its extension while it is not complete.
const PARTIAL: &str = ".partial";

/// A kind of file that hummingbus writes, and how one is known that it has written.
#[derive(Debug)]
pub struct Kind {
    /// What it is, in messages.
    pub name: &'static str,
    /// What is in every such file.
    pub mark: Mark,
}

/// How a file is known.
#[derive(Debug)]
pub enum Mark {
    /// It starts like this, or with the beginning of it where its writer was cut off.
    Start(&'static [u8]),
    /// This is within its first bytes.
    Within(&'static [u8]),
}

/// The recording of a run.
pub const RECORDING: Kind = Kind { name: "recording", mark: Mark::Start(recorder::writer::START) };
/// What a process says.
pub const LOG: Kind = Kind { name: "log", mark: Mark::Start(LOG_START.as_bytes()) };
/// The first line of a log that a manifest names.
pub const LOG_START: &str = "# What a process of a run said. Written by hummingbus.\n";

impl Kind {
    fn is_start(&self, start: &[u8]) -> bool {
        match self.mark {
            Mark::Start(mark) => start.starts_with(mark) || mark.starts_with(start),
            Mark::Within(mark) => start.is_empty() || start.windows(mark.len()).any(|bytes| bytes == mark),
        }
    }

    /// Why `file` must not be replaced; `None` if it may: it is empty, or of this kind.
    fn objection(&self, file: &File) -> io::Result<Option<String>> {
        if !file.metadata()?.is_file() {
            return Ok(Some(NOT_REGULAR.to_owned()));
        }
        let mut start = [0; START_BYTES];
        let length = read_start(file, &mut start)?;
        let words = || {
            let name = self.name;
            format!("it is a file that is no {name} of hummingbus, and would be lost; name another file")
        };
        Ok((!self.is_start(&start[..length])).then(words))
    }
}

/// What to do where two runs could not be kept apart.
const NO_LOCKS: &str = "the file system cannot lock files (flock), as some network file systems cannot; write to a local \
                        folder and move the file afterwards";
const NOT_REGULAR: &str = "it exists and is not a regular file; name another file";

fn read_start(file: &File, start: &mut [u8]) -> io::Result<usize> {
    let mut length = 0;
    loop {
        match file.read_at(&mut start[length..], length as u64) {
            Ok(0) => return Ok(length),
            Ok(more) => length += more,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The file that `path` names. Links are followed, so that all spellings of one file become one path.
///
/// # Errors
/// If its folder is not there.
pub fn real_path(path: &Path) -> Result<PathBuf> {
    let cannot = || format!("cannot create {}", path.display());
    let mut real = std::path::absolute(path).with_context(cannot)?;
    for _ in 0..LINKS_MAX {
        let (Some(folder), Some(name)) = (real.parent(), real.file_name()) else {
            bail!("{}: it names a folder", cannot())
        };
        if !folder.is_dir() {
            bail!("{}: there is no folder {}", cannot(), folder.display());
        }
        let folder = folder.canonicalize().with_context(cannot)?;
        real = folder.join(name);
        match std::fs::read_link(&real) {
            Ok(target) => real = folder.join(target),
            Err(_) => return Ok(real),
        }
    }
    bail!("{}: more than {LINKS_MAX} symbolic links", cannot())
}

/// Refuses a file of `kind` at `path` where something else would be lost; returns the file that `path` names.
///
/// # Errors
/// If its folder is not there, or something is in its place that is neither empty nor of this kind.
pub fn check(path: &Path, kind: &Kind) -> Result<PathBuf> {
    let cannot = || format!("cannot create the {} {}", kind.name, path.display());
    let old = match std::fs::metadata(path) {
        Ok(old) => old,
        Err(_) => return real_path(path),
    };
    // Before it is opened: to open a pipe or a device is to do something to it.
    if !old.is_file() {
        bail!("{}: {NOT_REGULAR}", cannot());
    }
    if is_standard_stream(&old) {
        bail!("{}: it is where this command prints; name another file", cannot());
    }
    if old.len() > 0 {
        match File::open(path).and_then(|file| kind.objection(&file)) {
            Ok(None) => {}
            Ok(Some(words)) => bail!("{}: {words}", cannot()),
            // Another run has just put it in its place, or removed it.
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error).with_context(cannot),
        }
    }
    real_path(path)
}

/// Whether standard output or standard error goes to this file.
fn is_standard_stream(file: &Metadata) -> bool {
    let streams = ["/proc/self/fd/1", "/proc/self/fd/2"].map(std::fs::metadata);
    streams.iter().flatten().any(|stream| (stream.dev(), stream.ino()) == (file.dev(), file.ino()))
}

/// Whether two paths name one file, by any spelling, link, or second name of it.
pub fn is_same(a: &Path, b: &Path) -> bool {
    let is_same_path = matches!((real_path(a), real_path(b)), (Ok(a), Ok(b)) if a == b);
    let identity = |path: &Path| std::fs::metadata(path).map(|file| (file.dev(), file.ino()));
    is_same_path || matches!((identity(a), identity(b)), (Ok(a), Ok(b)) if a == b)
}

/// Fills a file beside `path` with what `write` writes and puts it in the place of the file of `kind` that is there;
/// returns what `write` returns.
///
/// # Errors
/// If it cannot be written: then what was there is as it was.
pub fn write<T>(
    path: &Path,
    kind: &Kind,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<T>,
) -> Result<T> {
    let real = check(path, kind)?;
    let folder = real.parent().unwrap_or(Path::new("/"));
    let mut draft = tempfile::Builder::new()
        .prefix(".hummingbus-")
        // As for any new file, the user's umask takes from it.
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder)
        .with_context(|| format!("cannot create {}", path.display()))?;
    let cannot = || format!("cannot write {}", path.display());
    let mut out = BufWriter::new(draft.as_file_mut());
    let written = write(&mut out).and_then(|written| out.flush().map(|()| written)).with_context(cannot)?;
    drop(out);
    draft.persist(&real).map_err(|error| error.error).with_context(cannot)?;
    Ok(written)
}

/// Holds the folder `folder` for one command that fills it.
///
/// # Errors
/// If another command does.
pub fn lock_folder(folder: &Path) -> Result<File> {
    let cannot = || format!("cannot write to the folder {}", folder.display());
    let file = File::open(folder).with_context(cannot)?;
    match flock(&file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(file),
        Err(Errno::NOSYS | Errno::NOLCK | Errno::OPNOTSUPP) => bail!("{}: {NO_LOCKS}", cannot()),
        Err(Errno::WOULDBLOCK) => {
            bail!("{}: another hummingbus writes to it now; name another folder, or wait", cannot())
        }
        Err(error) => Err(error).with_context(cannot),
    }
}

/// What came of trying to lock a file.
enum Attempt {
    Locked(File),
    /// Somebody else holds it.
    Held,
    /// It was removed or renamed before it was locked.
    Gone,
}

fn try_lock(file: File, path: &Path) -> io::Result<Attempt> {
    match rustix::io::retry_on_intr(|| flock(&file, FlockOperation::NonBlockingLockExclusive)) {
        Err(Errno::NOSYS | Errno::NOLCK | Errno::OPNOTSUPP) => Err(io::Error::other(NO_LOCKS)),
        Ok(()) if is_at(&file, path) => Ok(Attempt::Locked(file)),
        Ok(()) => Ok(Attempt::Gone),
        Err(Errno::WOULDBLOCK) => Ok(Attempt::Held),
        Err(error) => Err(error.into()),
    }
}

/// Whether `file` is what lies at `path`.
fn is_at(file: &File, path: &Path) -> bool {
    let identity = |file: Metadata| (file.dev(), file.ino());
    let found = std::fs::symlink_metadata(path).map(identity);
    matches!((file.metadata().map(identity), found), (Ok(own), Ok(found)) if own == found)
}

fn open_options() -> OpenOptions {
    let mut options = OpenOptions::new();
    // Neither follows a link that was put there meanwhile nor waits for the other end of a pipe.
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    options.read(true).write(true).custom_flags(flags.bits().cast_signed());
    options
}

/// A recording that is being written, under another name beside its place, and locked; dropping it leaves what was
/// written there, or nothing where nothing was.
#[derive(Debug)]
pub struct Partial {
    real: PathBuf,
    path: PathBuf,
    file: File,
    kept: Option<PathBuf>,
}

impl Partial {
    /// Claims the place `path` of a recording; `None` where somebody else writes there.
    ///
    /// What a broken run left there gets another name, and is never lost.
    ///
    /// # Errors
    /// If something is in the way that must not be replaced, or the folder cannot be written to.
    pub fn claim(path: &Path) -> Result<Option<Self>> {
        let real = check(path, &RECORDING)?;
        let partial = partial_path(&real)?;
        check(&partial, &RECORDING)?;
        let cannot = || format!("cannot create the recording {}", partial.display());
        let claimed = claim_new(&partial).with_context(cannot)?;
        Ok(claimed.map(|(file, kept)| Self { real, path: partial, file, kept }))
    }

    /// Where it is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where what a broken run left lies now, if there was something.
    pub fn kept(&self) -> Option<&Path> {
        self.kept.as_deref()
    }

    /// Whether it still lies where it is written.
    pub fn is_there(&self) -> bool {
        is_at(&self.file, &self.path)
    }

    /// The file, whatever its name.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Whether something was written.
    pub fn is_empty(&self) -> bool {
        self.file.metadata().is_ok_and(|file| file.len() == 0)
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// If something came there during the run that must not be replaced, or the file was taken away.
    pub fn finish(&self) -> Result<()> {
        let cannot = || format!("cannot put {} in the place of {}", self.path.display(), self.real.display());
        check(&self.real, &RECORDING)?;
        if !is_at(&self.file, &self.path) {
            bail!("{}: somebody removed or replaced it during the run", cannot());
        }
        std::fs::rename(&self.path, &self.real).with_context(cannot)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if self.is_empty() && is_at(&self.file, &self.path) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// `hover.partial.mcap` for `hover.mcap`: where the recording is written that `real` is to be.
///
/// # Errors
/// If `real` itself has such a name.
pub fn partial_path(real: &Path) -> Result<PathBuf> {
    let (stem, extension) = (real.file_stem().unwrap_or_default(), real.extension());
    let is_partial = |name: &std::ffi::OsStr| name.as_encoded_bytes().ends_with(PARTIAL.as_bytes());
    if is_partial(stem) || real.file_name().is_some_and(is_partial) {
        bail!(
            "cannot create the recording {}: such a name is that of what a broken run leaves; name another file",
            real.display()
        );
    }
    let mut name = stem.to_owned();
    name.push(PARTIAL);
    if let Some(extension) = extension {
        name.push(".");
        name.push(extension);
    }
    Ok(real.with_file_name(name))
}

/// A new file at `path`, locked, and where what lay there before is kept; `None` where somebody else has one there.
///
/// Of any number of processes that try at once exactly one gets it: only who has locked what lies there removes it, and
/// who has created it and then finds it locked or gone has lost it to another.
fn claim_new(path: &Path) -> io::Result<Option<(File, Option<PathBuf>)>> {
    let mut kept = None;
    loop {
        let old = match open_options().open(path) {
            Ok(old) => try_lock(old, path)?,
            Err(error) if error.kind() == ErrorKind::NotFound => Attempt::Gone,
            Err(error) => return Err(error),
        };
        match old {
            Attempt::Held => return Ok(None),
            Attempt::Gone => {}
            // Locked until its name is gone: nobody removes a backup instead.
            Attempt::Locked(old) => {
                if let Some(words) = RECORDING.objection(&old)? {
                    return Err(io::Error::other(words));
                }
                kept = keep_aside(&old, path)?.or(kept);
            }
        }
        match open_options().create_new(true).open(path) {
            Ok(new) => match try_lock(new, path)? {
                Attempt::Locked(new) => return Ok(Some((new, kept))),
                Attempt::Held => return Ok(None),
                Attempt::Gone => {}
            },
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// Gives the locked recording `old` at `path` the first free name of `NAME-2.mcap`, `NAME-3.mcap`, …; one that is empty
/// is removed.
fn keep_aside(old: &File, path: &Path) -> io::Result<Option<PathBuf>> {
    if old.metadata()?.len() == 0 {
        return std::fs::remove_file(path).map(|()| None);
    }
    for number in 2_u32.. {
        let mut name = path.file_stem().unwrap_or_default().to_owned();
        name.push(format!("-{number}"));
        if let Some(extension) = path.extension() {
            name.push(".");
            name.push(extension);
        }
        let aside = path.with_file_name(name);
        // A second name first, which is never given to two files: no moment has none.
        match std::fs::hard_link(path, &aside) {
            Ok(()) => return std::fs::remove_file(path).map(|()| Some(aside)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // Not every file system has second names.
            Err(_) if !aside.exists() => return std::fs::rename(path, &aside).map(|()| Some(aside)),
            Err(_) => {}
        }
    }
    Err(io::Error::other("no name is free"))
}

/// A log that this run alone writes to, while this lives.
#[derive(Debug)]
pub struct LogClaim {
    file: File,
    path: PathBuf,
    is_new: bool,
}

impl LogClaim {
    /// Claims the log at `path`, which keeps what it holds for now; `None` where another run writes to it.
    ///
    /// # Errors
    /// If something is there that must not be replaced, or the file cannot be created.
    pub fn claim(path: &Path) -> Result<Option<Self>> {
        let real = check(path, &LOG)?;
        let cannot = || format!("cannot create the log {}", path.display());
        loop {
            let is_new = !real.exists();
            let file = open_options().create(true).truncate(false).open(&real).with_context(cannot)?;
            match try_lock(file, &real).with_context(cannot)? {
                Attempt::Held => return Ok(None),
                Attempt::Gone => {}
                Attempt::Locked(file) => {
                    if let Some(words) = LOG.objection(&file).with_context(cannot)? {
                        bail!("{}: {words}", cannot());
                    }
                    return Ok(Some(Self { file, path: real, is_new }));
                }
            }
        }
    }

    /// Removes what an earlier run wrote.
    ///
    /// # Errors
    /// If it cannot be written to.
    pub fn begin(&mut self) -> Result<()> {
        self.is_new = false;
        self.file
            .set_len(0)
            .and_then(|()| self.file.write_all_at(LOG_START.as_bytes(), 0))
            .with_context(|| format!("cannot write the log {}", self.path.display()))
    }
}

impl Drop for LogClaim {
    fn drop(&mut self) {
        if self.is_new && is_at(&self.file, &self.path) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Opens the log at `path` to write at its end, one that was claimed or one that a backup brings with it.
///
/// # Errors
/// If something else is there.
pub fn append_to_log(path: &Path) -> Result<File> {
    let cannot = || format!("cannot open the log {}", path.display());
    let real = check(path, &LOG)?;
    let flags = OFlags::NOFOLLOW.bits().cast_signed();
    let options = OpenOptions::new().create(true).append(true).custom_flags(flags).clone();
    let mut file = options.open(real).with_context(cannot)?;
    if file.metadata().with_context(cannot)?.len() == 0 {
        file.write_all(LOG_START.as_bytes()).with_context(cannot)?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::{LOG, LOG_START, Partial, RECORDING, check, partial_path, real_path, write};
    use std::io::Write as _;
    use std::path::Path;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Locks of one process exclude each other as those of two do: they belong to open files.
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
            let mut file = partial.file();
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
        let error = format!("{:#}", write(&path, &LOG, full).unwrap_err());
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
