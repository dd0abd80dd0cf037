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
        print_json(&json!({ "identical": difference.is_none(), "first": difference.as_ref().map(told) }))?;
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
            "refused": found.refused.as_ref().map(told),
        }))?;
    } else {
        print_text(&text(&found, tolerance))?;
    }
    Ok(is_within)
}

fn told(difference: &Difference) -> Value {
    json!({ "difference": difference, "text": difference.to_string() })
}

fn text(found: &Comparison, tolerance: f64) -> String {
    let Comparison { messages, fields, refused } = found;
    let beyond: Vec<&FieldDifference> = fields.iter().filter(|field| field.largest > tolerance).collect();
    let mut lines = vec![match (fields.len(), beyond.len()) {
        (0, _) => format!("{messages} messages are the same"),
        (all, 0) => format!("{messages} messages are within {tolerance:?}; {all} fields differ:"),
        (all, count) => format!("{count} of {all} fields that differ are beyond {tolerance:?}:"),
    }];
    // Within the tolerance those that differ are of interest.
    let listed: Vec<&FieldDifference> = if beyond.is_empty() { fields.iter().collect() } else { beyond };
    lines.extend(listed.iter().take(FIELDS_PRINTED).map(|field| line(field)));
    if listed.len() > FIELDS_PRINTED {
        lines.push(format!("  and {} more; --json lists all", listed.len() - FIELDS_PRINTED));
    }
    lines.extend(refused.iter().map(|difference| format!("no tolerance allows this: {difference}")));
    lines.join("\n")
}

fn line(field: &FieldDifference) -> String {
    let FieldDifference { topic, field: path, unit, messages, first_tick, largest, largest_tick } = field;
    let largest = match unit.as_str() {
        "" | "1" => format!("{largest:?}"),
        unit => format!("{largest:?} {unit}"),
    };
    let (topic, path, largest) = (printable_line(topic), printable_line(path), printable_line(&largest));
    format!(
        "  {topic} {path}: at most {largest} (tick {largest_tick}), in {messages} messages from tick {first_tick} on"
    )
}
