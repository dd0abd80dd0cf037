//! Standard output and standard error.

use anyhow::{Context, Result};
use diagnostics::Diagnostic;

/// Prints to standard output.
pub fn print_text(text: &str) -> Result<()> {
    use std::io::Write as _;
    writeln!(std::io::stdout(), "{}", text.trim_end()).or_else(|error| gone_or_failed(error).map(|_| ()))
}

/// A reader that has gone away (`| head`) is no error; a full disk is one.
pub fn gone_or_failed(error: std::io::Error) -> Result<bool> {
    if error.kind() == std::io::ErrorKind::BrokenPipe {
        Ok(true)
    } else {
        Err(error).context("cannot write to standard output")
    }
}

/// Says something on standard error. Where that is closed or full there is nobody to tell.
pub fn say(text: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// What went wrong and why, with the lines of files that are to blame; a cause that the text holds already is not said
/// twice.
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

/// Tells people of what is odd, on standard error.
pub fn print_warnings(warnings: &[Diagnostic]) {
    warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
}
