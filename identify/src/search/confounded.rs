//! Confounded effects: rivals that explain the flights as well in the place of an accepted effect.

use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::problem::Problem;
use crate::search::candidate::{Candidate, free_parameters};
use crate::search::fit_result::FitResult;
use crate::search::judgement::{Judged, at_bound, fitted, is_clearly_worse, is_worse, without};
use crate::search::ratios;
use crate::search::select::{Round, Selection};
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

/// The rivals of each accepted candidate among `open` ones; none after a search that was stopped, which has named nothing for sure.
pub fn rivals(problem: &Problem, selection: &Selection, open: &[Candidate]) -> Vec<Vec<Rival>> {
    if selection.is_stopped {
        return vec![Vec::new(); selection.accepted.len()];
    }
    (0..selection.accepted.len()).map(|at| of_candidate(problem, selection, open, at)).collect()
}

/// The rivals of the accepted candidate number `at`, among those that were near it when it was taken.
fn of_candidate(problem: &Problem, selection: &Selection, open: &[Candidate], at: usize) -> Vec<Rival> {
    let candidate = &selection.accepted[at];
    let mut others = selection.accepted.clone();
    others.remove(at);
    let screened = screened(problem, selection, candidate, &others, that_came_near(selection, candidate));
    let mut rivals: Vec<Rival> = Vec::new();
    if !screened.is_empty() {
        let base = without(problem, &selection.after, &selection.accepted, at);
        let rival = |rival: &&Candidate| {
            let fitted = fitted(problem, &base, &others, rival);
            let is_alike =
                !is_worse(&fitted, &selection.after) && at_bound(problem, rival, &fitted).is_none();
            is_alike.then(|| Rival { candidate: (*rival).clone(), fitted })
        };
        rivals.extend(screened.par_iter().filter_map(rival).collect::<Vec<_>>());
    }
    if ratios::shows_rotation_alone(problem) {
        rivals.extend(of_ratios(problem, selection, open, candidate));
    }
    rivals
}

/// Those of `rivals` that are not clearly worse than `candidate` by fits near the solution. What begins at a guess is far from linear, and
/// is not screened.
fn screened<'s>(
    problem: &Problem,
    selection: &Selection,
    candidate: &Candidate,
    others: &[Candidate],
    rivals: Vec<&'s Candidate>,
) -> Vec<&'s Candidate> {
    let is_guessed = |candidate: &Candidate| !candidate.kind.guesses.is_empty();
    if is_guessed(candidate) || rivals.iter().all(|rival| is_guessed(rival)) {
        return rivals;
    }
    let of_rivals = rivals.iter().filter(|rival| !is_guessed(rival)).flat_map(|rival| rival.free.clone());
    let free: Vec<usize> = selection.after.free.iter().copied().chain(of_rivals).collect();
    let equations = problem.equations(&selection.after.values, &free);
    let is_kept = |rival: &Candidate| {
        if is_guessed(rival) {
            return true;
        }
        let is_dropped = |at: &usize| !others.iter().chain([rival]).any(|kept| kept.free.contains(at));
        let dropped: Vec<usize> = free.iter().copied().filter(is_dropped).collect();
        let near = problem.near(&equations, &selection.after.values, &dropped);
        !is_clearly_worse(&problem.costs_near(&near), &selection.after)
    };
    rivals.into_par_iter().filter(|rival| is_kept(rival)).collect()
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
        let candidate = Candidate { kind: other.kind, free };
        let is_alike =
            !is_worse(&fitted, &selection.after) && at_bound(problem, &candidate, &fitted).is_none();
        is_alike.then_some(Rival { candidate, fitted })
    };
    open.iter().filter(is_other).filter_map(rival).collect()
}

/// The candidates of other effects with at least [`NEAR`] of the gain of `candidate`, in the round that took it. Winds of flights have many numbers, and
/// are no rival.
fn that_came_near<'s>(selection: &'s Selection, candidate: &Candidate) -> Vec<&'s Candidate> {
    let took = |round: &&Round| round.taken().is_some_and(|taken| taken.candidate == *candidate);
    let Some(round) = selection.rounds.iter().find(took) else { return Vec::new() };
    let gain = round.taken().map_or(0.0, |taken| taken.gain);
    let is_near = |judged: &&Judged| {
        judged.gain > NEAR * gain
            && judged.candidate.kind.name != candidate.kind.name
            && *judged.candidate.kind != FLIGHT_WIND
            && !judged.candidate.is_in(&selection.accepted)
    };
    round.judged.iter().filter(is_near).map(|judged| &judged.candidate).collect()
}
