//! Confounded effects: rivals that explain the flights as well in the place of an accepted effect.

use crate::candidate::{Candidate, free_parameters};
use crate::fit::{FitResult, Problem};
use crate::ratios;
use crate::select::{Judged, Round, Selection, fitted, is_clearly_worse, is_worse, without};
use rayon::prelude::*;
use std::sync::OnceLock;

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

/// The rivals of each accepted candidate among `open` ones.
pub fn rivals(problem: &Problem, selection: &Selection, open: &[Candidate]) -> Vec<Vec<Rival>> {
    (0..selection.accepted.len()).map(|at| of_candidate(problem, selection, open, at)).collect()
}

/// The rivals of the accepted candidate number `at`, among those that were near it when it was taken.
fn of_candidate(problem: &Problem, selection: &Selection, open: &[Candidate], at: usize) -> Vec<Rival> {
    let candidate = &selection.accepted[at];
    let mut others = selection.accepted.clone();
    others.remove(at);
    let near = near(selection, candidate);
    let linear = near.iter().filter(|rival| rival.kind.guesses.is_empty());
    let free: Vec<usize> =
        selection.after.free.iter().copied().chain(linear.flat_map(|rival| rival.free.clone())).collect();
    let equations = problem.equations(&selection.after.values, &free);
    let base = OnceLock::new();
    let rival = |rival: &&Candidate| {
        if rival.kind.guesses.is_empty() {
            let is_dropped = |at: &usize| !others.iter().chain([*rival]).any(|kept| kept.free.contains(at));
            let dropped: Vec<usize> = free.iter().copied().filter(is_dropped).collect();
            let costs = problem.costs_near(&problem.near(&equations, &selection.after.values, &dropped));
            if is_clearly_worse(&costs, &selection.after) {
                return None;
            }
        }
        let base = base.get_or_init(|| without(problem, &selection.after, &selection.accepted, at));
        let fitted = fitted(problem, base, &others, rival);
        let is_alike = !is_worse(&fitted, &selection.after);
        is_alike.then(|| Rival { candidate: (*rival).clone(), fitted })
    };
    let mut rivals: Vec<Rival> = near.par_iter().filter_map(rival).collect();
    if ratios::shows_rotation_alone(problem) {
        rivals.extend(of_ratios(problem, selection, open, candidate));
    }
    rivals
}

/// Rivals of the parameters of `candidate` that scale thrust or inertia: rotation alone shows their ratios only. The rest of the
/// candidate stays.
fn of_ratios(
    problem: &Problem,
    selection: &Selection,
    open: &[Candidate],
    candidate: &Candidate,
) -> Vec<Rival> {
    let scaling = ratios::scaling(problem, &candidate.free);
    if scaling.is_empty() {
        return Vec::new();
    }
    let mut start = selection.after.values.clone();
    scaling.iter().for_each(|at| start[*at] = problem.model.parameters.all[*at].baseline);
    let kept: Vec<usize> =
        free_parameters(&selection.accepted).into_iter().filter(|at| !scaling.contains(at)).collect();
    let is_other = |other: &&Candidate| {
        other.kind != candidate.kind && !selection.accepted.iter().any(|one| one.kind == other.kind)
    };
    let rival = |other: &Candidate| {
        let free = ratios::scaling(problem, &other.free);
        if free.is_empty() {
            return None;
        }
        let fitted = problem.fitted(&start, &[kept.as_slice(), &free].concat());
        let is_alike = !is_worse(&fitted, &selection.after);
        is_alike.then_some(Rival { candidate: Candidate { kind: other.kind, free }, fitted })
    };
    open.iter().filter(is_other).filter_map(rival).collect()
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
