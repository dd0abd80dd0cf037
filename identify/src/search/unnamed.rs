//! Effects that were found and are not named: withdrawn, worth nothing, or at a limit.

use crate::search::revision::Withdrawn;
use std::collections::BTreeMap;

/// Effects by name, each with the reason why it is not named.
type Reasons = BTreeMap<&'static str, String>;

/// The effects of a report that were found and are not named.
#[derive(Debug, Clone, Copy)]
pub struct Unnamed<'r> {
    /// Accepted and taken back.
    pub withdrawn: &'r [Withdrawn],
    /// Fitted errors of sensors that change no prediction noticeably.
    pub without_worth: &'r Reasons,
    /// Fitted effects at the limit of their meaning.
    pub at_limit: &'r Reasons,
}

impl<'r> Unnamed<'r> {
    /// Effects that are fitted and not named, each with the reason.
    pub fn fitted(self) -> impl Iterator<Item = (&'r &'static str, &'r String)> {
        self.without_worth.iter().chain(self.at_limit)
    }

    /// The withdrawn effects that reached a bound, or the others. Effects that another one replaced are in neither list: they are not small.
    fn withdrawn_names(self, at_bound: bool) -> Vec<&'static str> {
        let is_listed =
            |withdrawn: &&Withdrawn| withdrawn.at_bound == at_bound && withdrawn.replaced_by.is_none();
        let withdrawn = self.withdrawn.iter().filter(is_listed);
        withdrawn.map(|withdrawn| withdrawn.effect).collect()
    }

    /// The effects whose estimates are at a bound: withdrawn, or fitted and not named.
    pub fn bound_names(self) -> Vec<&'static str> {
        self.withdrawn_names(true).into_iter().chain(self.at_limit.keys().copied()).collect()
    }

    /// The effects that change no prediction noticeably: withdrawn, or fitted and not named.
    pub fn small_names(self) -> Vec<&'static str> {
        self.withdrawn_names(false).into_iter().chain(self.without_worth.keys().copied()).collect()
    }

    /// The reason why a report names no effect.
    pub fn no_effect(self) -> String {
        let [effects, beyond] = [self.small_names(), self.bound_names()].map(|names| names.join(", "));
        // Predictions may need an effect at a limit, so that the others do not say all.
        if !self.at_limit.is_empty() || (effects.is_empty() && !beyond.is_empty()) {
            format!("The equations put the estimate of {beyond} at its bound: the cause is not known.")
        } else if !effects.is_empty() {
            format!("The equations fit better with {effects}, but no prediction error falls noticeably.")
        } else {
            "No candidate makes the equations fit better beyond chance.".to_owned()
        }
    }
}
