//! A firmware's process: it has a folder of its own, which goes with it, and a log, whose end explains its end.

use bus::process::RUN_VARIABLE;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
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
        Ok(command)
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

/// A firmware that runs, and the socket at its standard input. It ends with this value.
#[derive(Debug)]
pub struct Firmware {
    scratch: Scratch,
    child: Child,
    socket: UnixStream,
    limit: Duration,
}

impl Firmware {
    /// Starts `command`; each of its answers is waited for as long as `limit`.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(scratch: Scratch, mut command: Command, limit: Duration) -> Result<Self, String> {
        let name = scratch.name;
        let pair = UnixStream::pair().and_then(|(socket, other)| {
            socket.set_read_timeout(Some(limit))?;
            socket.set_write_timeout(Some(limit))?;
            Ok((socket, other))
        });
        let (socket, other) = pair.map_err(|error| format!("no socket to {name}: {error}"))?;
        let child = scratch.start(command.stdin(OwnedFd::from(other)))?;
        // The command holds the other end: without it, the end of the firmware ends the reading.
        drop(command);
        Ok(Self { scratch, child, socket, limit })
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    /// The firmware has ended, or takes nothing.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        let sent = self.socket.write_all(bytes);
        sent.map_err(|error| self.failed(&error))
    }

    /// Fills `bytes` with what the firmware answers.
    ///
    /// # Errors
    /// The firmware has ended, or does not answer.
    pub fn receive(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        let received = self.socket.read_exact(bytes);
        received.map_err(|error| self.failed(&error))
    }

    /// Reason of a failed transfer.
    fn failed(&mut self, error: &io::Error) -> String {
        let name = self.scratch.name;
        if !matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) {
            // Its end follows the end of its socket.
            for _ in 0..STARTS_MAX {
                if let Ok(Some(status)) = self.child.try_wait() {
                    return format!("{}; {}", ended_with(name, status), self.scratch.quoted());
                }
                std::thread::sleep(NAP);
            }
        }
        let seconds = self.limit.as_secs_f64();
        match self.child.try_wait() {
            Ok(Some(status)) => format!("{}; {}", ended_with(name, status), self.scratch.quoted()),
            _ => format!("{name} runs and gave no answer for {seconds} s; {}", self.scratch.quoted()),
        }
    }

    /// A failure of the firmware in `words`, with the end of its log.
    #[must_use]
    pub fn complaint(&self, words: &str) -> String {
        format!("{words}; {}", self.scratch.quoted())
    }
}

impl Drop for Firmware {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
