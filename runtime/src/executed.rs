//! The files of a run's commands: those that their words name, and the modules that scripts in Python import from their own folders. A command
//! opens them itself, and a process that is started later may get other ones.

use crate::imported::Modules;
use crate::program::{Executable, Program};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata};
use std::io::{self, Seek as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Name of the attachment that lists the files of a run's commands. Files of a user are attached under names without a slash:
/// none takes its place.
pub const RECORD: &str = "hummingbus/programs.toml";

/// The files by their paths, as they were at the first look.
#[derive(Debug, Default)]
pub struct Executed(BTreeMap<PathBuf, Version>);

/// A file, kept open: once another one takes its place, it can still be compared with that one.
#[derive(Debug)]
struct Version {
    file: File,
    state: State,
    /// SHA-256 of its bytes at the first look. Only of a file of at most [`DIGESTED_BYTES`].
    digest: Option<String>,
}

/// Device, number, length and time of the last writing. It distinguishes versions without reading them.
type State = (u64, u64, u64, i64, i64);

/// Largest file that is read at the first look, in bytes: no start of a run waits for one that is much larger. Such a file is seldom a
/// script, and the kernel lets nobody write to another program while a process executes it.
const DIGESTED_BYTES: u64 = 64 * 1024 * 1024;

/// The attachment [`RECORD`].
#[derive(Serialize)]
struct Record<'a> {
    program: Vec<Entry<'a>>,
}

/// A file of a command.
#[derive(PartialEq, Serialize)]
struct Entry<'a> {
    process: &'a str,
    /// The word of the manifest that names it. Of a module: its path from the same folder as the word of its script.
    file: String,
    bytes: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<&'a str>,
}

/// A file, compared with the one of the first look.
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
        let is_same = || Ok::<_, io::Error>(state(&self.file.metadata()?) == self.state);
        // A file of data may be large: it is not read in vain.
        if !is_same()? {
            return Ok(None);
        }
        (&self.file).rewind()?;
        let digest = inputs::sha256_of(&self.file)?;
        Ok(is_same()?.then_some(digest))
    }

    /// Compares `found` with this one. The bytes are read only where the files differ by their states alone.
    fn compare(&self, found: &Self) -> Comparison {
        if self.state == found.state {
            return Comparison::Same;
        }
        if self.bytes() != found.bytes() {
            return Comparison::Changed;
        }
        let Ok(Some(first)) = self.sha256() else { return Comparison::Unknown };
        match found.sha256() {
            Ok(Some(found)) if first == found => Comparison::Same,
            Ok(Some(_)) => Comparison::Changed,
            _ => Comparison::Unknown,
        }
    }
}

/// The words of the command of `program` as the manifest states them, each with the path of the file that it may name. The process
/// looks for it in its working directory.
fn words(program: &Program) -> impl Iterator<Item = (&str, PathBuf)> {
    let words: &[String] = match &program.executable {
        Executable::Command(words) => words,
        Executable::Component(_) | Executable::Program(_) => &[],
    };
    let folder = program.working_directory.as_deref().unwrap_or(Path::new(""));
    words.iter().enumerate().map(move |(index, word)| {
        let stated = if index == 0 { &program.first_word } else { word };
        (stated.as_str(), folder.join(word))
    })
}

/// The files of the command of `program`, each with its name in the list [`RECORD`]. Those that its words may name come first, then the modules
/// of its scripts.
fn files(program: &Program) -> Vec<(String, PathBuf)> {
    let mut files: Vec<_> = words(program).map(|(word, path)| (word.to_owned(), path)).collect();
    // A word may lead over a link. The folder of modules has none on its way.
    let mut known: BTreeSet<PathBuf> =
        words(program).filter_map(|(_, path)| path.canonicalize().ok()).collect();
    for (word, path) in words(program) {
        let Some(Modules { folder, files: modules }) = Modules::of(&path) else { continue };
        for module in modules {
            let path = folder.join(&module);
            if path.canonicalize().is_ok_and(|path| known.insert(path)) {
                let name = Path::new(word).parent().unwrap_or(Path::new("")).join(module);
                files.push((name.to_string_lossy().into_owned(), path));
            }
        }
    }
    files
}

