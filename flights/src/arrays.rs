//! Arrays of numbers: how a name asks for a part of one, and cells of a CSV file that hold one.

use crate::name::Name;

/// Depth to which arrays in an array are read.
const DEPTH_MAX: usize = 4;

/// The name of an array and the index in `name[index]`.
pub fn indexed(name: &str) -> Option<(&str, usize)> {
    let (array, index) = name.strip_suffix(']')?.rsplit_once('[')?;
    Some((array, index.parse().ok()?))
}

/// The names of the first `size` numbers of the array `name`, whose sign they have.
pub fn parts(name: &Name, size: usize) -> Vec<Name> {
    let part = |index| Name { plain: format!("{}[{index}]", name.plain), is_negated: name.is_negated };
    (0..size).map(part).collect()
}

/// The numbers in a cell such as `[0.1, 0.2, 0.3]`, with blanks or semicolons between them too, and in round brackets; those of
/// arrays in it, as `[[0.1, 0.2], [0.3, 0.4]]`, row by row. NaN for a part that is not a number. `None` where the cell holds no array.
pub fn numbers(cell: &str) -> Option<Vec<f64>> {
    let mut numbers = Vec::new();
    append(cell, DEPTH_MAX, &mut numbers)?;
    Some(numbers)
}

/// The number at `indices` of the array in a cell, the outermost first. A single index counts all numbers, row by row.
pub fn part(cell: &str, indices: &[usize]) -> Option<f64> {
    let (last, outer) = indices.split_last()?;
    if outer.is_empty() {
        return numbers(cell)?.get(*last).copied();
    }
    let mut array = cell;
    for index in outer {
        array = elements(array)?.get(*index).copied()?;
    }
    number(elements(array)?.get(*last)?)
}

/// Appends the numbers of the array in a cell, with arrays in it to this depth. `None` if its elements are not of one size, since then the
/// place of a number says nothing.
fn append(cell: &str, depth: usize, numbers: &mut Vec<f64>) -> Option<()> {
    let mut size = None;
    for element in elements(cell)? {
        let (before, is_array) = (numbers.len(), element.starts_with(['[', '(']));
        if is_array {
            append(element, depth.checked_sub(1)?, numbers)?;
        } else {
            numbers.push(number(element)?);
        }
        let found = (is_array, numbers.len() - before);
        if *size.get_or_insert(found) != found {
            return None;
        }
    }
    Some(())
}

/// The number that an element is; NaN if it is not a number, `None` if it has brackets.
fn number(element: &str) -> Option<f64> {
    (!element.contains(['[', ']', '(', ')'])).then(|| element.parse().unwrap_or(f64::NAN))
}

/// The elements of the array in a cell; `None` where the cell holds no array.
fn elements(cell: &str) -> Option<Vec<&str>> {
    let cell = cell.trim();
    let of = |open: char, close: char| cell.strip_prefix(open)?.strip_suffix(close);
    let inner = of('[', ']').or_else(|| of('(', ')'))?;
    for delimiter in [',', ';'] {
        let elements = split(inner, |character| character == delimiter)?;
        if elements.len() > 1 {
            return Some(elements.into_iter().map(str::trim).collect());
        }
    }
    let elements = split(inner, char::is_whitespace)?;
    Some(elements.into_iter().filter(|element| !element.is_empty()).collect())
}

/// The parts of a text between delimiters that are in no brackets; `None` if a bracket has no partner.
fn split(text: &str, is_delimiter: impl Fn(char) -> bool) -> Option<Vec<&str>> {
    let (mut depth, mut from, mut parts) = (0_usize, 0, Vec::new());
    for (at, character) in text.char_indices() {
        match character {
            '[' | '(' => depth += 1,
            ']' | ')' => depth = depth.checked_sub(1)?,
            _ if depth == 0 && is_delimiter(character) => {
                parts.push(&text[from..at]);
                from = at + character.len_utf8();
            }
            _ => {}
        }
    }
    parts.push(&text[from..]);
    (depth == 0).then_some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_an_index_at_their_end() {
        assert_eq!(indexed("acc[2]"), Some(("acc", 2)));
        assert_eq!(indexed("esc[1].rpm[0]"), Some(("esc[1].rpm", 0)));
        for name in ["acc", "acc[]", "acc[x]", "acc[-1]", "acc[1].x", "[1"] {
            assert_eq!(indexed(name), None, "{name}");
        }
        assert_eq!(parts(&"-acc".into(), 2), ["-acc[0]", "-acc[1]"].map(Name::from));
    }

    #[test]
    fn cells_are_arrays_in_the_ways_programs_write_them() {
        for cell in
            ["[0.1, -2, 3e1]", "(0.1,-2,3e1)", "[ 0.1  -2\t3e1 ]", "[0.1; -2; 3e1]", " [0.1, -2, 3e1] "]
        {
            assert_eq!(numbers(cell), Some(vec![0.1, -2.0, 30.0]), "{cell}");
        }
        assert_eq!(numbers("[]"), Some(vec![]));
        assert!(numbers("[1, null]").is_some_and(|found| found[0] == 1.0 && found[1].is_nan()));
        for cell in ["", "0.1", "[0.1, 2", "0.1, 2]", "[1, 2] [3, 4]", "(1, 2]", "[array([1, 2])]"] {
            assert_eq!(numbers(cell), None, "{cell}");
        }
    }

    #[test]
    fn arrays_in_an_array_are_its_numbers_row_by_row() {
        for cell in [
            "[[1, 2], [3, 4]]",
            "[[1 2] [3 4]]",
            "((1, 2), (3, 4))",
            "[[1; 2]; [3; 4]]",
            "[[[1, 2], [3, 4]]]",
        ] {
            assert_eq!(numbers(cell), Some(vec![1.0, 2.0, 3.0, 4.0]), "{cell}");
        }
        let cell = "[[1, 2], [3, null]]";
        assert_eq!(part(cell, &[2]), Some(3.0));
        assert_eq!(part(cell, &[1, 0]), Some(3.0));
        assert!(part(cell, &[1, 1]).is_some_and(f64::is_nan));
        for indices in [&[4][..], &[0, 2], &[2, 0], &[0, 0, 0], &[]] {
            assert_eq!(part(cell, indices), None, "{indices:?}");
        }
        let deep = |depth: usize| format!("{}1{}", "[".repeat(depth), "]".repeat(depth));
        assert_eq!(numbers(&deep(3)), Some(vec![1.0]));
        assert_eq!(numbers(&deep(100_000)), None);
        for uneven in ["[[1], [2, 3]]", "[1, [2]]", "[[1, 2], 3]"] {
            assert_eq!(numbers(uneven), None, "{uneven}");
        }
    }
}
