//! The command `cat`.

use super::files::open_recording;
use super::output::{gone_or_failed, write_json_line};
use anyhow::{Context, Result, bail};
use clap::Args;
use diagnostics::nearest;
use recorder::RecordingError;
use recorder::definition::{Leaf, Value, is_padding};
use recorder::reader::{Record, Recording};
use std::io::Write as _;
use std::path::PathBuf;

/// Arguments of `cat`.
#[derive(Args)]
pub struct CatArguments {
    /// The recording.
    recording: PathBuf,
    /// Only this topic.
    #[arg(long)]
    topic: Option<String>,
    /// Only this field, such as position.z, or all fields below it, such as position; repeatable, and printed in the order
    /// given. Needs --topic.
    #[arg(long, value_name = "FIELD", requires = "topic")]
    field: Vec<String>,
    /// Start of the span, in seconds of simulated time.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value_t = 0.0, hide_default_value = true)]
    from: f64,
    /// End of the span, which belongs to it.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value_t = f64::INFINITY, hide_default_value = true)]
    to: f64,
    /// Print CSV with a column for each field. Needs --topic.
    #[arg(long, requires = "topic")]
    csv: bool,
}

/// Prints the messages of a recording: topic, tick, time and fields, without padding; false if the recording was cut off.
///
/// # Errors
/// If the recording cannot be read, or has no such topic or field.
pub fn cat(arguments: &CatArguments) -> Result<bool> {
    let (from_s, to_s) = (arguments.from, arguments.to);
    if to_s < from_s {
        bail!("--from {from_s} --to {to_s}: the end must not be before the start");
    }
    let recording = open_recording(&arguments.recording)?;
    if let Some(topic) = &arguments.topic {
        recording.topic(topic)?;
    }
    if arguments.csv { csv(&recording, arguments) } else { json_lines(&recording, arguments) }
}

/// Seconds of simulated time from 0 on.
fn seconds(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "expected seconds, such as 2.5".to_owned())?;
    if number >= 0.0 { Ok(number) } else { Err("expected seconds from 0 on".to_owned()) }
}

fn json_lines(recording: &Recording, arguments: &CatArguments) -> Result<bool> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut is_empty = true;
    for record in arguments.records(recording) {
        is_empty = false;
        let record = record?;
        let leaves = arguments.leaves(recording, &record)?;
        let fields: serde_json::Map<_, _> =
            leaves.into_iter().map(|leaf| (leaf.path, json_value(&leaf.value))).collect();
        let line = serde_json::json!({
            "topic": record.topic, "tick": record.tick, "time_ns": record.time_ns, "fields": fields
        });
        if let Err(error) = write_json_line(&mut out, &line) {
            return gone_or_failed(error);
        }
    }
    if is_empty {
        arguments.require_whole(recording)?;
    }
    out.flush().map_or_else(gone_or_failed, |()| Ok(recording.cut().is_none()))
}

fn csv(recording: &Recording, arguments: &CatArguments) -> Result<bool> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut header: Option<Vec<String>> = None;
    for record in arguments.records(recording) {
        let record = record?;
        let leaves = arguments.leaves(recording, &record)?;
        let (paths, values): (Vec<_>, Vec<_>) =
            leaves.into_iter().map(|leaf| (leaf.path, text_of(leaf.value))).unzip();
        let mut lines = String::new();
        if let Some(columns) = &header {
            if *columns != paths {
                let tick = record.tick;
                bail!(
                    "the message at tick {tick} has other fields than the first one: name single ones with --field"
                );
            }
        } else {
            lines += &row(["tick", "time_ns"].map(str::to_owned).into_iter().chain(paths.clone()));
            header = Some(paths);
        }
        let stamps = [record.tick.to_string(), record.time_ns.to_string()];
        lines += &row(stamps.into_iter().chain(values));
        if let Err(error) = out.write_all(lines.as_bytes()) {
            return gone_or_failed(error);
        }
    }
    if header.is_none() {
        arguments.require_whole(recording)?;
    }
    out.flush().map_or_else(gone_or_failed, |()| Ok(recording.cut().is_none()))
}

/// A value as a cell of CSV holds it.
fn text_of(value: Value) -> String {
    match value {
        Value::Text(text) => text,
        number => number.to_string(),
    }
}

/// A row of CSV, safe to be shown on a terminal.
fn row(cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<_> = cells.map(|cell| cell_of(&diagnostics::printable(&cell))).collect();
    format!("{}\n", cells.join(","))
}

