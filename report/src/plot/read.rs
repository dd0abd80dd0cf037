//! The one pass over a recording that takes out everything that is drawn.

use crate::plot::choice::{Ask, Choice};
use crate::plot::field;
use crate::plot::thin::{Curve, Trail};
use anyhow::{Result, bail};
use recorder::RecordingError;
use recorder::definition::{Leaf, number};
use recorder::reader::Recording;
use std::collections::BTreeMap;

/// Points of all curves together at most, so that a page with many vehicles opens.
const POINTS_MAX: usize = 400_000;
/// Bins of a curve: enough for a wide screen, and few enough for a small file.
const BINS: std::ops::RangeInclusive<usize> = 100..=1000;
/// Messages between two reports of progress.
const PROGRESS_EVERY: u64 = 4096;
/// Channels that a field has, as a guess before the first message is there.
const CHANNELS_PER_ASK: usize = 3;

/// The span of simulated time that is drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// First time in seconds.
    pub from_s: f64,
    /// Last time in seconds, if there is one.
    pub to_s: Option<f64>,
}

impl Span {
    /// Half a nanosecond of slack: limits in seconds are not exact in binary.
    fn holds(self, time_s: f64) -> bool {
        time_s >= self.from_s - 5e-10 && self.to_s.is_none_or(|to_s| time_s <= to_s + 5e-10)
    }
}

/// What a topic is read for.
type Uses<'a> = (Vec<&'a mut Ask>, Vec<&'a mut Trail>);

/// Reads what `choice` asks for in `span`; returns the first and the last time of it, in seconds. `progress` hears the
/// number of messages read, now and then.
///
/// # Errors
/// If the file is damaged, a named field is not there, or nothing is in the span.
pub fn read(
    recording: &Recording,
    choice: &mut Choice,
    span: Span,
    progress: &mut dyn FnMut(u64),
) -> Result<[f64; 2]> {
    let count: usize = choice.axes.iter().map(|axes| axes.asks.len()).sum();
    let bins = (POINTS_MAX / 4 / (CHANNELS_PER_ASK * count).max(1)).clamp(*BINS.start(), *BINS.end());
    let is_named = choice.is_named;
    let mut uses = uses(choice);
    let [mut read_s, mut whole_s] = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for (number, record) in (0_u64..).zip(recording.messages()) {
        let record = record?;
        if number.is_multiple_of(PROGRESS_EVERY) {
            progress(number);
        }
        let time_s = record.time_ns as f64 * 1e-9;
        widen(&mut whole_s, time_s);
        let uses = uses.get_mut(&record.topic).filter(|_| span.holds(time_s));
        let Some((asks, trails)) = uses else { continue };
        let leaves = recording.decode(&record)?;
        widen(&mut read_s, time_s);
        for ask in asks {
            if ask.curves.is_empty() {
                let channels = field::channels(&leaves, &ask.field);
                if channels.is_none() && is_named {
                    return Err(RecordingError::unknown_field(&ask.topic, &ask.field, &leaves).into());
                }
                // The first message shows which numbers the field has.
                let channels = channels.into_iter().flatten();
                ask.curves = channels.map(|channel| (channel, Curve::new(bins))).collect();
            }
            ask.curves.iter_mut().for_each(|(channel, curve)| curve.push(time_s, channel.value(&leaves)));
        }
        trails.iter_mut().for_each(|trail| trail.push(position(&leaves)));
    }
    require_samples(choice, span, read_s, whole_s)?;
    Ok(read_s)
}

fn uses(choice: &mut Choice) -> BTreeMap<String, Uses<'_>> {
    let mut uses: BTreeMap<String, Uses<'_>> = BTreeMap::new();
    for ask in choice.axes.iter_mut().flat_map(|axes| &mut axes.asks) {
        uses.entry(ask.topic.clone()).or_default().0.push(ask);
    }
    for (ask, trail) in &mut choice.trails {
        uses.entry(ask.topic.clone()).or_default().1.push(trail);
    }
    uses
}

fn position(leaves: &[Leaf]) -> [f64; 3] {
    let paths = ["position.x", "position.y", "position.z"];
    paths.map(|path| number(leaves, path).unwrap_or(f64::NAN))
}

fn widen(span_s: &mut [f64; 2], time_s: f64) {
    *span_s = [span_s[0].min(time_s), span_s[1].max(time_s)];
}

fn require_samples(choice: &Choice, span: Span, read_s: [f64; 2], whole_s: [f64; 2]) -> Result<()> {
    let mut asks = choice.axes.iter().flat_map(|axes| &axes.asks);
    let what = match asks.find(|ask| choice.is_named && ask.curves.is_empty()) {
        Some(ask) => format!("{} has no sample", ask.topic),
        None if read_s[0] > read_s[1] => "there is nothing to plot".to_owned(),
        None => return Ok(()),
    };
    let Span { from_s, to_s } = span;
    let to = to_s.map_or(String::new(), |to_s| format!(" to {to_s} s"));
    let [first_s, last_s] = whole_s;
    if first_s > last_s {
        bail!("{what}: the recording has no message");
    }
    bail!("{what} from {from_s} s{to}: the recording spans {first_s:.3} s to {last_s:.3} s");
}
