//! Arrays of numbers: how a name asks for a part of one, and cells of a CSV file that hold one.

use crate::name::Name;

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

/// The numbers in a cell such as `[0.1, 0.2, 0.3]`, with blanks or semicolons between them too, and in round brackets;
/// NaN for a part that is not a number. `None` where the cell holds no array.
pub fn numbers(cell: &str) -> Option<Vec<f64>> {
    let cell = cell.trim();
    let of = |open: char, close: char| cell.strip_prefix(open)?.strip_suffix(close);
    let inner = of('[', ']').or_else(|| of('(', ')'))?;
    let split: Vec<&str> = match [',', ';'].into_iter().find(|delimiter| inner.contains(*delimiter)) {
        Some(delimiter) => inner.split(delimiter).map(str::trim).collect(),
        None => inner.split_whitespace().collect(),
    };
    let is_plain = split.iter().all(|part| !part.contains(['[', ']', '(', ')']));
    is_plain.then(|| split.into_iter().map(|part| part.parse().unwrap_or(f64::NAN)).collect())
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
        for cell in ["", "0.1", "[0.1, 2", "0.1, 2]", "[[1, 2], [3, 4]]", "(1, 2]"] {
            assert_eq!(numbers(cell), None, "{cell}");
        }
    }
}
