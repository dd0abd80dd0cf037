//! Samples of a run for watchers: a ring in shared memory that the recorder fills while there is a watcher.
//!
//! A watcher makes the ring. The recorder takes every sample, finds the ring, and copies each sample into it. Neither waits
//! for the other: the recorder overwrites the oldest samples, and a watcher that was too slow goes on with the newest.
//!
//! Every word of the ring is an atomic. The recorder raises `begun` before it overwrites words, and `written` after it. A
//! watcher copies words, and then looks at `begun`: if the recorder has come round meanwhile, the copy is thrown away.

use crate::announcement::Announcement;
use crate::error::BusError;
use crate::json_file;
use crate::names::shm_path;
use crate::shared_file;
use memmap2::MmapRaw;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU64, fence};
use std::time::Duration;

/// Words in front of the samples.
const HEAD_WORDS: usize = 8;
/// Words of samples that the ring holds: 16 MiB, some seconds of a run at real time.
const RING_WORDS: usize = 1 << 21;
const RING_BYTES: usize = (HEAD_WORDS + RING_WORDS) * size_of::<u64>();
/// Looks for a ring that another watcher is making, and the pause between two.
const RING_LOOKS: u32 = 200;
const RING_LOOK: Duration = Duration::from_millis(5);
/// Words of the head, by their places.
const ATTACHED: usize = 0;
const BEGUN: usize = 1;
const WRITTEN: usize = 2;
/// Words in front of a sample: its words, tick and length of the topic's name, time, length of the message.
const SAMPLE_HEAD_WORDS: usize = 4;

/// Places of the files that a watcher and the recorder of a run share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WatchFiles {
    ring: PathBuf,
    topics: PathBuf,
}

impl WatchFiles {
    /// The files of run `run_id`, whose directory is `run_dir`.
    #[must_use]
    pub fn of(run_dir: &Path, run_id: &str) -> Self {
        Self { ring: shm_path(run_id, "watch"), topics: run_dir.join("watch.json") }
    }

    /// The ring, made unless another watcher has made it. The run removes it when it ends.
    ///
    /// # Errors
    /// If shared memory has no room for it.
    pub fn watch(&self) -> Result<WatchReader, BusError> {
        let (map, at) = match shared_file::create(&self.ring, RING_BYTES) {
            Ok(map) => (map, Some(0)),
            Err(BusError::File { source, .. }) if source.kind() == ErrorKind::AlreadyExists => {
                self.await_ring();
                (self.open()?, None)
            }
            Err(error) => return Err(error),
        };
        let ring = Ring(map);
        let at = at.unwrap_or_else(|| ring.head(WRITTEN).load(Acquire));
        Ok(WatchReader { ring, at, copy: Vec::new() })
    }

    /// Waits until another watcher has made the ring, but not for one that died over it.
    fn await_ring(&self) {
        for _ in 0..RING_LOOKS {
            if self.is_there() {
                return;
            }
            std::thread::sleep(RING_LOOK);
        }
    }

    /// Removes the ring: for a watcher whose run has ended while it made the ring.
    pub fn remove(&self) {
        let _ = std::fs::remove_file(&self.ring);
    }

    /// True if there is a watcher. A ring without a length is being made.
    #[must_use]
    pub fn is_there(&self) -> bool {
        self.ring.symlink_metadata().is_ok_and(|found| found.len() > 0)
    }

    /// The topics of the run with their messages, once the recorder has found the ring.
    ///
    /// # Errors
    /// If their file cannot be read.
    pub fn topics(&self) -> Result<Vec<(String, Announcement)>, BusError> {
        json_file::load(&self.topics, "the topics of a run")
    }

    fn open(&self) -> Result<MmapRaw, BusError> {
        shared_file::open(&self.ring, RING_BYTES, "the samples of a run for watchers")
    }
}

/// The recorder's end of the ring.
#[derive(Debug)]
pub struct WatchWriter {
    ring: Ring,
    /// Words written so far.
    at: u64,
}

