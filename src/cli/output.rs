//! Standard output and standard error: the one place that prints. Everything that a terminal would interpret is
//! escaped here.

use anyhow::{Context, Result};
use diagnostics::{Diagnostic, printable, printable_json, short_lines};
use serde::Serialize;
use std::borrow::Cow;
use std::io::Write as _;

/// Prints a text for people to standard output.
pub fn print_text(text: &str) -> Result<()> {
    print(&readable(text))
}

/// Prints `value` as JSON to standard output.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    print(&printable_json(&serde_json::to_string_pretty(value)?))
}

/// Prints a file that another program reads to standard output, whole.
pub fn print_file(text: &str) -> Result<()> {
    print(&printable(text))
}

/// Prints `value` as one line of JSON to standard output.
pub fn print_json_line(value: &impl Serialize) -> Result<()> {
    print(&printable_json(&serde_json::to_string(value)?))
}

/// Writes `value` as one line of JSON to `out`.
pub fn write_json_line(out: &mut impl std::io::Write, value: &serde_json::Value) -> std::io::Result<()> {
    writeln!(out, "{}", printable_json(&value.to_string()))
}

/// Text of a message as people can read it, for any names and contents of files in it.
pub fn readable(text: &str) -> Cow<'_, str> {
    match short_lines(text) {
        Cow::Borrowed(text) => printable(text),
        Cow::Owned(text) => Cow::Owned(printable(&text).into_owned()),
    }
}

fn print(text: &str) -> Result<()> {
    writeln!(std::io::stdout(), "{}", text.trim_end()).or_else(|error| gone_or_failed(error).map(|_| ()))
}

/// A reader that has gone away (`| head`) is not an error; a full disk is one.
pub fn gone_or_failed(error: std::io::Error) -> Result<bool> {
    if error.kind() == std::io::ErrorKind::BrokenPipe {
        Ok(true)
    } else {
        Err(error).context("cannot write to standard output")
    }
}

/// Prints a line on standard error. If that is closed or full, the line is lost.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", readable(text));
}

/// Message of an error with its causes and the lines of the files concerned; a cause that the text already contains
/// is not repeated.
pub fn message(error: &anyhow::Error) -> String {
    let first = error.chain().next().map_or(String::new(), |first| format!("{first:#}"));
    error.chain().skip(1).fold(first, |text, cause| {
        if text.contains(&cause.to_string()) || text.contains(&format!("{cause:#}")) {
            text
        } else {
            format!("{text}: {cause:#}")
        }
    })
}

/// Prints warnings on standard error.
pub fn print_warnings(warnings: &[Diagnostic]) {
    warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
}
