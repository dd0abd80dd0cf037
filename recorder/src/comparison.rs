//! Comparison of two recordings within a tolerance: the largest difference of each field.

use crate::definition::{Leaf, Value};
use crate::diff::{Difference, Messages, first_of, lacks_topic, message_difference, same_message, skip_to};
use crate::error::RecordingError;
use crate::reader::{Record, Recording};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Differences of a field between two recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldDifference {
    /// Topic.
    pub topic: String,
    /// Path of the field.
    pub field: String,
    /// Unit; empty for a field without one.
    pub unit: String,
    /// Number of messages in which it differs.
    pub messages: u64,
    /// First tick at which it differs.
    pub first_tick: u32,
    /// Largest absolute difference, in the field's unit; infinite for a text, and where only one of the two values is NaN. An
    /// infinite one serialises as the text `inf`: JSON has no such number.
    #[serde(serialize_with = "number_or_text")]
    pub largest: f64,
    /// Tick of the largest difference.
    pub largest_tick: u32,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde's interface")]
fn number_or_text<S: Serializer>(number: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if number.is_finite() { serializer.serialize_f64(*number) } else { serializer.collect_str(number) }
}

/// Comparison of two recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Number of messages that were compared.
    pub messages: u64,
    /// Fields that differ, by topic and path.
    pub fields: Vec<FieldDifference>,
    /// Topics of the first recording that the second lacks; their messages are not compared.
    pub only_a: Vec<String>,
    /// Topics of the second recording that the first lacks; their messages are not compared.
    pub only_b: Vec<String>,
    /// Difference that no tolerance allows, such as a missing message; the comparison ends there.
    pub refused: Option<Difference>,
}

impl Comparison {
    /// True if both recordings have the same topics, and all differences are at most `tolerance`, each in its field's unit.
    #[must_use]
    pub fn is_within(&self, tolerance: f64) -> bool {
        self.refused.is_none()
            && self.only_a.is_empty()
            && self.only_b.is_empty()
            && self.fields.iter().all(|field| field.largest <= tolerance)
    }
}

/// Compares the topics that `a` and `b` share, message by message. If one of them begins later, as the recording of a run
/// from a checkpoint does, the comparison begins there.
///
/// ```
/// use bus::announcement::Announcement;
/// use bus::messages::PlantState;
/// use bus::Message as _;
/// use recorder::{comparison::compare, reader::Recording, writer::RecordingWriter};
///
/// let folder = tempfile::tempdir()?;
/// let recorded = |name: &str, height_m: f64| -> Result<Recording, Box<dyn std::error::Error>> {
///     let path = folder.path().join(name);
///     let mut writer = RecordingWriter::create(&path)?;
///     let channel = writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA))?;
///     let state = PlantState { position: [0.0, 0.0, height_m].into(), ..PlantState::default() };
///     writer.write(channel, 0, 0, &[&[0, 1, 0, 0], bytemuck::bytes_of(&state)].concat())?;
///     writer.finish()?;
///     Ok(Recording::open(&path)?)
/// };
/// let found = compare(&recorded("a.mcap", 1.5)?, &recorded("b.mcap", 1.5001)?)?;
/// assert_eq!((found.fields.len(), found.fields[0].field.as_str()), (1, "position.z"));
/// assert!(found.is_within(1e-3) && !found.is_within(1e-5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If one of them is damaged.
pub fn compare(a: &Recording, b: &Recording) -> Result<Comparison, RecordingError> {
    let (mut only_a, mut only_b) = (LastTicks::new(), LastTicks::new());
    let begin = begin(a, b)?;
    let found = compare_shared((a, b), shared(a, b, &mut only_a), shared(b, a, &mut only_b), begin)?;
    let Shared { messages, fields, refused } = found;
    // A run from a checkpoint lacks topics that the whole run used before the checkpoint alone.
    let begin = begin.filter(|_| messages > 0).unwrap_or_default();
    let from = |only: LastTicks| -> Vec<String> {
        only.into_iter().filter(|(_, last_tick)| *last_tick >= begin).map(|(topic, _)| topic).collect()
    };
    let fields = fields.0.into_values().collect();
    Ok(Comparison { messages, fields, only_a: from(only_a), only_b: from(only_b), refused })
}

/// Last tick of each topic.
type LastTicks = BTreeMap<String, u32>;

