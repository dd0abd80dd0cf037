//! Logs in MCAP with ROS 2 messages in CDR: recordings of this project and ROS 2 bags.

use std::collections::BTreeMap;

use recorder::definition::{Definition, Leaf};
use recorder::reader::Messages;

use crate::log::{Log, Samples, known};

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
    /// The parsed definition, or why there is none.
    definition: Result<Definition, String>,
}

impl McapLog {
    /// Reads a log's bytes. One that is cut or damaged is read up to there, which its notes say.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, String> {
        let mut log = Self { bytes, topics: BTreeMap::new(), start_ns: 0, notes: Vec::new() };
        let mut topics = BTreeMap::new();
        let mut start_ns = None;
        for (count, message) in Messages::new(&log.bytes).enumerate() {
            let message = match message {
                Ok(message) => message,
                Err(error) if count == 0 => {
                    return Err(format!(
                        "it cannot be read as MCAP: {error}; check `format` and its compression"
                    ));
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
        log.start_ns = start_ns.ok_or("it has no messages; record the flight again")?.into();
        Ok(log)
    }

    fn topic(&self, topic: Option<&str>) -> Result<(&str, &Topic, &Definition), String> {
        let name = topic.ok_or("no `topic`, which an MCAP file needs; add it")?;
        let (name, topic) = self.topics.get_key_value(name).ok_or_else(|| {
            let known = known(self.topics.keys().map(String::as_str));
            format!("no topic `{name}`; it has {known}; correct `topic`")
        })?;
        Ok((name, topic, topic.definition.as_ref().map_err(|reason| format!("topic `{name}`: {reason}"))?))
    }
}

impl Topic {
    fn of(channel: &mcap::Channel<'_>) -> Self {
        let Some(schema) = &channel.schema else {
            return Self { kind: String::new(), definition: Err("it has no schema".to_owned()) };
        };
        let definition = if schema.encoding == "ros2msg" && channel.message_encoding == "cdr" {
            Definition::parse(&schema.name, &String::from_utf8_lossy(&schema.data))
        } else {
            Err(format!(
                "its messages are {} with a {} schema, expected cdr with ros2msg",
                channel.message_encoding, schema.encoding
            ))
        };
        Self { kind: schema.name.clone(), definition }
    }
}

impl Log for McapLog {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, String> {
        let (name, topic, definition) = self.topic(topic)?;
        let mut samples = Samples { notes: self.notes.clone(), ..Samples::default() };
        let mut stamped = 0_usize;
        for message in Messages::new(&self.bytes).map_while(Result::ok) {
            if message.channel.topic != name {
                continue;
            }
            let decoded = definition.decode(&little_endian(&message.data));
            let leaves =
                decoded.map_err(|reason| format!("a message of `{name}` ({}): {reason}", topic.kind))?;
            // A stamp of zero was not set, unless the log begins at zero too: the first tick of a simulation.
            let stamp_ns = stamp_ns(&leaves).filter(|ns| *ns > 0 || message.log_time == 0);
            stamped += usize::from(stamp_ns.is_some());
            let time_ns = stamp_ns.unwrap_or_else(|| message.log_time.into()) - self.start_ns;
            #[allow(clippy::cast_precision_loss, reason = "nanoseconds since the log's start")]
            samples.time_s.push(time_ns as f64 * 1e-9);
            samples.rows.push(row(&leaves, name, names)?);
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

fn number(leaves: &[Leaf], path: &str) -> Option<f64> {
    leaves.iter().find(|leaf| leaf.path == path)?.value.as_f64()
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
fn row(leaves: &[Leaf], topic: &str, names: &[String]) -> Result<Vec<f64>, String> {
    let lost = number(leaves, "measured_ns").is_some() && number(leaves, "valid") == Some(0.0);
    let find = |name: &String| {
        let found = number(leaves, name).ok_or_else(|| {
            let known = known(leaves.iter().map(|leaf| leaf.path.as_str()));
            format!("a message of `{topic}` has no number `{name}`; it has {known}; correct `fields`")
        })?;
        Ok(if lost { f64::NAN } else { found })
    };
    names.iter().map(find).collect()
}
