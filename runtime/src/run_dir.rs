//! The run directory and the registry of runs: the live runs, and those with remains.
//!
//! A run registers before it creates anything else and signs off after it has removed everything else. Its entry
//! is a file in /dev/shm that the launcher holds locked for its life. The kernel gives the lock back when the
//! launcher dies, in any way: so a process that can get the lock knows that the run is dead.

use crate::file_lock;
use crate::host::EXITED;
use anyhow::{Context, bail};
pub(crate) use bus::names::SHARED_MEMORY;
use bus::names::shm_prefix;
use bus::process::user_id;
use bus::user_file;
use diagnostics::{ComponentFailure, Error};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{File, Metadata};
use std::io::{Read as _, Write as _};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Largest size of an entry; more than any entry has: two paths and a few numbers.
const ENTRY_BYTES_MAX: u64 = 64 << 10;

/// Files that are kept open for the removal of a run directory: one for each folder in a folder, and one for a list.
const SPARE_FILES: usize = 8;
/// With less than this free, errors mention the folder for temporary files: a file that did not fit may have been
/// removed by then.
const FULL_BYTES: u64 = 256 << 10;
/// Words of the system for a lack of room: `ENOSPC` and `EDQUOT`.
const NO_ROOM: [&str; 2] = ["No space left on device", "Disk quota exceeded"];
/// Words of a process that ended for another reason than a lack of room.
const OTHER_REASONS: [&str; 3] = [" failed at tick ", " computed tick ", "panicked at"];

/// Entry of a run: its description of itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Entry {
    /// The run's name, unique on this machine.
    pub run_id: String,
    /// Its run directory.
    pub run_dir: PathBuf,
    /// The manifest that it flies.
    pub manifest: PathBuf,
    /// The process number of its launcher.
    pub launcher: u32,
    /// The folder in which it was started.
    #[serde(default)]
    pub folder: PathBuf,
    /// The number of the terminal on which it was started; `None` if it has none.
    #[serde(default)]
    pub terminal: Option<u32>,
    /// True for a flight that a longer command flies for itself, such as one of `identify`.
    #[serde(default)]
    pub is_part: bool,
}

impl Entry {
    /// Entry of a new run of `manifest`.
    fn new(manifest: &Path) -> anyhow::Result<Self> {
        Self::named(manifest, format!("{:x}-{:x}", std::process::id(), new_run_number()))
    }

    /// Entry of a new run of `manifest` that is called `run_id`.
    fn named(manifest: &Path, run_id: String) -> anyhow::Result<Self> {
        let run_dir = new_run_dir(&run_id)?;
        let (manifest, launcher) = (manifest.to_owned(), std::process::id());
        let folder = std::env::current_dir().unwrap_or_default();
        Ok(Self { run_id, run_dir, manifest, launcher, folder, terminal: terminal(), is_part: false })
    }

    /// Entry of run `run_id` in `file`; `None` for any other content.
    pub(crate) fn read(run_id: &str, file: &File) -> Option<Self> {
        let mut text = String::new();
        file.take(ENTRY_BYTES_MAX).read_to_string(&mut text).ok()?;
        let entry: Self = serde_json::from_str(&text).ok()?;
        (entry.run_id == run_id && is_run_dir_of(&entry.run_dir, run_id)).then_some(entry)
    }
}

/// Number of the terminal of this process; `None` if it has none.
fn terminal() -> Option<u32> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name of the program, in brackets, may hold spaces. Behind it: state, parent, group, session, terminal.
    let (_, fields) = stat.rsplit_once(')')?;
    let number: i32 = fields.split_whitespace().nth(4)?.parse().ok()?;
    (number != 0).then_some(number.cast_unsigned())
}

/// The monotonic time, in ns; later than any that this process has given out, though a clock may stand still between
/// two runs that begin together.
fn new_run_number() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    let now = bus::host_time::monotonic_ns();
    let next = |last: u64| now.max(last + 1);
    LAST.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |last| Some(next(last))).map_or(now, next)
}

