//! The command `diff`.

use super::files::open_recording;
use super::output::{print_json, print_text};
use anyhow::Result;
use clap::Args;
use diagnostics::printable_line;
use recorder::comparison::{Comparison, FieldDifference, compare};
use recorder::diff::{Difference, first_difference};
use recorder::reader::Recording;
use serde_json::{Value, json};
use std::fmt::Display;
use std::path::PathBuf;

/// Examples that `--help` shows.
pub const HELP: &str = "Example: hummingbus diff a.mcap b.mcap
         hummingbus diff a.mcap b.mcap --tolerance 1e-9
         hummingbus diff a.mcap b.mcap --tolerance 1e-9 --json";
/// Fields that are printed; `--json` lists all.
const FIELDS_PRINTED: usize = 20;

/// Arguments of `diff`.
#[derive(Args)]
pub struct DiffArguments {
    /// The first recording.
    a: PathBuf,
    /// The second recording.
    b: PathBuf,
    /// Largest difference that counts as none, in the unit of each field.
    #[arg(long, value_name = "NUMBER", value_parser = tolerance, allow_negative_numbers = true)]
    tolerance: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let expected = || "expected a number from 0 on, such as 1e-9".to_owned();
    text.parse().ok().filter(|number: &f64| *number >= 0.0 && number.is_finite()).ok_or_else(expected)
}

/// Compares two recordings; false if they differ, by more than the tolerance if there is one.
///
/// # Errors
/// If one of them cannot be read.
pub fn diff(arguments: &DiffArguments) -> Result<bool> {
    let (a, b) = (open_recording(&arguments.a)?, open_recording(&arguments.b)?);
    match arguments.tolerance {
        None => first(&a, &b, arguments.json),
        Some(tolerance) => within(&a, &b, tolerance, arguments.json),
    }
}

/// Prints the first difference.
fn first(a: &Recording, b: &Recording, is_json: bool) -> Result<bool> {
    let difference = first_difference(a, b)?;
    if is_json {
        print_json(&json!({
            "identical": difference.is_none(),
            "same_from_tick": difference.as_ref().and_then(same_from_tick),
            "first": difference.as_ref().map(told),
        }))?;
    } else {
        print_text(&difference.as_ref().map_or_else(|| "identical".to_owned(), ToString::to_string))?;
    }
    Ok(difference.is_none())
}

/// Prints the fields that differ, and whether all are within `tolerance`.
fn within(a: &Recording, b: &Recording, tolerance: f64, is_json: bool) -> Result<bool> {
    let found = compare(a, b)?;
    let is_within = found.is_within(tolerance);
    if is_json {
        print_json(&json!({
            "within": is_within,
            "tolerance": tolerance,
            "messages": found.messages,
            "fields": found.fields,
            "only_a": found.only_a,
            "only_b": found.only_b,
            "refused": found.refused.as_ref().map(told),
        }))?;
    } else {
        print_text(&text(&found, a, b, tolerance))?;
    }
    Ok(is_within)
}

/// The first tick of a recording that begins later than the other and has the same messages from there on.
fn same_from_tick(difference: &Difference) -> Option<u32> {
    match difference {
        Difference::Later { first_tick, .. } => Some(*first_tick),
        _ => None,
    }
}

fn told(difference: &Difference) -> Value {
    json!({ "difference": difference, "text": difference.to_string() })
}

fn text(found: &Comparison, a: &Recording, b: &Recording, tolerance: f64) -> String {
    let Comparison { fields, only_a, only_b, refused, .. } = found;
    let beyond: Vec<&FieldDifference> = fields.iter().filter(|field| field.largest > tolerance).collect();
    let mut lines = vec![headline(found, beyond.len(), tolerance)];
    // Within the tolerance those that differ are of interest.
    let listed: Vec<&FieldDifference> = if beyond.is_empty() { fields.iter().collect() } else { beyond };
    lines.extend(listed.iter().take(FIELDS_PRINTED).map(|field| line(field)));
    if listed.len() > FIELDS_PRINTED {
        lines.push(format!("  and {} more; --json lists all", listed.len() - FIELDS_PRINTED));
    }
    let lacking = [(b, only_a), (a, only_b)].into_iter().filter(|(_, topics)| !topics.is_empty());
    lines.extend(lacking.map(|(recording, topics)| {
        format!("{} has no topic {}", recording.path().display(), printable_line(&topics.join(", ")))
    }));
    lines.extend(refused.iter().map(|difference| format!("no tolerance allows this: {difference}")));
    lines.join("\n")
}

/// The first line: number of messages, and of the fields that differ.
fn headline(found: &Comparison, beyond: usize, tolerance: f64) -> String {
    let has_own = !(found.only_a.is_empty() && found.only_b.is_empty());
    let messages = || counted(found.messages, "message is", "messages are");
    match (found.fields.len(), beyond) {
        (0, _) if found.messages == 0 && has_own => "no topic is in both recordings".to_owned(),
        (0, _) => format!("{} the same", messages()),
        (all, 0) => {
            format!(
                "{} within {tolerance:?}; {}:",
                messages(),
                counted(all, "field differs", "fields differ")
            )
        }
        (all, beyond) => {
            let all = counted(all, "field that differs", "fields that differ");
            format!("{beyond} of {all} {} beyond {tolerance:?}:", if beyond == 1 { "is" } else { "are" })
        }
    }
}

/// The count with its words: those of one, or those of many.
fn counted<T: PartialEq + From<u8> + Display>(count: T, one: &str, many: &str) -> String {
    let words = if count == T::from(1) { one } else { many };
    format!("{count} {words}")
}

fn line(field: &FieldDifference) -> String {
    let FieldDifference { topic, field: path, unit, messages, first_tick, largest, largest_tick } = field;
    let largest = match unit.as_str() {
        "" | "1" => format!("{largest:?}"),
        unit => format!("{largest:?} {unit}"),
    };
    let (topic, path, largest) = (printable_line(topic), printable_line(path), printable_line(&largest));
    let messages = counted(*messages, "message", "messages");
    format!(
        "  {topic} {path}: at most {largest} (tick {largest_tick}), in {messages} from tick {first_tick} on"
    )
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn one_is_singular() {
        let of = |count: u64| counted(count, "message is", "messages are");
        assert_eq!([of(0), of(1), of(2)], ["0 messages are", "1 message is", "2 messages are"]);
    }
}