/// Comparison of the topics that two recordings share.
struct Shared {
    messages: u64,
    fields: Fields,
    refused: Option<Difference>,
}

/// First tick of the recording that begins later; `None` if both begin together.
fn begin(a: &Recording, b: &Recording) -> Result<Option<u32>, RecordingError> {
    let first = |recording: &Recording| recording.messages().next().transpose();
    let ticks = first(a)?.zip(first(b)?).map(|(x, y)| (x.tick, y.tick));
    Ok(ticks.filter(|(x, y)| x != y).map(|(x, y)| x.max(y)))
}

/// Messages of `of` on the topics that `other` has, too. The last ticks of the others go to `only`.
fn shared<'a>(
    of: &'a Recording,
    other: &'a Recording,
    only: &'a mut LastTicks,
) -> Messages<impl Iterator<Item = Result<Record, RecordingError>> + use<'a>> {
    let is_shared = move |message: &Result<Record, RecordingError>| match message {
        Ok(record) if lacks_topic(other, of, &record.topic) => {
            if let Some(last_tick) = only.get_mut(&record.topic) {
                *last_tick = record.tick;
            } else {
                only.insert(record.topic.clone(), record.tick);
            }
            false
        }
        _ => true,
    };
    of.messages().filter(is_shared).peekable()
}

/// Compares the messages `left` of `a` with the messages `right` of `b`, from the tick `begin` on.
fn compare_shared(
    (a, b): (&Recording, &Recording),
    mut left: Messages<impl Iterator<Item = Result<Record, RecordingError>>>,
    mut right: Messages<impl Iterator<Item = Result<Record, RecordingError>>>,
    begin: Option<u32>,
) -> Result<Shared, RecordingError> {
    if let (Some(begin), Some(x), Some(y)) = (begin, first_of(&mut left), first_of(&mut right))
        && !(skip_to(&mut left, begin) && skip_to(&mut right, begin))
    {
        // One ends before the other begins.
        let refused = Some(message_difference(&x, &y));
        drain(left);
        drain(right);
        return Ok(Shared { messages: 0, fields: Fields::default(), refused });
    }
    let mut fields = Fields::default();
    let (mut messages, mut last_tick) = (0, None);
    let ends = |shorter: &Recording, last_tick, longer: &Recording| Difference::Ends {
        shorter: shorter.path().to_owned(),
        last_tick,
        longer: longer.path().to_owned(),
    };
    let refused = loop {
        match (left.next().transpose()?, right.next().transpose()?) {
            (None, None) => break None,
            (None, Some(_)) => break Some(ends(a, last_tick, b)),
            (Some(_), None) => break Some(ends(b, last_tick, a)),
            (Some(x), Some(y)) => {
                if !same_message(&x, &y)
                    && let Some(refused) = fields.add(a, b, &x, &y)?
                {
                    break Some(refused);
                }
                messages += 1;
                last_tick = Some(x.tick);
            }
        }
    };
    drain(left);
    drain(right);
    Ok(Shared { messages, fields, refused })
}

/// Reads `messages` to their end: reading names the topics that only one recording has.
fn drain(messages: impl Iterator<Item = Result<Record, RecordingError>>) {
    messages.take_while(Result::is_ok).for_each(drop);
}

/// Differences by topic and path.
#[derive(Default)]
struct Fields(BTreeMap<(String, String), FieldDifference>);

impl Fields {
    /// Adds the differences of two messages; returns one that no tolerance allows.
    fn add(
        &mut self,
        a: &Recording,
        b: &Recording,
        x: &Record,
        y: &Record,
    ) -> Result<Option<Difference>, RecordingError> {
        if (x.tick, x.time_ns, &x.topic) != (y.tick, y.time_ns, &y.topic) {
            return Ok(Some(message_difference(x, y)));
        }
        let (type_a, type_b) = (&a.topic(&x.topic)?.type_name, &b.topic(&y.topic)?.type_name);
        let (p, q) = (a.decode(x)?, b.decode(y)?);
        let differs = |path: Option<&str>, a: String, b: String| Difference::Message {
            tick: x.tick,
            topic: x.topic.clone(),
            field: path.map(str::to_owned),
            a,
            b,
        };
        if type_a != type_b {
            return Ok(Some(differs(Some("(message type)"), type_a.clone(), type_b.clone())));
        }
        for (l, r) in p.iter().zip(&q) {
            if (&l.path, &l.unit) != (&r.path, &r.unit) {
                let text = |leaf: &Leaf| format!("a field {} in {:?}", leaf.path, leaf.unit);
                return Ok(Some(differs(None, text(l), text(r))));
            }
            if let Some(difference) = difference_of(&l.value, &r.value) {
                self.note(x, l, difference);
            }
        }
        let lengths = format!("{} fields", p.len());
        Ok((p.len() != q.len()).then(|| differs(None, lengths, format!("{} fields", q.len()))))
    }

