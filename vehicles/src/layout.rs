//! Finds the header, the delimiter and the first row of a CSV file, below any lines that its program wrote
//! above them.

use std::borrow::Cow;

use crate::dialect::{Delimiter, Dialect, number};
use crate::lines::{self, Line};
use crate::quotes;
use crate::table_error::TableError;

/// Number of lines in which a header is looked for: Blackbox Explorer writes two hundred lines above it.
const SEARCHED: usize = 1000;
/// Marks of lines that are comments.
const COMMENTS: [&str; 3] = ["#", "%", "//"];

/// Header, delimiter and place of the rows.
#[derive(Debug, PartialEq, Eq)]
pub struct Layout {
    /// Names of the columns; `None` in a file without a header.
    pub header: Option<Vec<String>>,
    /// Line of the header, from 1; 0 in a file without one.
    pub header_line: u64,
    /// First byte of the rows.
    pub from: usize,
    /// Number of lines before that.
    pub lines_before: u64,
    /// Delimiter between the cells of rows.
    pub delimiter: Delimiter,
}

/// Returns the number of a column that is named as `#3`, from 1.
pub fn by_number(name: &str) -> Option<usize> {
    let number = name.strip_prefix('#')?;
    let is_plain = number.bytes().all(|byte| byte.is_ascii_digit());
    number.parse().ok().filter(|number| is_plain && *number > 0)
}

/// The layout of `text`, of which the columns `names` are wanted.
pub fn find(text: &str, names: &[&str], dialect: &Dialect) -> Result<Layout, TableError> {
    let sep = sep_line(text);
    let delimiter = dialect.delimiter.or(sep.as_ref().map(|sep| sep.1));
    let rows_from = sep.map_or(0, |(number, _)| number);
    let search = Search { text, names, delimiter, lines_before: rows_from };
    match (dialect.header_line, dialect.header) {
        (Some(_), Some(false)) => Err(TableError::TwoHeaders),
        (Some(line), _) => search.header_at(line),
        (None, Some(false)) => Ok(search.without_header()),
        (None, _) if search.wanted().next().is_none() => Ok(search.without_header()),
        (None, _) => search.header(),
    }
}

struct Search<'a> {
    text: &'a str,
    names: &'a [&'a str],
    /// The delimiter, where it is declared.
    delimiter: Option<Delimiter>,
    /// Number of lines that are above everything.
    lines_before: u64,
}

/// A line that can be the header.
struct Candidate {
    line: Line,
    cells: Vec<String>,
    delimiter: Delimiter,
    /// Number of wanted names in it.
    found: usize,
    is_comment: bool,
}

