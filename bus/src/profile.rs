//! Host times of the ticks of a run: every process notes its own in a file of the run directory.
//!
//! A file is a header and records of a fixed number of words, mapped, reserved and touched before the first tick:
//! noting a tick is a look at the clock and a few stores. The cause of a node's wait is not noted: it follows from
//! the plan and from the notes of the other processes.

use crate::error::BusError;
use crate::host_time::monotonic_ns;
use crate::plan::Plan;
use memmap2::{Advice, Mmap, MmapMut};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Ticks that a process notes at most; those beyond are counted only.
pub const NOTED_TICKS_MAX: u32 = 2_000_000;

const MAGIC: u64 = 0x4855_4d50_524f_4631;
const WORD_BYTES: usize = size_of::<u64>();
/// Magic, words of a record, records, records left out.
const HEADER_WORDS: usize = 4;
/// Tick, received, done, ended; the host time at which each output was sent follows.
const TICK_WORDS: usize = 4;
/// First tick, tick after the last, deadline, granted.
const GRANT_WORDS: usize = 4;

/// Host times of one computation of a node, in nanoseconds of the monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickTimes<'a> {
    /// The tick.
    pub tick: u32,
    /// Time at which the node ended the computation before and began to wait; `None` for the first it noted.
    pub began_ns: Option<u64>,
    /// Time at which it had its inputs.
    pub received_ns: u64,
    /// Time at which it had computed.
    pub done_ns: u64,
    /// Time at which its outputs were sent and the memory of the next ones was taken.
    pub ended_ns: u64,
    /// Time at which each output was sent; 0 for one that was not due.
    pub sent_ns: &'a [u64],
}

/// A grant of the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grant {
    /// The first tick granted by it.
    pub first_tick: u32,
    /// The tick after the last granted by it.
    pub end_tick: u32,
    /// Host time at which it was due in a paced run.
    pub deadline_ns: Option<u64>,
    /// Host time at which it was given.
    pub granted_ns: u64,
}

/// Notes the ticks of a node.
#[derive(Debug)]
pub struct TickWriter(RecordWriter);

impl TickWriter {
    /// Creates the file of generation `generation` of `node`, whose first tick is `first_tick`, in `run_dir`.
    ///
    /// # Errors
    /// If the file cannot be created or its space not be reserved.
    pub fn create(
        run_dir: &Path,
        plan: &Plan,
        node: usize,
        generation: u32,
        first_tick: u32,
    ) -> Result<Self, BusError> {
        let words = TICK_WORDS + plan.nodes[node].outputs.len();
        let ticks = plan.duration_ticks.saturating_sub(first_tick);
        let ticks = ticks.div_ceil(plan.nodes[node].period_ticks.max(1));
        RecordWriter::create(path(run_dir, &node.to_string(), generation), words, ticks).map(Self)
    }

    /// Notes that `output` was sent at host time `sent_ns` in the current tick.
    pub fn sent(&mut self, output: usize, sent_ns: u64) {
        self.0.record()[TICK_WORDS + output] = sent_ns;
    }

    /// Notes the current tick.
    pub fn end(&mut self, tick: u32, received_ns: u64, done_ns: u64, ended_ns: u64) {
        let words = [u64::from(tick), received_ns, done_ns, ended_ns];
        self.0.record()[..TICK_WORDS].copy_from_slice(&words);
        self.0.commit();
    }
}

/// Notes the grants of the clock.
#[derive(Debug)]
pub struct GrantWriter {
    records: RecordWriter,
    granted: u32,
}

impl GrantWriter {
    /// Creates the clock's file in `run_dir`; the ticks before the first of `plan` are not granted.
    ///
    /// # Errors
    /// If the file cannot be created or its space not be reserved.
    pub fn create(run_dir: &Path, plan: &Plan) -> Result<Self, BusError> {
        let records = RecordWriter::create(path(run_dir, "clock", 0), GRANT_WORDS, plan.duration_ticks)?;
        Ok(Self { records, granted: plan.first_tick })
    }

    /// Notes that the ticks before `end_tick` are granted now; `deadline_ns` is when they were due.
    pub fn grant(&mut self, end_tick: u32, deadline_ns: Option<u64>) {
        self.grant_at(end_tick, deadline_ns, monotonic_ns());
    }

