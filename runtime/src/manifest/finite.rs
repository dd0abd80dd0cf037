//! Check that every number of a manifest is finite: a fault is found at its place, before the number becomes a
//! `null`.

use super::sources::Sources;
use diagnostics::Diagnostic;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Refuses every number in `table` that is not finite; `path` is the dotted key of the table.
///
/// # Errors
/// Its place and key.
pub fn require(table: &DeTable<'_>, path: &str, sources: &Sources) -> Result<(), Diagnostic> {
    let values = table.iter().map(|(key, value)| require_value(value, &joined(path, key.get_ref()), sources));
    Diagnostic::gather(values).map(drop)
}

fn require_value(value: &Spanned<DeValue<'_>>, path: &str, sources: &Sources) -> Result<(), Diagnostic> {
    match value.get_ref() {
        DeValue::Table(table) => require(table, path, sources),
        DeValue::Array(array) => array
            .iter()
            .enumerate()
            .try_for_each(|(index, item)| require_value(item, &joined(path, &index.to_string()), sources)),
        DeValue::Float(float) => match float.as_str().parse::<f64>() {
            Ok(number) if !number.is_finite() => {
                let message = format!("`{path}` is {}, expected a finite number", float.as_str());
                let help = "no quantity is infinite or none; a number above 1.8e308 counts as infinite";
                Err(sources.problem(&value.span(), message, help))
            }
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}
