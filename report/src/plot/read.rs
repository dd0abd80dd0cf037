//! The one pass over a recording that takes out everything that is drawn.

use crate::plot::choice::{Ask, Choice};
use crate::plot::field::{self, Channel};
use crate::plot::thin::{Curve, Trail};
use anyhow::{Result, bail};
use recorder::RecordingError;
use recorder::definition::Leaf;
use recorder::reader::Recording;
use std::collections::BTreeMap;

/// Points of all curves together at most, so that a page with many vehicles opens.
const POINTS_MAX: usize = 400_000;
/// Bins of a curve: enough for a wide screen, and few enough for a small file.
const BINS: std::ops::RangeInclusive<usize> = 100..=1000;
/// Points of a path in space.
const TRAIL_POINTS_MAX: usize = 2000;
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

/// What was read for one [`Ask`]: its channels with their curves; none where no message was in the span.
pub type Curves = Vec<(Channel, Curve)>;

/// What was read.
#[derive(Debug)]
pub struct Read {
    /// For each of the choice's asks.
    pub curves: Vec<Curves>,
    /// For each of the choice's paths.
    pub trails: Vec<Trail>,
    /// First and last time of what was drawn, in seconds.
    pub span_s: [f64; 2],
}

/// What a topic is read for.
#[derive(Default)]
struct Uses {
    asks: Vec<usize>,
    trails: Vec<usize>,
}

/// Reads what `choice` asks for in `span`; `progress` hears the number of messages read, now and then.
///
/// # Errors
/// If the file is damaged, a named field is not there, or nothing is in the span.
pub fn read(
    recording: &Recording,
    choice: &Choice,
    span: Span,
    progress: &mut dyn FnMut(u64),
) -> Result<Read> {
    let asks: Vec<&Ask> = choice.asks().collect();
    let bins = (POINTS_MAX / 4 / (CHANNELS_PER_ASK * asks.len()).max(1)).clamp(*BINS.start(), *BINS.end());
    let uses = uses(&asks, &choice.trails);
    let mut read = Read {
        curves: vec![Curves::new(); asks.len()],
        trails: vec![Trail::new(TRAIL_POINTS_MAX); choice.trails.len()],
        span_s: [f64::INFINITY, f64::NEG_INFINITY],
    };
    let mut whole_s = [f64::INFINITY, f64::NEG_INFINITY];
    for (number, record) in (0_u64..).zip(recording.messages()) {
        let record = record?;
        if number.is_multiple_of(PROGRESS_EVERY) {
            progress(number);
        }
        let time_s = record.time_ns as f64 * 1e-9;
        widen(&mut whole_s, time_s);
        let Some(uses) = uses.get(record.topic.as_str()).filter(|_| span.holds(time_s)) else { continue };
        let leaves = recording.decode(&record)?;
        widen(&mut read.span_s, time_s);
        for &index in &uses.asks {
            read.add(index, asks[index], time_s, &leaves, bins, choice.is_named)?;
        }
        for &index in &uses.trails {
            read.trails[index].push(position(&leaves));
        }
    }
    require_samples(&read, &asks, choice, span, whole_s)?;
    Ok(read)
}

fn uses<'a>(asks: &[&'a Ask], trails: &'a [Ask]) -> BTreeMap<&'a str, Uses> {
    let mut uses: BTreeMap<&str, Uses> = BTreeMap::new();
    for (index, ask) in asks.iter().enumerate() {
        uses.entry(&ask.topic).or_default().asks.push(index);
    }
    for (index, trail) in trails.iter().enumerate() {
        uses.entry(&trail.topic).or_default().trails.push(index);
    }
    uses
}

impl Read {
    /// Adds a message to the curves of an ask; the first shows which numbers the field has.
    fn add(
        &mut self,
        index: usize,
        ask: &Ask,
        time_s: f64,
        leaves: &[Leaf],
        bins: usize,
        is_named: bool,
    ) -> Result<(), RecordingError> {
        let curves = &mut self.curves[index];
        if curves.is_empty() {
            let channels = match field::channels(leaves, &ask.field) {
                Some(channels) => channels,
                None if is_named => return Err(unknown(ask, leaves)),
                None => Vec::new(),
            };
            *curves = channels.into_iter().map(|channel| (channel, Curve::new(bins))).collect();
        }
        for (channel, curve) in curves {
            curve.push(time_s, channel.value(leaves));
        }
        Ok(())
    }
}

fn unknown(ask: &Ask, leaves: &[Leaf]) -> RecordingError {
    RecordingError::UnknownField {
        topic: ask.topic.clone(),
        field: ask.field.clone(),
        known: leaves.iter().map(|leaf| leaf.path.as_str()).collect::<Vec<_>>().join(", "),
    }
}

fn position(leaves: &[Leaf]) -> [f64; 3] {
    let number =
        |path: &str| leaves.iter().find(|leaf| leaf.path == path).and_then(|leaf| leaf.value.as_f64());
    ["position.x", "position.y", "position.z"].map(|path| number(path).unwrap_or(f64::NAN))
}

fn widen(span_s: &mut [f64; 2], time_s: f64) {
    *span_s = [span_s[0].min(time_s), span_s[1].max(time_s)];
}

fn require_samples(read: &Read, asks: &[&Ask], choice: &Choice, span: Span, whole_s: [f64; 2]) -> Result<()> {
    let missing = asks.iter().zip(&read.curves).find(|(_, curves)| choice.is_named && curves.is_empty());
    let what = match missing {
        Some((ask, _)) => format!("{} has no sample", ask.topic),
        None if read.span_s[0] > read.span_s[1] => "there is nothing to plot".to_owned(),
        None => return Ok(()),
    };
    let to = span.to_s.map_or(String::new(), |to_s| format!(" to {to_s} s"));
    if whole_s[0] > whole_s[1] {
        bail!("{what}: the recording has no message");
    }
    bail!(
        "{what} from {} s{to}: the recording spans {:.3} s to {:.3} s",
        span.from_s,
        whole_s[0],
        whole_s[1]
    );
}