/// The folders in which runs have their directories: that for temporary files, or else the first of the others that is
/// there. `TMPDIR` may be a path that iceoryx2 does not take.
pub(crate) fn folders() -> Vec<PathBuf> {
    let stated = std::env::var_os("TMPDIR").filter(|path| !path.is_empty()).map(PathBuf::from);
    let session = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|path| path.is_absolute());
    let all = stated.into_iter().chain(["/tmp".into()]).chain(session).chain([SHARED_MEMORY.into()]);
    all.filter_map(|path: PathBuf| std::path::absolute(path).ok()).collect()
}

/// Path for the directory of run `run_id`. It is one level below the folder: a level shared by runs could vanish with
/// another run that ends.
fn new_run_dir(run_id: &str) -> anyhow::Result<PathBuf> {
    let folders = folders();
    let mut paths = folders.iter().map(|folder| folder.join(dir_name(run_id))).enumerate();
    // The first folder is taken even if it cannot be written to: creating the directory then reports the fault.
    let is_usable = |(index, path): &(usize, PathBuf)| {
        bus::takes_run_dir(path, run_id) && (*index == 0 || may_create(path))
    };
    paths.find(is_usable).map(|(_, path)| path).with_context(|| {
        format!(
            "no folder for the run directory: none of {folders:?} is there, may be written to and is short"
        )
    })
}

fn may_create(path: &Path) -> bool {
    use rustix::fs::{Access, access};
    path.parent().is_some_and(|folder| access(folder, Access::WRITE_OK | Access::EXEC_OK).is_ok())
}

/// Files of a run; dropping it removes them, the run's shared memory, and its entry.
#[derive(Debug)]
pub(crate) struct RunDir {
    entry: Entry,
    /// The entry and the directory, locked until the process ends.
    _locks: [File; 2],
    /// Files kept open so that there is a descriptor for listing the remains, however many files this process may
    /// open.
    spare: Vec<File>,
    is_removed: bool,
}

impl RunDir {
    /// Registers a new run of `manifest`, which `is_part` of a longer command or not, and creates its directory, open to this user
    /// alone.
    ///
    /// # Errors
    /// If shared memory or the folder for temporary files cannot be written to.
    pub fn create(manifest: &Path, is_part: bool) -> Result<Self, Error> {
        Ok(Self::create_by(manifest, |manifest| Ok(Entry { is_part, ..Entry::new(manifest)? }))?)
    }

    /// Registers a run that goes on under its old name, `run_id`, after its files were removed; creates its
    /// directory.
    ///
    /// # Errors
    /// As [`RunDir::create`].
    pub fn create_again(manifest: &Path, run_id: &str, is_part: bool) -> Result<Self, Error> {
        let new = |manifest: &Path| Ok(Entry { is_part, ..Entry::named(manifest, run_id.to_owned())? });
        Ok(Self::create_by(manifest, new)?)
    }

    fn create_by(manifest: &Path, new: impl Fn(&Path) -> anyhow::Result<Entry>) -> anyhow::Result<Self> {
        let manifest = std::path::absolute(manifest)?;
        let (entry, registered) = loop {
            let entry = new(&manifest)?;
            let registered =
                register(&entry).with_context(|| format!("cannot register in {SHARED_MEMORY}"))?;
            if let Some(file) = registered {
                break (entry, file);
            }
        };
        let directory = create_locked(&entry.run_dir)
            .inspect_err(|_| drop(std::fs::remove_file(entry_path(&entry.run_id))))
            .with_context(|| {
                format!(
                    "cannot create the run directory {}; set TMPDIR to a folder that is there and that this user may \
                     write to, or leave it out",
                    entry.run_dir.display()
                )
            })?;
        let spare = (0..SPARE_FILES).map(|_| File::open("/dev/null")).collect::<std::io::Result<_>>();
        let mut run_dir =
            Self { entry, _locks: [registered, directory], spare: Vec::new(), is_removed: false };
        run_dir.spare = spare.context(
            "cannot open as many files as a run needs; raise the limit of this process (`ulimit -n`), 1024 is usual",
        )?;
        Ok(run_dir)
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        &self.entry.run_dir
    }

