//! Which of the names that there are was meant.

/// The name among `known` that `found` was probably meant to be.
///
/// ```
/// use diagnostics::nearest;
///
/// assert_eq!(nearest("comand", ["command", "state"]), Some("command"));
/// assert_eq!(nearest("xyz", ["command", "state"]), None);
/// ```
pub fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let scored = known.into_iter().map(|name| (strsim::levenshtein(found, name), name));
    scored.filter(|(distance, name)| *distance <= name.len().div_ceil(3)).min().map(|(_, name)| name)
}
