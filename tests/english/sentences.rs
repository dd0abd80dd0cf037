//! Sentences of a text in Markdown, and their lengths in words.
//!
//! Tables, blocks of code, comments and pictures have no sentences. Each item of a list begins a sentence.

/// Characters that end a sentence, behind a word.
const ENDS: [char; 5] = ['.', ':', ';', '!', '?'];

/// Characters that may stand between the end of a sentence and the next blank.
const CLOSERS: [char; 6] = ['"', '”', ')', ']', '*', '_'];

/// Units that belong to the number before them. Products and powers of them do, too.
const UNITS: [&str; 55] = [
    "%", "°", "A", "Ah", "B", "C", "GB", "Hz", "J", "K", "LSB", "MB", "MHz", "Mbit", "N", "Pa", "V", "W",
    "baud", "bit", "cm", "count", "deg", "dB", "dBm", "g", "h", "hPa", "kB", "kHz", "kPa", "kW", "kbit",
    "kg", "km", "kticks", "m", "mA", "mAh", "mN", "mV", "mg", "min", "mm", "mrad", "ms", "ns", "rad", "rpm",
    "s", "ticks/s", "us", "µm", "µs", "μs",
];

/// A sentence of a text.
#[derive(Debug, Default, PartialEq)]
pub struct Sentence {
    /// Number of the line that it begins in, from 1.
    pub line: usize,
    /// Its text in one line, without the addresses of links. A code span has no blanks.
    pub text: String,
}

impl Sentence {
    /// Number of words: a code span, a number with its unit and each word of a link's text are one word each.
    pub fn words(&self) -> usize {
        let mut words = 0;
        let mut follows_number = false;
        for token in self.text.split(' ') {
            let is_number = is_number(token);
            let is_part = follows_number && (is_number || is_unit(token));
            words += usize::from(is_word(token) && !is_part);
            follows_number = is_number;
        }
        words
    }
}

/// Returns the sentences of a text.
pub fn sentences(text: &str) -> Vec<Sentence> {
    let mut found = Vec::new();
    let mut paragraph = String::new();
    let mut first = 1;
    let mut skipped = Skipped::Nothing;
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim().trim_start_matches("> ");
        let is_text = !line.is_empty() && skipped.next(line) && !line.starts_with('|');
        let item = if is_text { item(line) } else { None };
        let is_heading = line.starts_with('#');
        if !paragraph.is_empty() && (!is_text || item.is_some() || is_heading) {
            add_sentences(&paragraph, first, &mut found);
            paragraph.clear();
        }
        if is_text {
            if paragraph.is_empty() {
                first = number;
            }
            paragraph.push_str(item.unwrap_or(line));
            // The next line does not go on with a heading.
            paragraph.push_str(if is_heading { ".\n" } else { "\n" });
        }
    }
    add_sentences(&paragraph, first, &mut found);
    found
}

/// A block of lines that has no sentences.
#[derive(Clone, Copy, PartialEq)]
enum Skipped {
    Nothing,
    Code,
    Comment,
}

impl Skipped {
    /// Goes on to a line. True if the line may have sentences.
    fn next(&mut self, line: &str) -> bool {
        let before = *self;
        *self = match before {
            Self::Nothing if line.starts_with("```") => Self::Code,
            Self::Nothing if line.starts_with("<!--") && !line.contains("-->") => Self::Comment,
            Self::Code if line.starts_with("```") => Self::Nothing,
            Self::Comment if line.contains("-->") => Self::Nothing,
            _ => before,
        };
        before == Self::Nothing && *self == Self::Nothing && !is_html(line)
    }
}

/// True if a line begins with a comment or a tag.
fn is_html(line: &str) -> bool {
    line.strip_prefix('<')
        .is_some_and(|rest| rest.starts_with(['!', '/']) || rest.starts_with(char::is_alphabetic))
}

/// Returns the text of an item of a list behind its mark.
fn item(line: &str) -> Option<&str> {
    if let Some(rest) = ["- ", "* ", "+ "].iter().find_map(|mark| line.strip_prefix(mark)) {
        return Some(rest);
    }
    let (number, rest) = line.split_once(". ")?;
    (!number.is_empty() && number.len() < 3 && number.bytes().all(|byte| byte.is_ascii_digit()))
        .then_some(rest)
}

/// Adds the sentences of a paragraph that begins in the line `first`.
fn add_sentences(paragraph: &str, first: usize, found: &mut Vec<Sentence>) {
    let mut sentence = Sentence::default();
    for (number, line) in (first..).zip(plain(paragraph).lines()) {
        for token in line.split_ascii_whitespace() {
            if sentence.text.is_empty() {
                sentence.line = number;
            } else {
                sentence.text.push(' ');
            }
            sentence.text.push_str(token);
            if is_end(token) {
                push(std::mem::take(&mut sentence), found);
            }
        }
    }
    push(sentence, found);
}

/// True for the last word of a sentence.
fn is_end(token: &str) -> bool {
    let is_inside = token.ends_with(|c: char| c.is_ascii_alphanumeric() || c == ',' || c == '`');
    !is_inside && token.trim_end_matches(CLOSERS).ends_with(ENDS)
}

fn push(sentence: Sentence, found: &mut Vec<Sentence>) {
    if is_word(&sentence.text) {
        found.push(sentence);
    }
}

