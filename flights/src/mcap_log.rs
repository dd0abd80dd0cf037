//! Logs in MCAP with ROS 2 messages in CDR: recordings of this project and ROS 2 bags.

use std::collections::BTreeMap;

use recorder::definition::{Definition, DefinitionError, Leaf, number};
use recorder::reader::Messages;

use crate::declaration::Clock;
use crate::error::{LogError, Spot};
use crate::flight::median;
use crate::log::{Log, Samples};
use crate::number_rows::NumberRows;

/// Messages of a topic that are looked at for its clock.
const CLOCK_SAMPLES: usize = 200;
/// Clocks that are further apart than this are two: receiving a message takes less.
const ONE_CLOCK_S: f64 = 1.0;

/// A log, with the definitions of its topics.
pub struct McapLog {
    bytes: Vec<u8>,
    topics: BTreeMap<String, Topic>,
    /// Time of the first message: times count from it, as a double has no room for nanoseconds since 1970.
    start_ns: i128,
    /// The clock that the flights file chooses.
    clock: Option<Clock>,
    notes: Vec<String>,
}

struct Topic {
    kind: String,
    /// The parsed definition, or the reason why there is none.
    definition: Result<Definition, NoDefinition>,
}

/// Reason why a topic's messages cannot be read.
#[derive(Debug, thiserror::Error)]
enum NoDefinition {
    #[error("no schema")]
    Nothing,
    #[error("{message} with a {schema} schema")]
    Encoding { message: String, schema: String },
    #[error(transparent)]
    Text(#[from] DefinitionError),
}

impl McapLog {
    /// Reads a log's bytes. One that is cut or damaged is read up to there, which its notes say.
    pub fn parse(bytes: Vec<u8>, clock: Option<Clock>) -> Result<Self, LogError> {
        let mut log = Self { bytes, topics: BTreeMap::new(), start_ns: 0, clock, notes: Vec::new() };
        let mut topics = BTreeMap::new();
        let mut start_ns = None;
        for (count, message) in Messages::new(&log.bytes).enumerate() {
            let message = match message {
                Ok(message) => message,
                Err(error) if count == 0 => {
                    let found = format!("one that cannot be read as MCAP: {error}");
                    let advice = "check `format` and its compression";
                    return Err(LogError::unexpected(Spot::Whole, "an MCAP file", found, advice));
                }
                Err(error) => {
                    log.notes.push(format!("the log is cut or damaged after {count} messages: {error}"));
                    break;
                }
            };
            start_ns = start_ns.or(Some(message.log_time));
            topics.entry(message.channel.topic.clone()).or_insert_with(|| Topic::of(&message.channel));
        }
        log.topics = topics;
        let none = || LogError::unexpected(Spot::Whole, "messages", "none", "record the flight again");
        log.start_ns = start_ns.ok_or_else(none)?.into();
        Ok(log)
    }

    fn topic(&self, topic: Option<&str>) -> Result<(&str, &Topic, &Definition), LogError> {
        let none = || LogError::unexpected(Spot::Key("topic"), "a topic of the MCAP file", "none", "add it");
        let name = topic.ok_or_else(none)?;
        let (name, topic) = self
            .topics
            .get_key_value(name)
            .ok_or_else(|| LogError::missing("topic", name, self.topics.keys(), "`topic`"))?;
        let definition = topic.definition.as_ref().map_err(|found| {
            let at = Spot::Named("topic", name.clone());
            LogError::unexpected(
                at,
                "CDR with a ros2msg schema",
                found.to_string(),
                "record it so, or name another topic",
            )
        })?;
        Ok((name, topic, definition))
    }
}

impl McapLog {
    /// The messages of the topic `name`, up to where the log is damaged.
    fn messages_of(&self, name: &str) -> impl Iterator<Item = mcap::Message<'static>> {
        Messages::new(&self.bytes).map_while(Result::ok).filter(move |message| message.channel.topic == name)
    }

