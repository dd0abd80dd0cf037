//! Search for the known name that was probably meant.

/// The name among `known` that `found` was probably meant to be.
///
/// ```
/// use diagnostics::nearest;
///
/// assert_eq!(nearest("comand", ["command", "state"]), Some("command"));
/// assert_eq!(nearest("PID", ["pid", "lqr"]), Some("pid"));
/// assert_eq!(nearest("baro", ["barometer", "battery"]), Some("barometer"));
/// assert_eq!(nearest("xyz", ["command", "state"]), None);
/// ```
pub fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let (found, known) = (found.to_lowercase(), known.into_iter().collect::<Vec<_>>());
    let scored = known.iter().map(|name| (strsim::levenshtein(&found, &name.to_lowercase()), *name));
    let near = scored.filter(|(distance, name)| *distance <= name.len().div_ceil(3)).min();
    near.map(|(_, name)| name).or_else(|| begun(&found, &known))
}

/// The only name that begins with `found`, if that has three letters or more.
fn begun<'a>(found: &str, known: &[&'a str]) -> Option<&'a str> {
    let mut begun = known.iter().filter(|name| name.to_lowercase().starts_with(found));
    let first = begun.next().filter(|_| found.len() >= 3)?;
    begun.next().is_none().then_some(*first)
}

/// The only name among `known` that `found` is, but for one or two letters; `None` where another name may be meant as well.
///
/// ```
/// use diagnostics::typo_of;
///
/// assert_eq!(typo_of("sede", ["seed", "pace"]), Some("seed"));
/// assert_eq!(typo_of("every_ticks", ["topic", "delay_ticks"]), None);
/// assert_eq!(typo_of("mix", ["min", "max"]), None);
/// ```
pub fn typo_of<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let most = found.len().min(6) / 3;
    let mut near = known.into_iter().filter(|name| strsim::damerau_levenshtein(found, name) <= most);
    let first = near.next()?;
    near.next().is_none().then_some(first)
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