/// Returns a paragraph with each code span as one token, with the texts of links and without pictures. The number of lines stays.
fn plain(paragraph: &str) -> String {
    let mut text = String::with_capacity(paragraph.len());
    let mut rest = paragraph;
    while let Some(at) = rest.find(['`', '!', '[', ']']) {
        text.push_str(&rest[..at]);
        rest = &rest[at..];
        rest = code_span(rest, &mut text)
            .or_else(|| without_address(rest))
            .unwrap_or_else(|| with_bracket(rest, &mut text));
    }
    text + rest
}

/// Adds the code span that `rest` begins with to `text`. Returns what follows it.
fn code_span<'a>(rest: &'a str, text: &mut String) -> Option<&'a str> {
    let mark = &rest[..rest.len() - rest.trim_start_matches('`').len()];
    let inside = (!mark.is_empty()).then(|| &rest[mark.len()..])?;
    let end = inside.find(mark)?;
    let code = &inside[..end];
    text.push('`');
    text.extend(code.chars().map(|c| if c.is_whitespace() { '_' } else { c }));
    text.push('`');
    text.extend(code.chars().filter(|&c| c == '\n'));
    Some(&inside[end + mark.len()..])
}

/// Returns what follows the picture or the address of a link that `rest` begins with.
fn without_address(rest: &str) -> Option<&str> {
    let start = if rest.starts_with("![") { rest.find("](")? } else { 0 };
    let address = rest[start..].strip_prefix("](")?;
    Some(&address[address.find(')')? + 1..])
}

/// Adds the first character of `rest`, without a link's bracket, to `text`. Returns what follows it.
fn with_bracket<'a>(rest: &'a str, text: &mut String) -> &'a str {
    let first = &rest[..1];
    if matches!(first, "`" | "!") {
        text.push_str(first);
    }
    &rest[1..]
}

fn is_word(token: &str) -> bool {
    token.contains(|c: char| c.is_alphanumeric() || c == '`')
}

/// True for a token such as `-0.5`, `(±40` or `5.6e-3`.
fn is_number(token: &str) -> bool {
    let number = token.trim_start_matches(|c: char| !c.is_alphanumeric() && c != '`');
    number.starts_with(|c: char| c.is_ascii_digit())
        && number.chars().all(|c| c.is_ascii_digit() || matches!(c, '.' | ',' | 'e' | '-' | '+' | '−'))
}

/// True for a token such as `m/s²`, `kg·m^2` or `%)`.
fn is_unit(token: &str) -> bool {
    let unit = token.trim_end_matches(|c: char| !c.is_alphanumeric() && !matches!(c, '%' | '°'));
    let parts =
        unit.split(['/', '·', '*', '²', '³', '^', '√', '1', '2', '3']).filter(|part| !part.is_empty());
    let mut parts = parts.peekable();
    parts.peek().is_some() && parts.all(|part| UNITS.contains(&part))
}

#[cfg(test)]
mod tests {
    use super::{Sentence, sentences};

    /// Requires the lines and the numbers of words of the sentences of a text.
    #[track_caller]
    fn require(text: &str, expected: &[(usize, usize)]) {
        let found: Vec<_> =
            sentences(text).iter().map(|sentence| (sentence.line, sentence.words())).collect();
        assert_eq!(found, expected, "{text}");
    }

    #[test]
    fn a_sentence_ends_at_its_mark_or_with_its_paragraph() {
        require(
            "One two. Three: four;\nfive six! \"Seven?\" (Eight.) **Nine.** ten",
            &[(1, 2), (1, 1), (1, 1), (2, 2), (2, 1), (2, 1), (2, 1), (2, 1)],
        );
        require("One\ntwo\n\nthree 1.5 m.", &[(1, 2), (4, 2)]);
        require(
            "# One two\nThree\n- four five\n  six\n- seven\n12. eight\n",
            &[(1, 2), (2, 1), (3, 3), (5, 1), (6, 1)],
        );
    }

    #[test]
    fn code_links_and_numbers_with_units_are_one_word() {
        require("`cargo test --all` runs `a\nb`. Then", &[(1, 3), (2, 1)]);
        require("``a ` b. c`` runs", &[(1, 2)]);
        require("[two words](page.md#a.b) and [`code`](a.md).", &[(1, 4)]);
        require("A ![picture of it](a.png) here! [x] y", &[(1, 2), (1, 2)]);
        require("−0.5 m/s² to (±40 g) at 60 000 rad/s, 5.6e-3 kg·m², 10 %, 3 rotors", &[(1, 9)]);
        require("One – two … three", &[(1, 3)]);
    }

    #[test]
    fn tables_code_and_comments_have_no_sentences() {
        require("One\n| a | b |\n|---|---|\nTwo", &[(1, 1), (4, 1)]);
        require("One\n```sh\nrun this. And that\n```\nTwo", &[(1, 1), (5, 1)]);
        require("<!-- a\nb -->\n<!-- c -->\n<img src=\"a b c\">\nOne", &[(5, 1)]);
    }

    #[test]
    fn the_text_of_a_sentence_is_in_one_line() {
        let expected = Sentence { line: 2, text: "See page `a_b`.".into() };
        assert_eq!(sentences("\nSee [page](x.md)\n`a b`."), [expected]);
    }
}
