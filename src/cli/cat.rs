//! The command `cat`.

use super::files::open_recording;
use super::output::{gone_or_failed, write_json_line};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// What `cat` takes.
#[derive(Args)]
pub struct CatArguments {
    /// The recording.
    recording: PathBuf,
    /// Only this topic.
    #[arg(long)]
    topic: Option<String>,
}

/// Prints the messages of a recording: topic, tick, time and fields in the order of the definition; false if it
/// was cut off.
///
/// # Errors
/// If the recording cannot be read, or has no such topic.
pub fn cat(arguments: &CatArguments) -> Result<bool> {
    use std::io::Write as _;
    let (recording, topic) = (open_recording(&arguments.recording)?, arguments.topic.as_deref());
    if let Some(topic) = topic {
        recording.topic(topic)?;
    }
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for record in recording.messages() {
        let record = record?;
        if topic.is_some_and(|topic| topic != record.topic) {
            continue;
        }
        let leaves = recording.decode(&record)?;
        let fields: serde_json::Map<_, _> =
            leaves.into_iter().map(|leaf| (leaf.path, json_value(&leaf.value))).collect();
        let line = serde_json::json!({
            "topic": record.topic, "tick": record.tick, "time_ns": record.time_ns, "fields": fields
        });
        if let Err(error) = write_json_line(&mut out, &line) {
            return gone_or_failed(error);
        }
    }
    out.flush().map_or_else(gone_or_failed, |()| Ok(recording.cut().is_none()))
}

/// A value of a recording as JSON; JSON has no NaN and no infinity, so these are strings.
fn json_value(value: &recorder::definition::Value) -> serde_json::Value {
    use recorder::definition::Value;
    match value {
        Value::Float(number) if number.is_finite() => (*number).into(),
        Value::Float(number) => number.to_string().into(),
        Value::Integer(number) => match i64::try_from(*number) {
            Ok(number) => number.into(),
            Err(_) => u64::try_from(*number).map_or_else(|_| number.to_string().into(), Into::into),
        },
        Value::Text(text) => text.clone().into(),
    }
}
