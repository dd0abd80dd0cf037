//! The recorder's samples for watchers: copied into a ring in shared memory while there is a watcher.

use bus::BusError;
use bus::announcement::Announcement;
use bus::host_time::monotonic_ns;
use bus::watch::{WatchFiles, WatchWriter};

/// Host time between two looks for a watcher: a look is a call of the kernel, and costs a microsecond. A run that was held,
/// or one that is slow, finds its watcher at its next tick. No byte of the recording depends on it.
const LOOK_NS: u64 = 1_000_000;

/// The way to watchers.
#[derive(Debug)]
pub enum Watched {
    /// Nobody can watch.
    Closed,
    /// Nobody watches yet.
    Awaited {
        /// Files of the watchers.
        files: WatchFiles,
        /// Host time of the next look, ns.
        next_ns: u64,
    },
    /// Somebody watches.
    Open(WatchWriter),
}

impl Watched {
    /// The way by `files`; closed without any.
    pub fn by(files: Option<&WatchFiles>) -> Self {
        files.cloned().map_or(Self::Closed, |files| Self::Awaited { files, next_ns: 0 })
    }

    /// Looks for a watcher, unless the last look was just before. A run goes on if its ring cannot be used: it is then
    /// closed, and the watcher reports that nothing comes.
    pub fn look<'a>(&mut self, topics: impl Iterator<Item = (&'a str, &'a Announcement)>) {
        if matches!(self, Self::Awaited { .. }) {
            self.look_at(monotonic_ns(), topics);
        }
    }

    fn look_at<'a>(&mut self, now_ns: u64, topics: impl Iterator<Item = (&'a str, &'a Announcement)>) {
        if let Self::Awaited { files, next_ns } = self
            && *next_ns <= now_ns
        {
            *next_ns = now_ns + LOOK_NS;
            if let Some(next) = Self::attached(files, topics).unwrap_or(Some(Self::Closed)) {
                *self = next;
            }
        }
    }

    fn attached<'a>(
        files: &WatchFiles,
        topics: impl Iterator<Item = (&'a str, &'a Announcement)>,
    ) -> Result<Option<Self>, BusError> {
        if !files.is_there() {
            return Ok(None);
        }
        let topics: Vec<_> = topics.collect();
        Ok(Some(Self::Open(WatchWriter::attach(files, &topics)?)))
    }

    /// True if there is a watcher.
    pub fn is_open(&self) -> bool {
        matches!(self, Self::Open(_))
    }

    /// Copies a sample for the watchers, if there are any.
    pub fn write(&mut self, tick: u32, time_ns: u64, topic: &str, cdr: &[u8]) {
        if let Self::Open(writer) = self {
            writer.write(tick, time_ns, topic, cdr);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{LOOK_NS, Watched};
    use bus::watch::WatchFiles;
    use std::iter::empty;

    /// No tick decides: the next one of a run that was held may be any.
    #[test]
    fn a_watcher_is_found_at_the_next_tick_once_the_last_look_is_a_millisecond_ago() {
        let folder = tempfile::tempdir().unwrap();
        let files = WatchFiles::of(folder.path(), &format!("{:x}-e1d", std::process::id()));
        let mut watched = Watched::by(Some(&files));
        watched.look_at(7, empty());
        let mut reader = files.watch().unwrap();
        watched.look_at(6 + LOOK_NS, empty());
        let was_open = watched.is_open();
        watched.look_at(7 + LOOK_NS, empty());
        files.remove();
        assert!(!was_open && watched.is_open() && reader.is_attached());
        watched.write(1481, 1_481_000_000, "/plant/state", &[0, 1, 0, 0]);
        let mut ticks = Vec::new();
        assert_eq!(reader.read(|sample| ticks.push(sample.tick)), 0);
        assert_eq!(ticks, [1481]);
    }

    #[test]
    fn a_run_that_nobody_can_watch_looks_for_nobody() {
        let mut watched = Watched::by(None);
        watched.look(empty());
        assert!(matches!(watched, Watched::Closed));
    }
}
