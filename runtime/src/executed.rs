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
}

/// Device, number, length and time of the last writing. It tells versions apart without reading them.
type State = (u64, u64, u64, i64, i64);

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
        Some(Self { file, state })
    }

    /// SHA-256 of its bytes; `None` if it has been written to since.
    fn sha256(&self) -> io::Result<Option<String>> {
        (&self.file).rewind()?;
        let digest = inputs::sha256_of(&self.file)?;
        Ok((state(&self.file.metadata()?) == self.state).then_some(digest))
    }

    fn is_same(&self, other: &Self) -> bool {
        let digests = || Ok::<_, io::Error>((self.sha256()?, other.sha256()?));
        self.state == other.state || matches!(digests(), Ok((Some(a), Some(b))) if a == b)
    }
}

impl Executed {
    /// Notes the program that process `name` is about to execute. Returns a warning if it is another one than at its first start.
    pub fn note(&mut self, name: &str, program: &Program) -> Option<String> {
        let Executable::Command(words) = &program.executable else { return None };
        let path = words.first()?;
        let found = Version::at(path.as_ref())?;
        let Some(first) = self.0.get(path) else {
            self.0.insert(path.clone(), found);
            return None;
        };
        (!first.is_same(&found)).then(|| {
            format!(
                "warning: process `{name}`: {path} has changed since the run first started it; this process executes the new \
                 program"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Executable, Executed, Program};
    use std::fs;

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
    }
}
