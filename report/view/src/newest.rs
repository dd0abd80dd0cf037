//! The newest values of a live run: samples from the ring of its recorder, which a recording holds up to a second later.

use crate::fields::{Asked, Columns};
use crate::frames::{FramesRequest, frames};
use crate::shown::Shown;
use anyhow::{Context as _, Result};
use bus::plan::Plan;
use bus::watch::{WatchFiles, WatchReader, WatchedSample};
use recorder::reader::Record;
use runtime::run_dir::{LiveRun, find_live};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A request of the newest values.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NewestRequest {
    /// Fields, each a value.
    pub fields: Vec<Asked>,
}

/// The newest sample of each topic of a run. The ring is made at the first look: a run whose page nobody opens copies
/// nothing.
#[derive(Debug)]
pub struct Newest {
    files: WatchFiles,
    samples: Option<WatchReader>,
    /// Newest samples by their topics, with the times of the run.
    topics: BTreeMap<String, Record>,
    /// Values at the end of the recording, for topics without a newer sample.
    recorded: Option<Recorded>,
}

/// Values at the end of a recording, kept until it grows.
#[derive(Debug)]
struct Recorded {
    fields: Vec<Asked>,
    end_ns: u64,
    values: Vec<f64>,
}

impl Newest {
    /// Newest samples of the run of `plan`.
    pub fn of(run: &LiveRun, plan: &Plan) -> Self {
        let files = WatchFiles::of(&run.entry.run_dir, &plan.run_id);
        Self { files, samples: None, topics: BTreeMap::new(), recorded: None }
    }

    /// Time of the newest sample since the first message of the recording, in ns, and the newest values of `fields`. `None`
    /// while the recorder fills no ring, as in a paused run that nobody has watched yet.
    ///
    /// # Errors
    /// If shared memory has no room for the ring, the recording is damaged, or it has no such topic.
    pub fn values(&mut self, run: &LiveRun, shown: &Shown, fields: &[Asked]) -> Result<Option<Vec<f64>>> {
        if !self.look(run)? {
            return Ok(None);
        }
        let start_ns = shown.start_ns();
        let end_ns = start_ns.saturating_add(shown.duration_ns());
        let mut columns = Columns::new(shown, fields)?;
        let mut values = self.recorded(shown, fields)?;
        let mut newest_ns = end_ns;
        for record in self.topics.values().filter(|record| record.time_ns > end_ns) {
            newest_ns = newest_ns.max(record.time_ns);
            columns.read_message(record, &mut |sample| {
                sample.values.iter().for_each(|(number, value)| values[*number] = *value);
            });
        }
        values.insert(0, newest_ns.saturating_sub(start_ns) as f64);
        Ok(Some(values))
    }

    /// Takes the samples that have come; false while there are none.
    fn look(&mut self, run: &LiveRun) -> Result<bool> {
        if self.samples.is_none() {
            self.samples = Some(self.files.watch().context("cannot watch the run")?);
            if find_live(Some(&run.entry.run_id)).is_err() {
                // The run may have ended while the ring was made.
                self.files.remove();
            }
        }
        let Self { samples: Some(samples), topics, .. } = self else { return Ok(false) };
        samples.read(|sample| keep(topics, sample));
        Ok(!topics.is_empty())
    }

    /// The values at the end of the recording.
    fn recorded(&mut self, shown: &Shown, fields: &[Asked]) -> Result<Vec<f64>> {
        let end_ns = shown.duration_ns();
        if let Some(recorded) = &self.recorded
            && recorded.end_ns == end_ns
            && recorded.fields == fields
        {
            return Ok(recorded.values.clone());
        }
        let fields = fields.to_vec();
        let request = FramesRequest { recording: 0, from_ns: end_ns, step_ns: 0, count: 1, fields };
        let values = frames(shown, &request)?;
        self.recorded = Some(Recorded { fields: request.fields, end_ns, values: values.clone() });
        Ok(values)
    }
}

/// Keeps a sample as the newest of its topic.
fn keep(topics: &mut BTreeMap<String, Record>, sample: &WatchedSample<'_>) {
    let WatchedSample { tick, time_ns, topic, cdr } = *sample;
    if let Some(record) = topics.get_mut(topic) {
        (record.tick, record.time_ns) = (tick, time_ns);
        record.cdr.clear();
        record.cdr.extend_from_slice(cdr);
    } else {
        let record = Record { tick, time_ns, topic: topic.to_owned(), cdr: cdr.to_vec() };
        topics.insert(topic.to_owned(), record);
    }
}