    /// The clocks of a topic's times, each with its median distance from the log's time in s, and in words.
    fn clocks(&self, name: &str) -> Vec<(f64, String)> {
        let Ok((name, topic, definition)) = self.topic(Some(name)) else { return Vec::new() };
        let (mut offsets_s, mut unstamped) = (Vec::new(), 0);
        for message in self.messages_of(name).take(CLOCK_SAMPLES) {
            let Ok(leaves) = decoded(definition, &message, name, &topic.kind) else { break };
            match set_stamp_ns(&leaves, message.log_time) {
                Some(stamp_ns) => offsets_s.push((stamp_ns - i128::from(message.log_time)) as f64 * 1e-9),
                None => unstamped += 1,
            }
        }
        let logged =
            (unstamped > 0).then(|| (0.0, format!("the log's time of `{name}`, which has no stamps")));
        let stamps = median(offsets_s.into_iter()).map(|offset_s| {
            (offset_s, format!("the stamps of `{name}`, {offset_s:.3} s from the log's time"))
        });
        logged.into_iter().chain(stamps).collect()
    }
}

impl Topic {
    fn of(channel: &mcap::Channel<'_>) -> Self {
        let Some(schema) = &channel.schema else {
            return Self { kind: String::new(), definition: Err(NoDefinition::Nothing) };
        };
        let definition = if schema.encoding == "ros2msg" && channel.message_encoding == "cdr" {
            Definition::parse(&schema.name, &String::from_utf8_lossy(&schema.data))
                .map_err(NoDefinition::from)
        } else {
            let (message, schema) = (channel.message_encoding.clone(), schema.encoding.clone());
            Err(NoDefinition::Encoding { message, schema })
        };
        Self { kind: schema.name.clone(), definition }
    }
}

impl Log for McapLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        let (name, topic, definition) = self.topic(topic)?;
        let rows = NumberRows::of_width(names.len());
        let mut samples = Samples { rows, notes: self.notes.clone(), ..Samples::default() };
        let mut stamped = 0_usize;
        let mut absent = Absent::of(names);
        for message in self.messages_of(name) {
            let leaves = decoded(definition, &message, name, &topic.kind)?;
            let stamp_ns = set_stamp_ns(&leaves, message.log_time).filter(|_| self.clock != Some(Clock::Log));
            stamped += usize::from(stamp_ns.is_some());
            let time_ns = match self.clock {
                Some(Clock::Stamp) => stamp_ns,
                _ => stamp_ns.or(Some(message.log_time.into())),
            };
            samples.time_s.push(time_ns.map_or(f64::NAN, |ns| (ns - self.start_ns) as f64 * 1e-9));
            samples.rows.push(absent.row(&leaves, names)?);
        }
        absent.check(names)?;
        if self.clock == Some(Clock::Stamp) && stamped == 0 {
            let at = Spot::Named("topic", name.to_owned());
            let expected = "messages with a stamp, as `time = \"stamp\"` asks for";
            let advice = "name another topic, or choose `time = \"log\"`";
            return Err(LogError::unexpected(at, expected, "none", advice));
        }
        samples.notes.push(match (stamped, samples.time_s.len()) {
            _ if self.clock == Some(Clock::Log) => "time is the log's own (`time = \"log\"`)".to_owned(),
            (0, _) => "time is the log's own, as the messages have no stamp".to_owned(),
            (stamped, all) if stamped == all => "time is the messages' stamp".to_owned(),
            (stamped, all) if self.clock.is_some() => {
                format!("time is the messages' stamp, which {stamped} of {all} have")
            }
            (stamped, all) => {
                format!("time is the messages' stamp in {stamped} of {all}, else the log's own")
            }
        });
        Ok(samples)
    }

    /// Refuses topics whose times are of two clocks, where the flights file does not choose one.
    fn check_clocks(&self, topics: &[&str]) -> Result<(), LogError> {
        if self.clock.is_some() {
            return Ok(());
        }
        let clocks = topics.iter().flat_map(|topic| self.clocks(topic));
        let mut clocks: Vec<(f64, String)> = clocks.collect();
        clocks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(first), Some(last)) = (clocks.first(), clocks.last()) else { return Ok(()) };
        let apart_s = last.0 - first.0;
        if apart_s <= ONE_CLOCK_S {
            return Ok(());
        }
        let found = format!("two that are {apart_s:.3} s apart: {}, and {}", first.1, last.1);
        let advice = "choose by `time = \"log\"`, or by `time = \"stamp\"` where every topic has stamps, in the flight";
        Err(LogError::unexpected(Spot::Key("time"), "one clock for all topics", found, advice))
    }

    fn origin_ns(&self) -> i128 {
        self.start_ns
    }

    fn topics(&self) -> Vec<(String, String)> {
        self.topics.iter().map(|(name, topic)| (name.clone(), topic.kind.clone())).collect()
    }
}

