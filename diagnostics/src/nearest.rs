//! Search for the known name that was probably meant.

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

/// Returns advice on the name `found` that is none of `known`: the one that was probably meant, else `all` and
/// the names.
///
/// ```
/// use diagnostics::did_you_mean;
///
/// assert_eq!(did_you_mean("comand", ["command", "state"], "the ports are"), "did you mean `command`?");
/// assert_eq!(did_you_mean("xyz", ["command", "state"], "the ports are"), "the ports are command, state");
/// assert_eq!(did_you_mean("xyz", [], "the ports are"), "there is none");
/// ```
#[must_use]
pub fn did_you_mean<'a>(found: &str, known: impl IntoIterator<Item = &'a str>, all: &str) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match nearest(found, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => "there is none".to_owned(),
        None => format!("{all} {}", known.join(", ")),
    }
}
