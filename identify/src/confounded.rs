//! Confounded effects: rivals that explain the flights as well in the place of an accepted effect.

use crate::candidate::Candidate;
use crate::fit::{FitResult, Problem};
use crate::select::{Judged, Round, Selection, fitted, is_worse, without};
use rayon::prelude::*;

/// A rival has at least this part of the gain.
const NEAR: f64 = 0.5;

/// A candidate that explains the flights as well as an accepted one, in its place.
#[derive(Debug, Clone)]
pub struct Rival {
    /// The candidate.
    pub candidate: Candidate,
    /// The fit of it and of the other accepted candidates.
    pub fitted: FitResult,
}

/// The rivals of each accepted candidate.
pub fn rivals(problem: &Problem, selection: &Selection) -> Vec<Vec<Rival>> {
    (0..selection.accepted.len()).map(|at| of_candidate(problem, selection, at)).collect()
}

/// The rivals of the accepted candidate number `at`, among those that were near it when it was taken.
fn of_candidate(problem: &Problem, selection: &Selection, at: usize) -> Vec<Rival> {
    let candidate = &selection.accepted[at];
    let mut others = selection.accepted.clone();
    others.remove(at);
    let base = without(problem, &selection.after, &selection.accepted, at);
    let rival = |candidate: &&Candidate| {
        let fitted = fitted(problem, &base, &others, candidate);
        let is_alike = !is_worse(&fitted, &selection.after);
        is_alike.then(|| Rival { candidate: (*candidate).clone(), fitted })
    };
    near(selection, candidate).par_iter().filter_map(rival).collect()
}

/// The candidates of other effects with at least [`NEAR`] of the gain of `candidate`, in the round that took it.
fn near<'s>(selection: &'s Selection, candidate: &Candidate) -> Vec<&'s Candidate> {
    let took = |round: &&Round| round.taken().is_some_and(|taken| taken.candidate == *candidate);
    let Some(round) = selection.rounds.iter().find(took) else { return Vec::new() };
    let gain = round.taken().map_or(0.0, |taken| taken.gain);
    let is_near = |judged: &&Judged| {
        judged.gain > NEAR * gain
            && judged.candidate.kind.name != candidate.kind.name
            && !selection.accepted.contains(&judged.candidate)
    };
    round.judged.iter().filter(is_near).map(|judged| &judged.candidate).collect()
}
