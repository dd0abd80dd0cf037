//! A firmware's process: it has a folder of its own, which goes with it, and a log, whose end explains its end.

use bus::process::{RUN_VARIABLE, die_with_this_one};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// Lines of the log that an error quotes.
const QUOTED_LINES: usize = 8;
/// Looks at a process that is to end, so far apart.
const NAP: Duration = Duration::from_millis(5);
/// A file that was just written may be busy until another thread's child has left it.
const STARTS_MAX: usize = 50;

/// Folder of a firmware: its program, its files, its log.
#[derive(Debug)]
pub struct Scratch {
    folder: TempDir,
    name: &'static str,
}

impl Scratch {
    /// A new folder in that of the run, or where temporary files are.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn new(name: &'static str) -> Result<Self, String> {
        let parent = std::env::var_os(RUN_VARIABLE).map_or_else(std::env::temp_dir, PathBuf::from);
        let made = tempfile::Builder::new().prefix(&format!("{name}-")).tempdir_in(&parent);
        let folder =
            made.map_err(|error| format!("no folder for {name} in {}: {error}", parent.display()))?;
        Ok(Self { folder, name })
    }

    /// Writes the file `name`, executable for this user.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, String> {
        let path = self.folder.path().join(name);
        let written = fs::write(&path, bytes)
            .and_then(|()| fs::set_permissions(&path, fs::Permissions::from_mode(0o700)));
        written.map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        Ok(path)
    }

    /// Makes the folder `name`.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn add_folder(&self, name: &str) -> Result<PathBuf, String> {
        let path = self.folder.path().join(name);
        fs::create_dir(&path).map_err(|error| format!("cannot make {}: {error}", path.display()))?;
        Ok(path)
    }

    /// Links the file `name` to `to`.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn link(&self, name: &OsStr, to: &Path) -> Result<(), String> {
        let path = self.folder.path().join(name);
        symlink(to, &path).map_err(|error| format!("cannot link {}: {error}", path.display()))
    }

    /// The program `path` of this folder, which runs in it with nothing of this process's environment.
    ///
    /// # Errors
    /// Its log cannot be written.
    pub fn command(&self, path: &Path) -> Result<Command, String> {
        let log = File::create(self.log()).and_then(|log| Ok([log.try_clone()?, log]));
        let [output, error] =
            log.map_err(|error| format!("cannot write {}: {error}", self.log().display()))?;
        let mut command = Command::new(path);
        command.current_dir(&self.folder).env_clear().stdin(Stdio::null()).stdout(output).stderr(error);
        // A firmware that waits for an answer does not notice that nobody is left to give it.
        die_with_this_one(&mut command);
        Ok(command)
    }

    /// Its name in errors.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    /// Text that it has printed.
    fn printed(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.log()).unwrap_or_default()).into_owned()
    }

    /// The end of the log, for an error.
    fn quoted(&self) -> String {
        let text = self.printed();
        let lines: Vec<&str> = text.lines().collect();
        let last = &lines[lines.len().saturating_sub(QUOTED_LINES)..];
        if last.is_empty() {
            return format!("{} printed nothing", self.name);
        }
        format!("end of the log of {}:\n  {}", self.name, last.join("\n  "))
    }

    /// Runs `command` to its end; what it printed.
    ///
    /// # Errors
    /// It does not start, or not end within `limit`, or fails.
    pub fn run(&self, mut command: Command, limit: Duration) -> Result<String, String> {
        let mut child = self.start(&mut command)?;
        for _ in 0..limit.as_millis() / NAP.as_millis() {
            let ended =
                child.try_wait().map_err(|error| format!("cannot wait for {}: {error}", self.name))?;
            if let Some(status) = ended {
                let told = || format!("{}; {}", ended_with(self.name, status), self.quoted());
                return if status.success() { Ok(self.printed()) } else { Err(told()) };
            }
            std::thread::sleep(NAP);
        }
        let _ = child.kill().and_then(|()| child.wait());
        Err(format!("{} has not ended after {} s; {}", self.name, limit.as_secs(), self.quoted()))
    }

    fn start(&self, command: &mut Command) -> Result<Child, String> {
        let mut started = command.spawn();
        for _ in 0..STARTS_MAX {
            if !matches!(&started, Err(error) if error.kind() == io::ErrorKind::ExecutableFileBusy) {
                break;
            }
            std::thread::sleep(NAP);
            started = command.spawn();
        }
        started.map_err(|error| format!("{} does not start: {error}", self.name))
    }
}

/// "it ended with exit code 1", "it was killed by signal 11".
fn ended_with(name: &str, status: ExitStatus) -> String {
    match status.signal() {
        Some(signal) => format!("{name} was killed by signal {signal}"),
        None => format!("{name} ended with exit code {}", status.code().unwrap_or_default()),
    }
}

/// A firmware that runs, with its folder. It ends with this value.
#[derive(Debug)]
pub struct Firmware {
    scratch: Scratch,
    child: Child,
}

impl Firmware {
    /// Starts `command`.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(scratch: Scratch, mut command: Command) -> Result<Self, String> {
        let child = scratch.start(&mut command)?;
        Ok(Self { scratch, child })
    }

    /// Its end, with that of its log, if it has ended.
    pub fn ended(&mut self) -> Option<String> {
        let status = self.child.try_wait().ok().flatten()?;
        Some(self.complaint(&ended_with(self.scratch.name, status)))
    }

    /// The reason of a transfer that failed: the firmware's end, or else that it gave no answer for `limit`, or closed its socket.
    pub fn failed(&mut self, error: &io::Error, limit: Duration) -> String {
        if is_silence(error) {
            return self.ended().unwrap_or_else(|| self.silence(limit));
        }
        // Its end follows the end of its socket.
        for _ in 0..STARTS_MAX {
            if let Some(words) = self.ended() {
                return words;
            }
            std::thread::sleep(NAP);
        }
        self.complaint(&format!("{} runs and has closed its connection: {error}", self.scratch.name))
    }

    /// Text that it has printed.
    #[must_use]
    pub fn printed(&self) -> String {
        self.scratch.printed()
    }

    /// A firmware that runs and gave no answer for `limit`.
    #[must_use]
    pub fn silence(&self, limit: Duration) -> String {
        let (name, seconds) = (self.scratch.name, limit.as_secs_f64());
        self.complaint(&format!("{name} runs and gave no answer for {seconds} s"))
    }

    /// A failure of the firmware in `words`, with the end of its log.
    #[must_use]
    pub fn complaint(&self, words: &str) -> String {
        format!("{words}; {}", self.scratch.quoted())
    }
}

/// True if a transfer failed by the time that it took alone.
#[must_use]
pub fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
}

impl Drop for Firmware {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
