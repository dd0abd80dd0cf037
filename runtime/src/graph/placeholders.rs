//! Placeholders among the parameters of a command: a table with the key `file` or `text` alone becomes a text, in which the
//! variables of the environment are expanded. The program gets a file's path from the root on.

use crate::manifest::Manifest;
use diagnostics::Diagnostic;
use serde_json::Value;
use std::ops::Range;
use toml::Spanned;

/// The parameter `value`, whose key stands at `span`, with texts in place of its placeholders.
///
/// # Errors
/// A variable that is not set, or a path that is no text.
pub fn replaced(manifest: &Manifest, span: &Range<usize>, value: &Value) -> Result<Value, Diagnostic> {
    match value {
        Value::Object(table) => {
            if let Some(text) = placeholder(table) {
                return expanded(manifest, span, text);
            }
            let entries =
                table.iter().map(|(key, value)| Ok((key.clone(), replaced(manifest, span, value)?)));
            entries.collect::<Result<_, _>>().map(Value::Object)
        }
        Value::Array(values) => {
            let values = values.iter().map(|value| replaced(manifest, span, value));
            values.collect::<Result<_, _>>().map(Value::Array)
        }
        _ => Ok(value.clone()),
    }
}

/// A text to expand.
#[derive(Clone, Copy)]
enum Placeholder<'v> {
    /// A path, relative to the file of the manifest.
    File(&'v str),
    /// Any text.
    Text(&'v str),
}

fn placeholder(table: &serde_json::Map<String, Value>) -> Option<Placeholder<'_>> {
    let (key, value) = table.iter().next().filter(|_| table.len() == 1)?;
    match (key.as_str(), value.as_str()?) {
        ("file", path) => Some(Placeholder::File(path)),
        ("text", text) => Some(Placeholder::Text(text)),
        _ => None,
    }
}

fn expanded(manifest: &Manifest, span: &Range<usize>, text: Placeholder<'_>) -> Result<Value, Diagnostic> {
    let written = |text: &str| Spanned::new(span.clone(), text.to_owned());
    match text {
        Placeholder::File(path) => {
            let path = manifest.resolve(&written(path))?;
            Ok(path.to_string_lossy().into_owned().into())
        }
        Placeholder::Text(text) => manifest.expand(&written(text), "the text is").map(Value::String),
    }
}
