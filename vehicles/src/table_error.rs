//! Faults of tables of measurements.

use crate::foreign::Foreign;
use crate::quotes::StrayQuote;
use diagnostics::suggestion;

/// Reason why a file is not a table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// It is of another format.
    #[error(transparent)]
    Foreign(#[from] Foreign),
    /// A quotation mark joins many cells to one.
    #[error(transparent)]
    Quote(#[from] StrayQuote),
    /// It cannot be taken apart into cells.
    #[error("it is not CSV: {0}; check the path and the format")]
    Csv(#[from] csv::Error),
    /// It has more rows than are read.
    #[error("it has more than {0} rows; cut it into several files, or leave out rows")]
    Rows(usize),
    /// A column that is asked for.
    #[error(transparent)]
    Column(#[from] ColumnError),
    /// Numbers where names are expected.
    #[error(
        "line {line}: expected a header with the names of the columns, found numbers ({}); if the file has no header, name \
         the columns by number, \"#1\" the first; if the header is on another line, set `csv.header_line`",
        cells(found)
    )]
    NoHeader {
        /// The line, from 1.
        line: u64,
        /// Its cells.
        found: Vec<String>,
    },
    /// A line that the file does not have.
    #[error(
        "`csv.header_line`: expected a line of the file, found {found} of {lines} lines; the first line is 1"
    )]
    HeaderLine {
        /// The line that is declared.
        found: u64,
        /// Number of lines.
        lines: u64,
    },
    /// Two keys that exclude each other.
    #[error("`csv.header`: expected this or `csv.header_line`, found both; remove one")]
    TwoHeaders,
    /// A comma whose meaning the file does not show.
    #[error(
        "line {line}, column `{}`: expected a number, found `{}`, whose comma can be a decimal comma or stand between \
         thousands; set `csv.decimal` to \",\" or \".\"",
        shown(column),
        shown(cell)
    )]
    Comma {
        /// The line, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// The cell.
        cell: String,
    },
    /// Decimal commas beside decimal points.
    #[error(
        "line {line}, column `{}`: found `{}` with a decimal comma, and `{}` with a decimal point in line {other_line}; set \
         `csv.decimal` to \",\" or \".\", or write all numbers with one mark",
        shown(column),
        shown(cell),
        shown(other)
    )]
    TwoMarks {
        /// The line of the comma, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// The cell with the comma.
        cell: String,
        /// The line of the point.
        other_line: u64,
        /// The cell with the point.
        other: String,
    },
    /// Fewer rows than are needed.
    #[error(
        "line {line}: expected {} of numbers below the header, found {} before the file ends; check that the file was \
         written and copied as a whole",
        if *expected == 1 { "a row".to_owned() } else { format!("at least {expected} rows") },
        if *found == 0 { "none".to_owned() } else { found.to_string() }
    )]
    FewRows {
        /// The last line of the table, from 1.
        line: u64,
        /// Number of rows that are needed.
        expected: usize,
        /// Number of rows with anything in them.
        found: usize,
    },
    /// Rows that are longer than the header.
    #[error(
        "line {line}: expected {expected} cells as in the header (line {header_line}), found {found}; if commas are decimal \
         marks as well as delimiters, write the file with semicolons between cells; if the header lacks a name, correct it, \
         or set `csv.header = false` and name the columns by number"
    )]
    LongRows {
        /// Line of the header, from 1.
        header_line: u64,
        /// The first such line.
        line: u64,
        /// Number of cells of the header.
        expected: usize,
        /// Number of cells of the line.
        found: usize,
    },
}

/// Reason why a table has no column of a name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ColumnError {
    /// It has none of that name.
    #[error(
        "no column `{}`; it has {}; {}",
        shown(name),
        names(known),
        column_advice(name, known, *header_line)
    )]
    Missing {
        /// The name.
        name: String,
        /// The names there are.
        known: Vec<String>,
        /// Line of the header.
        header_line: Option<u64>,
    },
    /// It has several of that name.
    #[error(
        "column `{}` stands {} times in the header, as the columns {}; name the one that is meant by its number, as \"#{}\"",
        shown(name),
        places.len(),
        places.iter().map(usize::to_string).collect::<Vec<_>>().join(", "),
        places.first().unwrap_or(&1)
    )]
    Several {
        /// The name.
        name: String,
        /// Their numbers, from 1.
        places: Vec<usize>,
    },
    /// Its number is beyond the last.
    #[error("no column `{name}`; it has {count} columns; the first is \"#1\", the last \"#{count}\"")]
    Number {
        /// The number as it is written.
        name: String,
        /// Number of columns.
        count: usize,
    },
}

/// Advice on the column `name`, which is none of `known`.
fn column_advice(name: &str, known: &[String], header_line: Option<u64>) -> String {
    /// Shorter names differ from each other by as much as from a misspelling.
    const SHORTEST: usize = 3;
    let known: Vec<String> = known.iter().map(|name| shown(name)).collect();
    let question = suggestion(name, known.iter().map(String::as_str)).filter(|_| name.len() >= SHORTEST);
    question.unwrap_or_else(|| match header_line {
        Some(line) => {
            format!("choose from this list, or set `csv.header_line` if line {line} is not the header")
        }
        None => "choose from this list".to_owned(),
    })
}

/// Text from a file for a message: short, and without characters that a terminal obeys.
#[must_use]
pub fn shown(text: &str) -> String {
    const SHOWN: usize = 40;
    let rest = if text.chars().nth(SHOWN).is_some() { "..." } else { "" };
    let visible = |character: char| match character {
        '"' | '\'' | '\\' => vec![character],
        _ => character.escape_debug().collect(),
    };
    text.chars().take(SHOWN).flat_map(visible).collect::<String>() + rest
}

/// Names for a message.
#[must_use]
pub fn names(names: &[String]) -> String {
    const SHOWN: usize = 60;
    let rest = if names.len() > SHOWN { format!(" and {} more", names.len() - SHOWN) } else { String::new() };
    names.iter().take(SHOWN).map(|name| shown(name)).collect::<Vec<_>>().join(", ") + &rest
}

/// The first cells for a message.
fn cells(cells: &[String]) -> String {
    const SHOWN: usize = 3;
    let rest = if cells.len() > SHOWN { ", ..." } else { "" };
    cells.iter().take(SHOWN).map(|cell| format!("`{}`", shown(cell))).collect::<Vec<_>>().join(", ") + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_files_do_not_reach_terminals_raw() {
        assert_eq!(shown("a\x1b[31mb\u{202e}c\x07\0"), "a\\u{1b}[31mb\\u{202e}c\\u{7}\\0");
        assert_eq!(shown("\"°\""), "\"°\"");
        assert_eq!(shown(&"x".repeat(50)), "x".repeat(40) + "...");
        assert!(names(&vec!["n".to_owned(); 70]).ends_with("n and 10 more"));
    }

    #[test]
    fn a_column_that_is_nearly_right_is_asked_for() {
        let told = |name: &str, header_line| {
            let known = vec!["time".to_owned(), "px".to_owned()];
            ColumnError::Missing { name: name.to_owned(), known, header_line }.to_string()
        };
        assert_eq!(told("tme", Some(1)), "no column `tme`; it has time, px; did you mean `time`?");
        assert!(told("py", None).ends_with("; choose from this list"));
        assert!(told("q", Some(2)).ends_with("or set `csv.header_line` if line 2 is not the header"));
    }
}