    /// The run's name, unique on this machine.
    pub fn run_id(&self) -> &str {
        &self.entry.run_id
    }
}

impl RunDir {
    /// Adds to an error that may come from lack of room that the folder of the run directory has no room left, if so.
    pub(crate) fn blame_room(&self, error: anyhow::Error) -> anyhow::Error {
        let Ok(found) = rustix::fs::statvfs(self.path()) else { return error };
        let free = found.f_bavail.saturating_mul(found.f_frsize);
        with_room(error.into(), self.path().parent().unwrap_or(self.path()), free).into()
    }

    /// Removes everything; returns the failures, each as a sentence.
    pub fn remove(mut self) -> Vec<String> {
        self.clear()
    }

    fn clear(&mut self) -> Vec<String> {
        self.is_removed = true;
        self.spare.clear();
        let told = |path: &Path, removed: std::io::Result<()>| match removed {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Some(format!(
                "cannot remove {}, which the run has left: {error}; `hummingbus clean` removes it once that is possible",
                path.display()
            )),
            _ => None,
        };
        let directory = told(self.path(), std::fs::remove_dir_all(self.path()));
        // The entry last: a file without an entry belongs to no run.
        let files = shared_memory_of(self.run_id()).into_iter().chain([entry_path(self.run_id())]);
        directory
            .into_iter()
            .chain(files.filter_map(|path| told(&path, std::fs::remove_file(&path))))
            .collect()
    }
}

/// Returns `error` with the room in `folder`, if that has few bytes `free` and the error may come from it.
fn with_room(error: Error, folder: &Path, free: u64) -> Error {
    if free >= FULL_BYTES || !may_lack_room(&error) {
        return error;
    }
    let text = format!(
        "{}\nThe folder for temporary files, {}, has {free} bytes free; make room there, or set TMPDIR to another folder",
        error.with_causes(),
        folder.display()
    );
    let full = std::io::Error::new(std::io::ErrorKind::StorageFull, text);
    if error.is_component() { ComponentFailure::new(error.process(), full).into() } else { full.into() }
}

/// True if the system says so, or if a process has ended by itself without another reason: its own words go to the same
/// folder, and iceoryx2 has no word for a lack of room.
fn may_lack_room(error: &Error) -> bool {
    let text = error.with_causes();
    let is_unexplained = || {
        let is_explained = OTHER_REASONS.iter().any(|&reason| text.contains(reason));
        error.is_component() && text.contains(EXITED) && !is_explained
    };
    NO_ROOM.iter().any(|&words| text.contains(words)) || is_unexplained()
}

impl Drop for RunDir {
    fn drop(&mut self) {
        if !self.is_removed {
            self.clear();
        }
    }
}

/// A folder for a command that flies several runs, one after another; dropping it removes it. It is named and locked as
/// a run directory is, so that `clean` removes it once its process is dead, and not before.
///
/// ```
/// let scratch = runtime::run_dir::Scratch::create()?;
/// let path = scratch.path().to_owned();
/// assert!(path.is_dir());
/// drop(scratch);
/// assert!(!path.exists());
/// # Ok::<(), runtime::Error>(())
/// ```
#[derive(Debug)]
pub struct Scratch {
    path: PathBuf,
    _lock: File,
}

impl Scratch {
    /// Creates the folder, open to this user alone.
    ///
    /// # Errors
    /// If the folder for temporary files cannot be written to.
    pub fn create() -> Result<Self, Error> {
        let path = Entry::new(Path::new(""))?.run_dir;
        let lock = create_locked(&path).with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self { path, _lock: lock })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.path);
    }
}

/// The name of the directory of run `run_id`.
fn dir_name(run_id: &str) -> String {
    format!("hummingbus-{}-{run_id}", user_id())
}

