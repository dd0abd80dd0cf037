//! Frames: the newest values at evenly spaced times, as the room shows them.

use crate::fields::{Asked, Columns, Sample};
use crate::shown::Shown;
use anyhow::{Result, bail};
use serde::Deserialize;

/// Frames of one request.
const FRAMES_MAX: usize = 8192;
/// Values of one request: 16 MiB.
const VALUES_MAX: usize = 1 << 21;
/// Blocks that one request reads; as many mebibytes, at most, in a recording of ours.
const BLOCKS_MAX: usize = 512;
/// Blocks in front of the first frame in which the newest sample of a topic is looked for.
const LOOK_BACK_BLOCKS: usize = 16;

/// A request of frames.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FramesRequest {
    /// Number of the recording.
    pub recording: usize,
    /// Time of the first frame, in ns.
    pub from_ns: u64,
    /// Time between two frames, in ns.
    pub step_ns: u64,
    /// Number of frames.
    pub count: usize,
    /// Fields, each a column.
    pub fields: Vec<Asked>,
}

/// The newest samples of each topic at each frame.
struct Grid<'a> {
    request: &'a FramesRequest,
    /// Frame after frame, a value for each field.
    values: Vec<f64>,
    /// Frame after frame, the time of the sample of each topic; `None` where none came since the frame before.
    stamps: Vec<Option<u64>>,
    groups: usize,
}

/// The values of all fields at each frame, frame after frame: those of the newest message at or before its time; NaN
/// if there is none.
///
/// # Errors
/// If the recording is damaged, has no such topic, or too much is requested.
pub fn frames(shown: &Shown, request: &FramesRequest) -> Result<Vec<f64>> {
    let mut columns = Columns::new(shown, &request.fields)?;
    let FramesRequest { from_ns, step_ns, count, .. } = *request;
    if count == 0 || count > FRAMES_MAX || count.saturating_mul(columns.count()) > VALUES_MAX {
        bail!(
            "{count} frames of {} fields are asked for, expected 1 to {FRAMES_MAX} frames and at most {VALUES_MAX} values",
            columns.count()
        );
    }
    let to_ns = from_ns.saturating_add(step_ns.saturating_mul(count as u64 - 1));
    let blocks = shown.blocks(from_ns, to_ns);
    if blocks.len() > BLOCKS_MAX {
        bail!(
            "the frames spread over {} blocks, expected at most {BLOCKS_MAX}: ask for less time",
            blocks.len()
        );
    }
    let mut grid = Grid::new(request, &columns);
    columns.read(shown, blocks.clone(), &mut |sample| grid.add(&sample))?;
    look_back(shown, request, blocks.start, &mut columns, &mut grid)?;
    grid.hold(&columns);
    Ok(grid.values)
}

/// Looks in front of `block` for the newest samples of the topics that have none at the first frame.
fn look_back(
    shown: &Shown,
    request: &FramesRequest,
    block: usize,
    columns: &mut Columns,
    grid: &mut Grid<'_>,
) -> Result<()> {
    for group in (0..columns.group_count()).filter(|group| grid.stamps[*group].is_none()).collect::<Vec<_>>()
    {
        let topic = columns.group(group).0.to_owned();
        let asked: Vec<Asked> = request.fields.iter().filter(|asked| asked.topic == topic).cloned().collect();
        let numbers: Vec<usize> = columns.group(group).1.collect();
        let mut alone = Columns::new(shown, &asked)?;
        let mut at = block;
        for _ in 0..LOOK_BACK_BLOCKS {
            let Some(before) = shown.block_before(&topic, at) else { break };
            alone.read(shown, before..before + 1, &mut |sample| {
                let values: Vec<_> =
                    sample.values.iter().map(|(number, value)| (numbers[*number], *value)).collect();
                grid.add(&Sample { group, time_ns: sample.time_ns, values: &values });
            })?;
            if grid.stamps[group].is_some() {
                break;
            }
            at = before;
        }
    }
    Ok(())
}

impl<'a> Grid<'a> {
    fn new(request: &'a FramesRequest, columns: &Columns) -> Self {
        let groups = columns.group_count();
        let values = vec![f64::NAN; request.count * columns.count()];
        Self { request, values, stamps: vec![None; request.count * groups], groups }
    }

    /// Puts a sample at the first frame at or after it, unless a newer one is there.
    fn add(&mut self, sample: &Sample<'_>) {
        let FramesRequest { from_ns, step_ns, count, .. } = *self.request;
        let late_ns = sample.time_ns.saturating_sub(from_ns);
        let frame = if late_ns == 0 { 0 } else { late_ns.div_ceil(step_ns.max(1)) };
        let Some(frame) = usize::try_from(frame).ok().filter(|frame| *frame < count) else { return };
        // With a step of 0 all frames are at one time.
        if step_ns == 0 && late_ns > 0 {
            return;
        }
        let stamp = &mut self.stamps[frame * self.groups + sample.group];
        if stamp.is_none_or(|other_ns| sample.time_ns >= other_ns) {
            *stamp = Some(sample.time_ns);
            let row = frame * self.request.fields.len();
            sample.values.iter().for_each(|(number, value)| self.values[row + number] = *value);
        }
    }

    /// Gives each frame without a sample of a topic the one of the frame before.
    fn hold(&mut self, columns: &Columns) {
        let width = self.request.fields.len();
        for frame in 1..self.request.count {
            for group in (0..self.groups).filter(|group| self.stamps[frame * self.groups + group].is_none()) {
                for number in columns.group(group).1 {
                    self.values[frame * width + number] = self.values[(frame - 1) * width + number];
                }
            }
        }
    }
}