impl Executed {
    /// Notes the files of `programs`, with which a run begins. Returns a warning for each that has changed since the run began
    /// before, if it has gone back. They count as they are now.
    pub fn begin(&mut self, programs: &[(&str, &Program)]) -> Vec<String> {
        let warnings = self.note_all(programs);
        if !warnings.is_empty() {
            self.0.clear();
            self.note_all(programs);
        }
        warnings
    }

    fn note_all(&mut self, programs: &[(&str, &Program)]) -> Vec<String> {
        programs.iter().flat_map(|(name, program)| self.note(name, program)).collect()
    }

    /// Notes the files of the command of process `name`, which is about to start. Returns a warning for each that is another one
    /// than at the first look, or may be.
    pub fn note(&mut self, name: &str, program: &Program) -> Vec<String> {
        files(program).into_iter().filter_map(|(_, path)| self.note_file(name, &path)).collect()
    }

    fn note_file(&mut self, name: &str, path: &Path) -> Option<String> {
        let found = Version::at(path)?;
        let Some(first) = self.0.get(path) else {
            self.0.insert(path.to_owned(), found.digested());
            return None;
        };
        let what = match first.compare(&found) {
            Comparison::Same => return None,
            Comparison::Changed => "has changed since the run first read it",
            Comparison::Unknown => "was written again since the run first read it, and may have changed",
        };
        let path = path.display();
        Some(format!(
            "warning: process `{name}`: {path} {what}; the process that starts now gets the new file"
        ))
    }

    /// Returns a warning for each file that a word of `programs` names and that was written during the run. The recording of
    /// another run lists it with other bytes.
    pub fn end(&self, programs: &[(&str, &Program)]) -> Vec<String> {
        let mut warnings = Vec::new();
        for &(name, program) in programs {
            for path in words(program).map(|(_, path)| path).filter(|path| self.was_written(path)) {
                let path = path.display();
                let warning = format!(
                    "warning: process `{name}`: {path} is a word of its command and was written during the run. {RECORD} lists the \
                     file of the start. If it is an output, recordings of two runs differ: pass its path in `parameters` or \
                     `environment`"
                );
                if !warnings.contains(&warning) {
                    warnings.push(warning);
                }
            }
        }
        warnings
    }

    /// True if another file than at the first look is at `path`, or may be.
    fn was_written(&self, path: &Path) -> bool {
        let first = self.0.get(path);
        Version::at(path)
            .is_some_and(|found| first.is_none_or(|first| first.compare(&found) != Comparison::Same))
    }

    /// Text of the attachment that lists the noted files of `programs`, in their order; `None` if there are none. It has no times and no
    /// paths but those that the manifest states, so that two runs of the same files have the same text.
    ///
    /// # Errors
    /// If it cannot be written as TOML.
    pub fn record(&self, programs: &[(&str, &Program)]) -> Result<Option<String>, toml::ser::Error> {
        let mut entries = Vec::new();
        for &(process, program) in programs {
            for (file, path) in files(program) {
                let Some(version) = self.0.get(&path) else { continue };
                let entry =
                    Entry { process, file, bytes: version.bytes(), sha256: version.digest.as_deref() };
                // A swap may name the program of its process again.
                if !entries.contains(&entry) {
                    entries.push(entry);
                }
            }
        }
        if entries.is_empty() {
            return Ok(None);
        }
        let head = "# Files that the words of commands name, and modules that scripts in Python import from their own folders, as they were when the run \
                    began. Those of more than 64 MiB have no SHA-256.\n";
        toml::to_string(&Record { program: entries }).map(|text| Some(format!("{head}{text}")))
    }
}

