//! Standard output and standard error: the one place that prints. Everything that a terminal would interpret is
//! escaped here.

use anyhow::{Context, Result};
use diagnostics::parameter::FileFault;
use diagnostics::{
    Diagnostic, ParameterError, Place, find_diagnostic, has_text_of, plain, printable, printable_json,
    short_lines,
};
use serde::Serialize;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::io::{IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};

/// True once a JSON document was printed: a command prints one.
static HAS_PRINTED_JSON: AtomicBool = AtomicBool::new(false);

/// Prints a text for people to standard output.
pub fn print_text(text: &str) -> Result<()> {
    print(&readable(text))
}

/// Prints `value` as JSON to standard output.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    print_document(&serde_json::to_string_pretty(value)?)
}

/// Prints a file that another program reads to standard output, whole.
pub fn print_file(text: &str) -> Result<()> {
    print(&printable(text))
}

/// Prints `value` as one line of JSON to standard output.
pub fn print_json_line(value: &impl Serialize) -> Result<()> {
    print_document(&serde_json::to_string(value)?)
}

fn print_document(json: &str) -> Result<()> {
    HAS_PRINTED_JSON.store(true, Ordering::Relaxed);
    print(&printable_json(json))
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
    let text = readable(text);
    let text = if has_colour() { coloured(&text).into() } else { text };
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// `text` with colours: each of several faults begins a line with a word of its own.
fn coloured(text: &str) -> String {
    let line = |line: &str| {
        let marked = MARKS.iter().find_map(|(mark, style)| Some((mark, style, line.strip_prefix(mark)?)));
        marked.map_or(line.to_owned(), |(mark, style, rest)| format!("{style}{mark}{RESET}{rest}"))
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Begins of lines that are coloured on a terminal, and their colours: those of the errors of arguments.
const MARKS: [(&str, &str); 2] = [("error:", "\x1b[1m\x1b[31m"), ("warning:", "\x1b[1m\x1b[33m")];
const RESET: &str = "\x1b[0m";

/// True if standard error is a terminal that may be coloured (<https://no-color.org>).
fn has_colour() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
    std::io::stderr().is_terminal() && !is_set("NO_COLOR") && !is_dumb
}

/// Message of an error with its causes and the lines of the files concerned; a cause that the text already contains
/// is not repeated.
pub fn message(error: &anyhow::Error) -> String {
    plain(&whole_message(error)).into_owned()
}

fn whole_message(error: &anyhow::Error) -> String {
    let first = error.chain().next().map_or(String::new(), |first| format!("{first:#}"));
    error.chain().skip(1).fold(first, |text, cause| {
        if has_text_of(&text, cause) { text } else { format!("{text}: {cause:#}") }
    })
}

/// Prints the error of a command on standard error. Where `--json` asks for it, a program finds it on standard output, too: `error` is the text, and
/// `faults` are the places in files.
pub fn print_error(error: &anyhow::Error) {
    say(&format!("error: {}", message(error)));
    print_warnings(diagnostic(error).map_or(&[], Diagnostic::warnings));
    print_error_json(&json!({ "error": message(error), "faults": faults(error) }));
}

/// Prints `value` as JSON if the arguments ask for JSON, and no document was printed before.
pub fn print_error_json(value: &Value) {
    let asks = std::env::args_os().take_while(|word| word != "--").any(|word| word == "--json");
    if asks && !HAS_PRINTED_JSON.load(Ordering::Relaxed) {
        // The text is on standard error, whatever becomes of this.
        let _ = print_json(value);
    }
}

/// The faults of files in an error.
fn diagnostic(error: &anyhow::Error) -> Option<&Diagnostic> {
    find_diagnostic(&**error)
}

/// The faults of files that an error is about.
fn faults(error: &anyhow::Error) -> Vec<Value> {
    diagnostic(error).into_iter().flat_map(Diagnostic::all).flat_map(|fault| of_named_file(&fault)).collect()
}

/// The fault, or those of the file that is named there.
fn of_named_file(fault: &Diagnostic) -> Vec<Value> {
    let Diagnostic { file, place, error, help, .. } = fault;
    let ParameterError::File { faults, .. } = error else {
        return vec![fault_json((file, place.as_ref(), fault.key()), (&error.to_string(), help), None)];
    };
    let others =
        faults.also.iter().map(|(who, place)| named_in((&place.file, Some(place), fault.key()), who));
    let others: Vec<Value> = others.collect();
    let one = |FileFault { file, place, key, message, help, .. }: &FileFault| {
        let mut told = fault_json((file, place.as_ref(), key), (message, help), Some((fault, &faults.who)));
        if !others.is_empty() {
            told["also_named_in"] = others.clone().into();
        }
        told
    };
    faults.each.iter().map(one).collect()
}

/// A fault at a place; `by` is the place that names its file, where another one does, and the component that reads it.
fn fault_json(
    at: (&str, Option<&Place>, &str),
    (message, help): (&str, &str),
    by: Option<(&Diagnostic, &str)>,
) -> Value {
    let named_in = by.map(|(by, component)| named_in((&by.file, by.place.as_ref(), by.key()), component));
    let mut fault = place_json(at);
    fault["message"] = plain(message).into();
    fault["help"] = help.into();
    fault["named_in"] = named_in.into();
    fault
}

/// The place that names a file, and the component that reads it.
fn named_in(at: (&str, Option<&Place>, &str), component: &str) -> Value {
    let mut place = place_json(at);
    place["component"] = component.into();
    place
}

fn place_json((file, place, key): (&str, Option<&Place>, &str)) -> Value {
    let (line, column) = place.map(|place| (place.line, place.column)).unzip();
    json!({ "file": file, "line": line, "column": column, "key": key })
}

/// Prints warnings on standard error.
pub fn print_warnings(warnings: &[Diagnostic]) {
    warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
}

#[cfg(test)]
mod tests {
    use super::coloured;

    #[test]
    fn each_fault_begins_with_a_coloured_word() {
        let text = "error: a.toml:1:1: bad\n  |\n1 | error: = 1\nerror: a.toml:2:1: bad, too";
        let red = "\x1b[1m\x1b[31merror:\x1b[0m";
        let shown = format!("{red} a.toml:1:1: bad\n  |\n1 | error: = 1\n{red} a.toml:2:1: bad, too");
        assert_eq!(coloured(text), shown);
        assert_eq!(coloured("warning: odd"), "\x1b[1m\x1b[33mwarning:\x1b[0m odd");
        assert_eq!(coloured("passed"), "passed");
    }
}
