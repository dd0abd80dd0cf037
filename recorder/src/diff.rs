//! The first difference between two recordings.

use crate::error::RecordingError;
use crate::reader::{Record, Recording};
use diagnostics::printable_line;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// The first difference of two recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Difference {
    /// A message, or a field of it.
    Message {
        /// Tick.
        tick: u32,
        /// Topic.
        topic: String,
        /// Field path; `None` where the whole message is in one recording only.
        field: Option<String>,
        /// Value in the first recording.
        a: String,
        /// Value in the second recording.
        b: String,
    },
    /// A message on a topic that only one recording has.
    Topic {
        /// Tick.
        tick: u32,
        /// Topic.
        topic: String,
        /// The recording that has it.
        has: PathBuf,
        /// The recording that lacks it.
        lacks: PathBuf,
    },
    /// One recording is the beginning of the other, which goes on.
    Prefix {
        /// The recording that ends first.
        shorter: PathBuf,
        /// Its last tick; `None` where it has no message.
        last_tick: Option<u32>,
        /// The recording that goes on.
        longer: PathBuf,
    },
    /// One recording ends before the other, in a comparison within a tolerance.
    Ends {
        /// The recording that ends first.
        shorter: PathBuf,
        /// Its last tick; `None` if it has no message.
        last_tick: Option<u32>,
        /// The recording that goes on.
        longer: PathBuf,
    },
    /// One recording begins later, as that of a run from a checkpoint does, and holds the same messages as the other
    /// from there on.
    Later {
        /// The recording that begins later.
        later: PathBuf,
        /// Its first tick.
        first_tick: u32,
        /// The recording that begins earlier.
        earlier: PathBuf,
        /// The recording that ends first, and its last tick; `None` where they end together.
        ends: Option<(PathBuf, u32)>,
    },
    /// The messages are the same; an attachment or the container differs.
    Container {
        /// Description of the difference.
        difference: String,
    },
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Message { tick, topic, field, a, b } => {
                let field = field.as_ref().map_or(String::new(), |field| format!(", field {field}"));
                let text = format!("tick {tick}, topic {topic}{field}: {a} against {b}");
                f.write_str(&printable_line(&text))
            }
            Self::Topic { tick, topic, has, lacks } => {
                let (has, lacks, topic) = (has.display(), lacks.display(), printable_line(topic));
                write!(f, "tick {tick}, topic {topic}: {lacks} has no such topic, and {has} has it")
            }
            Self::Prefix { shorter, last_tick, longer } => {
                write!(f, "{} is a prefix of {}: ", shorter.display(), longer.display())?;
                match last_tick {
                    Some(tick) => {
                        write!(f, "all of its messages are the same, and it ends after tick {tick}")
                    }
                    None => write!(f, "it ends before the first message"),
                }
            }
            Self::Ends { shorter, last_tick, longer } => {
                let tick = last_tick.map_or_else(
                    || "before its first message".to_owned(),
                    |tick| format!("after tick {tick}"),
                );
                write!(f, "{} ends {tick}, and {} goes on", shorter.display(), longer.display())
            }
            Self::Later { later, first_tick, earlier, ends } => {
                let (later, earlier) = (later.display(), earlier.display());
                write!(
                    f,
                    "{later} begins at tick {first_tick}, and from there on all messages are those of {earlier}"
                )?;
                match ends {
                    Some((path, tick)) => write!(f, " up to tick {tick}, where {} ends", path.display()),
                    None => Ok(()),
                }
            }
            Self::Container { difference } => write!(f, "all messages are the same; {difference}"),
        }
    }
}

/// The first difference of `a` and `b`, or `None` if they are the same bytes.
///
/// # Errors
/// If one of them is damaged.
pub fn first_difference(a: &Recording, b: &Recording) -> Result<Option<Difference>, RecordingError> {
    let is_same = a.source().is_same(&b.source()).map_err(RecordingError::file("read", a.path()))?;
    if is_same {
        return Ok(None);
    }
    let (mut left, mut right) = (a.messages().peekable(), b.messages().peekable());
    let later = match (first_of(&mut left), first_of(&mut right)) {
        (Some(x), Some(y)) if x.tick != y.tick => {
            let is_later = x.tick < y.tick;
            let overlaps = if is_later { skip_to(&mut left, y.tick) } else { skip_to(&mut right, x.tick) };
            if !overlaps {
                // One ends before the other begins.
                return Ok(Some(message_difference(&x, &y)));
            }
            Some(if is_later { (b, y.tick, a) } else { (a, x.tick, b) })
        }
        _ => None,
    };
    let ends = |first: Option<(&Recording, u32)>| -> Option<Difference> {
        let (later, first_tick, earlier) = later?;
        let (later, earlier) = (later.path().to_owned(), earlier.path().to_owned());
        let ends = first.map(|(recording, tick)| (recording.path().to_owned(), tick));
        Some(Difference::Later { later, first_tick, earlier, ends })
    };
    let prefix = |shorter: &Recording, last_tick: Option<u32>, longer: &Recording| {
        let (path, longer) = (shorter.path().to_owned(), longer.path().to_owned());
        let later = last_tick.and_then(|tick| ends(Some((shorter, tick))));
        Ok(later.unwrap_or(Difference::Prefix { shorter: path, last_tick, longer }))
    };
    let mut last_tick = None;
    loop {
        return match (left.next().transpose()?, right.next().transpose()?) {
            (None, None) => ends(None).map_or_else(|| container_difference(a, b), Ok),
            (Some(x), Some(y)) if same_message(&x, &y) => {
                last_tick = Some(x.tick);
                continue;
            }
            (None, Some(_)) => prefix(a, last_tick, b),
            (Some(_), None) => prefix(b, last_tick, a),
            (Some(x), Some(y)) if (x.tick, &x.topic) == (y.tick, &y.topic) => field_difference(a, b, &x, &y),
            (Some(x), Some(y)) => {
                Ok(topic_difference(a, b, &x, &y).unwrap_or_else(|| message_difference(&x, &y)))
            }
        }
        .map(Some);
    }
}