impl WatchWriter {
    /// Opens the ring, and states the `topics` of the run.
    ///
    /// # Errors
    /// If the ring is not there or of another size, or the topics cannot be written.
    pub fn attach(files: &WatchFiles, topics: &[(&str, &Announcement)]) -> Result<Self, BusError> {
        let map = files.open()?;
        json_file::store(&files.topics, &topics)?;
        let ring = Ring(map);
        let at = ring.head(WRITTEN).load(Relaxed);
        ring.head(ATTACHED).store(1, Release);
        Ok(Self { ring, at })
    }

    /// Copies a sample into the ring: `cdr` is its encapsulation header and body. One that is longer than the ring is left out.
    pub fn write(&mut self, tick: u32, time_ns: u64, topic: &str, cdr: &[u8]) {
        let words = SAMPLE_HEAD_WORDS + topic.len().div_ceil(8) + cdr.len().div_ceil(8);
        if words > RING_WORDS || topic.len() > u32::MAX as usize {
            return;
        }
        let end = self.at.wrapping_add(words as u64);
        self.ring.head(BEGUN).store(end, Relaxed);
        fence(Release);
        let head = [words as u64, u64::from(tick) << 32 | topic.len() as u64, time_ns, cdr.len() as u64];
        let mut at = self.at;
        let words = head.into_iter().chain(words_of(topic.as_bytes())).chain(words_of(cdr));
        for word in words {
            self.ring.word(at).store(word, Relaxed);
            at = at.wrapping_add(1);
        }
        self.ring.head(WRITTEN).store(end, Release);
        self.at = end;
    }
}

/// The words of `bytes`, filled up with zeros.
fn words_of(bytes: &[u8]) -> impl Iterator<Item = u64> {
    let (whole, rest) = bytes.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let last = (!rest.is_empty()).then_some(u64::from_le_bytes(last));
    whole.iter().map(|word| u64::from_le_bytes(*word)).chain(last)
}

/// A sample of a run, as its recording holds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchedSample<'a> {
    /// The tick at which it was sent.
    pub tick: u32,
    /// Simulation time, ns.
    pub time_ns: u64,
    /// Name of the topic.
    pub topic: &'a str,
    /// Encapsulation header and body.
    pub cdr: &'a [u8],
}

/// A watcher's end of the ring.
///
/// ```
/// # use bus::{Message as _, announcement::Announcement, messages::SetPoint, watch::{WatchFiles, WatchWriter}};
/// # let folder = tempfile::tempdir()?;
/// # let run_id = format!("{:x}-d0c", std::process::id());
/// let files = WatchFiles::of(folder.path(), &run_id);
/// let topics = [("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA))];
/// assert!(!files.is_there(), "nobody watches");
///
/// let mut watcher = files.watch()?;
/// let mut recorder = WatchWriter::attach(&files, &topics)?;
/// assert_eq!(files.topics()?[0].0, "/pilot/set_point");
/// recorder.write(7, 7_000_000, "/pilot/set_point", &[0, 1, 0, 0, 42]);
/// let mut seen = Vec::new();
/// let missed = watcher.read(|sample| seen.push((sample.tick, sample.time_ns, sample.cdr.to_vec())));
/// assert_eq!((missed, seen), (0, vec![(7, 7_000_000, vec![0, 1, 0, 0, 42])]));
/// # files.remove();
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct WatchReader {
    ring: Ring,
    /// Words read so far.
    at: u64,
    /// The sample that is being read.
    copy: Vec<u8>,
}

impl WatchReader {
    /// True once the recorder has found the ring.
    #[must_use]
    pub fn is_attached(&self) -> bool {
        self.ring.head(ATTACHED).load(Acquire) != 0
    }