/// The run whose directory has this name; `None` for anything else, and for runs of other users.
pub(crate) fn run_of_dir(name: &str) -> Option<&str> {
    let run_id = name.strip_prefix("hummingbus-")?.strip_prefix(&user_id().to_string())?;
    run_id.strip_prefix('-').filter(|run_id| is_run_id(run_id))
}

/// The run to which a shared-memory file of this name belongs; `None` for anything else.
pub(crate) fn run_of_shared_memory(name: &str) -> Option<&str> {
    name.strip_prefix("hb_")?.split_once('_').map(|(run_id, _)| run_id).filter(|run_id| is_run_id(run_id))
}

fn is_run_id(text: &str) -> bool {
    let is_hex = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    text.split_once('-').is_some_and(|(launcher, time)| is_hex(launcher) && is_hex(time))
}

/// Path of the entry of run `run_id`.
pub(crate) fn entry_path(run_id: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{}run", shm_prefix(run_id)))
}

/// True if this is a path to a directory with the name that run `run_id` gives its own.
pub(crate) fn is_run_dir_of(path: &Path, run_id: &str) -> bool {
    path.is_absolute() && path.file_name().and_then(OsStr::to_str).and_then(run_of_dir) == Some(run_id)
}

/// True if `path` is a directory of this user, and not a link to one.
pub(crate) fn is_own_run_dir(path: &Path) -> bool {
    own(path).is_some_and(|found| found.is_dir())
}

/// True if `path` exists, belongs to this user, and is not a folder: runs have no folders in shared memory.
pub(crate) fn is_own_name(path: &Path) -> bool {
    own(path).is_some_and(|found| !found.is_dir())
}

/// Metadata of `path` itself, without following a link, if it belongs to this user.
fn own(path: &Path) -> Option<Metadata> {
    path.symlink_metadata().ok().filter(|found| found.uid() == user_id())
}

/// Every shared-memory file of run `run_id` but its entry.
pub(crate) fn shared_memory_of(run_id: &str) -> Vec<PathBuf> {
    let (prefix, entry) = (shm_prefix(run_id), entry_path(run_id));
    let files = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let belongs = |file: &std::fs::DirEntry| file.file_name().to_string_lossy().starts_with(&prefix);
    let paths = files.filter(belongs).map(|file| file.path());
    paths.filter(|path| *path != entry && is_own_name(path)).collect()
}

/// Writes `entry` and locks it. `None` if `clean` met the file before it was locked, and has removed it: then the
/// run needs another name, so that a name that was once dead is so for ever.
fn register(entry: &Entry) -> anyhow::Result<Option<File>> {
    let mut options = std::fs::OpenOptions::new();
    options.read(true).write(true).create_new(true).mode(0o600);
    let path = entry_path(&entry.run_id);
    let text = serde_json::to_vec(entry)?;
    let file = options.open(&path)?;
    Ok(lock_and_write(file, &text).inspect_err(|_| drop(std::fs::remove_file(path)))?)
}

fn lock_and_write(mut file: File, text: &[u8]) -> std::io::Result<Option<File>> {
    // Waits while `clean` has the lock.
    file_lock::exclusive(&file)?;
    if file.metadata()?.nlink() == 0 {
        return Ok(None);
    }
    // Even if the umask would take them away.
    file.set_permissions(std::fs::Permissions::from_mode(0o600))?;
    file.write_all(text)?;
    Ok(Some(file))
}

/// Creates the run directory and locks it as well: where two containers share the folder for temporary files but
/// not /dev/shm, neither sees the other's entries.
fn create_locked(run_dir: &Path) -> std::io::Result<File> {
    std::fs::DirBuilder::new().mode(0o700).create(run_dir)?;
    // Even if the umask would take them away.
    let opened = std::fs::set_permissions(run_dir, std::fs::Permissions::from_mode(0o700))
        .and_then(|()| user_file::open_folder(run_dir));
    opened
        .and_then(|directory| file_lock::exclusive(&directory).map(|()| directory))
        .inspect_err(|_| drop(std::fs::remove_dir(run_dir)))
}