#[cfg(test)]
mod tests {
    use super::{DIGESTED_BYTES, Executable, Executed, Program};
    use inputs::sha256;
    use std::fs::{self, File};
    use std::time::{Duration, SystemTime};

    /// A program whose manifest states the same words, the first with `bin/` in the place of its folder.
    fn command<const N: usize>(words: [&str; N]) -> Program {
        let name = words[0].rsplit('/').next().unwrap_or_default();
        let executable = Executable::Command(words.map(str::to_owned).into());
        Program { executable, first_word: format!("bin/{name}"), ..Program::unknown() }
    }

    #[test]
    fn every_word_that_names_a_file_is_looked_at_in_the_working_directory() {
        let folder = tempfile::tempdir().unwrap();
        let interpreter = folder.path().join("python3").to_string_lossy().into_owned();
        fs::write(&interpreter, "an interpreter").unwrap();
        fs::create_dir(folder.path().join("laws")).unwrap();
        let law = folder.path().join("law.py");
        fs::write(&law, "old").unwrap();
        let program = command([interpreter.as_str(), "-u", "law.py", "laws", "missing.py", ""]);
        let program = Program { working_directory: Some(folder.path().to_owned()), ..program };
        let mut executed = Executed::default();
        assert!(executed.begin(&[("pilot", &program)]).is_empty());
        assert!(executed.note("pilot", &program).is_empty());
        fs::write(&law, "newer").unwrap();
        let told = executed.note("pilot", &program);
        let expected = format!("process `pilot`: {} has changed since the run first read it", law.display());
        assert!(told.len() == 1 && told[0].contains(&expected), "{told:?}");
        // A run that goes back begins with the new file, and says so once.
        assert_eq!(executed.begin(&[("pilot", &program)]), told);
        assert!(executed.note("pilot", &program).is_empty());
    }

