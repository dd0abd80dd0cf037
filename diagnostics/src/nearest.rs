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
/// assert_eq!(nearest("rnu", ["run", "fly"]), Some("run"), "two letters that change places are one fault");
/// assert_eq!(nearest("gyro_noise", ["gyro_cross_axis", "gyro_noise_density"]), Some("gyro_noise_density"));
/// assert_eq!(nearest("every_ticks", ["delay_ticks"]), None, "a common end alone is not enough");
/// assert_eq!(nearest("feed_forward", ["rate_feed_forward"]), Some("rate_feed_forward"));
/// ```
pub fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if found.len() > LONGEST {
        return None;
    }
    let (found, known) = (found.to_lowercase(), known.into_iter().collect::<Vec<_>>());
    let scored = || known.iter().filter_map(|name| Some((distance(&found, &name.to_lowercase())?, *name)));
    begun(&found, &known).or_else(|| ended(&found, &known)).or_else(|| scored().min().map(|(_, name)| name))
}

/// The names among `known` that `found` was probably meant to be: the nearest, or those with a word that begins with `found`.
fn suggested<'a>(found: &str, known: &[&'a str]) -> Vec<&'a str> {
    /// More would be a list of the names.
    const MOST: usize = 3;
    if found.len() > LONGEST {
        return Vec::new();
    }
    if let Some(nearest) = nearest(found, known.iter().copied()) {
        return vec![nearest];
    }
    let found = found.to_lowercase();
    let holds = |name: &&&str| name.to_lowercase().split('_').any(|word| word.starts_with(&found));
    let names: Vec<&str> = known.iter().filter(holds).copied().collect();
    if found.len() < SHORTEST || names.len() > MOST { Vec::new() } else { names }
}

/// Fewer letters are the beginning of too many words.
const SHORTEST: usize = 3;
/// Bytes of the longest word that is compared. No name is longer, and a comparison takes time and memory by the product of both
/// lengths.
const LONGEST: usize = 100;

/// Number of faults by which `found` differs from `name`; `None` if it is too different. Words at the end that both have, such as a
/// unit, do not count.
fn distance(found: &str, name: &str) -> Option<usize> {
    let (mut found, mut name) = (found, name);
    while let (Some((before, last)), Some((before_name, last_name))) =
        (found.rsplit_once('_'), name.rsplit_once('_'))
        && last == last_name
    {
        (found, name) = (before, before_name);
    }
    faults(found, name).filter(|faults| *faults <= name.len().div_ceil(3))
}

/// Number of letters to add, drop, replace or exchange until `found` is `name`; `None` if one of them is too long for a name.
fn faults(found: &str, name: &str) -> Option<usize> {
    (found.len().max(name.len()) <= LONGEST).then(|| strsim::damerau_levenshtein(found, name))
}

/// The only name that begins with `found`, if that is not too short.
fn begun<'a>(found: &str, known: &[&'a str]) -> Option<&'a str> {
    let mut begun = known.iter().filter(|name| name.to_lowercase().starts_with(found));
    let first = begun.next().filter(|_| found.len() >= SHORTEST)?;
    begun.next().is_none().then_some(*first)
}

/// The only name that ends with the words of `found`, if these are several.
fn ended<'a>(found: &str, known: &[&'a str]) -> Option<&'a str> {
    let mut ended = known.iter().filter(|name| name.to_lowercase().ends_with(&format!("_{found}")));
    let first = ended.next().filter(|_| found.contains('_'))?;
    ended.next().is_none().then_some(*first)
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
    let mut near = known.into_iter().filter(|name| faults(found, name).is_some_and(|faults| faults <= most));
    let first = near.next()?;
    near.next().is_none().then_some(first)
}

/// Returns the question for the name that `found` was probably meant to be among `known`, or for up to three such names; `None` if there
/// is none.
///
/// ```
/// use diagnostics::suggestion;
///
/// assert_eq!(suggestion("comand", ["command", "state"]).as_deref(), Some("did you mean `command`?"));
/// let noises = suggestion("nois", ["position_noise_m", "attitude_noise_deg", "rate_hz"]);
/// assert_eq!(noises.as_deref(), Some("did you mean `position_noise_m` or `attitude_noise_deg`?"));
/// assert_eq!(suggestion("xyz", ["command", "state"]), None);
/// ```
pub fn suggestion<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let known: Vec<&str> = known.into_iter().collect();
    let names = suggested(found, &known);
    (!names.is_empty()).then(|| format!("did you mean `{}`?", names.join("` or `")))
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
    match suggestion(found, known.iter().copied()) {
        Some(question) => question,
        None if known.is_empty() => "there is none".to_owned(),
        None => format!("{all} {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::{LONGEST, did_you_mean, nearest, suggestion, typo_of};

    #[test]
    fn words_too_long_for_a_name_are_no_guess_and_take_no_time() {
        let long = "command_".repeat(1_000_000);
        assert_eq!(
            did_you_mean(&long, ["command", "state"], "the ports are"),
            "the ports are command, state"
        );
        assert_eq!((nearest(&long, [&*long]), typo_of(&long, [&*long])), (None, None));
        assert_eq!((nearest("kommand", [&*long]), typo_of("kommand", [&*long])), (None, None));
        assert_eq!(suggestion("kommand", [&*long, "command"]).as_deref(), Some("did you mean `command`?"));
    }

    #[test]
    fn the_longest_names_are_guessed() {
        let name = "n".repeat(LONGEST);
        assert_eq!(nearest(&name.replacen('n', "m", 1), [&*name]), Some(&*name));
        assert_eq!(typo_of(&name.replacen('n', "m", 1), [&*name]), Some(&*name));
        assert_eq!(nearest(&format!("{name}m"), [&*name]), None);
    }
}