/// True if the launcher that locked `entry` lives. The test does not disturb other processes that test it.
fn is_locked(entry: &File) -> bool {
    let is_free = file_lock::try_shared(entry).unwrap_or(false);
    if is_free {
        let _ = entry.unlock();
    }
    !is_free
}

/// Claims the remains of run `run_id`, with the existing ones of `run_dirs`, by locking them. `None` if the run is
/// alive. While the locks are held, no launcher can take up the run's entry.
///
/// Without an entry no process of the run uses this /dev/shm: the entry is made before everything else, and removed
/// after.
pub(crate) fn try_claim(run_id: &str, run_dirs: &BTreeSet<PathBuf>) -> Option<Vec<File>> {
    let (mut locks, entry) = (Vec::new(), entry_path(run_id));
    let opened = std::iter::once(open_own(&entry, user_file::open(&entry, false)));
    let opened = opened.chain(run_dirs.iter().map(|path| open_own(path, user_file::open_folder(path))));
    for file in opened {
        if let Some(file) = file.ok()? {
            file_lock::try_shared(&file).ok()?.then(|| locks.push(file))?;
        }
    }
    Some(locks)
}

/// The file opened at `path`. `None` if there is none, or if no run of this user has made it: no lock can be on it.
fn open_own(path: &Path, opened: std::io::Result<File>) -> std::io::Result<Option<File>> {
    match opened {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(_) if !own(path).is_some_and(|found| found.is_dir() || found.is_file()) => Ok(None),
        Err(error) => Err(error),
    }
}

/// A run that was alive when it was found.
///
/// ```
/// if let Ok(run) = runtime::run_dir::find_live(None) {
///     println!("{} flies {}", run.entry.run_id, run.entry.manifest.display());
/// }
/// assert!(runtime::run_dir::find_live(Some("0-0")).is_err(), "no run is called so");
/// ```
#[derive(Debug)]
pub struct LiveRun {
    /// Its entry.
    pub entry: Entry,
    file: File,
}

impl LiveRun {
    /// True if its launcher still lives.
    pub fn is_live(&self) -> bool {
        is_locked(&self.file)
    }
}

/// The live runs of this user, oldest first where process numbers do not wrap.
pub(crate) fn live_runs() -> Vec<LiveRun> {
    let files = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let mut runs: Vec<LiveRun> = files.filter_map(|file| live_run(&file.path())).collect();
    runs.sort_by(|a, b| a.entry.run_id.cmp(&b.entry.run_id));
    runs
}

fn live_run(path: &Path) -> Option<LiveRun> {
    let run_id = run_of_shared_memory(path.file_name()?.to_str()?)?;
    if path != entry_path(run_id) {
        return None;
    }
    let file = user_file::open(path, false).ok()?;
    // A run that is registering has an empty entry, and is not up yet.
    let entry = Entry::read(run_id, &file)?;
    Some(LiveRun { entry, file }).filter(LiveRun::is_live)
}

/// Folder and terminal in which a command was started.
struct Here {
    folder: PathBuf,
    terminal: Option<u32>,
}

impl Here {
    fn of_this_process() -> Self {
        Self { folder: std::env::current_dir().unwrap_or_default(), terminal: terminal() }
    }

    /// True if the run of `entry` was started here, too.
    fn has(&self, entry: &Entry) -> bool {
        entry.folder == self.folder && entry.terminal == self.terminal
    }
}

/// True if a run is alive that was started in this folder and on this terminal, and is no part of a longer command.
///
/// ```
/// assert!(!runtime::run_dir::is_own_alive(), "this process flies none");
/// ```
#[must_use]
pub fn is_own_alive() -> bool {
    let here = Here::of_this_process();
    live_runs().iter().any(|run| !run.entry.is_part && here.has(&run.entry))
}

/// The live run named `run_id`. Without a name, the only one, or of several the only one that was started in this folder and on
/// this terminal. Parts of longer commands, such as the flights of `identify`, are found without a name only if no other run is alive.
///
/// # Errors
/// If there is no such run, or several to choose from; the error lists the live runs.
pub fn find_live(run_id: Option<&str>) -> Result<LiveRun, Error> {
    Ok(choose(live_runs(), run_id, &Here::of_this_process())?)
}