    #[test]
    fn a_record_has_the_words_of_the_manifest_and_the_bytes_of_the_start() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        fs::write(path("node"), "program").unwrap();
        fs::write(path("law.py"), "old").unwrap();
        File::create(path("large")).unwrap().set_len(DIGESTED_BYTES + 1).unwrap();
        let program = Program {
            working_directory: Some(folder.path().to_owned()),
            ..command([path("node").as_str(), "law.py", "--fast", "large"])
        };
        let programs = [("pilot", &program), ("pilot", &program)];
        let mut executed = Executed::default();
        assert_eq!(executed.record(&programs).unwrap(), None, "nothing was looked at");
        executed.begin(&programs);
        fs::write(path("law.py"), "new").unwrap();
        let text = executed.record(&programs).unwrap().unwrap();
        assert!(!text.contains(&*folder.path().to_string_lossy()), "{text}");
        let record: toml::Table = text.parse().unwrap();
        let expected = format!(
            "[[program]]\nprocess = 'pilot'\nfile = 'bin/node'\nbytes = 7\nsha256 = '{}'\n\
             [[program]]\nprocess = 'pilot'\nfile = 'law.py'\nbytes = 3\nsha256 = '{}'\n\
             [[program]]\nprocess = 'pilot'\nfile = 'large'\nbytes = {}\n",
            sha256(b"program"),
            sha256(b"old"),
            DIGESTED_BYTES + 1
        );
        assert_eq!(record, expected.parse::<toml::Table>().unwrap());
        let kind = Program { executable: Executable::Command(Vec::new()), ..Program::unknown() };
        assert_eq!(executed.record(&[("imu", &kind)]).unwrap(), None);
    }

    #[test]
    fn a_module_that_a_script_imports_is_listed_and_told_when_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        fs::create_dir(folder.path().join("laws")).unwrap();
        write("laws/law.py", "import json, gains\n");
        write("laws/gains.py", "from limits import THRUST\n");
        write("laws/limits.py", "THRUST = 1\n");
        write("laws/other.py", "");
        let program = Program {
            working_directory: Some(folder.path().to_owned()),
            ..command(["python3", "laws/law.py", "laws/limits.py"])
        };
        let programs = [("pilot", &program)];
        let mut executed = Executed::default();
        assert!(executed.begin(&programs).is_empty());
        let record: toml::Table = executed.record(&programs).unwrap().unwrap().parse().unwrap();
        let listed = record["program"].as_array().unwrap().iter();
        let listed: Vec<&str> = listed.map(|entry| entry["file"].as_str().unwrap()).collect();
        assert_eq!(listed, ["laws/law.py", "laws/limits.py", "laws/gains.py"]);
        write("laws/other.py", "edited");
        assert!(executed.note("pilot", &program).is_empty());
        write("laws/gains.py", "from limits import THRUST as T\n");
        let told = executed.note("pilot", &program);
        assert!(told.len() == 1 && told[0].contains("gains.py has changed"), "{told:?}");
        // An output is told of words alone: no command writes its own modules.
        assert!(executed.end(&programs).is_empty());
    }

    #[test]
    fn a_module_that_is_a_word_too_is_told_once_although_a_link_leads_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let (laws, link) = (folder.path().join("laws"), folder.path().join("link"));
        fs::create_dir(&laws).unwrap();
        std::os::unix::fs::symlink(&laws, &link).unwrap();
        fs::write(laws.join("law.py"), "import gains\n").unwrap();
        fs::write(laws.join("gains.py"), "THRUST = 1\n").unwrap();
        let program = Program { working_directory: Some(link), ..command(["python3", "law.py", "gains.py"]) };
        let mut executed = Executed::default();
        assert!(executed.begin(&[("pilot", &program)]).is_empty());
        fs::write(laws.join("gains.py"), "THRUST = 1.5\n").unwrap();
        let told = executed.note("pilot", &program);
        assert!(told.len() == 1 && told[0].contains("gains.py has changed"), "{told:?}");
    }

    #[test]
    fn an_output_among_the_words_is_told_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("law.py", "law");
        write("old.csv", "1");
        let program = Program {
            working_directory: Some(folder.path().to_owned()),
            ..command(["python3", "law.py", "old.csv", "new.csv"])
        };
        let programs = [("pilot", &program), ("pilot", &program)];
        let mut executed = Executed::default();
        executed.begin(&programs);
        assert!(executed.end(&programs).is_empty());
        write("old.csv", "1, 2");
        write("new.csv", "1");
        let told = executed.end(&programs);
        assert!(told.len() == 2 && told[0].contains("old.csv") && told[1].contains("new.csv"), "{told:?}");
    }

    #[test]
    fn another_program_at_the_same_path_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node");
        let program = command([&*path.to_string_lossy(), "--fast"]);
        let mut executed = Executed::default();
        let mut is_told = || !executed.note("imu", &program).is_empty();
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
        let program = command([path.as_str()]);
        let mut executed = Executed::default();
        fs::write(&path, "old").unwrap();
        assert!(executed.note("imu", &program).is_empty());
        fs::write(&path, "longer").unwrap();
        let told = executed.note("imu", &program).concat();
        assert!(told.contains(&format!("process `imu`: {path} has changed")), "{told}");
        fs::write(&path, "bad").unwrap();
        written_at(&path, 2);
        let told = executed.note("imu", &program).concat();
        assert!(told.contains("has changed"), "as long as the first: {told}");
        fs::write(&path, "old").unwrap();
        written_at(&path, 1);
        assert!(executed.note("imu", &program).is_empty(), "the same bytes");
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
        let program = command([path.as_str()]);
        let mut executed = Executed::default();
        File::create(&path).unwrap().set_len(DIGESTED_BYTES + 1).unwrap();
        assert!(executed.note("imu", &program).is_empty());
        written_at(&path, 1);
        let told = executed.note("imu", &program).concat();
        assert!(told.contains("was written again") && told.contains("may have changed"), "{told}");
    }
}
