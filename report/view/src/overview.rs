//! The overview: the lowest and highest values of every field over the whole recording, in a bounded number of bins.
//! It is read once, in the background, and goes on as the recording grows; it holds the part read so far.

use crate::fields::{Asked, Columns, Field, Sample};
use crate::shown::Shown;
use anyhow::{Result, bail};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Memory of the bins of all fields.
const BYTES_MAX: usize = 96 << 20;
/// Bins of a field, at least and at most: powers of two.
const BINS: [usize; 2] = [1 << 10, 1 << 16];

/// The lowest and highest values of the fields of a recording.
#[derive(Debug)]
pub struct Overview {
    budget_bytes: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    fields: BTreeMap<String, Vec<Field>>,
    topics: BTreeMap<String, Topic>,
    /// Bins of a topic, at most: a power of two.
    bins_max: usize,
    /// Blocks that were read.
    read: usize,
    /// Blocks of the recording.
    blocks: usize,
    /// The error that ended reading.
    damage: Option<String>,
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
    pub fn new(fields: &BTreeMap<String, Vec<Field>>) -> Self {
        Self::with_budget(fields, BYTES_MAX)
    }

    /// The overview with bins that take this many bytes, unless that is fewer than the least number of bins.
    pub(crate) fn with_budget(fields: &BTreeMap<String, Vec<Field>>, bytes: usize) -> Self {
        let overview = Self { budget_bytes: bytes, state: Mutex::default() };
        overview.add_fields(fields);
        overview
    }

    /// Takes fields of topics that had no message before. If the budget requires it, all topics then have fewer bins.
    pub fn add_fields(&self, fields: &BTreeMap<String, Vec<Field>>) {
        let mut state = self.state();
        for (topic, fields) in fields {
            state.fields.entry(topic.clone()).or_insert_with(|| fields.clone());
        }
        let count: usize = state.fields.values().map(Vec::len).sum();
        let affordable = (self.budget_bytes / size_of::<[f64; 2]>() / count.max(1)).max(1);
        state.bins_max = (1 << affordable.ilog2()).clamp(BINS[0], BINS[1]);
        let bins_max = state.bins_max;
        state.topics.values_mut().for_each(|topic| topic.shrink(bins_max));
    }

    /// Reads the recording from where it was read before to its end, or until `is_ended`.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn fill(&self, shown: &Shown, is_ended: &AtomicBool) -> Result<()> {
        let mut state = self.state();
        state.blocks = shown.block_count();
        // Topic by topic, so that none has more fields than may be requested at once.
        let mut columns = Vec::new();
        for (topic, fields) in &state.fields {
            let asked = |field: &Field| Asked { topic: topic.clone(), field: field.path.clone() };
            let asked: Vec<Asked> = fields.iter().take(crate::fields::ASKED_MAX).map(asked).collect();
            columns.push((topic.clone(), Columns::new(shown, &asked)?));
        }
        let blocks = state.read..state.blocks;
        drop(state);
        for block in blocks {
            if is_ended.load(Ordering::Relaxed) {
                break;
            }
            let mut state = self.state();
            state.add_block(shown, block, &mut columns)?;
            state.read = block + 1;
        }
        Ok(())
    }

    /// Keeps the error that ended reading: [`Overview::visit`] answers with it from now on.
    pub fn fail(&self, damage: String) {
        self.state().damage = Some(damage);
    }

    /// The error that ended reading.
    #[must_use]
    pub fn damage(&self) -> Option<String> {
        self.state().damage.clone()
    }

    /// The part of the recording that was read, 0 to 1.
    #[must_use]
    pub fn read(&self) -> f64 {
        let state = self.state();
        if state.blocks == 0 { 0.0 } else { state.read as f64 / state.blocks as f64 }
    }

    /// Calls `visit` with the time of each bin of a field, and its lowest and highest value.
    ///
    /// # Errors
    /// If reading ended with an error.
    pub fn visit(&self, asked: &Asked, visit: &mut dyn FnMut(u64, f64, f64)) -> Result<()> {
        let state = self.state();
        if let Some(damage) = &state.damage {
            bail!("{damage}");
        }
        let fields = state.fields.get(&asked.topic);
        let place = fields.and_then(|fields| fields.iter().position(|field| field.path == asked.field));
        let (Some(place), Some(topic)) = (place, state.topics.get(&asked.topic)) else { return Ok(()) };
        let rows = topic.extremes.chunks_exact(topic.width.max(1));
        for (time_ns, row) in topic.times_ns.iter().zip(rows) {
            if let Some([low, high]) = row.get(place) {
                visit(*time_ns, *low, *high);
            }
        }
        Ok(())
    }

    /// The state, also after a thread that held it panicked: its numbers are valid one by one.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn add_block(&mut self, shown: &Shown, block: usize, columns: &mut [(String, Columns)]) -> Result<()> {
        for record in shown.messages(block) {
            let record = record?;
            let found = columns.binary_search_by(|(topic, _)| topic.cmp(&record.topic));
            let Ok(found) = found else { continue };
            let (name, columns) = &mut columns[found];
            columns.read_message(&record, &mut |sample: Sample<'_>| {
                if !self.topics.contains_key(name) {
                    self.topics.insert(name.clone(), Topic::new(sample.values.len()));
                }
                if let Some(topic) = self.topics.get_mut(name) {
                    topic.add(&sample, self.bins_max);
                }
            });
        }
        Ok(())
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

    /// Merges bins until there are at most this many, which is a power of two.
    fn shrink(&mut self, bins_max: usize) {
        while self.times_ns.len() > bins_max {
            self.halve();
        }
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