/// The live run that a command is to change, as [`find_live`] finds it. Without a name, it must have been started in this folder and
/// on this terminal.
///
/// # Errors
/// As [`find_live`], or if the only run was started elsewhere: it may be a long flight of another person.
pub fn find_own(run_id: Option<&str>) -> Result<LiveRun, Error> {
    let run = find_live(run_id)?;
    if run_id.is_none() {
        require_here(&run.entry, &Here::of_this_process())?;
    }
    Ok(run)
}

fn require_here(entry: &Entry, here: &Here) -> anyhow::Result<()> {
    if here.has(entry) {
        return Ok(());
    }
    let elsewhere = if entry.folder == here.folder {
        "on another terminal".to_owned()
    } else {
        format!("in another folder, {}", entry.folder.display())
    };
    let Entry { run_id, manifest, .. } = entry;
    bail!(
        "the run that is alive, of {}, was started {elsewhere}; if it is meant, say so with --run {run_id}",
        manifest.display()
    )
}

/// The run that the process `launcher` flies; the first one, if it flies several.
///
/// ```
/// assert!(runtime::run_dir::run_of_launcher(std::process::id()).is_none(), "this process flies none");
/// ```
#[must_use]
pub fn run_of_launcher(launcher: u32) -> Option<LiveRun> {
    live_runs().into_iter().find(|run| run.entry.launcher == launcher)
}

fn choose(mut runs: Vec<LiveRun>, run_id: Option<&str>, here: &Here) -> anyhow::Result<LiveRun> {
    if run_id.is_none() && runs.iter().any(|run| !run.entry.is_part) {
        runs.retain(|run| !run.entry.is_part);
    }
    let is_own = |run: &LiveRun| run_id.is_none() && here.has(&run.entry);
    if runs.iter().filter(|run| is_own(run)).count() == 1 {
        runs.retain(is_own);
    }
    let is_chosen = |run: &LiveRun| run_id.is_none_or(|run_id| run.entry.run_id == run_id);
    let index = runs.iter().position(is_chosen);
    match (index, run_id, runs.len()) {
        (_, _, 0) => bail!("no run of this user is alive; `hummingbus run MANIFEST` starts one"),
        (Some(index), Some(_), _) | (Some(index), None, 1) => Ok(runs.swap_remove(index)),
        (_, None, count) => {
            let is_any_own = runs.iter().any(|run| here.has(&run.entry));
            let none =
                if is_any_own { "" } else { ", none of them started in this folder and on this terminal" };
            bail!("{count} runs are alive{none}; choose one with --run:{}", listed(&runs))
        }
        (None, Some(run_id), _) => bail!("no run `{run_id}` is alive; there are:{}", listed(&runs)),
    }
}

