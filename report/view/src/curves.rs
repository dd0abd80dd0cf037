//! Curves: the lowest and highest values in intervals of time, as scopes draw them.
//!
//! The intervals divide a window evenly, one or two to a pixel: drawn through both values of each, a curve covers the same
//! pixels as all of its samples would (M4: Jugel et al., Proc. VLDB Endowment 7(10), 2014).

use crate::fields::{Asked, Columns, Sample};
use crate::overview::Overview;
use crate::shown::Shown;
use anyhow::{Result, bail};
use serde::Deserialize;

/// Intervals of one request: of a wide screen.
const BINS_MAX: usize = 8192;
/// Windows over more blocks are answered by the overview: a minute of a recording of ours, which has a block a second.
const BLOCKS_MAX: usize = 64;
/// The limit while the recording grows: pages request the whole time at each growth.
const GROWING_BLOCKS_MAX: usize = 8;

/// A request of curves.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvesRequest {
    /// Number of the recording.
    pub recording: usize,
    /// Start of the window, in ns.
    pub from_ns: u64,
    /// End of the window, in ns; it does not belong to it.
    pub to_ns: u64,
    /// Intervals that divide it.
    pub bins: usize,
    /// Fields, each a curve.
    pub fields: Vec<Asked>,
}

/// Two values of each interval of each curve, in the order of time where that is known: the lowest and the highest. NaN
/// where it has no sample.
#[derive(Debug, PartialEq)]
pub struct Curves {
    /// Curve after curve, interval after interval, two values.
    pub values: Vec<f64>,
    /// The part of the recording that was read for them, 0 to 1: below 1 while the overview is being made.
    pub read: f64,
}

/// The requested curves, with all samples of a short window, and by the overview of a long one.
///
/// # Errors
/// If the recording is damaged, has no such topic, or too much is requested. A long window of a damaged recording is
/// refused, wherever the damage is.
pub fn curves(shown: &Shown, overview: &Overview, request: &CurvesRequest) -> Result<Curves> {
    let CurvesRequest { from_ns, to_ns, bins, .. } = *request;
    if bins == 0 || bins > BINS_MAX || to_ns <= from_ns {
        bail!(
            "{bins} intervals from {from_ns} to {to_ns} ns are asked for, expected 1 to {BINS_MAX} and a later end"
        );
    }
    let mut columns = Columns::new(shown, &request.fields)?;
    let mut bins = Bins::new(request);
    let blocks = shown.blocks(from_ns, to_ns - 1);
    let blocks_max = if shown.is_growing() { GROWING_BLOCKS_MAX } else { BLOCKS_MAX };
    if blocks.len() <= blocks_max {
        columns.read(shown, blocks, &mut |sample: Sample<'_>| {
            sample.values.iter().for_each(|(curve, value)| bins.add(*curve, sample.time_ns, *value));
        })?;
        return Ok(Curves { values: bins.values(), read: 1.0 });
    }
    for (curve, asked) in request.fields.iter().enumerate() {
        overview.visit(asked, &mut |time_ns, low, high| {
            bins.add(curve, time_ns, low);
            bins.add(curve, time_ns, high);
        })?;
    }
    Ok(Curves { values: bins.values(), read: overview.read() })
}

/// The extremes of an interval, with their times.
#[derive(Clone, Copy)]
struct Bin {
    low: (u64, f64),
    high: (u64, f64),
}

struct Bins {
    from_ns: u64,
    to_ns: u64,
    count: usize,
    bins: Vec<Bin>,
}

impl Bins {
    fn new(request: &CurvesRequest) -> Self {
        let CurvesRequest { from_ns, to_ns, bins: count, .. } = *request;
        let none = (0, f64::NAN);
        Self {
            from_ns,
            to_ns,
            count,
            bins: vec![Bin { low: none, high: none }; count * request.fields.len()],
        }
    }

    /// Adds a sample, unless it is outside of the window or NaN.
    fn add(&mut self, curve: usize, time_ns: u64, value: f64) {
        if time_ns < self.from_ns || time_ns >= self.to_ns || value.is_nan() {
            return;
        }
        let span_ns = u128::from(self.to_ns - self.from_ns);
        let place = u128::from(time_ns - self.from_ns) * self.count as u128 / span_ns;
        let bin = &mut self.bins[curve * self.count + place as usize];
        if bin.low.1.is_nan() || value < bin.low.1 {
            bin.low = (time_ns, value);
        }
        if bin.high.1.is_nan() || value > bin.high.1 {
            bin.high = (time_ns, value);
        }
    }

    fn values(&self) -> Vec<f64> {
        let pair = |bin: &Bin| match bin.low.0 <= bin.high.0 {
            true => [bin.low.1, bin.high.1],
            false => [bin.high.1, bin.low.1],
        };
        self.bins.iter().flat_map(pair).collect()
    }
}
