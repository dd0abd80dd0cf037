//! The recorder's samples for watchers: copied into a ring in shared memory while somebody watches.

use bus::BusError;
use bus::announcement::Announcement;
use bus::watch::{WatchFiles, WatchWriter};

/// Ticks between two looks for a watcher: a look is a call of the kernel, and costs a microsecond.
const LOOK_TICKS: u32 = 64;

/// The way to watchers.
#[derive(Debug)]
pub enum Watched {
    /// Nobody can watch.
    Closed,
    /// Nobody watches yet.
    Awaited(WatchFiles),
    /// Somebody watches.
    Open(WatchWriter),
}

impl Watched {
    /// The way by `files`; closed without any.
    pub fn by(files: Option<&WatchFiles>) -> Self {
        files.cloned().map_or(Self::Closed, Self::Awaited)
    }

    /// Looks for a watcher, at some ticks. A run goes on if its ring cannot be used: it is then closed, and the watcher
    /// reports that nothing comes.
    pub fn look<'a>(&mut self, tick: u32, topics: impl Iterator<Item = (&'a str, &'a Announcement)>) {
        if let Self::Awaited(files) = self
            && tick.is_multiple_of(LOOK_TICKS)
            && let Some(next) = Self::attached(files, topics).unwrap_or(Some(Self::Closed))
        {
            *self = next;
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

    /// True if somebody watches.
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
