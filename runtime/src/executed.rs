//! The files that the commands of a run were first started from: a command opens its program itself, and a process that is started
//! later may get another one.

use crate::program::{Executable, Program};
use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::io::{self, Seek as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

/// The files by their paths, as they were at the first start.
#[derive(Debug, Default)]
pub struct Executed(BTreeMap<String, Version>);

/// A file, kept open: once another one takes its place, it can still be compared with that one.
#[derive(Debug)]
struct Version {
    file: File,
    state: State,
    /// SHA-256 of its bytes at the first start. Only of a file of at most [`DIGESTED_BYTES`].
    digest: Option<String>,
}

/// Device, number, length and time of the last writing. It tells versions apart without reading them.
type State = (u64, u64, u64, i64, i64);

/// Largest file that is read at its first start, in bytes. A larger one is seldom a script, and the kernel lets nobody write to another program
/// while a process executes it.
const DIGESTED_BYTES: u64 = 4 * 1024 * 1024;

/// A program, compared with the one that was first started.
#[derive(Debug, PartialEq)]
enum Comparison {
    Same,
    Changed,
    /// The bytes of the first one are gone, or could not be read.
    Unknown,
}

fn state(of: &Metadata) -> State {
    (of.dev(), of.ino(), of.len(), of.mtime(), of.mtime_nsec())
}

impl Version {
    /// The file at `path`; `None` if it is not a regular file, or cannot be read.
    fn at(path: &Path) -> Option<Self> {
        // To open a pipe waits for its other end.
        path.metadata().ok().filter(Metadata::is_file)?;
        let file = File::open(path).ok()?;
        let state = state(&file.metadata().ok()?);
        Some(Self { file, state, digest: None })
    }

    /// The same version, which can be compared after other bytes were written to its file.
    fn digested(mut self) -> Self {
        if self.bytes() <= DIGESTED_BYTES {
            self.digest = self.sha256().ok().flatten();
        }
        self
    }

    fn bytes(&self) -> u64 {
        self.state.2
    }

    /// SHA-256 of its bytes; `None` if it has been written to since.
    fn sha256(&self) -> io::Result<Option<String>> {
        if self.digest.is_some() {
            return Ok(self.digest.clone());
        }
        (&self.file).rewind()?;
        let digest = inputs::sha256_of(&self.file)?;
        Ok((state(&self.file.metadata()?) == self.state).then_some(digest))
    }

    /// Compares `found` with this one. The bytes are read only where the files differ by their states alone.
    fn compare(&self, found: &Self) -> Comparison {
        if self.state == found.state {
            return Comparison::Same;
        }
        if self.bytes() != found.bytes() {
            return Comparison::Changed;
        }
        match (self.sha256(), found.sha256()) {
            (Ok(Some(first)), Ok(Some(found))) if first == found => Comparison::Same,
            (Ok(Some(_)), Ok(Some(_))) => Comparison::Changed,
            _ => Comparison::Unknown,
        }
    }
}

impl Executed {
    /// Notes the program that process `name` is about to execute. Returns a warning if it is another one than at its first start, or may be.
    pub fn note(&mut self, name: &str, program: &Program) -> Option<String> {
        let Executable::Command(words) = &program.executable else { return None };
        let path = words.first()?;
        let found = Version::at(path.as_ref())?;
        let Some(first) = self.0.get(path) else {
            self.0.insert(path.clone(), found.digested());
            return None;
        };
        let what = match first.compare(&found) {
            Comparison::Same => return None,
            Comparison::Changed => "has changed since the run first started it",
            Comparison::Unknown => "was written again since the run first started it, and may have changed",
        };
        Some(format!("warning: process `{name}`: {path} {what}; the process is started from the new file"))
    }
}

#[cfg(test)]
mod tests {
    use super::{DIGESTED_BYTES, Executable, Executed, Program};
    use std::fs::{self, File};
    use std::time::{Duration, SystemTime};

    #[test]
    fn another_program_at_the_same_path_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node");
        let words = vec![path.to_string_lossy().into_owned(), "--fast".to_owned()];
        let program = Program { executable: Executable::Command(words), ..Program::unknown() };
        let mut executed = Executed::default();
        let mut is_told = || executed.note("imu", &program).is_some();
        assert!(!is_told(), "it is missing, which the start tells");
        fs::write(&path, "old").unwrap();
        assert!(!is_told() && !is_told());
        // Built again from the same sources.
        let built = folder.path().join("built");
        let replace = |content: &str| {
            fs::write(&built, content).unwrap();
            fs::rename(&built, &path).unwrap();
        };
        replace("old");
        assert!(!is_told());
        replace("new");
        assert!(is_told() && is_told(), "each process is told");
        replace("old");
        assert!(!is_told());
        fs::write(&path, "written in place").unwrap();
        assert!(is_told());
    }

    #[test]
    fn a_program_that_is_written_in_place_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node").to_string_lossy().into_owned();
        let program = Program { executable: Executable::Command(vec![path.clone()]), ..Program::unknown() };
        let mut executed = Executed::default();
        fs::write(&path, "old").unwrap();
        assert_eq!(executed.note("imu", &program), None);
        fs::write(&path, "longer").unwrap();
        let told = executed.note("imu", &program).unwrap();
        assert!(told.contains(&format!("process `imu`: {path} has changed")), "{told}");
        fs::write(&path, "bad").unwrap();
        written_at(&path, 2);
        let told = executed.note("imu", &program).unwrap();
        assert!(told.contains("has changed"), "as long as the first: {told}");
        fs::write(&path, "old").unwrap();
        written_at(&path, 1);
        assert_eq!(executed.note("imu", &program), None, "the same bytes");
    }

    /// The time of the last writing becomes `s` after 1970.
    fn written_at(path: &str, s: u64) {
        let file = File::options().write(true).open(path).unwrap();
        file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(s)).unwrap();
    }

    #[test]
    fn a_large_program_whose_first_bytes_are_gone_may_have_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node").to_string_lossy().into_owned();
        let program = Program { executable: Executable::Command(vec![path.clone()]), ..Program::unknown() };
        let mut executed = Executed::default();
        File::create(&path).unwrap().set_len(DIGESTED_BYTES + 1).unwrap();
        assert_eq!(executed.note("imu", &program), None);
        written_at(&path, 1);
        let told = executed.note("imu", &program).unwrap();
        assert!(told.contains("was written again") && told.contains("may have changed"), "{told}");
    }
}
