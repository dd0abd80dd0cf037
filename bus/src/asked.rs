//! Set points that a person requests while a run flies, on their way from a page to the node that sends them.
//!
//! A file of the run directory holds the newest ones, and the host time at which they were written. It is as long as one
//! entry; a sum over the entry lets a reader detect that it has read half of one and half of the next.

use crate::host_time::monotonic_ns;
use crate::user_file;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Words of 64 bits of an entry: host time, four values, sum.
const WORDS: usize = 6;
/// Attempts to read an entry that is being written.
const ATTEMPTS: usize = 8;

/// Values that a person requests.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// Altitude of the centre of mass, m.
    pub altitude_m: f64,
    /// Roll, rad.
    pub roll_rad: f64,
    /// Pitch, positive nose down, rad.
    pub pitch_rad: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
}

impl Asked {
    /// True if every value is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.altitude_m, self.roll_rad, self.pitch_rad, self.yaw_rad].iter().all(|value| value.is_finite())
    }
}

/// The file that brings them to a node.
///
/// ```
/// use bus::asked::{Asked, AskedFile};
/// let folder = tempfile::tempdir()?;
/// assert!(AskedFile::open(folder.path(), "pilot").is_err(), "no node of this name reads any");
/// let node = AskedFile::create(folder.path(), "pilot")?;
/// assert!(node.read().is_none(), "nobody has asked");
/// let asked = Asked { altitude_m: 1.5, roll_rad: 0.1, ..Asked::default() };
/// AskedFile::open(folder.path(), "pilot")?.write(&asked)?;
/// let (read, age) = node.read().unwrap();
/// assert!(read == asked && age.as_secs() < 60);
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct AskedFile(File);

impl AskedFile {
    /// The file of node `node` in `run_dir`, made unless another instance of the node has made it.
    ///
    /// # Errors
    /// If the run directory cannot be written to.
    pub fn create(run_dir: &Path, node: &str) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        options.custom_flags(user_file::FLAGS).open(path(run_dir, node)).map(Self)
    }

    /// The file of a node that has made it.
    ///
    /// # Errors
    /// If there is none.
    pub fn open(run_dir: &Path, node: &str) -> io::Result<Self> {
        user_file::open(&path(run_dir, node), true).map(Self)
    }

    /// Requests `asked` from now on.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, asked: &Asked) -> io::Result<()> {
        let Asked { altitude_m, roll_rad, pitch_rad, yaw_rad } = *asked;
        let values = [altitude_m, roll_rad, pitch_rad, yaw_rad].map(f64::to_bits);
        let mut words = [monotonic_ns(), values[0], values[1], values[2], values[3], 0];
        words[WORDS - 1] = sum(&words);
        self.0.write_all_at(words.map(u64::to_le_bytes).as_flattened(), 0)
    }

    /// The newest values and their age by the host's clock. `None` if none were requested yet.
    #[must_use]
    pub fn read(&self) -> Option<(Asked, Duration)> {
        let words = (0..ATTEMPTS).find_map(|_| self.words())?;
        let [written_ns, values @ .., _] = words;
        let [altitude_m, roll_rad, pitch_rad, yaw_rad] = values.map(f64::from_bits);
        let age = Duration::from_nanos(monotonic_ns().saturating_sub(written_ns));
        Some((Asked { altitude_m, roll_rad, pitch_rad, yaw_rad }, age))
    }

    fn words(&self) -> Option<[u64; WORDS]> {
        let mut bytes = [[0; 8]; WORDS];
        self.0.read_exact_at(bytes.as_flattened_mut(), 0).ok()?;
        let words = bytes.map(u64::from_le_bytes);
        (words[WORDS - 1] == sum(&words)).then_some(words)
    }
}

/// A sum over all words but the last, in which their places count.
fn sum(words: &[u64; WORDS]) -> u64 {
    words[..WORDS - 1].iter().fold(1, |sum: u64, word| sum.rotate_left(7) ^ word)
}

/// Names of nodes have no dots, so that no two have one file.
fn path(run_dir: &Path, node: &str) -> PathBuf {
    run_dir.join(format!("asked-{}", node.replace('/', ".")))
}

#[cfg(test)]
mod tests {
    use super::{Asked, AskedFile, path};
    use std::os::unix::fs::FileExt as _;
    use std::path::Path;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn no_two_nodes_have_one_file() {
        let folder = Path::new("run");
        assert_ne!(path(folder, "h1/pilot"), path(folder, "h1-pilot"));
    }

    #[test]
    fn half_an_entry_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let file = AskedFile::create(folder.path(), "h1/pilot").unwrap();
        file.write(&Asked { altitude_m: 2.0, ..Asked::default() }).unwrap();
        let raw = std::fs::OpenOptions::new().write(true).open(path(folder.path(), "h1/pilot")).unwrap();
        raw.write_all_at(&1.0_f64.to_le_bytes(), 16).unwrap();
        assert!(file.read().is_none());
        raw.set_len(20).unwrap();
        assert!(file.read().is_none());
    }

    /// Two pages may ask at once.
    #[test]
    fn a_reader_sees_what_one_writer_wrote_and_no_mixture() {
        let folder = tempfile::tempdir().unwrap();
        let file = AskedFile::create(folder.path(), "pilot").unwrap();
        let is_over = AtomicBool::new(false);
        let all = |value: f64| Asked { altitude_m: value, roll_rad: value, pitch_rad: value, yaw_rad: value };
        std::thread::scope(|scope| {
            for start in [1.0, 1e6] {
                let writer = AskedFile::open(folder.path(), "pilot").unwrap();
                let is_over = &is_over;
                scope.spawn(move || {
                    let mut value = start;
                    while !is_over.load(Ordering::Relaxed) {
                        value += 1.0;
                        writer.write(&all(value)).unwrap();
                    }
                });
            }
            let read = (0..20_000).filter_map(|_| file.read());
            let mixed = read.filter(|(asked, _)| *asked != all(asked.altitude_m)).count();
            is_over.store(true, Ordering::Relaxed);
            assert_eq!(mixed, 0);
        });
    }
}