impl Search<'_> {
    /// The names that a header has to have.
    fn wanted(&self) -> impl Iterator<Item = &str> {
        self.names.iter().filter(|name| number_of(name).is_none()).copied()
    }

    /// The lines that are not blank.
    fn lines(&self) -> impl Iterator<Item = Line> {
        let is_blank = |line: &Line| self.text[line.content.clone()].trim().is_empty();
        lines::of(self.text.as_bytes()).filter(move |line| line.number > self.lines_before && !is_blank(line))
    }

    /// The header is the first line that has all names, else the first with most of them, else the first of all.
    fn header(&self) -> Result<Layout, TableError> {
        let wanted = self.wanted().count();
        let mut best: Option<Candidate> = None;
        for line in self.lines().take(SEARCHED) {
            let candidate = self.candidate(line);
            let is_better = best.as_ref().is_none_or(|best| {
                candidate.found > best.found || (best.found == 0 && best.is_comment && !candidate.is_comment)
            });
            let is_whole = candidate.found == wanted;
            if is_better {
                best = Some(candidate);
            }
            if is_whole {
                break;
            }
        }
        let Some(best) = best else { return Ok(self.without_header()) };
        match self.numbers(&best).filter(|_| best.found == 0) {
            Some(found) => Err(TableError::NoHeader { line: best.line.number, found }),
            None => self.below(best),
        }
    }

    /// The cells of the line, if all of them are numbers with one of the delimiters.
    fn numbers(&self, candidate: &Candidate) -> Option<Vec<String>> {
        let text = &self.text[candidate.line.content.clone()];
        let by_delimiter = self.delimiters(text).into_iter().map(|delimiter| cells(text, delimiter));
        std::iter::once(candidate.cells.clone()).chain(by_delimiter).find(|cells| is_numeric(cells))
    }

    /// The line as a header: with or without a comment's mark, and with the delimiter that gives more of the names.
    fn candidate(&self, line: Line) -> Candidate {
        let text = &self.text[line.content.clone()];
        let uncommented = without_mark(text);
        let forms = std::iter::once(text).chain(uncommented);
        let tries =
            forms.flat_map(|form| self.delimiters(form).into_iter().map(move |delimiter| (form, delimiter)));
        let read = tries.map(|(form, delimiter)| {
            let cells = cells(form, delimiter);
            (self.wanted().filter(|name| has(&cells, name)).count(), cells, delimiter)
        });
        // Of equals the first.
        let best = read.reduce(|best, next| if next.0 > best.0 { next } else { best });
        let (found, cells, delimiter) = best.unwrap_or((0, Vec::new(), Delimiter::Byte(b',')));
        Candidate { line, cells, delimiter, found, is_comment: uncommented.is_some() }
    }

    fn delimiters(&self, header: &str) -> Vec<Delimiter> {
        match self.delimiter {
            Some(delimiter) => vec![delimiter],
            None => vec![most_frequent(header), Delimiter::Blanks],
        }
    }

    fn header_at(&self, number: u64) -> Result<Layout, TableError> {
        let line = lines::of(self.text.as_bytes()).find(|line| line.number == number);
        let lines = || lines::of(self.text.as_bytes()).count() as u64;
        let line = line.ok_or_else(|| TableError::HeaderLine { found: number, lines: lines() })?;
        self.below(self.candidate(line))
    }

    fn below(&self, header: Candidate) -> Result<Layout, TableError> {
        let (number, from) = (header.line.number, header.line.next);
        let (text, byte) = delimited(&self.text[header.line.content], header.delimiter);
        quotes::check(text.as_bytes(), byte).map_err(|quote| quotes::StrayQuote { line: number, ..quote })?;
        let is_row =
            |line: &Line| line.number > number && without_mark(&self.text[line.content.clone()]).is_none();
        let row = self.lines().find(is_row).map_or("", |line| &self.text[line.content]);
        let is_delimited = header.cells.len() < 2 || cells(row, header.delimiter).len() > 1;
        let delimiter = if is_delimited { header.delimiter } else { of_row(row) };
        Ok(Layout {
            header: Some(header.cells),
            header_line: number,
            from,
            lines_before: number,
            delimiter: self.delimiter.unwrap_or(delimiter),
        })
    }

    /// The rows begin with the first line that has a cell for each column that is asked for, and numbers in most.
    fn without_header(&self) -> Layout {
        let numbers = self.names.iter().filter_map(|name| number_of(name));
        let least = numbers.max().unwrap_or(1);
        let row = self.lines().take(SEARCHED).find_map(|line| {
            let text = &self.text[line.content.clone()];
            let delimiter = self.delimiter.unwrap_or_else(|| of_row(text));
            let cells = cells(text, delimiter);
            let numbers = cells.iter().filter(|cell| number(cell).is_some()).count();
            (cells.len() >= least && 2 * numbers >= cells.len()).then_some((line, delimiter))
        });
        let from = row.as_ref().map_or(0, |(line, _)| line.content.start);
        Layout {
            header: None,
            header_line: 0,
            from,
            lines_before: row.as_ref().map_or(0, |(line, _)| line.number - 1),
            delimiter: row
                .map_or(self.delimiter.unwrap_or(Delimiter::Byte(b',')), |(_, delimiter)| delimiter),
        }
    }
}

/// True if a header has the column `name`, or the array of which `name` is a part.
fn has(header: &[String], name: &str) -> bool {
    arrays(name).any(|name| header.iter().any(|cell| cell == name))
}

/// Returns the number of the column `name`, or of the array of which `name` is a part.
fn number_of(name: &str) -> Option<usize> {
    arrays(name).find_map(by_number)
}