fn listed(runs: &[LiveRun]) -> String {
    let line = |LiveRun { entry: Entry { run_id, manifest, launcher, .. }, .. }: &LiveRun| {
        format!("\n  {run_id}  {}  (launcher {launcher})", manifest.display())
    };
    runs.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::{
        Entry, Here, LiveRun, choose, dir_name, entry_path, is_run_id, register, require_here, run_of_dir,
        run_of_shared_memory, try_claim, with_room,
    };
    use diagnostics::{ComponentFailure, Diagnostic, Error};
    use std::collections::BTreeSet;
    use std::path::Path;
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicBool, Ordering};

    fn runs(names: &[&str]) -> Vec<LiveRun> {
        let run = |name: &&str| {
            let run_id = (*name).to_owned();
            let (run_dir, manifest, folder) = ("/t".into(), "/m.toml".into(), "/f".into());
            let (launcher, terminal, is_part) = (1, Some(7), false);
            let entry = Entry { run_id, run_dir, manifest, launcher, folder, terminal, is_part };
            LiveRun { entry, file: tempfile::tempfile().unwrap() }
        };
        names.iter().map(run).collect()
    }

    #[test]
    fn lack_of_room_is_blamed_where_it_can_be_the_reason() {
        let of_process = |text: &str| Error::from(ComponentFailure::new(Some("imu"), text));
        let with_free = |error: Error, free| with_room(error, Path::new("/tmp"), free);
        let full = || Error::from(std::io::Error::from(rustix::io::Errno::NOSPC));
        let silent = || of_process("process `imu` ended with exit code 2");
        for (error, is_component) in [(full(), false), (silent(), true)] {
            let text = error.with_causes();
            let blamed = with_free(error, 4096);
            assert_eq!((blamed.is_component(), blamed.is_system()), (is_component, !is_component));
            assert_eq!(blamed.process(), is_component.then_some("imu"));
            let expected = format!(
                "{text}\nThe folder for temporary files, /tmp, has 4096 bytes free; make room there, or set TMPDIR to another folder"
            );
            assert_eq!(blamed.with_causes(), expected);
        }
        for (error, free) in [
            (full(), 1 << 30),
            (silent(), 1 << 30),
            (
                of_process(
                    "process `imu` ended with exit code 2\n  error: node `imu` failed at tick 7 (t = 0.07 s): stuck",
                ),
                0,
            ),
            (of_process("process `imu` failed: it panicked: the propeller came off"), 0),
            (of_process("process `imu` was killed by signal 9 (SIGKILL)"), 0),
            (Diagnostic::in_file("a.toml", "no rotors").into(), 0),
        ] {
            let (text, is_input) = (error.with_causes(), error.is_input());
            let same = with_free(error, free);
            assert_eq!((same.with_causes(), same.is_input()), (text, is_input));
        }
    }

    #[test]
    fn a_cause_that_the_message_contains_is_told_once_beside_the_room() {
        let source = std::io::Error::from(rustix::io::Errno::NOSPC);
        let error = bus::BusError::File { action: "write", path: "/tmp/inputs".into(), source };
        let blamed = with_room(error.into(), Path::new("/tmp"), 0).with_causes();
        assert_eq!(blamed.matches("No space left on device").count(), 1, "{blamed}");
    }

    #[test]
    fn no_number_of_a_run_is_given_out_twice() {
        let take = || (0..10_000).map(|_| super::new_run_number()).collect::<Vec<_>>();
        let mut numbers = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(take)).collect();
            threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect::<Vec<_>>()
        });
        numbers.sort_unstable();
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn a_run_of_another_folder_or_terminal_is_changed_by_its_name_alone() {
        let run = runs(&["1-a"]).remove(0);
        let here = |folder: &str, terminal| {
            let here = Here { folder: folder.into(), terminal };
            require_here(&run.entry, &here).map_err(|error| error.to_string())
        };
        assert_eq!(here("/f", Some(7)), Ok(()));
        let error = here("/g", Some(7)).unwrap_err();
        assert!(error.contains("another folder, /f") && error.contains("--run 1-a"), "{error}");
        let error = here("/f", None).unwrap_err();
        assert!(error.contains("another terminal") && error.contains("/m.toml"), "{error}");
    }

    #[test]
    fn the_only_run_is_the_default_and_several_are_listed() {
        let elsewhere = Here { folder: "/g".into(), terminal: Some(7) };
        let chosen =
            |names: &[&str], run_id| choose(runs(names), run_id, &elsewhere).map(|run| run.entry.run_id);
        assert_eq!(chosen(&["1-a"], None).unwrap(), "1-a");
        assert_eq!(chosen(&["1-a", "2-b"], Some("2-b")).unwrap(), "2-b");
        let message = |names: &[&str], run_id| chosen(names, run_id).unwrap_err().to_string();
        assert!(message(&[], Some("1-a")).contains("no run of this user is alive"));
        for text in [message(&["1-a", "2-b"], None), message(&["1-a", "2-b"], Some("3-c"))] {
            assert!(text.contains("\n  1-a  /m.toml  (launcher 1)\n  2-b  /m.toml"), "{text}");
        }
    }

    #[test]
    fn of_several_runs_the_only_one_that_was_started_here_is_the_default() {
        let chosen = |own: &[usize], run_id| {
            let mut runs = runs(&["1-a", "2-b", "3-c"]);
            own.iter().for_each(|index| runs[*index].entry.folder = "/here".into());
            let here = Here { folder: "/here".into(), terminal: Some(7) };
            choose(runs, run_id, &here).map(|run| run.entry.run_id)
        };
        assert_eq!(chosen(&[1], None).unwrap(), "2-b");
        assert_eq!(chosen(&[1], Some("3-c")).unwrap(), "3-c");
        assert!(chosen(&[1, 2], None).unwrap_err().to_string().contains("3 runs are alive"));
        let foreign = chosen(&[], None).unwrap_err().to_string();
        assert!(foreign.contains("none of them started in this folder"), "{foreign}");
    }

    #[test]
    fn a_flight_of_a_longer_command_is_the_default_only_if_it_is_alone() {
        let here = Here { folder: "/f".into(), terminal: Some(7) };
        let chosen = |names: &[&str], run_id| {
            let mut runs = runs(names);
            runs[0].entry.is_part = true;
            choose(runs, run_id, &here).map(|run| run.entry.run_id)
        };
        assert_eq!(chosen(&["1-a", "2-b"], None).unwrap(), "2-b");
        assert_eq!(chosen(&["1-a", "2-b"], Some("1-a")).unwrap(), "1-a");
        assert_eq!(chosen(&["1-a"], None).unwrap(), "1-a");
        let error = chosen(&["1-a", "2-b", "3-c"], None).unwrap_err().to_string();
        assert!(error.contains("2 runs are alive") && !error.contains("1-a"), "{error}");
    }

    #[test]
    fn a_run_that_has_registered_is_never_cleaned_whenever_clean_looked() {
        let name = Mutex::new(String::new());
        let clean = || {
            let run_id = name.lock().unwrap().clone();
            let path = entry_path(&run_id);
            // Of a run that was there when `clean` looked around.
            if path.exists()
                && let Some(_claim) = try_claim(&run_id, &BTreeSet::new())
            {
                let _ = std::fs::remove_file(&path);
            }
        };
        let (is_over, mut kept, mut removed, mut lost) = (AtomicBool::new(false), 0, 0, 0);
        std::thread::scope(|scope| {
            (0..2).for_each(|_| {
                drop(scope.spawn(|| {
                    while !is_over.load(Ordering::Relaxed) {
                        clean()
                    }
                }))
            });
            for _ in 0..20_000 {
                let entry = Entry::new(Path::new("/m.toml")).unwrap();
                name.lock().unwrap().clone_from(&entry.run_id);
                match register(&entry) {
                    Ok(Some(_lock)) => match std::fs::remove_file(entry_path(&entry.run_id)) {
                        Ok(()) => kept += 1,
                        Err(_) => lost += 1,
                    },
                    _ => removed += 1,
                }
            }
            is_over.store(true, Ordering::Relaxed);
        });
        assert!(lost == 0 && kept > 0, "{lost} lost, {kept} kept, {removed} removed before they were locked");
    }

    #[test]
    fn names_that_are_not_of_runs_are_left_alone() {
        assert_eq!(run_of_dir(&dir_name("1f-2e")), Some("1f-2e"));
        assert_eq!(run_of_shared_memory("hb_1f-2e_control"), Some("1f-2e"));
        for name in ["hb_control-1f-2e_control", "hb_1f_control", "hb_1f-2e", "hb_-_x", "hb_..-1_x", "sem.hb"]
        {
            assert_eq!(run_of_shared_memory(name), None, "{name}");
        }
        for name in ["hummingbus-x-1f-2e", "hummingbus-", "hummingbus", "hummingbus-0-1f-2e/.."] {
            assert_eq!(run_of_dir(name), None, "{name}");
        }
        assert!(!is_run_id("-") && !is_run_id("1f-") && is_run_id("1f-2e"));
    }
}
