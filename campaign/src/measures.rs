//! The `[[measure]]` tables of a campaign file. They are read behind the text of the manifest; their errors are shown where
//! they stand in the campaign file.

use diagnostics::{Diagnostic, Place};
use toml::Spanned;

/// Start of a table in the text that is read.
const HEAD: &str = "[[measure]]";

/// The measures of a campaign file.
#[derive(Clone, Debug, Default)]
pub struct Measures {
    /// The tables as TOML.
    text: String,
    tables: Vec<Places>,
}

/// Places of a table in the campaign file.
#[derive(Clone, Debug)]
struct Places {
    table: Place,
    keys: Vec<(String, Place)>,
}

impl Measures {
    /// The `tables` of the campaign file called `file`, whose text is `text`.
    #[must_use]
    pub fn of(file: &str, text: &str, tables: &[Spanned<toml::Table>]) -> Self {
        if tables.is_empty() {
            return Self::default();
        }
        let places = tables.iter().map(|table| Places::of(file, text, table)).collect();
        let tables: Vec<toml::Table> = tables.iter().map(|table| table.get_ref().clone()).collect();
        let mut file = toml::Table::new();
        file.insert("measure".into(), tables.into());
        Self { text: file.to_string(), tables: places }
    }

    /// True without a table.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tables.is_empty()
    }

    /// The text of a manifest with the measures. They are tables: they may stand behind everything else.
    #[must_use]
    pub fn behind(&self, manifest: String) -> String {
        if self.is_empty() { manifest } else { format!("{manifest}\n{}", self.text) }
    }

    /// `error` with places in the campaign file instead of those behind the `manifest_lines` of the manifest called `manifest`.
    #[must_use]
    pub fn placed(&self, error: anyhow::Error, manifest: &str, manifest_lines: usize) -> anyhow::Error {
        let placed = |mut fault: Diagnostic| {
            let place = fault.place.as_ref().filter(|place| place.file == manifest);
            if let Some(place) =
                place.and_then(|place| self.place(place.line.checked_sub(manifest_lines + 1)?))
            {
                fault.file.clone_from(&place.file);
                fault.place = Some(place);
            }
            fault
        };
        changed(error, placed)
    }

    /// Place in the campaign file of what stands in line number `line` of the text, from 0.
    fn place(&self, line: usize) -> Option<Place> {
        let before = self.text.lines().take(line + 1);
        let index = before.filter(|line| line.trim() == HEAD).count().checked_sub(1)?;
        let Places { table, keys } = self.tables.get(index)?;
        let key = self.text.lines().nth(line)?.split('=').next()?.trim();
        let place = keys.iter().find(|(name, _)| name == key).map_or(table, |(_, place)| place);
        Some(place.clone())
    }
}

/// `error` with each of its faults changed.
#[must_use]
pub fn changed(error: anyhow::Error, change: impl Fn(Diagnostic) -> Diagnostic) -> anyhow::Error {
    let error = diagnostics::Error::from(error);
    let Some(fault) = error.diagnostic() else { return error.into() };
    let mut all: Vec<Diagnostic> = fault.all().map(change).collect();
    let others = all.split_off(1);
    all.remove(0).and(others).into()
}

impl Places {
    fn of(file: &str, text: &str, table: &Spanned<toml::Table>) -> Self {
        let span = table.span();
        let head = text[span.start..].lines().next().unwrap_or_default();
        let keys = table.get_ref().keys().filter_map(|key| {
            let value = value(text, span.start + head.len(), key)?;
            Some((key.clone(), Place::of(file, text, &value)))
        });
        Self { table: Place::of(file, text, &(span.start..span.start + head.len())), keys: keys.collect() }
    }
}

/// Bytes of the value of `key`, which begins a line of the table whose lines begin at byte `start` of `text`.
fn value(text: &str, start: usize, key: &str) -> Option<std::ops::Range<usize>> {
    let mut at = start;
    for line in text[start..].split_inclusive('\n') {
        if line.trim_start().starts_with('[') {
            return None;
        }
        let found = line.split_once('=').filter(|(name, _)| name.trim() == key);
        if let Some((name, value)) = found {
            let begin = at + name.len() + 1 + (value.len() - value.trim_start().len());
            return Some(begin..begin + value.trim().len());
        }
        at += line.len();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::Measures;
    use diagnostics::{Diagnostic, Place};
    use toml::Spanned;

    #[derive(serde::Deserialize)]
    struct File {
        measure: Vec<Spanned<toml::Table>>,
    }

    #[test]
    fn an_error_is_shown_where_the_measure_stands() {
        let text = "flights = 2\n\n[[measure]]\nname = \"a\"\ntopic = \"/t\"\n[[vary]]\nkey = \"x\"\n[[measure]]\n  # the second\n  name = \"b\"\n  topic = \"/u\"\n";
        let file: File = toml::from_str(text).unwrap();
        let measures = Measures::of("c.toml", text, &file.measure);
        let manifest = "[run]\nduration_s = 1";
        let whole = measures.behind(manifest.to_owned());
        let shown = |part: &str| {
            let start = whole.find(part).unwrap();
            let place = Place::of("m.toml", &whole, &(start..start + part.len()));
            let error = measures.placed(Diagnostic::at(place, "bad").into(), "m.toml", 2);
            error.to_string()
        };
        assert_eq!(shown("/u"), "c.toml:11:11: bad");
        assert_eq!(shown("\"a\""), "c.toml:4:8: bad");
        assert_eq!(shown("[[measure]]"), "c.toml:3:1: bad");
        assert_eq!(shown("duration_s"), "m.toml:2:1: bad");
    }
}