    /// Notes that the ticks before `end_tick` were granted at host time `granted_ns`.
    pub fn grant_at(&mut self, end_tick: u32, deadline_ns: Option<u64>, granted_ns: u64) {
        if end_tick > self.granted {
            let words = [u64::from(self.granted), u64::from(end_tick), deadline_ns.unwrap_or(0), granted_ns];
            self.records.record().copy_from_slice(&words);
            self.records.commit();
            self.granted = end_tick;
        }
    }
}

/// Host times noted by one process of a node.
#[derive(Debug)]
pub struct TickReader {
    /// `None` if it ended before it could note anything.
    records: Option<RecordReader>,
    period_ticks: u32,
}

impl TickReader {
    /// Opens the file of generation `generation` of `node` in `run_dir`; its process must have ended.
    ///
    /// # Errors
    /// If the file cannot be read or is not one of this plan.
    pub fn open(run_dir: &Path, plan: &Plan, node: usize, generation: u32) -> Result<Self, BusError> {
        let words = TICK_WORDS + plan.nodes[node].outputs.len();
        let records = RecordReader::open(path(run_dir, &node.to_string(), generation), words)?;
        Ok(Self { records, period_ticks: plan.nodes[node].period_ticks.max(1) })
    }

    /// Computations that were not noted because the file was full.
    #[must_use]
    pub fn left_out(&self) -> u64 {
        self.records.as_ref().map_or(0, RecordReader::left_out)
    }

    /// The computation of `tick`.
    #[must_use]
    pub fn at(&self, tick: u32) -> Option<TickTimes<'_>> {
        let file = self.records.as_ref()?;
        let first_tick = *file.record(0)?.first()?;
        let index = u64::from(tick).checked_sub(first_tick)? / u64::from(self.period_ticks);
        let index = usize::try_from(index).ok()?;
        let record = file.record(index).filter(|record| record[0] == u64::from(tick))?;
        let before = index.checked_sub(1).and_then(|before| file.record(before));
        Some(TickTimes {
            tick,
            began_ns: before.map(|record| record[3]),
            received_ns: record[1],
            done_ns: record[2],
            ended_ns: record[3],
            sent_ns: &record[TICK_WORDS..],
        })
    }
}

/// Grants noted by the clock.
#[derive(Debug)]
pub struct GrantReader(Option<RecordReader>);

impl GrantReader {
    /// Opens the clock's file in `run_dir`; its process must have ended.
    ///
    /// # Errors
    /// If the file cannot be read or is not one of this program.
    pub fn open(run_dir: &Path) -> Result<Self, BusError> {
        RecordReader::open(path(run_dir, "clock", 0), GRANT_WORDS).map(Self)
    }

    /// The grants, in their order.
    pub fn grants(&self) -> impl Iterator<Item = Grant> {
        self.0.iter().flat_map(|file| (0..file.count()).filter_map(|index| file.record(index))).map(grant)
    }

    /// The grant of `tick`.
    #[must_use]
    pub fn of(&self, tick: u32) -> Option<Grant> {
        let file = self.0.as_ref()?;
        let (mut low, mut high) = (0, file.count());
        while low < high {
            let middle = usize::midpoint(low, high);
            if file.record(middle)?[1] <= u64::from(tick) { low = middle + 1 } else { high = middle }
        }
        file.record(low).map(grant)
    }
}

#[allow(clippy::cast_possible_truncation, reason = "ticks were written from 32-bit numbers")]
fn grant(record: &[u64]) -> Grant {
    Grant {
        first_tick: record[0] as u32,
        end_tick: record[1] as u32,
        deadline_ns: Some(record[2]).filter(|&ns| ns > 0),
        granted_ns: record[3],
    }
}

/// Path of the file in which process number `generation` of `writer` (a node's index, or the clock) notes its ticks.
/// Nodes have an index here because their names may hold characters that a file's name may not.
fn path(run_dir: &Path, writer: &str, generation: u32) -> PathBuf {
    run_dir.join(format!("profile-{writer}.{generation}.bin"))
}