    /// Hands `take` the samples written since the last call, oldest first. Returns the bytes of those that were overwritten
    /// before they were read; reading then goes on with the newest.
    pub fn read(&mut self, mut take: impl FnMut(&WatchedSample<'_>)) -> u64 {
        let (mut missed, written) = (0, self.ring.head(WRITTEN).load(Acquire));
        while self.at != written {
            match self.next() {
                Some((sample, end)) => {
                    take(&sample);
                    self.at = end;
                }
                None => {
                    missed += written.wrapping_sub(self.at).wrapping_mul(8);
                    self.at = written;
                }
            }
        }
        missed
    }

    /// The sample at the present place and the place behind it; `None` if it was overwritten.
    fn next(&mut self) -> Option<(WatchedSample<'_>, u64)> {
        let at = self.at;
        let head = [0, 1, 2, 3].map(|place| self.ring.word(at.wrapping_add(place)).load(Relaxed));
        self.is_whole(at)?;
        let [words, tick_and_name, time_ns, length] = head;
        let (name_length, length) =
            ((tick_and_name & u64::from(u32::MAX)) as usize, usize::try_from(length).ok()?);
        let [name_words, cdr_words] = [name_length.div_ceil(8), length.div_ceil(8)];
        let stated = usize::try_from(words).ok().filter(|&words| words <= RING_WORDS)?;
        if SAMPLE_HEAD_WORDS.checked_add(name_words)?.checked_add(cdr_words)? != stated {
            return None;
        }
        self.copy.clear();
        for place in SAMPLE_HEAD_WORDS..stated {
            let word = self.ring.word(at.wrapping_add(place as u64)).load(Relaxed);
            self.copy.extend_from_slice(&word.to_le_bytes());
        }
        self.is_whole(at)?;
        let (name, cdr) = self.copy.split_at(8 * name_words);
        let topic = std::str::from_utf8(&name[..name_length]).ok()?;
        let tick = u32::try_from(tick_and_name >> 32).ok()?;
        Some((WatchedSample { tick, time_ns, topic, cdr: &cdr[..length] }, at.wrapping_add(words)))
    }

    /// `None` if the recorder has begun to overwrite words from `at` on.
    fn is_whole(&self, at: u64) -> Option<()> {
        // What was copied before stays before the look.
        fence(Acquire);
        let begun = self.ring.head(BEGUN).load(Relaxed);
        (begun.wrapping_sub(at) <= RING_WORDS as u64).then_some(())
    }
}

/// The mapped ring.
#[derive(Debug)]
struct Ring(MmapRaw);

impl Ring {
    fn words(&self) -> &[AtomicU64] {
        debug_assert_eq!(self.0.len(), RING_BYTES);
        // SAFETY: the mapping has RING_BYTES bytes (`shared_file` has checked it), starts at a page, and lives as long as
        // `self`. Every process uses its words as atomics.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast::<AtomicU64>(), HEAD_WORDS + RING_WORDS) }
    }

    fn head(&self, place: usize) -> &AtomicU64 {
        &self.words()[place]
    }