    fn note(&mut self, record: &Record, leaf: &Leaf, difference: f64) {
        let tick = record.tick;
        let new = || FieldDifference {
            topic: record.topic.clone(),
            field: leaf.path.clone(),
            unit: leaf.unit.clone(),
            messages: 0,
            first_tick: tick,
            largest: difference,
            largest_tick: tick,
        };
        let noted = self.0.entry((record.topic.clone(), leaf.path.clone())).or_insert_with(new);
        noted.messages += 1;
        if difference > noted.largest {
            (noted.largest, noted.largest_tick) = (difference, tick);
        }
    }
}

/// Absolute difference of two values; `None` if they are the same, as two NaNs are.
#[allow(clippy::cast_precision_loss, reason = "a difference is not zero for being large")]
fn difference_of(a: &Value, b: &Value) -> Option<f64> {
    if a.to_string() == b.to_string() {
        return None;
    }
    let difference = match (a, b) {
        // Doubles do not tell large integers apart.
        (Value::Integer(a), Value::Integer(b)) => a.abs_diff(*b) as f64,
        _ => a.as_f64().zip(b.as_f64()).map_or(f64::INFINITY, |(a, b)| (a - b).abs()),
    };
    Some(if difference.is_nan() { f64::INFINITY } else { difference })
}

#[cfg(test)]
mod tests {
    use super::{compare, difference_of};
    use crate::definition::Value;
    use crate::diff::Difference;
    use crate::reader::Recording;
    use crate::writer::RecordingWriter;
    use bus::Message as _;
    use bus::announcement::Announcement;
    use bus::messages::PlantState;
    use std::ops::Range;
    use std::path::Path;

    /// A climb of 1 m a tick, `above_m` higher at tick 7.
    fn climb(folder: &Path, name: &str, ticks: Range<u32>, above_m: f64) -> Recording {
        climb_on(folder, name, &[("/plant/state", ticks)], above_m)
    }