/// Appends records to a file that has its full size from the start.
#[derive(Debug)]
struct RecordWriter {
    map: MmapMut,
    words: usize,
    capacity: usize,
    count: usize,
    left_out: u64,
}

impl RecordWriter {
    fn create(path: PathBuf, words: usize, records: u32) -> Result<Self, BusError> {
        let capacity = records.min(NOTED_TICKS_MAX) as usize;
        // One more than counts: when the file is full, that one takes the notes that are left out.
        let bytes = WORD_BYTES * (HEADER_WORDS + words * (capacity + 1));
        let file = crate::reserve::create(&path, bytes as u64)?;
        // SAFETY: the file was created by this call in the run's own directory; others read it only after
        // this process has ended.
        let map = unsafe { MmapMut::map_mut(&file) };
        let map = map.map_err(|source| BusError::File { action: "map", path, source })?;
        // A page that is touched here costs the tick that writes to it no fault; older kernels cannot.
        let _ = map.advise(Advice::PopulateWrite);
        let mut writer = Self { map, words, capacity, count: 0, left_out: 0 };
        writer.set_header();
        Ok(writer)
    }

    fn set_header(&mut self) {
        let header = [MAGIC, self.words as u64, self.count as u64, self.left_out];
        self.all_words()[..HEADER_WORDS].copy_from_slice(&header);
    }

    fn all_words(&mut self) -> &mut [u64] {
        bytemuck::cast_slice_mut(&mut self.map)
    }

    /// The words of the current record.
    fn record(&mut self) -> &mut [u64] {
        let (start, words) = (HEADER_WORDS + self.words * self.count, self.words);
        &mut self.all_words()[start..start + words]
    }

    /// Ends the current record.
    fn commit(&mut self) {
        if self.count < self.capacity {
            self.count += 1;
        } else {
            self.left_out += 1;
        }
        self.set_header();
    }
}

/// The records of a file whose writer has ended.
#[derive(Debug)]
struct RecordReader {
    map: Mmap,
    words: usize,
}

impl RecordReader {
    /// Opens the file at `path`; `None` where there is none.
    fn open(path: PathBuf, words: usize) -> Result<Option<Self>, BusError> {
        let map = crate::user_file::open(&path, false).and_then(|file| {
            // SAFETY: the file lies in the run's own directory and its writer has ended.
            unsafe { Mmap::map(&file) }
        });
        let map = match map {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            other => other.map_err(|source| BusError::File { action: "read", path: path.clone(), source })?,
        };
        let reader = Self { map, words };
        let is_whole = reader.map.len().is_multiple_of(WORD_BYTES)
            && reader.map.len() / WORD_BYTES >= HEADER_WORDS
            && reader.all_words()[..2] == [MAGIC, words as u64]
            && reader.record(reader.count().saturating_sub(1)).is_some() == (reader.count() > 0);
        if is_whole {
            return Ok(Some(reader));
        }
        let found = format!("{} bytes that do not start like one", reader.map.len());
        Err(BusError::Content { path, expected: "the host times of a process", found })
    }

    fn all_words(&self) -> &[u64] {
        bytemuck::cast_slice(&self.map)
    }

    fn count(&self) -> usize {
        usize::try_from(self.all_words()[2]).unwrap_or(0)
    }

    fn left_out(&self) -> u64 {
        self.all_words()[3]
    }

    fn record(&self, index: usize) -> Option<&[u64]> {
        if index >= self.count() {
            return None;
        }
        let start = HEADER_WORDS + self.words.checked_mul(index)?;
        self.all_words().get(start..start + self.words)
    }
}

#[cfg(test)]
mod tests {
    use super::{GrantReader, GrantWriter, TickReader, TickWriter, path};
    use crate::plan::{NodePlan, OutputPlan, Plan};

    fn plan(period_ticks: u32) -> Plan {
        let output = |port: &str| OutputPlan { port: port.to_owned(), topic: 0 };
        let node = NodePlan::for_test("arm/left", vec![], vec![output("a"), output("b")]);
        Plan::for_test(30, vec![], vec![NodePlan { period_ticks, ..node }])
    }