/// A cell of CSV, in quotes where it needs them (RFC 4180).
fn cell_of(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

impl CatArguments {
    /// Refuses a span without a message, where the recording or the topic has some.
    fn require_whole(&self, recording: &Recording) -> Result<()> {
        let mut span_s: Option<[f64; 2]> = None;
        recording.visit::<RecordingError>(|message| {
            if self.topic.as_ref().is_none_or(|topic| topic == message.topic) {
                let time_s = std::time::Duration::from_nanos(message.time_ns).as_secs_f64();
                let [first_s, last_s] = span_s.unwrap_or([time_s; 2]);
                span_s = Some([first_s.min(time_s), last_s.max(time_s)]);
            }
            Ok(())
        })?;
        let Some([first_s, last_s]) = span_s else { return Ok(()) };
        let what =
            self.topic.as_ref().map_or_else(|| "the recording".to_owned(), |topic| format!("`{topic}`"));
        let from = (self.from > 0.0).then(|| format!("--from {}", self.from));
        let to = self.to.is_finite().then(|| format!("--to {}", self.to));
        let span = [from, to].into_iter().flatten().collect::<Vec<_>>().join(" ");
        bail!("{span}: no message; those of {what} go from {first_s} s to {last_s} s")
    }

    /// The messages of the topic within the span; of all topics where none is named.
    fn records<'a>(&'a self, recording: &'a Recording) -> impl Iterator<Item = Result<Record>> + 'a {
        let is_wanted = |record: &Record| {
            let time_s = std::time::Duration::from_nanos(record.time_ns).as_secs_f64();
            let is_within = time_s >= self.from && time_s <= self.to;
            is_within && self.topic.as_ref().is_none_or(|topic| *topic == record.topic)
        };
        let records = recording.messages().filter(move |record| record.as_ref().map_or(true, is_wanted));
        records.map(|record| record.context("cannot read on"))
    }

    /// The requested fields, each once, in the order of the arguments; without any, all fields in the order of the definition.
    fn leaves(&self, recording: &Recording, record: &Record) -> Result<Vec<Leaf>> {
        let mut leaves = recording.decode(record)?;
        leaves.retain(|leaf| !is_padding(&leaf.path));
        if self.field.is_empty() {
            return Ok(leaves);
        }
        let mut requested: Vec<Leaf> = Vec::new();
        for field in &self.field {
            let found = leaves_of(&leaves, field);
            if found.is_empty() {
                let known: Vec<_> = leaves.iter().map(|leaf| leaf.path.as_str()).collect();
                let meant = nearest(field, known.iter().copied());
                let meant = meant.map_or(String::new(), |meant| format!(" (did you mean `{meant}`?)"));
                bail!("no field {field} in {}{meant}; there are: {}", record.topic, known.join(", "));
            }
            let is_new = |leaf: &Leaf| requested.iter().all(|other| other.path != leaf.path);
            let new: Vec<Leaf> = found.into_iter().filter(is_new).collect();
            requested.extend(new);
        }
        Ok(requested)
    }
}

/// The leaves of a `field`: itself and all below it, or the number that is made of others, as conditions and plots have them: an
/// angle of a quaternion, or a velocity along an axis of the body.
fn leaves_of(leaves: &[Leaf], field: &str) -> Vec<Leaf> {
    let parts: Vec<Leaf> = leaves.iter().filter(|leaf| is_part(&leaf.path, field)).cloned().collect();
    if !parts.is_empty() {
        return parts;
    }
    let made = recorder::series::value(leaves, field);
    let leaf = |(value, unit): (f64, &str)| Leaf {
        path: field.to_owned(),
        unit: unit.to_owned(),
        value: Value::Float(value),
    };
    made.map(leaf).into_iter().collect()
}

/// True for the field `of` itself and the fields and elements below it.
fn is_part(path: &str, of: &str) -> bool {
    path.strip_prefix(of).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// A value of a recording as JSON; JSON has no NaN and no infinity, so these are strings.
fn json_value(value: &Value) -> serde_json::Value {
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

#[cfg(test)]
mod tests {
    use super::{cell_of, is_part, leaves_of};
    use recorder::definition::{Leaf, Value};

    #[test]
    fn a_field_is_found_with_all_below_it_or_made_of_others() {
        let leaf = |path: &str, value| Leaf {
            path: path.to_owned(),
            unit: "1".to_owned(),
            value: Value::Float(value),
        };
        let leaves =
            [("q.x", 0.0), ("q.y", 0.0), ("q.z", 0.0), ("q.w", 1.0)].map(|(path, value)| leaf(path, value));
        let paths =
            |field: &str| leaves_of(&leaves, field).into_iter().map(|leaf| leaf.path).collect::<Vec<_>>();
        assert_eq!(paths("q"), ["q.x", "q.y", "q.z", "q.w"]);
        assert_eq!(paths("q.z"), ["q.z"]);
        assert_eq!(paths("q.yaw"), ["q.yaw"]);
        assert!(paths("q.v").is_empty());
    }

    #[test]
    fn a_field_has_the_fields_below_it() {
        assert!(
            is_part("position.z", "position")
                && is_part("position.z", "position.z")
                && is_part("command[2]", "command")
        );
        assert!(!is_part("position_error.z", "position") && !is_part("position", "position.z"));
    }

    #[test]
    fn cells_with_commas_are_quoted() {
        assert_eq!(cell_of("a,b"), "\"a,b\"");
        assert_eq!(cell_of("say \"a\""), "\"say \"\"a\"\"\"");
        assert_eq!(cell_of("1.5"), "1.5");
    }
}
