//! The overview: the lowest and highest values of every field over the whole recording, in a bounded number of bins. It is
//! read once, in the background, and goes on where the recording grows; it holds what was read so far.

use crate::fields::{Asked, Columns, Field, Sample};
use crate::shown::Shown;
use anyhow::Result;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard};

/// Memory of the bins of all fields.
const BYTES_MAX: usize = 96 << 20;
/// Bins of a field, at least and at most: powers of two.
const BINS: [usize; 2] = [1 << 10, 1 << 16];

/// The lowest and highest values of the fields of a recording.
#[derive(Debug)]
pub struct Overview {
    topics: Mutex<BTreeMap<String, Topic>>,
    fields: Mutex<BTreeMap<String, Vec<Field>>>,
    /// Blocks that were read, and blocks that there are.
    progress: Mutex<[usize; 2]>,
    bins_max: usize,
}

/// The bins of one topic.
#[derive(Debug)]
struct Topic {
    /// Number of samples of a bin.
    samples_of_bin: u64,
    samples: u64,
    /// Time of the first sample of each bin.
    times_ns: Vec<u64>,
    /// Bin after bin, the lowest and the highest value of each field.
    extremes: Vec<[f64; 2]>,
    width: usize,
}

impl Overview {
    /// The overview of a recording with these fields, of which nothing was read yet.
    #[must_use]
    pub fn new(fields: BTreeMap<String, Vec<Field>>) -> Self {
        Self::with_budget(fields, BYTES_MAX)
    }

    /// The same with bins that take this many bytes, unless that is fewer than the least number of bins.
    pub(crate) fn with_budget(fields: BTreeMap<String, Vec<Field>>, bytes: usize) -> Self {
        let count: usize = fields.values().map(Vec::len).sum();
        let affordable = (bytes / size_of::<[f64; 2]>() / count.max(1)).max(1);
        let bins_max = (1 << affordable.ilog2()).clamp(BINS[0], BINS[1]);
        Self { topics: Mutex::default(), fields: Mutex::new(fields), progress: Mutex::default(), bins_max }
    }

    /// Takes fields of topics that had no message before.
    pub fn add_fields(&self, fields: &BTreeMap<String, Vec<Field>>) {
        let mut known = lock(&self.fields);
        for (topic, fields) in fields {
            known.entry(topic.clone()).or_insert_with(|| fields.clone());
        }
    }

    /// Reads the recording from where it was read before to its end, or until `is_ended`.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn fill(&self, shown: &Shown, is_ended: &AtomicBool) -> Result<()> {
        // Topic by topic, so that none has more fields than may be asked for at once.
        let mut columns = Vec::new();
        let known = lock(&self.fields).clone();
        for (topic, fields) in &known {
            let asked = |field: &Field| Asked { topic: topic.clone(), field: field.path.clone() };
            let asked: Vec<Asked> = fields.iter().take(crate::fields::ASKED_MAX).map(asked).collect();
            columns.push((topic, Columns::new(shown, &asked)?));
        }
        let read = self.progress(|progress| {
            progress[1] = shown.block_count();
            progress[0]
        });
        for block in read..shown.block_count() {
            if is_ended.load(Ordering::Relaxed) {
                return Ok(());
            }
            self.add_block(shown, block, &mut columns)?;
            self.progress(|progress| progress[0] = block + 1);
        }
        Ok(())
    }

    fn add_block(&self, shown: &Shown, block: usize, columns: &mut [(&String, Columns)]) -> Result<()> {
        let mut topics = lock(&self.topics);
        for record in shown.messages(block) {
            let record = record?;
            let found = columns.binary_search_by_key(&&record.topic, |(topic, _)| *topic);
            let Ok(found) = found else { continue };
            let (name, columns) = &mut columns[found];
            columns.read_message(&record, &mut |sample: Sample<'_>| {
                if !topics.contains_key(*name) {
                    topics.insert((*name).clone(), Topic::new(sample.values.len()));
                }
                if let Some(topic) = topics.get_mut(*name) {
                    topic.add(&sample, self.bins_max);
                }
            });
        }
        Ok(())
    }

    fn progress<T>(&self, change: impl FnOnce(&mut [usize; 2]) -> T) -> T {
        change(&mut lock(&self.progress))
    }

    /// The part of the recording that was read, 0 to 1.
    #[must_use]
    pub fn read(&self) -> f64 {
        let [read, all] = *lock(&self.progress);
        if all == 0 { 0.0 } else { read as f64 / all as f64 }
    }

    /// Calls `visit` with the time of each bin of a field, and its lowest and highest value.
    pub fn visit(&self, asked: &Asked, visit: &mut dyn FnMut(u64, f64, f64)) {
        let place = {
            let known = lock(&self.fields);
            let fields = known.get(&asked.topic);
            fields.and_then(|fields| fields.iter().position(|field| field.path == asked.field))
        };
        let topics = lock(&self.topics);
        let (Some(place), Some(topic)) = (place, topics.get(&asked.topic)) else { return };
        let rows = topic.extremes.chunks_exact(topic.width.max(1));
        for (time_ns, row) in topic.times_ns.iter().zip(rows) {
            if let Some([low, high]) = row.get(place) {
                visit(*time_ns, *low, *high);
            }
        }
    }
}

impl Topic {
    fn new(width: usize) -> Self {
        Self { samples_of_bin: 1, samples: 0, times_ns: Vec::new(), extremes: Vec::new(), width }
    }

    fn add(&mut self, sample: &Sample<'_>, bins_max: usize) {
        let is_full = self.samples.is_multiple_of(self.samples_of_bin);
        if is_full && self.times_ns.len() == bins_max {
            self.halve();
        }
        if self.samples.is_multiple_of(self.samples_of_bin) {
            self.times_ns.push(sample.time_ns);
            self.extremes.resize(self.extremes.len() + self.width, [f64::NAN; 2]);
        }
        let row = self.extremes.len() - self.width;
        for (number, value) in sample.values {
            let [low, high] = &mut self.extremes[row + number];
            // The minimum of a number and NaN is the number.
            (*low, *high) = (low.min(*value), high.max(*value));
        }
        self.samples += 1;
    }

    /// Makes one bin of two.
    fn halve(&mut self) {
        let width = self.width;
        self.times_ns = self.times_ns.iter().step_by(2).copied().collect();
        let merged = |pair: &[[f64; 2]]| -> Vec<[f64; 2]> {
            let (first, second) = pair.split_at(width.min(pair.len()));
            let other = |place: usize| second.get(place).copied().unwrap_or([f64::NAN; 2]);
            let both = |(place, [low, high]): (usize, &[f64; 2])| {
                [low.min(other(place)[0]), high.max(other(place)[1])]
            };
            first.iter().enumerate().map(both).collect()
        };
        self.extremes = self.extremes.chunks(2 * width.max(1)).flat_map(merged).collect();
        self.samples_of_bin *= 2;
    }
}

/// A lock that holds whatever a thread that panicked left: numbers that are valid one by one.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
