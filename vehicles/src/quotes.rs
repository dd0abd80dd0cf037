//! Quotation marks in CSV files of measurements, whose rows are lines.
//!
//! CSV lets a cell in quotation marks go on over line ends and delimiters. So a single stray mark joins all
//! rows up to the next mark or the end of the file to one cell. A reader then finds no fault. No logger
//! writes a cell of several lines: a cell that begins with a mark has to end with one, on its line. The crate
//! `csv` takes any such cell.

use crate::lines;

/// A quotation mark that would swallow the cells behind it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "line {line}, cell {cell}: expected a cell on one line, found a quotation mark (\") that opens one and has none \
     before the next delimiter that closes it, so that what follows would be read as its text; remove the mark, \
     or close it"
)]
pub struct StrayQuote {
    /// The line, from 1.
    pub line: u64,
    /// The cell of the line, from 1.
    pub cell: u64,
}

/// Refuses the first cell that begins with a quotation mark and does not end with one on its line.
///
/// ```
/// use vehicles::quotes::{StrayQuote, check};
///
/// assert_eq!(check(b"t,a\n1,\"2\n", b','), Err(StrayQuote { line: 2, cell: 2 }));
/// ```
///
/// # Errors
/// The line and the number of the cell.
pub fn check(text: &[u8], delimiter: u8) -> Result<(), StrayQuote> {
    for line in lines::of(text) {
        let row = &text[line.content];
        if row.contains(&b'"') {
            check_row(row, delimiter).map_err(|cell| StrayQuote { line: line.number, cell })?;
        }
    }
    Ok(())
}

/// The number of the cell that is wrong, from 1.
fn check_row(mut rest: &[u8], delimiter: u8) -> Result<(), u64> {
    let mut cell = 1_u64;
    loop {
        let end = match rest.strip_prefix(b"\"") {
            Some(quoted) => 1 + closed(quoted, delimiter).ok_or(cell)?,
            None => rest.iter().position(|byte| *byte == delimiter).unwrap_or(rest.len()),
        };
        let Some((_, behind)) = rest[end..].split_first() else { return Ok(()) };
        (rest, cell) = (behind, cell + 1);
    }
}

/// Returns the end of the cell whose text begins with `quoted`: its mark is followed by a delimiter or the
/// line's end, but for blanks. Two marks are one of the text.
fn closed(quoted: &[u8], delimiter: u8) -> Option<usize> {
    let mut at = 0;
    loop {
        at += quoted.get(at..)?.iter().position(|byte| *byte == b'"')? + 1;
        if quoted.get(at) == Some(&b'"') {
            at += 1;
            continue;
        }
        let is_blank = |byte: &&u8| **byte != delimiter && matches!(**byte, b' ' | b'\t');
        let end = at + quoted[at..].iter().take_while(is_blank).count();
        return quoted.get(end).is_none_or(|byte| *byte == delimiter).then_some(end);
    }
}

#[cfg(test)]
mod tests {
    use super::{StrayQuote, check};

    #[test]
    fn lines_of_every_system_are_counted() {
        for end in ["\n", "\r", "\r\n"] {
            let text = ["t,a", "1,2", "", "3,\"4", "5,6"].join(end);
            assert_eq!(check(text.as_bytes(), b','), Err(StrayQuote { line: 4, cell: 2 }), "{end:?}");
        }
    }

    #[test]
    fn cells_that_are_closed_on_their_line_pass() {
        let text = "\"t\",\"a, b\" ,c\r\n1,\"say \"\"so\"\"\",3\n\"\",5\" prop,\"\"\"\"\n";
        assert_eq!(check(text.as_bytes(), b','), Ok(()));
        assert_eq!(check(b"", b','), Ok(()));
        assert_eq!(check(b"\"a\"\t\"b\"\n", b'\t'), Ok(()));
    }

    #[test]
    fn a_cell_that_is_not_closed_is_named_with_its_line() {
        let stray = |text: &str| check(text.as_bytes(), b',').unwrap_err();
        assert_eq!(stray("t,a\n1,2\n3,\"4\n5,6\n"), StrayQuote { line: 3, cell: 2 });
        assert_eq!(stray("t,a\n1,\"2\n3,4\"\n"), StrayQuote { line: 2, cell: 2 });
        assert_eq!(stray("t,a\n\"1\"2,3"), StrayQuote { line: 2, cell: 1 });
        assert_eq!(stray("\"t,a\n"), StrayQuote { line: 1, cell: 1 });
        assert_eq!(stray("t\r\n1\r\n\"\r\n"), StrayQuote { line: 3, cell: 1 });
        assert_eq!(stray("t\n\"\"\"\n"), StrayQuote { line: 2, cell: 1 });
        assert!(
            stray("\"").to_string().contains("line 1, cell 1") && stray("\"").to_string().contains("remove")
        );
    }
}
