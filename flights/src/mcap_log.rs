//! Logs in MCAP with ROS 2 messages in CDR: recordings of this project and ROS 2 bags.

use std::collections::BTreeMap;

use recorder::definition::{Definition, DefinitionError, Leaf, number};
use recorder::reader::Messages;

use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};

/// A log, with what its topics are.
pub struct McapLog {
    bytes: Vec<u8>,
    topics: BTreeMap<String, Topic>,
    /// Time of the first message: times count from it, as a double has no room for nanoseconds since 1970.
    start_ns: i128,
    notes: Vec<String>,
}

struct Topic {
    kind: String,
    /// The parsed definition, or what there is instead.
    definition: Result<Definition, NoDefinition>,
}

/// Why a topic's messages cannot be read.
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
    pub fn parse(bytes: Vec<u8>) -> Result<Self, LogError> {
        let mut log = Self { bytes, topics: BTreeMap::new(), start_ns: 0, notes: Vec::new() };
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
        let mut samples = Samples { notes: self.notes.clone(), ..Samples::default() };
        let mut stamped = 0_usize;
        for message in Messages::new(&self.bytes).map_while(Result::ok) {
            if message.channel.topic != name {
                continue;
            }
            let decoded = definition.decode(&little_endian(&message.data));
            let leaves = decoded.map_err(|found| {
                let (at, expected) =
                    (Spot::Named("topic", name.to_owned()), format!("messages of type {}", topic.kind));
                LogError::unexpected(
                    at,
                    expected,
                    found.to_string(),
                    "the log is damaged, or its schema is another's",
                )
            })?;
            // A stamp of zero was not set, unless the log begins at zero too: the first tick of a simulation.
            let stamp_ns = stamp_ns(&leaves).filter(|ns| *ns > 0 || message.log_time == 0);
            stamped += usize::from(stamp_ns.is_some());
            let time_ns = stamp_ns.unwrap_or_else(|| message.log_time.into()) - self.start_ns;
            samples.time_s.push(time_ns as f64 * 1e-9);
            samples.rows.push(row(&leaves, names)?);
        }
        samples.notes.push(match stamped {
            0 => "time is the log's own, as the messages have no stamp".to_owned(),
            n if n == samples.time_s.len() => "time is the messages' stamp".to_owned(),
            n => {
                format!("time is the messages' stamp in {n} of {}, else the log's own", samples.time_s.len())
            }
        });
        Ok(samples)
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

/// The numbers of a message; NaN where a sensor of ours says that the sample was lost.
fn row(leaves: &[Leaf], names: &[String]) -> Result<Vec<f64>, LogError> {
    let lost = number(leaves, "measured_ns").is_some() && number(leaves, "valid") == Some(0.0);
    let find = |name: &String| {
        let found = number(leaves, name);
        let found = found.ok_or_else(|| {
            LogError::missing("field", name, leaves.iter().map(|leaf| &leaf.path), "`fields`")
        })?;
        Ok(if lost { f64::NAN } else { found })
    };
    names.iter().map(find).collect()
}
