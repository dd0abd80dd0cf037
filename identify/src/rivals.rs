//! Rivals: effects that would do as well in the place of an accepted one, so that flights cannot tell them apart.

use crate::candidate::Candidate;
use crate::fit::Problem;
use crate::select::{Judged, Round, Selection, fitted, is_worse, without};
use plant::effects::EffectKind;
use rayon::prelude::*;

/// A rival has at least this part of the gain.
const NEAR: f64 = 0.5;

/// For an accepted candidate: the effects that would do as well in its place, of those that were anywhere near it when
/// it was taken or are declared to look like it; alone, or with another that is declared to look like it.
pub fn confounded(problem: &Problem, selection: &Selection, at: usize) -> Vec<&'static EffectKind> {
    let candidate = &selection.accepted[at];
    let mut others = selection.accepted.clone();
    others.remove(at);
    let base = without(problem, &selection.after, &selection.accepted, at);
    let is_alike = |rivals: &[&Candidate]| {
        let (mut accepted, mut fit) = (others.clone(), base.clone());
        for rival in rivals {
            fit = fitted(problem, &fit, &accepted, rival);
            accepted.push((*rival).clone());
        }
        !is_worse(&fit, &selection.after)
    };
    let seconds = declared_rivals(selection, candidate);
    let of_first = |first: &&Candidate| -> Vec<&'static EffectKind> {
        if is_alike(&[first]) {
            return vec![first.kind];
        }
        let seconds = seconds.iter().filter(|second| second.kind != first.kind);
        seconds
            .filter(|second| is_alike(&[first, second]))
            .flat_map(|second| [first.kind, second.kind])
            .collect()
    };
    let mut firsts = near(selection, candidate);
    firsts.extend(seconds.iter().filter(|second| !firsts.contains(second)).copied().collect::<Vec<_>>());
    firsts.par_iter().flat_map_iter(of_first).collect()
}

/// The candidates that are declared to look like `candidate`, of those that were not accepted.
fn declared_rivals<'s>(selection: &'s Selection, candidate: &Candidate) -> Vec<&'s Candidate> {
    let judged = selection.rounds.iter().find(|round| round.taken().is_some()).into_iter();
    let is_rival = |rival: &&Candidate| {
        rival.kind.experiment_against(candidate.kind).is_some() && !selection.accepted.contains(*rival)
    };
    judged.flat_map(|round| &round.judged).map(|judged| &judged.candidate).filter(is_rival).collect()
}

/// The candidates of other effects that gained at least [`NEAR`] of what `candidate` did in the round that took it.
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
