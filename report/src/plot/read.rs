//! The one pass over a recording that takes out everything that is drawn.

use crate::plot::choice::{Ask, Choice};
use crate::plot::field;
use crate::plot::request::{Request, Span};
use crate::plot::thin::{Curve, Line, Poses, Trail};
use anyhow::{Result, bail};
use diagnostics::printable_line;
use recorder::RecordingError;
use recorder::definition::{Leaf, number};
use recorder::reader::Recording;
use std::collections::BTreeMap;

/// Points of all curves together at most, so that a page with many vehicles opens.
const POINTS_MAX: usize = 400_000;
/// Bins of a curve: enough for a wide screen, and few enough for a small file.
const BINS: std::ops::RangeInclusive<usize> = 100..=1000;
/// Points of a curve against another field.
const AGAINST_POINTS_MAX: usize = 4000;
/// Messages between two reports of progress.
const PROGRESS_EVERY: u64 = 4096;
/// Channels that a field has, as a guess before the first message is there.
const CHANNELS_PER_ASK: usize = 3;

/// Uses of a topic.
#[derive(Default)]
struct Uses<'a> {
    /// The number of this topic that the curves are drawn against.
    against: Option<&'a mut Ask>,
    asks: Vec<&'a mut Ask>,
    /// Paths in space, each with the field that it is of.
    trails: Vec<(&'a str, &'a mut Poses)>,
}

/// Settings for turning the numbers of a recording into points.
struct Drawn<'a> {
    /// Bins of a curve over time.
    bins: usize,
    request: &'a Request,
    /// True if the user named the fields: a missing one is then an error.
    is_named: bool,
    /// Last value of the number that curves are drawn against; NaN before the first.
    against: f64,
}

/// Reads the samples for `choice` and `request`; returns their first and last time, in seconds. `progress` is called
/// with the number of messages read, now and then.
///
/// # Errors
/// If the file is damaged, a named field is not there, or nothing is in the span.
pub fn read(
    recording: &Recording,
    choice: &mut Choice,
    request: &Request,
    progress: &mut dyn FnMut(u64),
) -> Result<[f64; 2]> {
    let count: usize = choice.axes.iter().map(|axes| axes.asks.len()).sum();
    let bins = (POINTS_MAX / 4 / (CHANNELS_PER_ASK * count).max(1)).clamp(*BINS.start(), *BINS.end());
    let mut drawn = Drawn { bins, request, is_named: choice.is_named, against: f64::NAN };
    let mut uses = uses(choice);
    let [mut read_s, mut whole_s] = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let mut number = 0_u64;
    recording.visit::<anyhow::Error>(|message| {
        if number.is_multiple_of(PROGRESS_EVERY) {
            progress(number);
        }
        number += 1;
        let time_s = message.time_ns as f64 * 1e-9;
        widen(&mut whole_s, time_s);
        let wanted = uses.get_mut(message.topic).filter(|_| request.span.holds(time_s));
        let Some(uses) = wanted else { return Ok(()) };
        let leaves = recording.decode_on(message.topic, message.cdr)?;
        widen(&mut read_s, time_s);
        drawn.push(uses, time_s, &leaves)
    })?;
    require_samples(choice, request.span, read_s, whole_s)?;
    Ok(read_s)
}

impl Drawn<'_> {
    /// Takes the wanted values out of a message with these leaves.
    fn push(&mut self, uses: &mut Uses<'_>, time_s: f64, leaves: &[Leaf]) -> Result<()> {
        if let Some(ask) = &mut uses.against {
            self.begin(ask, true, leaves)?;
            // More than one is refused when all is read.
            for (channel, line) in &mut ask.curves {
                self.against = channel.value(leaves);
                line.push(time_s, self.against);
            }
        }
        let is_over_time = self.request.against.is_none();
        let x = if is_over_time { time_s } else { self.against };
        for ask in &mut uses.asks {
            self.begin(ask, self.is_named, leaves)?;
            if !x.is_nan() {
                ask.curves.iter_mut().for_each(|(channel, line)| line.push(x, channel.value(leaves)));
            }
        }
        uses.trails.iter_mut().for_each(|(field, trail)| trail.push(pose(leaves, field)));
        Ok(())
    }

    /// Before the first message: it shows which numbers the field has.
    fn begin(&self, ask: &mut Ask, is_named: bool, leaves: &[Leaf]) -> Result<()> {
        if !ask.curves.is_empty() {
            return Ok(());
        }
        let channels = field::channels(leaves, &ask.field, self.request.full_throttle);
        if channels.is_none() && is_named {
            return Err(RecordingError::unknown_field(&ask.topic, &ask.field, leaves).into());
        }
        let line = || match self.request.against {
            Some(_) => Line::Against(Trail::new(AGAINST_POINTS_MAX)),
            None => Line::OverTime(Curve::new(self.bins)),
        };
        ask.curves = channels.into_iter().flatten().map(|channel| (channel, line())).collect();
        Ok(())
    }
}

fn uses(choice: &mut Choice) -> BTreeMap<String, Uses<'_>> {
    let mut uses: BTreeMap<String, Uses<'_>> = BTreeMap::new();
    if let Some(ask) = &mut choice.against {
        let topic = ask.topic.clone();
        uses.entry(topic).or_default().against = Some(ask);
    }
    for ask in choice.axes.iter_mut().flat_map(|axes| &mut axes.asks) {
        uses.entry(ask.topic.clone()).or_default().asks.push(ask);
    }
    for (ask, trail) in &mut choice.trails {
        uses.entry(ask.topic.clone()).or_default().trails.push((&ask.field, trail));
    }
    uses
}

/// Position and attitude, of a body if `field` is the position of one; values that the message lacks are NaN.
fn pose(leaves: &[Leaf], field: &str) -> [f64; 7] {
    let attitude = field.replacen("position", "attitude", 1);
    let places = ["x", "y", "z"].map(|axis| format!("{field}.{axis}"));
    let turns = ["x", "y", "z", "w"].map(|part| format!("{attitude}.{part}"));
    let mut paths = places.iter().chain(&turns);
    std::array::from_fn(|_| paths.next().and_then(|path| number(leaves, path)).unwrap_or(f64::NAN))
}

fn is_empty(ask: &Ask) -> bool {
    ask.curves.iter().all(|(_, line)| line.samples() == 0)
}

fn widen(span_s: &mut [f64; 2], time_s: f64) {
    *span_s = [span_s[0].min(time_s), span_s[1].max(time_s)];
}

fn require_samples(choice: &Choice, span: Span, read_s: [f64; 2], whole_s: [f64; 2]) -> Result<()> {
    let named = choice.axes.iter().flat_map(|axes| &axes.asks).filter(|_| choice.is_named);
    let what = match choice.against.iter().chain(named).find(|ask| is_empty(ask)) {
        Some(ask) => format!("{} has no sample", printable_line(&ask.topic)),
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
