//! Reads the logs of a flights file, each once, however many flights are parts of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::logs::Log;

/// Source of the bytes of a file.
pub type ReadFile<'a> = dyn Fn(&Path) -> std::io::Result<Vec<u8>> + 'a;

/// Reads logs. The bytes of a log are kept until the last flight in it has been read.
pub struct LogReader<'a> {
    read: &'a ReadFile<'a>,
    logs: BTreeMap<PathBuf, Reading>,
}

/// A log on its way.
#[derive(Default)]
struct Reading {
    /// Flights that have still to be read from it.
    flights: usize,
    bytes: Option<Vec<u8>>,
    sha256: String,
}

impl<'a> LogReader<'a> {
    /// A reader of `logs`, whose bytes `read` gives.
    pub fn of(logs: &[Log<'_>], read: &'a ReadFile<'a>) -> Self {
        let mut reader = Self { read, logs: BTreeMap::new() };
        let files = logs.iter().flat_map(|log| &log.files);
        files.for_each(|file| reader.logs.entry(real(file)).or_default().flights += 1);
        reader
    }

    /// The bytes of the log at `path`, for one flight.
    pub fn read(&mut self, path: &Path) -> std::io::Result<Vec<u8>> {
        let log = self.logs.entry(real(path)).or_default();
        let bytes = match log.bytes.take() {
            Some(bytes) => bytes,
            None => {
                let bytes = (self.read)(path)?;
                log.sha256 = inputs::sha256(&bytes);
                bytes
            }
        };
        log.flights = log.flights.saturating_sub(1);
        if log.flights > 0 {
            log.bytes = Some(bytes.clone());
        }
        Ok(bytes)
    }

    /// The bytes of a log beside the flights' own, which is read once and kept.
    pub fn read_beside(&mut self, path: &Path) -> std::io::Result<Vec<u8>> {
        self.logs.entry(real(path)).or_default().flights += 2;
        self.read(path)
    }

    /// The SHA-256 of a log that was read.
    pub fn sha256(&self) -> impl Fn(&Path) -> Option<String> + '_ {
        |path| self.logs.get(&real(path)).map(|log| log.sha256.clone())
    }
}

/// One name for all spellings of a path.
fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}