/// The message with the plain header of little-endian CDR, whose options some writers use to note padding.
fn little_endian(cdr: &[u8]) -> Vec<u8> {
    let mut plain = cdr.to_vec();
    if let [0, 1, options @ ..] = &mut plain[..] {
        options.iter_mut().take(2).for_each(|option| *option = 0);
    }
    plain
}

/// When the message was measured: by our own sensors' `measured_ns`, else by its header's or its own stamp.
fn stamp_ns(leaves: &[Leaf]) -> Option<i128> {
    let integer = |path: &str| match leaves.iter().find(|leaf| leaf.path == path)?.value {
        recorder::definition::Value::Integer(number) => Some(number),
        _ => None,
    };
    let stamp = |prefix: &str| {
        let (sec, nanosec) = (integer(&format!("{prefix}.sec"))?, integer(&format!("{prefix}.nanosec"))?);
        sec.checked_mul(1_000_000_000)?.checked_add(nanosec)
    };
    integer("measured_ns").or_else(|| stamp("header.stamp")).or_else(|| stamp("stamp"))
}

/// The stamp of a message that was logged at `log_ns`. A stamp of zero was not set, unless the log begins at zero too: the
/// first tick of a simulation.
fn set_stamp_ns(leaves: &[Leaf], log_ns: u64) -> Option<i128> {
    stamp_ns(leaves).filter(|ns| *ns > 0 || log_ns == 0)
}

fn decoded(
    definition: &Definition,
    message: &mcap::Message<'_>,
    topic: &str,
    kind: &str,
) -> Result<Vec<Leaf>, LogError> {
    definition.decode(&little_endian(&message.data)).map_err(|found| {
        let (at, expected) = (Spot::Named("topic", topic.to_owned()), format!("messages of type {kind}"));
        LogError::unexpected(
            at,
            expected,
            found.to_string(),
            "the log is damaged, or its schema is that of another type",
        )
    })
}

/// Fields that messages may lack: parts of arrays, which have any length in each message.
struct Absent {
    /// For each name, true if a message had it.
    is_found: Vec<bool>,
    /// The fields of the message with the most.
    known: Vec<String>,
}

impl Absent {
    fn of(names: &[String]) -> Self {
        Self { is_found: vec![false; names.len()], known: Vec::new() }
    }

    /// The numbers of a message; NaN where its array is too short, or where a sensor of ours marks the sample
    /// as lost.
    fn row(&mut self, leaves: &[Leaf], names: &[String]) -> Result<Vec<f64>, LogError> {
        let lost = number(leaves, "measured_ns").is_some() && number(leaves, "valid") == Some(0.0);
        let row: Vec<Option<f64>> = names.iter().map(|name| number(leaves, name)).collect();
        row.iter().zip(&mut self.is_found).for_each(|(number, is_found)| *is_found |= number.is_some());
        if self.is_found.contains(&false) && leaves.len() > self.known.len() {
            self.known = leaves.iter().map(|leaf| leaf.path.clone()).collect();
        }
        let is_gone = |name: &&String| !name.contains('[') && number(leaves, name).is_none();
        if let Some(name) = names.iter().find(is_gone) {
            return Err(LogError::missing("field", name, leaves.iter().map(|leaf| &leaf.path), "`fields`"));
        }
        Ok(row.into_iter().map(|number| number.filter(|_| !lost).unwrap_or(f64::NAN)).collect())
    }

    /// Refuses a field that no message has.
    fn check(&self, names: &[String]) -> Result<(), LogError> {
        match names.iter().zip(&self.is_found).find(|(_, is_found)| !**is_found) {
            Some((name, _)) => Err(LogError::missing("field", name, &self.known, "`fields`")),
            None => Ok(()),
        }
    }
}