    /// The word that is number `at` of those written.
    fn word(&self, at: u64) -> &AtomicU64 {
        &self.words()[HEAD_WORDS + (at % RING_WORDS as u64) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::{RING_WORDS, WatchFiles, WatchReader, WatchWriter};
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Files of a run, which go with it.
    struct Run {
        files: WatchFiles,
        _folder: tempfile::TempDir,
    }

    impl Run {
        fn new(name: &str) -> Self {
            let folder = tempfile::tempdir().unwrap();
            let files = WatchFiles::of(folder.path(), &format!("{:x}-{name}", std::process::id()));
            Self { files, _folder: folder }
        }

        fn ends(&self) -> (WatchReader, WatchWriter) {
            let reader = self.files.watch().unwrap();
            (reader, WatchWriter::attach(&self.files, &[]).unwrap())
        }
    }

    impl Drop for Run {
        fn drop(&mut self) {
            self.files.remove();
        }
    }

    fn ticks(reader: &mut WatchReader) -> (u64, Vec<u32>) {
        let mut ticks = Vec::new();
        let missed = reader.read(|sample| ticks.push(sample.tick));
        (missed, ticks)
    }

    #[test]
    fn samples_of_any_length_come_out_as_they_went_in() {
        let run = Run::new("a1");
        let (mut reader, mut writer) = run.ends();
        assert!(reader.is_attached() && run.files.topics().unwrap().is_empty());
        let bytes: Vec<u8> = (0..=255).collect();
        for length in 0..40 {
            writer.write(
                length,
                u64::from(length) * 10,
                &"/topic"[..length as usize % 7],
                &bytes[..length as usize],
            );
        }
        let mut next = 0;
        let missed = reader.read(|sample| {
            assert_eq!((sample.tick, sample.time_ns), (next, u64::from(next) * 10));
            assert_eq!(sample.topic, &"/topic"[..next as usize % 7]);
            assert_eq!(sample.cdr, &bytes[..next as usize]);
            next += 1;
        });
        assert_eq!((missed, next), (0, 40));
        assert_eq!(ticks(&mut reader), (0, vec![]));
    }

    #[test]
    fn a_second_watcher_begins_with_the_present_and_a_second_recorder_goes_on() {
        let run = Run::new("b2");
        let (mut first, mut writer) = run.ends();
        writer.write(0, 0, "/a", &[1]);
        let mut second = run.files.watch().unwrap();
        drop(writer);
        let mut writer = WatchWriter::attach(&run.files, &[]).unwrap();
        writer.write(1, 1, "/a", &[1]);
        assert_eq!((ticks(&mut first), ticks(&mut second)), ((0, vec![0, 1]), (0, vec![1])));
    }

    #[test]
    fn a_watcher_that_was_too_slow_misses_samples_and_goes_on_with_the_newest() {
        let run = Run::new("c3");
        let (mut reader, mut writer) = run.ends();
        let big = vec![7; RING_WORDS];
        for tick in 0..9 {
            writer.write(tick, 0, "/big", &big);
        }
        let (missed, seen) = ticks(&mut reader);
        assert!(missed > 8 * RING_WORDS as u64 && seen.is_empty(), "{missed} {seen:?}");
        writer.write(9, 0, "/big", &big);
        assert_eq!(ticks(&mut reader), (0, vec![9]));
        writer.write(10, 0, "/too big", &vec![7; 8 * RING_WORDS]);
        writer.write(11, 0, "/small", &[7]);
        assert_eq!(ticks(&mut reader), (0, vec![11]));
    }

    /// Each sample repeats one number.
    #[test]
    fn no_sample_is_half_of_one_and_half_of_another() {
        let run = Run::new("d4");
        let (mut reader, mut writer) = run.ends();
        let is_over = AtomicBool::new(false);
        let (mut seen, mut missed) = (0_u64, 0);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for tick in 0..4000_u32 {
                    let number = tick.to_le_bytes()[0];
                    writer.write(
                        tick,
                        u64::from(number),
                        "/wide",
                        &vec![number; 4096 + tick as usize % 4096],
                    );
                }
                is_over.store(true, Ordering::Release);
            });
            loop {
                let was_over = is_over.load(Ordering::Acquire);
                missed += reader.read(|sample| {
                    let number = sample.tick.to_le_bytes()[0];
                    assert_eq!(sample.time_ns, u64::from(number));
                    assert!(sample.cdr.iter().all(|&byte| byte == number), "tick {}", sample.tick);
                    seen += 1;
                });
                if was_over {
                    break;
                }
            }
        });
        assert!(missed > 0 || seen == 4000, "{seen} seen, {missed} bytes missed");
        // The writer may have been through before the first look.
        writer.write(4000, 160, "/wide", &[160; 100]);
        assert_eq!(ticks(&mut reader), (0, vec![4000]));
    }
}
