//! Lines of a text, with the ends of lines of any system.

use std::ops::Range;

/// A line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Number, from 1.
    pub number: u64,
    /// Bytes without the line's end.
    pub content: Range<usize>,
    /// First byte behind the line's end.
    pub next: usize,
}

/// The lines of `text`, which end with `\n`, `\r` or `\r\n`.
///
/// ```
/// let lines: Vec<_> = vehicles::lines::of(b"a\r\nbc\rd").collect();
/// assert_eq!((lines.len(), lines[1].number, lines[1].content.clone(), lines[1].next), (3, 2, 3..5, 6));
/// ```
pub fn of(text: &[u8]) -> impl Iterator<Item = Line> {
    let mut from = 0;
    let mut number = 0;
    std::iter::from_fn(move || {
        let rest = text.get(from..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
        let end = match rest[length..] {
            [b'\r', b'\n', ..] => 2,
            [] => 0,
            _ => 1,
        };
        let content = from..from + length;
        from += length + end;
        number += 1;
        Some(Line { number, content, next: from })
    })
}

/// The lines of `text` with their numbers.
///
/// ```
/// let lines: Vec<_> = vehicles::lines::numbered("a\r\nbc\rd").collect();
/// assert_eq!(lines, [(1, "a"), (2, "bc"), (3, "d")]);
/// ```
pub fn numbered(text: &str) -> impl Iterator<Item = (u64, &str)> {
    of(text.as_bytes()).map(move |line| (line.number, &text[line.content]))
}