    /// The climb on several topics, each during its ticks.
    fn climb_on(folder: &Path, name: &str, topics: &[(&str, Range<u32>)], above_m: f64) -> Recording {
        let path = folder.join(name);
        let mut writer = RecordingWriter::create(&path).unwrap();
        let announcement = Announcement::of(PlantState::SCHEMA);
        let channels: Vec<_> =
            topics.iter().map(|(topic, _)| writer.add_channel(topic, &announcement).unwrap()).collect();
        let end = topics.iter().map(|(_, ticks)| ticks.end).max().unwrap();
        for tick in 0..end {
            let z = f64::from(tick) + if tick == 7 { above_m } else { 0.0 };
            let state = PlantState { position: [0.0, 0.0, z].into(), ..PlantState::default() };
            let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&state)].concat();
            for (channel, (_, ticks)) in channels.iter().zip(topics) {
                if ticks.contains(&tick) {
                    writer.write(*channel, tick, u64::from(tick) * 1_000_000, &cdr).unwrap();
                }
            }
        }
        writer.finish().unwrap();
        Recording::open(&path).unwrap()
    }

    #[test]
    fn the_largest_difference_of_each_field_is_found_and_judged() {
        let folder = tempfile::tempdir().unwrap();
        let first = climb(folder.path(), "a.mcap", 0..20, 0.0);
        let second = climb(folder.path(), "b.mcap", 0..20, 0.25);
        let found = compare(&first, &second).unwrap();
        assert_eq!((found.messages, found.fields.len(), found.refused.is_none()), (20, 1, true));
        let field = &found.fields[0];
        assert_eq!((field.field.as_str(), field.unit.as_str()), ("position.z", "m"));
        assert_eq!((field.messages, field.first_tick, field.largest_tick), (1, 7, 7));
        assert_eq!(field.largest, 0.25);
        assert!(found.is_within(0.25) && !found.is_within(0.249));
        assert!(compare(&first, &first).unwrap().is_within(0.0));
    }

    #[test]
    fn a_recording_that_ends_earlier_is_within_no_tolerance_and_one_that_begins_later_is_compared_from_there()
    {
        let folder = tempfile::tempdir().unwrap();
        let whole = climb(folder.path(), "a.mcap", 0..20, 0.0);
        let short = climb(folder.path(), "b.mcap", 0..12, 0.0);
        let found = compare(&whole, &short).unwrap();
        assert!(!found.is_within(f64::INFINITY));
        assert!(matches!(found.refused, Some(Difference::Ends { last_tick: Some(11), .. })), "{found:?}");
        let later = climb(folder.path(), "c.mcap", 5..20, 0.5);
        let found = compare(&later, &whole).unwrap();
        assert_eq!((found.messages, found.is_within(0.5)), (15, true));
    }

    #[test]
    fn topics_that_only_one_has_are_named_and_the_others_are_compared_to_their_ends() {
        let folder = tempfile::tempdir().unwrap();
        let posed = [("/plant/pose", 0..20), ("/plant/state", 0..20)];
        let shadowed = [("/plant/state", 0..20), ("/shadow/plant/state", 3..5)];
        let first = climb_on(folder.path(), "a.mcap", &posed, 0.0);
        let second = climb_on(folder.path(), "b.mcap", &shadowed, 0.25);
        let found = compare(&first, &second).unwrap();
        assert_eq!((found.messages, &found.refused), (20, &None));
        assert_eq!((&found.only_a, &found.only_b), (&only("/plant/pose"), &only("/shadow/plant/state")));
        assert_eq!((found.fields.len(), found.fields[0].first_tick), (1, 7));
        assert!(!found.is_within(1.0), "the topics differ");
        // A comparison that ends early names them, too.
        let short = climb(folder.path(), "c.mcap", 0..2, 0.0);
        let found = compare(&short, &second).unwrap();
        assert!(matches!(found.refused, Some(Difference::Ends { .. })), "{found:?}");
        assert_eq!((found.only_a.len(), &found.only_b), (0, &only("/shadow/plant/state")));
    }

    fn only(topic: &str) -> Vec<String> {
        vec![topic.to_owned()]
    }

    #[test]
    fn a_run_from_a_checkpoint_needs_no_topic_that_ended_before_it() {
        let folder = tempfile::tempdir().unwrap();
        let whole = climb_on(folder.path(), "a.mcap", &[("/start", 0..2), ("/plant/state", 0..20)], 0.0);
        let later = climb(folder.path(), "b.mcap", 5..20, 0.0);
        let found = compare(&whole, &later).unwrap();
        assert_eq!((found.messages, found.is_within(0.0)), (15, true), "{found:?}");
        let apart = climb_on(folder.path(), "c.mcap", &[("/start", 0..2)], 0.0);
        let found = compare(&apart, &later).unwrap();
        assert_eq!((found.messages, found.only_a.len(), found.only_b.len()), (0, 1, 1));
        // A shared topic that begins later is not a recording that begins later.
        let late = climb_on(folder.path(), "d.mcap", &[("/start", 0..2), ("/plant/state", 5..20)], 0.0);
        let found = compare(&late, &climb(folder.path(), "e.mcap", 0..20, 0.0)).unwrap();
        assert!(found.refused.is_some() && found.only_a == only("/start"), "{found:?}");
    }

    #[test]
    fn values_that_have_no_difference_are_infinitely_far_apart() {
        let float = |number| Value::Float(number);
        assert_eq!(difference_of(&float(f64::NAN), &float(f64::NAN)), None);
        assert_eq!(difference_of(&float(f64::NAN), &float(1.0)), Some(f64::INFINITY));
        assert_eq!(difference_of(&Value::Text("a".into()), &Value::Text("b".into())), Some(f64::INFINITY));
        assert_eq!(difference_of(&float(0.0), &float(-0.0)), Some(0.0));
        assert_eq!(difference_of(&Value::Integer(3), &Value::Integer(5)), Some(2.0));
        let large = 1 << 60;
        assert_eq!(difference_of(&Value::Integer(large), &Value::Integer(large + 1)), Some(1.0));
    }
}
