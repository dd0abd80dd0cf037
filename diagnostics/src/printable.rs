//! Untrusted text as a terminal shows it: nothing in it is obeyed, hidden, or longer than a screen.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Characters of a line of a message; of a longer line the middle is left out.
const LINE_CHARS_MAX: usize = 4000;

/// The text with every character escaped, as in a Rust string, that a terminal obeys or does not show. Ends of lines
/// and tabs stay.
///
/// ```
/// assert_eq!(diagnostics::printable("a\x1b[2J\u{202e}b\n"), "a\\u{1b}[2J\\u{202e}b\n");
/// assert_eq!(diagnostics::printable("rötor"), "rötor");
/// ```
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| is_printable(c) || matches!(c, '\n' | '\t'), push_rust)
}

/// As [`printable`]; ends of lines and tabs are escaped, too.
///
/// ```
/// assert_eq!(diagnostics::printable_line("hover.toml\nerror: gone"), "hover.toml\\nerror: gone");
/// ```
#[must_use]
pub fn printable_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_printable, push_rust)
}

/// Text that is more than a part of one line of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NotOneLine {
    /// Text as expected.
    pub expected: &'static str,
    /// Text as found, its control characters escaped.
    pub found: String,
}

/// Refuses a text that would be more than a part of one line of a report.
///
/// ```
/// assert!(diagnostics::require_line("höver 1").is_ok());
/// let refused = diagnostics::require_line("hover\nverdict: held").unwrap_err();
/// assert_eq!(refused.found, "hover\\nverdict: held");
/// assert_eq!(refused.expected, "a text without control characters such as ends of lines");
/// ```
///
/// # Errors
/// If it has control characters.
pub fn require_line(text: &str) -> Result<(), NotOneLine> {
    if text.contains(char::is_control) {
        let expected = "a text without control characters such as ends of lines";
        return Err(NotOneLine { expected, found: printable_line(text).into_owned() });
    }
    Ok(())
}

/// The JSON text with the same characters as JSON escapes: it holds the same data.
///
/// ```
/// assert_eq!(diagnostics::printable_json("{\"name\": \"\u{202e}\u{e0041}\"}"), "{\"name\": \"\\u202e\\udb40\\udc41\"}");
/// ```
#[must_use]
pub fn printable_json(json: &str) -> Cow<'_, str> {
    // A serializer has escaped the control characters within texts; between them stand only ends of lines and blanks.
    escaped(
        json,
        |c| is_printable(c) || matches!(c, '\n' | '\r' | '\t'),
        |text, c| {
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Writing to a string does not fail.
                let _ = write!(text, "\\u{unit:04x}");
            }
        },
    )
}

/// The text with the middle left out of every line that is longer than any message.
///
/// ```
/// let short = diagnostics::short_lines(&"x".repeat(8_000_000)).into_owned();
/// assert!(short.contains("7996000 characters left out") && short.len() < 5000);
/// ```
#[must_use]
pub fn short_lines(text: &str) -> Cow<'_, str> {
    if text.len() <= LINE_CHARS_MAX {
        return text.into();
    }
    let lines: Vec<_> = text.split('\n').map(|line| shortened(line, LINE_CHARS_MAX)).collect();
    if lines.iter().all(|line| matches!(line, Cow::Borrowed(_))) {
        text.into()
    } else {
        lines.join("\n").into()
    }
}

/// The text with its middle left out where it has more than `chars_max` characters.
#[must_use]
pub fn shortened(text: &str, chars_max: usize) -> Cow<'_, str> {
    let count = if text.len() <= chars_max { 0 } else { text.chars().count() };
    if count <= chars_max {
        return text.into();
    }
    let (head, tail) = (chars_max - chars_max / 4, chars_max / 4);
    let at = |index: usize| text.char_indices().nth(index).map_or(text.len(), |(at, _)| at);
    let (start, end) = (&text[..at(head)], &text[at(count - tail)..]);
    format!("{start} … {} characters left out … {end}", count - head - tail).into()
}

fn push_rust(text: &mut String, c: char) {
    text.extend(c.escape_default());
}

fn escaped(text: &str, is_kept: impl Fn(char) -> bool, push: impl Fn(&mut String, char)) -> Cow<'_, str> {
    if text.chars().all(&is_kept) {
        return text.into();
    }
    text.chars()
        .fold(String::with_capacity(text.len()), |mut text, c| {
            if is_kept(c) {
                text.push(c)
            } else {
                push(&mut text, c)
            }
            text
        })
        .into()
}

/// True if a terminal shows the character and leaves the characters around it where they are. False for
/// control characters, the controls of the direction of writing (Unicode's `Bidi_Control`) and separators of
/// lines. False also for characters without width (`Default_Ignorable_Code_Point`, but for the variation
/// selectors of emoji).
#[must_use]
pub fn is_printable(c: char) -> bool {
    let is_hidden = matches!(c,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}'..='\u{1160}' | '\u{17b4}'..='\u{17b5}'
        | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}'
        | '\u{3164}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}'
        | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}');
    !c.is_control() && !is_hidden
}

#[cfg(test)]
mod tests {
    use super::{LINE_CHARS_MAX, printable, printable_json, printable_line, short_lines, shortened};

    /// Every control character, and every character that changes the direction of writing or has no width.
    #[test]
    fn nothing_that_a_terminal_obeys_is_left() {
        let controls = (0..0x20).chain(0x7f..0xa0).filter_map(char::from_u32);
        let hidden = "\u{200b}\u{200c}\u{200d}\u{200e}\u{200f}\u{202a}\u{202b}\u{202c}\u{202d}\u{202e}\u{2060}\
                      \u{2066}\u{2067}\u{2068}\u{2069}\u{61c}\u{feff}\u{ad}\u{2028}\u{2029}\u{e0041}";
        for c in controls.chain(hidden.chars()) {
            let text = format!("a{c}b");
            assert_eq!(printable_line(&text), format!("a{}b", c.escape_default()));
            if !matches!(c, '\n' | '\t') {
                assert_eq!(printable(&text), printable_line(&text));
            }
            let json = serde_json::to_string(&text).unwrap();
            let shown = printable_json(&json).into_owned();
            assert!(shown.is_ascii() && !shown.contains(c), "{c:?}: {shown}");
            assert_eq!(serde_json::from_str::<String>(&shown).unwrap(), text);
        }
    }

    #[test]
    fn what_people_write_stays() {
        for text in ["hover.toml:2:5", "Grüße, 東京, ελ, é, m/s², 5 °C", "a\tb\nc", "C:\\flights \"x\""]
        {
            assert_eq!(printable(text), text);
        }
    }

    #[test]
    fn a_long_line_is_shortened_and_a_short_one_is_not() {
        let long = "ä".repeat(LINE_CHARS_MAX + 1);
        let text = format!("first\n{long}\nlast");
        let short = short_lines(&text);
        assert!(short.starts_with("first\nää") && short.ends_with("ä\nlast"), "{short}");
        assert!(short.chars().count() < LINE_CHARS_MAX + 50);
        let whole = format!("{}\n{}", "x".repeat(LINE_CHARS_MAX), "ä".repeat(LINE_CHARS_MAX));
        assert_eq!(short_lines(&whole), whole);
        assert_eq!(shortened("abcdefgh", 4), "abc … 4 characters left out … h");
        assert_eq!(shortened("abcd", 4), "abcd");
    }
}