/// Messages of a recording, of which the next can be looked at.
pub(crate) type Messages<I> = std::iter::Peekable<I>;

/// The next of `messages`, which stays the next.
pub(crate) fn first_of(
    messages: &mut Messages<impl Iterator<Item = Result<Record, RecordingError>>>,
) -> Option<Record> {
    messages.peek()?.as_ref().ok().cloned()
}

/// Passes over those of `messages` before `tick`; false if none is left.
pub(crate) fn skip_to(
    messages: &mut Messages<impl Iterator<Item = Result<Record, RecordingError>>>,
    tick: u32,
) -> bool {
    while messages.next_if(|record| record.as_ref().is_ok_and(|record| record.tick < tick)).is_some() {}
    messages.peek().is_some()
}

pub(crate) fn same_message(x: &Record, y: &Record) -> bool {
    (x.tick, x.time_ns, &x.topic, &x.cdr) == (y.tick, y.time_ns, &y.topic, &y.cdr)
}

fn field_difference(
    a: &Recording,
    b: &Recording,
    x: &Record,
    y: &Record,
) -> Result<Difference, RecordingError> {
    let (tick, topic) = (x.tick, x.topic.clone());
    let difference =
        |field: &str, a, b| Difference::Message { tick, topic, field: Some(field.to_owned()), a, b };
    if x.time_ns != y.time_ns {
        return Ok(difference("(log time in ns)", x.time_ns.to_string(), y.time_ns.to_string()));
    }
    let (type_a, type_b) = (&a.topic(&x.topic)?.type_name, &b.topic(&y.topic)?.type_name);
    if type_a != type_b {
        return Ok(difference("(message type)", type_a.clone(), type_b.clone()));
    }
    let (p, q) = (a.decode(x)?, b.decode(y)?);
    // Compared as text: NaN equals NaN here, and -0.0 is not 0.0, as in the bytes.
    let differing =
        p.iter().zip(&q).find(|(l, r)| l.path != r.path || l.value.to_string() != r.value.to_string());
    Ok(match differing {
        Some((l, r)) => difference(&l.path, l.value.to_string(), r.value.to_string()),
        None => difference("(length)", format!("{} bytes", x.cdr.len()), format!("{} bytes", y.cdr.len())),
    })
}

pub(crate) fn message_difference(x: &Record, y: &Record) -> Difference {
    let describe = |record: &Record| format!("a message of {} at tick {}", record.topic, record.tick);
    let earlier = if (x.tick, &x.topic) <= (y.tick, &y.topic) { x } else { y };
    let (tick, topic) = (earlier.tick, earlier.topic.clone());
    Difference::Message { tick, topic, field: None, a: describe(x), b: describe(y) }
}

/// The difference of the next messages, `x` of `a` and `y` of `b`, if the topic of one is missing in the
/// other recording.
fn topic_difference(a: &Recording, b: &Recording, x: &Record, y: &Record) -> Option<Difference> {
    let (of_a, of_b) = ((x, a, b), (y, b, a));
    let by_time = if (x.tick, &x.topic) <= (y.tick, &y.topic) { [of_a, of_b] } else { [of_b, of_a] };
    let (record, has, lacks) =
        by_time.into_iter().find(|(record, has, lacks)| lacks_topic(lacks, has, &record.topic))?;
    let (has, lacks) = (has.path().to_owned(), lacks.path().to_owned());
    Some(Difference::Topic { tick: record.tick, topic: record.topic.clone(), has, lacks })
}

/// True if `recording` lacks `topic`, which `other` has.
pub(crate) fn lacks_topic(recording: &Recording, other: &Recording, topic: &str) -> bool {
    other.topics().contains_key(topic) && !recording.topics().contains_key(topic)
}

fn container_difference(a: &Recording, b: &Recording) -> Result<Difference, RecordingError> {
    if let Some(cut) = [a, b].into_iter().find(|recording| recording.cut().is_some()) {
        let path = cut.path().display();
        let difference = format!("{path} was cut off behind its last message");
        return Ok(Difference::Container { difference });
    }
    let (left, right) = (a.attachments()?, b.attachments()?);
    let differing = left.iter().find(|attachment| !right.contains(attachment));
    let differing = differing.or_else(|| right.iter().find(|attachment| !left.contains(attachment)));
    let difference = match differing {
        Some((name, _)) => format!("the attachment `{name}` differs"),
        None => "the bytes of the container differ (compression, library or chunks)".to_owned(),
    };
    Ok(Difference::Container { difference })
}