/// The name, and those of the arrays of which it is a part: `a[0][1]`, `a[0]` and `a`.
fn arrays(name: &str) -> impl Iterator<Item = &str> {
    std::iter::successors(Some(name), |name| array(name))
}

/// The name of the array in `name[index]`.
fn array(name: &str) -> Option<&str> {
    Some(name.strip_suffix(']')?.rsplit_once('[')?.0)
}

fn is_numeric(cells: &[String]) -> bool {
    let mut filled = cells.iter().filter(|cell| !cell.is_empty()).peekable();
    filled.peek().is_some() && filled.all(|cell| number(cell).is_some())
}

/// The text of a comment; `None` where a line is none.
fn without_mark(line: &str) -> Option<&str> {
    let line = line.trim_start();
    COMMENTS.iter().find_map(|mark| line.strip_prefix(mark)).map(|rest| rest.trim_start_matches('#').trim())
}

/// The number of the line `sep=;`, by which spreadsheets are told the delimiter, and that delimiter.
fn sep_line(text: &str) -> Option<(u64, Delimiter)> {
    let line = lines::of(text.as_bytes()).find(|line| !text[line.content.clone()].trim().is_empty())?;
    let content = text[line.content].trim_matches(['"', ' ']);
    let (key, value) = content.split_once('=')?;
    let byte = match value.as_bytes() {
        [byte] if Delimiter::is_possible(*byte) => *byte,
        _ => return None,
    };
    key.eq_ignore_ascii_case("sep").then_some((line.number, Delimiter::Byte(byte)))
}

/// The delimiter that a header has most of.
fn most_frequent(header: &str) -> Delimiter {
    let count = |delimiter: u8| header.bytes().filter(|byte| *byte == delimiter).count();
    // The last of equals wins, which is the comma.
    let most = [b'|', b'\t', b';', b','].into_iter().max_by_key(|delimiter| count(*delimiter));
    Delimiter::Byte(most.unwrap_or(b','))
}

/// The delimiter of a row of numbers, whose commas can be decimal ones.
fn of_row(row: &str) -> Delimiter {
    if let Some(delimiter) =
        [b'\t', b';', b'|'].into_iter().find(|delimiter| row.as_bytes().contains(delimiter))
    {
        return Delimiter::Byte(delimiter);
    }
    let mut words = row.split_whitespace();
    let is_by_blanks =
        words.clone().count() > 1 && (words.all(|word| number(word).is_some()) || !row.contains(','));
    if is_by_blanks { Delimiter::Blanks } else { Delimiter::Byte(b',') }
}

/// The cells of a line, without blanks around them.
fn cells(line: &str, delimiter: Delimiter) -> Vec<String> {
    let (line, byte) = delimited(line, delimiter);
    let stray = quotes::check(line.as_bytes(), byte).is_err();
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .has_headers(false)
        .quoting(!stray)
        .delimiter(byte)
        .from_reader(line.as_bytes());
    let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
    record.iter().map(unquoted).collect()
}

/// A cell without the quotation marks around it: a blank in front of them, as in Blackbox logs, hides them from the reader of CSV.
fn unquoted(cell: &str) -> String {
    let inner = cell.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    inner.map_or_else(|| cell.to_owned(), |inner| inner.replace("\"\"", "\""))
}

/// The same text with one byte between cells, and that byte: runs of blanks become tabs, but for those in quotation marks.
pub fn delimited(text: &str, delimiter: Delimiter) -> (Cow<'_, str>, u8) {
    if let Delimiter::Byte(byte) = delimiter {
        return (Cow::Borrowed(text), byte);
    }
    let mut by_tabs = String::with_capacity(text.len());
    for line in lines::of(text.as_bytes()) {
        let (mut is_quoted, mut is_between) = (false, false);
        for character in text[line.content.clone()].trim().chars() {
            is_quoted ^= character == '"';
            if !is_quoted && matches!(character, ' ' | '\t') {
                is_between = true;
                continue;
            }
            if std::mem::take(&mut is_between) {
                by_tabs.push('\t');
            }
            by_tabs.push(character);
        }
        by_tabs.push_str(&text[line.content.end..line.next]);
    }
    (Cow::Owned(by_tabs), b'\t')
}