    #[test]
    fn what_was_noted_is_read_by_tick() {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(10));
        let mut writer = TickWriter::create(folder.path(), &plan, 0, 0, 0).unwrap();
        for tick in [0, 10, 20] {
            let at = 100 * u64::from(tick);
            writer.sent(1, at + 3);
            writer.end(tick, at + 1, at + 2, at + 4);
        }
        let reader = TickReader::open(folder.path(), &plan, 0, 0).unwrap();
        assert_eq!(reader.left_out(), 0);
        let times = reader.at(10).unwrap();
        let found = [times.began_ns.unwrap(), times.received_ns, times.done_ns, times.ended_ns];
        assert_eq!(found, [4, 1001, 1002, 1004]);
        assert_eq!(times.sent_ns, [0, 1003]);
        assert_eq!(reader.at(0).unwrap().began_ns, None);
        assert_eq!([5, 11, 30, u32::MAX].map(|tick| reader.at(tick)), [None; 4]);
    }

    #[test]
    fn a_full_file_counts_what_it_leaves_out() {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(10));
        let mut writer = TickWriter::create(folder.path(), &plan, 0, 0, 0).unwrap();
        (0..5).for_each(|index| writer.end(10 * index, 1, 2, 3));
        let reader = TickReader::open(folder.path(), &plan, 0, 0).unwrap();
        assert_eq!(reader.left_out(), 2);
        assert!(reader.at(20).is_some() && reader.at(30).is_none());
    }

    #[test]
    fn a_process_that_joins_late_notes_from_its_first_tick_on() {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(10));
        let mut writer = TickWriter::create(folder.path(), &plan, 0, 1, 20).unwrap();
        writer.end(20, 1, 2, 3);
        let of = |generation| TickReader::open(folder.path(), &plan, 0, generation).unwrap();
        assert_eq!([0, 10, 20].map(|tick| of(1).at(tick).is_some()), [false, false, true]);
        assert!(of(0).at(20).is_none(), "another process noted nothing");
    }

    #[test]
    fn a_grant_covers_the_ticks_since_the_one_before() {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(1));
        let mut writer = GrantWriter::create(folder.path(), &plan).unwrap();
        for (end_tick, granted_ns) in [(3, 100), (3, 110), (5, 120), (30, 130)] {
            writer.grant_at(end_tick, (end_tick == 5).then_some(115), granted_ns);
        }
        let reader = GrantReader::open(folder.path()).unwrap();
        assert_eq!(reader.grants().count(), 3, "one that grants nothing is none");
        let granted = [0, 2, 3, 4, 5, 29].map(|tick| reader.of(tick).unwrap().granted_ns);
        assert_eq!(granted, [100, 100, 120, 120, 130, 130]);
        assert_eq!(reader.of(4).unwrap().deadline_ns, Some(115));
        assert_eq!(reader.of(30), None);
    }

    #[test]
    fn the_first_grant_of_a_run_from_a_checkpoint_begins_there() {
        let folder = tempfile::tempdir().unwrap();
        let plan = Plan { first_tick: 10, ..plan(1) };
        let mut writer = GrantWriter::create(folder.path(), &plan).unwrap();
        writer.grant_at(14, None, 100);
        let reader = GrantReader::open(folder.path()).unwrap();
        let granted: Vec<_> = reader.grants().map(|grant| (grant.first_tick, grant.end_tick)).collect();
        assert_eq!(granted, [(10, 14)]);
    }

    #[test]
    fn a_damaged_file_is_refused_by_its_name() {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(1));
        drop(TickWriter::create(folder.path(), &plan, 0, 0, 0).unwrap());
        let file = path(folder.path(), "0", 0);
        let whole = std::fs::read(&file).unwrap();
        let mut claims_more = whole.clone();
        claims_more[16..24].copy_from_slice(&u64::MAX.to_le_bytes());
        for damaged in [&whole[..30], &whole[..7], b"", &[b'x'; 64], &claims_more] {
            std::fs::write(&file, damaged).unwrap();
            let error = TickReader::open(folder.path(), &plan, 0, 0).unwrap_err().to_string();
            assert!(error.contains("profile-0.0.bin"), "{error}");
        }
    }
}
