//! Place in a file.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;

/// A place in a file, for messages: `file:line:column`, both counted from 1.
///
/// `{:#}` draws the line as well, with the place marked:
/// ```
/// let place = diagnostics::Place::of("a.toml", "x = 1\ny = 2\n", &(10..11));
/// assert_eq!(place.to_string(), "a.toml:2:5");
/// assert_eq!(format!("{place:#}"), "  |\n2 | y = 2\n  |     ^");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file's name as it was given to the reader.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The text of the line.
    source: String,
    /// The bytes of `source` that are meant.
    marked: Range<usize>,
    /// An earlier place in the same file that belongs to the fault; in a box, since few places have one.
    before: Option<Box<Before>>,
}

/// An earlier place, and the lines from there on.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Before {
    line: usize,
    /// The text from its line to the line that is meant, without that.
    source: String,
    /// The bytes of `source` that are meant.
    marked: Range<usize>,
}

impl Place {
    /// The place of the bytes `span` of `text`; an offset past the end means the end, one within a character its begin.
    #[must_use]
    pub fn of(file: impl Into<String>, text: &str, span: &Range<usize>) -> Self {
        let before = &text[..text.floor_char_boundary(span.start)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let source = text[line_start..].lines().next().unwrap_or_default();
        let in_line = |offset: usize| source.floor_char_boundary(offset.saturating_sub(line_start));
        Place {
            file: file.into(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            marked: in_line(span.start)..in_line(span.end.max(span.start)),
            source: source.to_owned(),
            before: None,
        }
    }

    /// The same place, drawn together with the earlier bytes `first` of the same `text`.
    ///
    /// ```
    /// let text = "x = 1\ny = 2\nx = 3\n";
    /// let place = diagnostics::Place::of("a.toml", text, &(12..13)).after(text, &(0..1));
    /// let drawn = format!("{place:#}");
    /// assert!(drawn.contains("1 | x = 1") && drawn.contains("3 | x = 3"), "{drawn}");
    /// ```
    #[must_use]
    pub fn after(self, text: &str, first: &Range<usize>) -> Self {
        let of_first = Self::of("", text, first);
        let lines: Vec<&str> = text.lines().skip(of_first.line - 1).take(self.line - of_first.line).collect();
        let source: String = lines.iter().flat_map(|line| [*line, "\n"]).collect();
        let before = Before { line: of_first.line, source, marked: of_first.marked };
        Self { before: Some(Box::new(before)), ..self }
    }

    /// The place of line number `line` of `text`, from 1; a number past the end means the end.
    ///
    /// ```
    /// use diagnostics::Place;
    ///
    /// assert_eq!(Place::of_line("a.toml", "x = 1\ny = 2\n", 2).to_string(), "a.toml:2:1");
    /// ```
    #[must_use]
    pub fn of_line(file: impl Into<String>, text: &str, line: usize) -> Self {
        let before = text.split_inclusive('\n').take(line.saturating_sub(1));
        let start = before.map(str::len).sum();
        Self::of(file, text, &(start..start))
    }

    /// The same place in the `text` of another `file`: the nearest line that is the same; `None` if there is none.
    ///
    /// ```
    /// use diagnostics::Place;
    ///
    /// let place = Place::of("copy.toml", "new = 0\nx = 1\n", &(8..9));
    /// assert_eq!(place.in_file("a.toml", "x = 1\n").unwrap().to_string(), "a.toml:1:1");
    /// assert_eq!(place.in_file("a.toml", "x = 2\n"), None);
    /// ```
    #[must_use]
    pub fn in_file(&self, file: impl Into<String>, text: &str) -> Option<Self> {
        let same = text.lines().enumerate().filter(|(_, line)| *line == self.source);
        let (index, _) = same.min_by_key(|(index, _)| (index + 1).abs_diff(self.line))?;
        Some(Self { file: file.into(), line: index + 1, ..self.clone() })
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !f.alternate() {
            return write!(f, "{}:{}:{}", self.file, self.line, self.column);
        }
        if let Some(before) = &self.before {
            let source = format!("{}{}", before.source, self.source);
            let shifted = self.marked.start + before.source.len()..self.marked.end + before.source.len();
            let first = AnnotationKind::Context.span(before.marked.clone()).label("the first one");
            let marks = [AnnotationKind::Primary.span(shifted), first];
            let snippet = Snippet::source(&source).line_start(before.line).annotations(marks);
            let drawn = Renderer::plain().render(&[Group::with_level(Level::ERROR).element(snippet)]);
            return f.write_str(&drawn);
        }
        let mark = AnnotationKind::Primary.span(self.marked.clone());
        let snippet = Snippet::source(&self.source).line_start(self.line).annotation(mark);
        f.write_str(&Renderer::plain().render(&[Group::with_level(Level::ERROR).element(snippet)]))
    }
}

#[cfg(test)]
mod tests {
    use super::Place;

    #[test]
    fn any_offset_is_a_place() {
        let text = "a = \"ä\"\nb";
        for start in 0..text.len() + 3 {
            for end in 0..text.len() + 3 {
                assert!(!format!("{:#}", Place::of("a.toml", text, &(start..end))).is_empty());
            }
        }
        assert_eq!(Place::of("a.toml", text, &(50..51)).to_string(), "a.toml:2:2");
        assert_eq!(Place::of("a.toml", "", &(0..0)).to_string(), "a.toml:1:1");
    }
}
